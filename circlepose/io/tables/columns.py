"""Results as flat rows: one per image, circle and candidate, for a spreadsheet, pandas or a shell pipeline.

The names of the columns, their units and their order are fixed; `COLUMN_MEANING` is the registry that the
manual is checked against. An empty cell means that there is nothing to say: never a sentinel, never NaN.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import TextIO, TypeAlias

from circlepose.io.text.escaping import guarded, quoted, unguarded, unquoted
from circlepose.results import Candidate, CircleResult, ImageResult, Status

Row: TypeAlias = dict[str, object]

COLUMN_MEANING: Mapping[str, str] = {
    "image": "name of the image",
    "instance": "number of the target in the image, from 0",
    "circle": "circle of the target: disc; outer, inner, ring2 ...; big, small",
    "method": "method that made the candidates",
    "solution": "number of the candidate pose; 0 is the better",
    "chosen": "true for the candidate to use",
    "status": "ok, or why there is no pose",
    "center_x_mm": "center of the circle in the camera frame, to the right",
    "center_y_mm": "center of the circle in the camera frame, downwards",
    "center_z_mm": "center of the circle in the camera frame, forwards",
    "normal_x": "unit normal of the circle's plane, towards the camera",
    "normal_y": "see normal_x",
    "normal_z": "see normal_x",
    "radius_mm": "radius that was given",
    "position_difference_mm": "distance of the center from that of chen-huang, with --method all",
    "orientation_difference_deg": "angle of the normal to that of chen-huang, with --method all",
    "generatrix_mm": "coaxial targets: rim to rim distance of this pair of candidates",
    "ambiguity": "probability that the chosen candidate is the wrong one",
    "center_u_px": "where the circle's center is seen in the raw image (not the ellipse's center)",
    "center_v_px": "see center_u_px",
    "semi_major_px": "semi-major axis of the rim's image",
    "semi_minor_px": "semi-minor axis of the rim's image",
    "angle_deg": "direction of the major axis, from the image's x axis towards its y axis, in (-90, 90]",
    "residual_px": "rms distance of the contour from the fitted rim",
    "cone": "viewing condition: right, elliptical or degenerate",
    "sigma_x_mm": "standard deviation of center_x_mm",
    "sigma_y_mm": "standard deviation of center_y_mm",
    "sigma_z_mm": "standard deviation of center_z_mm",
    "sigma_normal_deg": "standard deviation of the normal's direction: root of the sum of both tilts' variances",
    "flags": "remarks on a pose that stands, joined with ;",
    "rim_used": "share of the rim, 0 to 1, whose edge the pose rests on",
    "score": "how surely it is a circle's rim, 0 to 1: share of it on an edge, less where that strays or varies",
    "settled_by": "what settled the choice: vanishing_line, generatrix, joint_fit, common_plane, hint or none",
}
COLUMNS: tuple[str, ...] = tuple(COLUMN_MEANING)
TEXT_COLUMNS = frozenset({"image", "circle", "method", "status", "cone", "flags", "settled_by", "first", "second"})
"""of all our layouts"""
WHOLE_NUMBER_COLUMNS = frozenset({"instance", "solution", "circles_used", "circles_in_layout"})
"""of all our layouts"""
QUATERNION = ("qw", "qx", "qy", "qz")


def pose_rows(result: ImageResult) -> Iterator[Row]:
    """Yield the rows of one image in the `poses` layout; a key that is absent or None is an empty cell.

    A circle without a pose has one row. An image without a circle has one row of name and status; so does
    an image with too few circles, after the rows of those that were found.
    """
    for circle in result.circles:
        shared = {"image": result.image, **circle_fields(circle)}
        if not circle.candidates:
            yield shared
        for number, candidate in enumerate(circle.candidates):
            yield shared | candidate_fields(candidate, number, chosen=number == circle.chosen)
    if not result.circles or stands_for_missing(result):
        yield {"image": result.image, "status": result.status}


def stands_for_missing(result: ImageResult) -> bool:
    """Return whether an image's status says more than the statuses of its circles do."""
    return result.status is not Status.OK and all(c.status is not result.status for c in result.circles)


def circle_fields(circle: CircleResult) -> Row:
    """Return what both candidates of a circle share, by column name."""
    fields: Row = {
        "instance": circle.instance,
        "circle": circle.circle,
        "method": circle.method,
        "status": circle.status,
        "radius_mm": circle.radius_mm,
        "residual_px": circle.residual_px,
        "cone": circle.cone_kind,
        "flags": ";".join(circle.flags),
        "rim_used": circle.rim_used,
        "score": circle.score,
    }
    if circle.candidates:
        fields["ambiguity"] = circle.ambiguity
        fields["settled_by"] = circle.settled_by
    if circle.ellipse is not None:
        fields["semi_major_px"] = float(circle.ellipse.semi_major)
        fields["semi_minor_px"] = float(circle.ellipse.semi_minor)
        fields["angle_deg"] = math.degrees(float(circle.ellipse.angle))
    return fields


def candidate_fields(candidate: Candidate, number: int, *, chosen: bool) -> Row:
    """Return what belongs to one candidate, by column name."""
    fields: Row = {
        "solution": number,
        "chosen": chosen,
        "position_difference_mm": candidate.position_difference_mm,
        "orientation_difference_deg": candidate.orientation_difference_deg,
        "generatrix_mm": candidate.generatrix_mm,
    }
    fields |= zip(("center_x_mm", "center_y_mm", "center_z_mm"), candidate.center.tolist(), strict=True)
    fields |= zip(("normal_x", "normal_y", "normal_z"), candidate.normal.tolist(), strict=True)
    fields |= zip(("center_u_px", "center_v_px"), candidate.imaged_center.tolist(), strict=True)
    if candidate.sigma_mm is not None:
        fields |= zip(("sigma_x_mm", "sigma_y_mm", "sigma_z_mm"), candidate.sigma_mm.tolist(), strict=True)
        fields["sigma_normal_deg"] = candidate.sigma_deg
    return fields


def cell(column: str, value: object) -> str:
    """Return `value` as the text of a table's cell, with the decimals that belong to `column`."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return fixed(value, _decimals(column))
    return quoted(str(value))


def _decimals(column: str) -> int:
    if column.startswith("normal_") or column in QUATERNION:
        return 9
    return 4 if column.endswith("_px") else 6


def fixed(value: float, decimals: int) -> str:
    """Return a number with `decimals` decimals; a zero without sign, an empty text for NaN and infinity."""
    if not math.isfinite(value):
        return ""
    # Adding zero turns a negative zero into a plain one.
    return f"{round(value, decimals) + 0.0:.{decimals}f}"


def write_csv(results: Iterable[ImageResult], handle: TextIO) -> None:
    """Write the `poses` layout as CSV; each image's rows leave as soon as it is measured."""
    write_csv_rows(COLUMNS, pose_rows, results, handle)


def write_csv_rows(
    columns: tuple[str, ...],
    rows_of: Callable[[ImageResult], Iterable[Row]],
    results: Iterable[ImageResult],
    handle: TextIO,
    *,
    delimiter: str = ",",
) -> None:
    """Write a header of `columns` and the rows of each image to `handle`, flushed image by image."""
    writer = csv.writer(handle, lineterminator="\n", delimiter=delimiter)
    writer.writerow(columns)
    handle.flush()
    for result in results:
        for row in rows_of(result):
            writer.writerow([csv_cell(column, row.get(column)) for column in columns])
        handle.flush()


def csv_cell(column: str, value: object) -> str:
    """Return `cell` with texts, but not numbers, kept from being run as formulas; `csv_text` reads it back."""
    shown = cell(column, value)
    return guarded(shown) if isinstance(value, str) else shown


def csv_text(shown: str) -> str:
    """Return the text that a cell of a CSV table stands for."""
    return unquoted(unguarded(shown))
