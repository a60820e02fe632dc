"""MATLAB's text to numbers: assignments of scripts (`fc = [ 600 ; 601 ];`) and what MATLAB prints of variables."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import TypeAlias

Rows: TypeAlias = list[list[float]]
"""a matrix row by row; a number is [[number]]"""

MAX_ROWS = 100
"""of a matrix; a longer one is no part of a calibration and is left out"""
_NAME = re.compile(r"\s*(?:[A-Za-z]\w*\.)*([A-Za-z]\w*)\s*(?:=|:)(?!=)(.*)")
_NEXT = re.compile(r"[;,](?=[ \t]*[A-Za-z]\w*[ \t]*=(?!=))")
"""between two assignments of a line"""
_SCALE = re.compile(r"\s*(\d(?:\.\d+)?[eE][-+]\d+)\s*\*\s*")
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|[-+]?(?i:inf)|(?i:nan)")


def variables(text: str) -> tuple[dict[str, Rows], set[str]]:
    """Return the variables whose numbers stand in `text`, by their last name, and the names of several values.

    `a.b = 1` is b. Strings, calls, and values that MATLAB only describes (`[3x3 double]`) are left out.
    """
    found: dict[str, Rows] = {}
    ambiguous: set[str] = set()
    lines = _Lines(text)
    for line in lines:
        match = _NAME.fullmatch(line)
        if match is None:
            continue
        name, rest = match[1], match[2].strip()
        rows = _printed(lines) if not rest else _given(rest, lines)
        if rows is not None:
            if found.get(name, rows) != rows:
                ambiguous.add(name)
            found[name] = rows
    return found, ambiguous


class _Lines:
    """The lines without comments, an assignment each, which can be looked at before they are taken."""

    def __init__(self, text: str) -> None:
        self._lines = [part for line in text.splitlines() for part in _NEXT.split(line.split("%", 1)[0].rstrip())]
        self._next = 0

    def __iter__(self) -> Iterator[str]:
        while self._next < len(self._lines):
            self._next += 1
            yield self._lines[self._next - 1]

    def peek(self) -> str | None:
        return self._lines[self._next] if self._next < len(self._lines) else None

    def skip(self) -> None:
        self._next += 1


def _given(rest: str, lines: _Lines) -> Rows | None:
    """Return the value after `=` or `:`: a number, or a matrix in brackets that may go on below."""
    if not rest.startswith("["):
        row = _row(rest.rstrip(";,"))
        return None if row is None or len(row) != 1 else [row]
    parts = [rest]
    while "]" not in parts[-1]:
        line = lines.peek()
        if line is None or len(parts) > MAX_ROWS or _NAME.fullmatch(line):
            return None
        parts.append(line)
        lines.skip()
    # Rows end at a semicolon or at the end of a line, unless that continues; JSON and YAML nest brackets instead.
    inside = re.sub(r"\.\.\.[^\n]*\n", " ", "\n".join(parts))
    inside = re.sub(r"\]\s*,", ";", inside.rstrip(";,. \n"))
    rows = [_row(row.replace("[", " ").replace("]", " ")) for row in re.split(r"[;\n]", inside)]
    filled = [row for row in rows if row != []]
    return None if not filled and "double" in inside else _complete(filled)


def _printed(lines: _Lines) -> Rows | None:
    """Return the matrix that MATLAB prints below a name: rows of numbers, all times a factor that stands above."""
    factor, rows = 1.0, list[list[float] | None]()
    while (line := lines.peek()) is not None and len(rows) <= MAX_ROWS:
        scale = _SCALE.fullmatch(line)
        if scale is not None and not rows:
            factor = float(scale[1])
        elif line.strip():
            row = _row(line)
            if row is None:
                break
            rows.append(row)
        elif rows:
            break
        lines.skip()
    matrix = _complete(rows) if rows else None
    return None if matrix is None else [[factor * value for value in row] for row in matrix]


def _complete(rows: list[list[float] | None]) -> Rows | None:
    complete = [row for row in rows if row is not None]
    is_matrix = len(complete) == len(rows) <= MAX_ROWS and len({len(row) for row in complete}) <= 1
    return complete if is_matrix else None


def _row(text: str) -> list[float] | None:
    words = text.replace(",", " ").split()
    return [float(word) for word in words] if all(_NUMBER.fullmatch(word) for word in words) else None
