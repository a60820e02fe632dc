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
_PIPE_WIDTH = 200


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
    from rich import box  # noqa: PLC0415 - only where it is shown
    from rich.console import Console  # noqa: PLC0415
    from rich.table import Table  # noqa: PLC0415
    from rich.text import Text  # noqa: PLC0415

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    for header in ("image", "#", "circle", "method", "change"):
        table.add_column(header, overflow="fold")
    for header in ("tolerances", "mm", "deg"):
        table.add_column(header, justify="right", overflow="fold")
    table.add_column("remarks", overflow="fold")
    for each in comparison.differences:
        names = (each.image, each.instance, each.circle, each.method, each.change)
        numbers = (
            (each.tolerances, 2),
            (each.position_difference_mm, 3),
            (each.orientation_difference_deg, 3),
        )
        cells = [
            *("" if name is None else printable(str(name)) for name in names),
            *("" if value is None else columns.fixed(value, decimals) for value, decimals in numbers),
            printable(_remarks(each)),
        ]
        table.add_row(*map(Text, cells))
    Console(file=handle, width=None if handle.isatty() else _PIPE_WIDTH).print(table)


def _remarks(difference: Difference) -> str:
    """Return the statuses, if they say more than that a pose moved."""
    status, reference = difference.status, difference.reference_status
    if difference.change == "status":
        return f"{reference} -> {status}"
    one = status if difference.change == "missing" else reference
    return "" if one in (None, Status.OK) else f"status {one}"
