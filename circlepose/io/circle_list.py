"""The circles of a board as a table: CSV, its columns separated by commas, semicolons or tabs."""

from __future__ import annotations

import csv
import io
import math
import re
from difflib import get_close_matches
from pathlib import Path

from circlepose._arguments import shown
from circlepose.errors import TargetError
from circlepose.io.length_units import check_column
from circlepose.io.text.source import read_source
from circlepose.io.text.validation import brief

_COLUMNS = ("name", "x_mm", "y_mm", "z_mm", "radius_mm", "nx", "ny", "nz")
_FOR_PEOPLE = ("comment", "note")
"""columns that are passed over"""
_SEPARATORS = (",", ";", "\t")
_DECIMAL_COMMA = re.compile(r"[-+]?\d+,\d+")


def read_circle_list(path: Path) -> list[tuple[str, dict[str, object]]]:
    """Return the circles of a file as entries of `circles:`, each with where it stands, for a message.

    The columns are name, x_mm, y_mm, z_mm, radius_mm, nx, ny, nz; comment and note are passed over. Raises
    `TargetError`.
    """
    text, name = read_source(path, TargetError)
    where = f"circles: {name}"
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=_separator(text))
    rows = ((reader.line_num, [each.strip() for each in row]) for row in reader)
    try:
        columns = next((row for _, row in rows if any(row)), [])
        _check_columns(columns, where)
        return [_circle(row, columns, f"{where}: line {line}") for line, row in rows if any(row)]
    except csv.Error as error:
        raise TargetError(f"{where}: line {reader.line_num}: is no CSV ({error}).") from None


def _separator(text: str) -> str:
    """Return the separator of the columns: the one that leaves most columns known in the header."""
    header = next(line for line in text.splitlines() if line.strip())

    def known(separator: str) -> int:
        return sum(each.strip().strip('"') in _COLUMNS for each in header.split(separator))

    return max(_SEPARATORS, key=known)


def _check_columns(columns: list[str], where: str) -> None:
    known = f"the columns are {', '.join(_COLUMNS)}, and {' and '.join(_FOR_PEOPLE)} for people"
    for i, column in enumerate(columns):
        if column in _FOR_PEOPLE:
            continue
        if column not in _COLUMNS:
            check_column(column, where)
            near = get_close_matches(column.lower(), _COLUMNS, n=1, cutoff=0.7)
            hint = f"did you mean {near[0]}?" if near else f"{known}; commas, semicolons or tabs separate them."
            raise TargetError(f"{where}: column {shown(column)} is not known; {hint}")
        if column in columns[:i]:
            raise TargetError(f"{where}: column {column!r} is there twice; remove one of them.")
    missing = [each for each in ("x_mm", "y_mm") if each not in columns]
    if missing:
        raise TargetError(f"{where}: the column {missing[0]} is missing; {known}.")


def _circle(row: list[str], columns: list[str], line: str) -> tuple[str, dict[str, object]]:
    if any(row[len(columns) :]):
        raise TargetError(
            f"{line}: has {len(row)} values for {len(columns)} columns; numbers have a decimal point, and a text "
            "with a separator is put in quotes."
        )
    entries: dict[str, object] = {
        key: value if key == "name" else _number(value, f"{line}: {key}")
        for key, value in zip(columns, row, strict=False)
        if value and key not in _FOR_PEOPLE
    }
    normal = [entries.pop(key, None) for key in ("nx", "ny", "nz")]
    if any(each is not None for each in normal):
        entries["normal"] = [0.0 if each is None else each for each in normal]
    return line, entries


def _number(text: str, where: str) -> float:
    try:
        number = float(text)
    except ValueError:
        point = " with a decimal point" if _DECIMAL_COMMA.fullmatch(text) else ""
        raise TargetError(f"{where}: expected a number{point}, got {shown(text)}.") from None
    if not math.isfinite(number):
        raise TargetError(f"{where}: expected a number; {brief(text)} is not a finite number.")
    return number
