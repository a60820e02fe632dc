"""The papers' own tables as layouts of the results: Table I of Chen & Huang, Tables 1 and 2 of Fu & Zhou.

A cell that holds a vector is one text, as in print: `(-14.86, 31.54, 902.38)`. In JSON it is a list. The data formats
have each component as a column of its own as well, after the printed ones.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import TextIO

import numpy as np

from circlepose._numerics import angle_between
from circlepose._typing import FloatArray
from circlepose.evaluation.matching import TabledPose
from circlepose.io.tables import Layout, json_records
from circlepose.io.tables import columns as tables
from circlepose.io.tables.columns import Row
from circlepose.io.tables.data_layouts import DataFormat, is_data_layout, write_data
from circlepose.io.tables.reference import CircleKey, Reference
from circlepose.io.tables.selection import EVERYTHING, Selection
from circlepose.results import CircleResult, ImageResult
from circlepose.solvers.fu_zhou_coaxial import generatrix_ends

TABLE1_COLUMNS = (
    "Method",
    "Image",
    "Circle center position",
    "Position difference (mm)",
    "Surface normal",
    "Orientation difference (deg)",
)
TABLE2_COLUMNS = ("Scene", "Candidate", "UN", "TV", "GCC")
TABLE2_ERRORS = ("TV error (mm)", "UN error (deg)")
"""columns that are there where a reference is given; the error of TV is a vector, as in Table 1"""
AMBIGUITY = "Ambiguity"
"""last column of both: the probability that the chosen candidate is the wrong one"""
POSE_NUMBERS = ("center_x_mm", "center_y_mm", "center_z_mm", "normal_x", "normal_y", "normal_z")
"""columns of the data formats, after the printed ones"""
ERROR_NUMBERS = ("center_error_x_mm", "center_error_y_mm", "center_error_z_mm", "center_error_mm")
"""those that are there where a reference is given: measured less reference, and the distance"""

_DECIMALS = {
    "Circle center position": 2,
    "Position difference (mm)": 2,
    "Surface normal": 2,
    "Orientation difference (deg)": 2,
    "UN": 4,
    "TV": 4,
    "GCC": 2,
    "TV error (mm)": 3,
    "UN error (deg)": 3,
    AMBIGUITY: 4,
}
_REFERENCE_METHOD = "chen-huang"


@dataclass(frozen=True, slots=True)
class Vector:
    """Three numbers that share a cell."""

    values: tuple[float, ...]


def table1_rows(result: ImageResult) -> Iterator[Row]:
    """Yield a row per method and circle: the chosen candidate, as in Table I of Chen & Huang.

    Differences are to their method; its own rows, and runs of a single method, have none.
    """
    for circle in result.circles:
        row: Row = {"Method": circle.method, "Image": _label(result, circle)}
        if circle.candidates:
            chosen = circle.candidates[circle.chosen]
            is_reference = circle.method == _REFERENCE_METHOD
            row["Circle center position"] = _vector(chosen.center)
            row["Position difference (mm)"] = None if is_reference else chosen.position_difference_mm
            row["Surface normal"] = _vector(chosen.normal)
            row["Orientation difference (deg)"] = None if is_reference else chosen.orientation_difference_deg
            row |= {AMBIGUITY: circle.ambiguity, **_pose_numbers(chosen.center, chosen.normal)}
        else:
            row["Circle center position"] = circle.status
        yield row
    if not result.circles or tables.stands_for_missing(result):
        yield {"Image": result.image, "Circle center position": result.status}


def table2_rows(result: ImageResult, reference: Reference | None = None) -> Iterator[Row]:
    """Yield a row per candidate of each target's largest circle, the chosen first, as in Table 2 of Fu & Zhou.

    UN is the unit normal, TV the translation vector (mm), GCC the generatrix between the concentric circles (mm).
    With a `reference` its pose follows, and each candidate's row has the errors to it: the components (mm) of TV,
    without their signs as in Table 1, and the angle (deg) of UN.
    """
    known = {} if reference is None else reference.poses(result)
    seen = set()
    for circle in result.circles:
        if (circle.instance, circle.method) in seen:
            continue
        seen.add((circle.instance, circle.method))
        scene = _scene(result, circle)
        true = known.get(_key(circle))
        if not circle.candidates:
            yield {"Scene": scene, "UN": circle.status}
        order = sorted(range(len(circle.candidates)), key=lambda number: number != circle.chosen)
        for number in order:
            candidate = circle.candidates[number]
            yield {
                "Scene": scene,
                "Candidate": "chosen" if number == circle.chosen else "other",
                "UN": _vector(candidate.normal),
                "TV": _vector(candidate.center),
                "GCC": candidate.generatrix_mm,
                "UN error (deg)": _angle_deg(candidate.normal, true),
                AMBIGUITY: circle.ambiguity if number == circle.chosen else None,
                **_pose_numbers(candidate.center, candidate.normal),
                **_center_errors(candidate.center, true),
            }
        if true is not None:
            yield {
                "Scene": scene,
                "Candidate": "reference",
                "UN": None if true.normal is None else Vector(true.normal),
                "TV": None if true.center_mm is None else Vector(true.center_mm),
                "GCC": _reference_generatrix(result, circle, known),
                **_pose_numbers(true.center_mm, true.normal),
            }
    if not result.circles or tables.stands_for_missing(result):
        yield {"Scene": result.image, "UN": result.status}


def columns_and_rows(
    layout: Layout, reference: Reference | None = None, *, numbers: bool = False
) -> tuple[tuple[str, ...], Callable[[ImageResult], Iterator[Row]]]:
    """Return the columns of a printed layout, and what makes the rows of a result; `reference` for `table2`.

    With `numbers` the components of vectors follow, each in a column of its own.
    """
    columns, rows_of = PRINTED[layout]
    plain = POSE_NUMBERS if numbers else ()
    if layout == "table2" and reference is not None:
        errors = ERROR_NUMBERS if numbers else ()
        return (*columns, *TABLE2_ERRORS, AMBIGUITY, *plain, *errors), lambda result: table2_rows(result, reference)
    return (*columns, AMBIGUITY, *plain), rows_of


PRINTED: Mapping[Layout, tuple[tuple[str, ...], Callable[[ImageResult], Iterator[Row]]]] = {
    "table1": (TABLE1_COLUMNS, table1_rows),
    "table2": (TABLE2_COLUMNS, table2_rows),
}
"""columns, without the ambiguity, and rows of the layouts that have the form of a printed table"""


def printed(row: Row, columns: Iterable[str]) -> Row:
    """Return `row` with the printed columns as texts; columns of components stay numbers."""
    return {
        column: _print(row.get(column), _DECIMALS[column]) if column in _DECIMALS else row.get(column)
        for column in columns
    }


def write_results(
    results: Iterable[ImageResult],
    handle: TextIO,
    *,
    data_format: DataFormat,
    layout: Layout = "poses",
    reference: Reference | None = None,
    selection: Selection = EVERYTHING,
) -> None:
    """Write all `results` to `handle` in one of the data formats and layouts; `reference` for `table2`.

    Of `selection`, the columns hold for rows of our own layouts; JSON has all keys.
    """
    if is_data_layout(layout):
        write_data(results, handle, data_format=data_format, layout=layout, selection=selection)
        return
    delimiter = "\t" if data_format == "tsv" else ","
    columns, rows_of = columns_and_rows(layout, reference, numbers=True)
    schema = f"circlepose.{layout}/1"

    def printed_rows(result: ImageResult) -> Iterator[Row]:
        return (printed(row, columns) for row in selection.printed_rows(rows_of(result)))

    def plain_rows(result: ImageResult) -> Iterator[Row]:
        rows = selection.printed_rows(rows_of(result))
        return ({column: _listed(row.get(column)) for column in columns} for row in rows)

    if data_format in {"csv", "tsv"}:
        tables.write_csv_rows(columns, printed_rows, results, handle, delimiter=delimiter)
    elif data_format == "json":
        json_records.write_json_document(schema, "rows", plain_rows, results, handle)
    else:
        json_records.write_json_lines(schema, plain_rows, results, handle)


def _label(result: ImageResult, circle: CircleResult) -> str:
    """Name the image, and the circle in it where there are several."""
    several = len({(c.instance, c.circle) for c in result.circles}) > 1
    return f"{result.image} [{circle.instance} {circle.circle}]" if several else result.image


def _scene(result: ImageResult, circle: CircleResult) -> str:
    """Name the image, and the target and method where there are several."""
    parts = []
    if len({c.instance for c in result.circles}) > 1:
        parts.append(str(circle.instance))
    if len({c.method for c in result.circles}) > 1:
        parts.append(circle.method)
    return f"{result.image} [{' '.join(parts)}]" if parts else result.image


def _key(circle: CircleResult) -> CircleKey:
    return circle.instance, circle.circle, circle.method


def _pose_numbers(center: Iterable[float] | None, normal: Iterable[float] | None) -> Row:
    values = [*((None,) * 3 if center is None else center), *((None,) * 3 if normal is None else normal)]
    return {name: None if value is None else float(value) for name, value in zip(POSE_NUMBERS, values, strict=True)}


def _center_errors(center: FloatArray, true: TabledPose | None) -> Row:
    if true is None or true.center_mm is None:
        return {}
    error = center - np.array(true.center_mm)
    numbers = [*error.tolist(), float(np.linalg.norm(error))]
    return {TABLE2_ERRORS[0]: _vector(np.abs(error)), **dict(zip(ERROR_NUMBERS, numbers, strict=True))}


def _angle_deg(normal: FloatArray, true: TabledPose | None) -> float | None:
    if true is None or true.normal is None:
        return None
    return float(np.degrees(angle_between(normal, np.asarray(true.normal))))


def _reference_generatrix(
    result: ImageResult, circle: CircleResult, known: Mapping[CircleKey, TabledPose]
) -> float | None:
    """Return the generatrix of the reference's two circles, where `circle` is the big one of a coaxial target."""
    small = next(
        (
            other
            for other in result.circles
            if (other.instance, other.method, other.circle) == (circle.instance, circle.method, "small")
        ),
        None,
    )
    if small is None or circle.circle != "big" or _key(small) not in known:
        return None
    poses = known[_key(circle)], known[_key(small)]
    if any(pose.center_mm is None or pose.normal is None for pose in poses):
        return None
    big_pose, small_pose = ((np.array(pose.center_mm), np.array(pose.normal)) for pose in poses)
    return float(generatrix_ends(*big_pose, circle.radius_mm, *small_pose, small.radius_mm)[0])


def _vector(values: FloatArray) -> Vector:
    return Vector(tuple(values.tolist()))


def _print(value: object, decimals: int) -> object:
    if isinstance(value, Vector):
        return f"({', '.join(tables.fixed(v, decimals) for v in value.values)})"
    if isinstance(value, float):
        return tables.fixed(value, decimals)
    return value


def _listed(value: object) -> object:
    return list(value.values) if isinstance(value, Vector) else value
