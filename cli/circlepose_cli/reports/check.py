"""What differs between two tables of poses, as a table for people or as data."""

from __future__ import annotations

import csv
from dataclasses import asdict
from typing import TextIO

from circlepose._version import __version__
from circlepose.evaluation.compare import Comparison, Difference, Tolerance
from circlepose.io.tables import columns, json_records
from circlepose.io.text.escaping import printable
from circlepose.results import Status
from circlepose_cli.options.declared import FormatChoice
from circlepose_cli.output.results import DELIMITERS

SCHEMA = "circlepose.check/1"
COLUMNS = tuple(Difference.__dataclass_fields__)


def write_comparison(
    comparison: Comparison, tolerance: Tolerance, handle: TextIO, output_format: FormatChoice
) -> None:
    """Write the differences to `handle`."""
    if output_format is FormatChoice.TABLE:
        if comparison.differences:
            _write_table(comparison, handle)
    elif output_format in DELIMITERS:
        _write_csv(comparison, handle, DELIMITERS[output_format])
    elif output_format is FormatChoice.JSON:
        handle.write(json_records.dumps(_record(comparison, tolerance)) + "\n")
    else:
        for difference in comparison.differences:
            handle.write(json_records.dumps({"schema": SCHEMA, **asdict(difference)}) + "\n")


def _record(comparison: Comparison, tolerance: Tolerance) -> columns.Row:
    return {
        "schema": SCHEMA,
        "version": __version__,
        "tolerance": asdict(tolerance),
        "compared": comparison.compared,
        "largest_position_mm": comparison.largest_position_mm,
        "largest_normal_deg": comparison.largest_normal_deg,
        "notes": list(comparison.notes),
        "differences": [asdict(difference) for difference in comparison.differences],
    }


def _write_csv(comparison: Comparison, handle: TextIO, delimiter: str) -> None:
    writer = csv.writer(handle, lineterminator="\n", delimiter=delimiter)
    writer.writerow(COLUMNS)
    for difference in comparison.differences:
        writer.writerow([columns.csv_cell(column, value) for column, value in asdict(difference).items()])


def _write_table(comparison: Comparison, handle: TextIO) -> None:
    from circlepose_cli.output.digits import aligned  # noqa: PLC0415 - needs rich, only where it is shown
    from circlepose_cli.output.grid import Column, Grid, Row, print_grid  # noqa: PLC0415

    names = ("image", "#", "circle", "method", "change")
    numbers = {
        "tolerances": ("tolerances", 2),
        "mm": ("position_difference_mm", 3),
        "deg": ("orientation_difference_deg", 3),
    }
    differences = comparison.differences
    cells = [
        aligned([_number(getattr(each, field), decimals) for each in differences])
        for field, decimals in numbers.values()
    ]
    rows = [
        Row((*_names(each), *texts, printable(_remarks(each))))
        for each, texts in zip(differences, zip(*cells, strict=True), strict=True)
    ]
    is_one = len({each.method for each in differences}) == 1
    shown = (
        *(Column(name, "name" if name == "image" else "words", int(name == "method" and is_one)) for name in names),
        *(Column(header, "number", 2 if header == "tolerances" else 0) for header in numbers),
        Column("remarks"),
    )
    print_grid(handle, Grid(shown, tuple(rows)))


def _names(difference: Difference) -> list[str]:
    names = (difference.image, difference.instance, difference.circle, difference.method, difference.change)
    return ["" if name is None else printable(str(name)) for name in names]


def _number(value: float | None, decimals: int) -> str:
    return "" if value is None else columns.fixed(value, decimals)


def _remarks(difference: Difference) -> str:
    """Return the statuses, if they say more than that a pose moved."""
    status, reference = difference.status, difference.reference_status
    if difference.change == "status":
        return f"{reference} -> {status}"
    one = status if difference.change == "missing" else reference
    return "" if one in (None, Status.OK) else f"status {one}"
