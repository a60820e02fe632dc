"""The cells of a table of poses as values; each raises `UsageError` for what it cannot mean."""

from __future__ import annotations

import math
from collections.abc import Sequence

from circlepose._arguments import shown
from circlepose.errors import UsageError
from circlepose.evaluation.matching import Vector
from circlepose.io.tables.rows import TableRow

UNIT = 1e-3
"""How far the length of a unit vector may be from 1: files have six or more decimals."""


def in_order(where: str, rows: Sequence[TableRow]) -> tuple[list[TableRow], int]:
    """Return the candidates of one circle or board by their numbers, and the index of the chosen one."""
    by_number: dict[int, TableRow] = {}
    for row in rows:
        number = whole(row, "solution")
        if number in by_number:
            raise UsageError(f"{row.where}: solution: {where} has number {number} twice; are two tables joined?")
        by_number[number] = row
    ordered = [by_number[number] for number in sorted(by_number)]
    chosen = [place for place, row in enumerate(ordered) if _is_chosen(row)]
    if len(chosen) != 1:
        raise UsageError(f"{rows[0].where}: chosen: {where} has {len(chosen)} chosen candidates; expected one.")
    return ordered, chosen[0]


def vector(row: TableRow, columns: Sequence[str], *, complete: bool) -> Vector | None:
    """Return three numbers, None where all are empty; `complete` refuses that."""
    x, y, z = (number(row, column) for column in columns)
    if x is not None and y is not None and z is not None:
        return x, y, z
    empty = next(column for column, value in zip(columns, (x, y, z), strict=True) if value is None)
    if complete:
        raise UsageError(f"{row.where}: {empty}: is empty, though status is ok.")
    if any(value is not None for value in (x, y, z)):
        raise UsageError(f"{row.where}: {empty}: is empty, but not all of {', '.join(columns)} are.")
    return None


def number(row: TableRow, column: str) -> float | None:
    """Return a finite number, None for an empty cell."""
    if not row.text(column):
        return None
    value = _parsed(row, column)
    if not math.isfinite(value):
        raise UsageError(f"{row.where}: {column}: expected a number or an empty cell, got {shown(row.text(column))}.")
    return value


def whole(row: TableRow, column: str) -> int:
    """Return a whole number from 0."""
    value = _parsed(row, column)
    if not (value >= 0.0 and value.is_integer()):
        raise UsageError(f"{row.where}: {column}: expected a whole number from 0, got {shown(row.text(column))}.")
    return int(value)


def _parsed(row: TableRow, column: str) -> float:
    """Return a cell as a number, NaN if it is not one."""
    try:
        return float(row.text(column))
    except ValueError:
        return math.nan


def _is_chosen(row: TableRow) -> bool:
    text = row.text("chosen").strip().lower()
    if text not in {"true", "false"}:
        raise UsageError(f"{row.where}: chosen: expected true or false, got {shown(row.text('chosen'))}.")
    return text == "true"


def image_of(row: TableRow) -> str:
    """Return the name of the image."""
    return filled(row, "image")


def filled(row: TableRow, column: str) -> str:
    """Return a text that is not empty."""
    text = row.text(column)
    if not text:
        raise UsageError(f"{row.where}: {column}: is empty.")
    return text
