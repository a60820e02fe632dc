"""The papers' own tables as layouts of the results: Table I of Chen & Huang, Tables 1 and 2 of Fu & Zhou.

A cell that holds a vector is one text, as in print: `(-14.86, 31.54, 902.38)`. In JSON it is a list.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Literal, TextIO

from circlepose._typing import FloatArray
from circlepose.files import records, tables
from circlepose.files.tables import Row
from circlepose.pose import CircleResult, ImageResult

Layout = Literal["poses", "table1", "table2"]
LAYOUTS: tuple[Layout, ...] = ("poses", "table1", "table2")
DataFormat = Literal["csv", "json", "jsonl"]

TABLE1_COLUMNS = (
    "Method",
    "Image",
    "Circle center position",
    "Position difference (mm)",
    "Surface normal",
    "Orientation difference (deg)",
)
TABLE2_COLUMNS = ("Scene", "Candidate", "UN", "TV", "GCC")

_DECIMALS = {
    "Circle center position": 2,
    "Position difference (mm)": 2,
    "Surface normal": 2,
    "Orientation difference (deg)": 2,
    "UN": 4,
    "TV": 4,
    "GCC": 2,
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
        else:
            row["Circle center position"] = circle.status
        yield row
    if not result.circles or tables.stands_for_missing(result):
        yield {"Image": result.image, "Circle center position": result.status}


def table2_rows(result: ImageResult) -> Iterator[Row]:
    """Yield a row per candidate of each target's largest circle, the chosen first, as in Table 2 of Fu & Zhou.

    UN is the unit normal, TV the translation vector (mm), GCC the generatrix between the concentric circles (mm).
    """
    seen = set()
    for circle in result.circles:
        if (circle.instance, circle.method) in seen:
            continue
        seen.add((circle.instance, circle.method))
        scene = _scene(result, circle)
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
            }
    if not result.circles or tables.stands_for_missing(result):
        yield {"Scene": result.image, "UN": result.status}


PRINTED: Mapping[Layout, tuple[tuple[str, ...], Callable[[ImageResult], Iterator[Row]]]] = {
    "table1": (TABLE1_COLUMNS, table1_rows),
    "table2": (TABLE2_COLUMNS, table2_rows),
}
"""columns and rows of the layouts that have the form of a printed table"""


def printed(row: Row, columns: Iterable[str]) -> Row:
    """Return `row` with its numbers and vectors as the texts of the printed tables."""
    return {column: _print(row.get(column), _DECIMALS.get(column, 6)) for column in columns}


def write_results(results: Iterable[ImageResult], handle: TextIO, *, data_format: DataFormat, layout: Layout) -> None:
    """Write all `results` to `handle` in one of the data formats and layouts."""
    if layout == "poses":
        writers = {"csv": tables.write_csv, "json": records.write_json, "jsonl": records.write_jsonl}
        writers[data_format](results, handle)
        return
    columns, rows_of = PRINTED[layout]
    schema = f"circlepose.{layout}/1"

    def printed_rows(result: ImageResult) -> Iterator[Row]:
        return (printed(row, columns) for row in rows_of(result))

    def plain_rows(result: ImageResult) -> Iterator[Row]:
        return ({column: _listed(row.get(column)) for column in columns} for row in rows_of(result))

    if data_format == "csv":
        tables.write_csv_rows(columns, printed_rows, results, handle)
    elif data_format == "json":
        records.write_json_document(schema, "rows", plain_rows, results, handle)
    else:
        records.write_json_lines(schema, plain_rows, results, handle)


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
