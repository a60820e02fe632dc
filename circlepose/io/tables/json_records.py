"""Results as JSON: the names of the table's columns, nested image > circle > candidate, at full precision."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterable
from typing import Any, TextIO

from circlepose._typing import FloatArray
from circlepose._version import __version__
from circlepose.io.tables.board_rows import board_candidate_fields, board_fields
from circlepose.io.tables.columns import Row, candidate_fields, circle_fields
from circlepose.io.text.escaping import quoted
from circlepose.results import BoardResult, CircleResult, CovarianceTerms, ImageResult, NestedRim, Plane

POSES_SCHEMA = "circlepose.poses/1"

# Those that JSON lets pass: a terminal may act on them, or a reader take them for the end of a line.
_CONTROLS = re.compile("[\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069]")


def image_head(result: ImageResult) -> Row:
    """Return what is said of an image whatever was measured in it."""
    width, height = result.image_size or (None, None)
    return {
        "image": result.image,
        "status": result.status,
        "reason": result.reason,
        "remark": result.remark,
        "width": width,
        "height": height,
        "world": None if result.world is None else _world_record(result.world),
    }


def _world_record(world: BoardResult) -> Row:
    """Return the pose of a world board in the camera frame."""
    of_one = {"instance", "solution", "chosen"}
    fields = board_fields(world) | board_candidate_fields(world, world.chosen)
    covariance = world.candidates[world.chosen].covariance.tolist()
    known = {key: value for key, value in fields.items() if key not in of_one}
    return known | {"flags": list(world.flags), "covariance": covariance}


def image_record(result: ImageResult, *, chosen_only: bool = False) -> Row:
    """Return one image as nested values; every key is always there, None where there is nothing to say.

    With `chosen_only` a circle's solutions are the one that is chosen, under its number.
    """
    return image_head(result) | {
        "planes": [_plane_record(number, plane) for number, plane in enumerate(result.planes)],
        "circles": [_circle_record(circle, chosen_only=chosen_only) for circle in result.circles],
    }


_CIRCLE_KEYS = (
    "instance",
    "circle",
    "method",
    "status",
    "reason",
    "radius_mm",
    "cone",
    "ambiguity",
    "flags",
    "nested_rims",
    "semi_major_px",
    "semi_minor_px",
    "angle_deg",
    "residual_px",
    "rim_used",
    "score",
    "settled_by",
    "plane",
    "vanishing_normal",
    "vanishing_normal_sigma_deg",
    "generatrix_expected_mm",
    "color_mix",
    "solutions",
)
_SOLUTION_KEYS = (
    "solution",
    "chosen",
    "center_x_mm",
    "center_y_mm",
    "center_z_mm",
    "normal_x",
    "normal_y",
    "normal_z",
    "center_u_px",
    "center_v_px",
    "generatrix_mm",
    "generatrix_ends_mm",
    "generatrix_ends_sigma_mm",
    "height_mm",
    "height_sigma_mm",
    "vanishing_normal_distance_deg",
    "vanishing_normal_distance_sigmas",
    "position_difference_mm",
    "orientation_difference_deg",
    "sigma_x_mm",
    "sigma_y_mm",
    "sigma_z_mm",
    "sigma_normal_deg",
    "covariance",
    "covariance_terms",
)


def _circle_record(circle: CircleResult, *, chosen_only: bool) -> Row:
    solutions = []
    for number, candidate in enumerate(circle.candidates):
        if chosen_only and number != circle.chosen:
            continue
        fields = candidate_fields(candidate, number, chosen=number == circle.chosen) | {
            "covariance": _matrix(candidate.covariance),
            "covariance_terms": _terms_record(candidate.covariance_terms),
            "generatrix_ends_mm": _list(candidate.generatrix_ends_mm),
            "generatrix_ends_sigma_mm": _list(candidate.generatrix_ends_sigma_mm),
            "height_mm": candidate.height_mm,
            "height_sigma_mm": candidate.height_sigma_mm,
            "vanishing_normal_distance_deg": candidate.vanishing_distance_deg,
            "vanishing_normal_distance_sigmas": candidate.vanishing_distance_sigmas,
        }
        solutions.append({key: fields.get(key) for key in _SOLUTION_KEYS})
    fields = circle_fields(circle) | {
        "reason": circle.reason,
        "flags": list(circle.flags),
        "nested_rims": [_nested_record(rim) for rim in circle.nested_rims] or None,
        "plane": circle.plane,
        "vanishing_normal": _list(circle.vanishing_normal),
        "vanishing_normal_sigma_deg": circle.vanishing_sigma_deg,
        "generatrix_expected_mm": circle.generatrix_expected_mm,
        "color_mix": None if circle.color_mix is None else dict(circle.color_mix),
        "solutions": solutions,
    }
    return {key: fields.get(key) for key in _CIRCLE_KEYS}


def _nested_record(rim: NestedRim) -> Row:
    ellipse = rim.ellipse
    return {
        "center_px": ellipse.center.tolist(),
        "semi_major_px": float(ellipse.semi_major),
        "semi_minor_px": float(ellipse.semi_minor),
        "angle_deg": math.degrees(float(ellipse.angle)),
        "polarity": "dark" if rim.polarity > 0 else "bright",
        "distance_mm": rim.distance_mm,
        "admitted": rim.is_admitted,
        "taken": rim.is_taken,
    }


def _plane_record(number: int, plane: Plane) -> Row:
    return {
        "plane": number,
        "method": plane.method,
        "normal": plane.normal.tolist(),
        "offset_mm": plane.offset_mm,
        "circles": plane.circles,
    }


def _terms_record(terms: CovarianceTerms | None) -> Row | None:
    if terms is None:
        return None
    return {"image": _matrix(terms.image), "camera": _matrix(terms.camera), "radius": _matrix(terms.radius)}


def _list(vector: FloatArray | None) -> list[float] | None:
    return None if vector is None else vector.tolist()


def _matrix(matrix: FloatArray | None) -> list[list[float]] | None:
    return None if matrix is None else matrix.tolist()


def write_json_document(
    schema: str,
    key: str,
    records_of: Callable[[ImageResult], Iterable[Row]],
    results: Iterable[ImageResult],
    handle: TextIO,
) -> None:
    """Write one document, a record a line: {"schema", "version", `key`: [the records of all images]}."""
    head = json.dumps({"schema": schema, "version": __version__})
    handle.write(f'{head[:-1]}, "{key}": [')
    separator = "\n"
    try:
        for result in results:
            for record in records_of(result):
                handle.write(separator + dumps(record))
                separator = ",\n"
    finally:
        # Whatever ends the run early, the images that are done stay readable.
        handle.write("\n]}\n")
        handle.flush()


def write_json_lines(
    schema: str,
    records_of: Callable[[ImageResult], Iterable[Row]],
    results: Iterable[ImageResult],
    handle: TextIO,
) -> None:
    """Write the records of all images, one object a line with the schema in each; flushed image by image."""
    for result in results:
        for record in records_of(result):
            handle.write(dumps({"schema": schema, **record}) + "\n")
        handle.flush()


def dumps(record: Row) -> str:
    """Return `record` as one line of strict JSON, in which no control character stands as it is."""
    line = json.dumps(_plain(record), ensure_ascii=False, allow_nan=False)
    return _CONTROLS.sub(lambda match: f"\\u{ord(match[0]):04x}", line)


def _plain(value: Any) -> Any:
    """Return `value` with file names escaped, and NaN and infinity turned into None."""
    if isinstance(value, dict):
        return {key: _plain(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [_plain(entry) for entry in value]
    if isinstance(value, str):
        return quoted(value, keep_controls=True)
    if isinstance(value, float):
        # Adding zero turns a negative zero into a plain one.
        return float(value) + 0.0 if math.isfinite(value) else None
    return value
