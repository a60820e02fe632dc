"""What studies and plans print: one sheet of rows and notes, as a table for people, CSV, JSON or JSON lines."""

from __future__ import annotations

import csv
import sys
from dataclasses import dataclass
from pathlib import Path
from textwrap import fill, wrap
from typing import IO, TypeAlias

from circlepose._version import __version__
from circlepose.io.tables import columns, json_records
from circlepose.studies.published import Triple
from circlepose_cli.console.terminal import width_of
from circlepose_cli.options.declared import FormatChoice
from circlepose_cli.output.destination import open_output, output_place
from circlepose_cli.output.results import DELIMITERS, choose_format

Cell: TypeAlias = str | float | Triple | None
_HEADER_WIDTH = 11
_NOTE_WIDTH = 120


@dataclass(frozen=True, slots=True)
class Sheet:
    """Rows ready to be printed."""

    name: str
    """of the JSON's schema, such as study.table1"""
    decimals: dict[str, int]
    """columns in their order, and how many decimals their numbers have; 0 for texts"""
    rows: tuple[tuple[Cell, ...], ...]
    notes: tuple[str, ...]
    details: tuple[str, ...] = ()
    """columns that a narrow table leaves out, the first of them first, and any table where they are empty"""


def write_sheet(sheet: Sheet, asked: FormatChoice | None, path: Path | None, *, overwrite: bool = False) -> None:
    """Write `sheet` to standard output or to the file at `path`, in the form asked for or that fits the place."""
    output = output_place(path)
    to_terminal = output is None and sys.stdout.isatty()
    form = choose_format(asked, output, to_terminal=to_terminal, of_estimate=False)
    with open_output(output, overwrite=overwrite) as handle:
        if form is FormatChoice.TABLE:
            _write_table(sheet, handle)
        elif form in DELIMITERS:
            _write_csv(sheet, handle, DELIMITERS[form])
        else:
            _write_json(sheet, handle, lines=form is FormatChoice.JSONL)
    if form in {*DELIMITERS, FormatChoice.JSONL}:
        # Rows alone would not say what their numbers are.
        for note in sheet.notes:
            print(note, file=sys.stderr)


def _write_table(sheet: Sheet, handle: IO[str]) -> None:
    from circlepose_cli.output.grid import Column, Grid, Row, print_grid, without_repeats  # noqa: PLC0415 - needs rich

    printed = [_printed(sheet, row) for row in sheet.rows]
    names = [*sheet.decimals]
    kept = [i for i, name in enumerate(names) if name not in sheet.details or any(row[i] for row in printed)]
    columns = tuple(
        Column(
            "\n".join(wrap(names[i].replace("_", " "), _HEADER_WIDTH, break_long_words=False)),
            rank=len(sheet.details) - sheet.details.index(names[i]) if names[i] in sheet.details else 0,
        )
        for i in kept
    )
    rows = [Row(tuple(row[i] or "--" for i in kept)) for row in printed]
    print_grid(handle, Grid(columns, without_repeats(rows, 1)))
    width = width_of(handle) or _NOTE_WIDTH
    for note in sheet.notes:
        handle.write(fill(note, min(width, _NOTE_WIDTH), break_on_hyphens=False) + "\n")


def _write_csv(sheet: Sheet, handle: IO[str], delimiter: str) -> None:
    writer = csv.writer(handle, lineterminator="\n", delimiter=delimiter)
    writer.writerow(sheet.decimals)
    writer.writerows(_printed(sheet, row) for row in sheet.rows)


def _write_json(sheet: Sheet, handle: IO[str], *, lines: bool) -> None:
    schema = f"circlepose.{sheet.name}/1"
    rows: list[dict[str, object]] = [
        {
            column: list(value) if isinstance(value, tuple) else value
            for column, value in zip(sheet.decimals, row, strict=True)
        }
        for row in sheet.rows
    ]
    if lines:
        handle.writelines(json_records.dumps({"schema": schema, **row}) + "\n" for row in rows)
        return
    head = json_records.dumps({"schema": schema, "version": __version__, "notes": list(sheet.notes)})
    body = ",\n".join(json_records.dumps(row) for row in rows)
    handle.write(f'{head[:-1]}, "rows": [\n{body}\n]}}\n')


def _printed(sheet: Sheet, row: tuple[Cell, ...]) -> list[str]:
    """Return the cells as texts: a vector as in print, nothing for None."""
    return [_text(value, decimals) for value, decimals in zip(row, sheet.decimals.values(), strict=True)]


def _text(value: Cell, decimals: int) -> str:
    if value is None:
        return ""
    if isinstance(value, tuple):
        return f"({', '.join(columns.fixed(each, decimals) for each in value)})"
    return value if isinstance(value, str) else columns.fixed(value, decimals)
