"""The variables of MATLAB's files, whichever way they were saved: as a script, a print, JSON, or a .mat file."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from circlepose.errors import CalibrationError
from circlepose.io.calibration.document import Document
from circlepose.io.calibration.mat_file import MatError, MatObject, Value, is_mat_file, mat_variables
from circlepose.io.calibration.matlab_text import Rows, variables

Fields = Mapping[str, Value]
"""the variables of a file, or the fields of one structure"""
_MAX_DEPTH = 4
_MAX_CHARACTERS = 1_000_000
"""of a script or print; results of a calibration, with all poses of its board, have some 100 kB"""


@dataclass(frozen=True, slots=True)
class Values:
    """The numbers of a file."""

    fields: Fields
    ambiguous: frozenset[str] = frozenset()
    """names that stand in a text with several values"""
    problem: str = ""
    """what is wrong with a .mat file"""


def values_of(document: Document) -> Values:
    """Return what numbers a document holds. Raises nothing."""
    if is_mat_file(document.content):
        try:
            return Values(mat_variables(document.content))
        except MatError as reason:
            return Values({}, problem=str(reason))
    if document.text is None:
        return Values({})
    if document.text.lstrip().startswith("{"):
        return Values(_of_json(document.entries, 0))
    found, ambiguous = variables(document.text)
    return Values(found, frozenset(ambiguous))


def assigns(text: str | None, name: str) -> bool:
    """Whether a text gives the variable `name` a value: quicker than `values_of`, to recognize a form."""
    if text is None or len(text) > _MAX_CHARACTERS:
        return False
    return re.search(rf"(?:^|[;,])[ \t]*(?:\w+\.)*{name}[ \t]*[=:]", text, re.MULTILINE) is not None


def vector(fields: Fields, key: str, where: str, counts: tuple[int, ...]) -> list[float]:
    """Return the numbers of a row or column; raises `CalibrationError` where they, or some of them, are missing."""
    expected = " or ".join(map(str, counts))
    value = fields.get(key)
    if value is None:
        raise CalibrationError(f"{where}: {key}: is missing; expected {expected} numbers.")
    rows = value if isinstance(value, list) else []
    flat = [number for row in rows for number in row]
    if min(len(rows), max(map(len, rows), default=0)) > 1 or len(flat) not in counts:
        raise CalibrationError(f"{where}: {key}: expected {expected} numbers, got {_described(value)}.")
    return flat


def _described(value: Value) -> str:
    if isinstance(value, MatObject):
        return f"an object ({value.class_name[:40]})"
    if isinstance(value, Mapping):
        return "a structure"
    return f"{len(value)} x {max(map(len, value), default=0)}"


def _of_json(entries: Mapping[str, object], depth: int) -> dict[str, Value]:
    found: dict[str, Value] = {}
    for key, value in entries.items():
        if isinstance(value, Mapping):
            if depth < _MAX_DEPTH:
                found[key] = _of_json(value, depth + 1)
        else:
            rows = _rows(value)
            if rows is not None:
                found[key] = rows
    return found


def _rows(value: object) -> Rows | None:
    given = value if isinstance(value, list) else [value]
    rows: list[list[float]] = []
    for row in given if given and isinstance(given[0], list) else [given]:
        if not isinstance(row, list) or not all(map(_is_number, row)):
            return None
        rows.append([float(number) for number in row])
    return rows


def _is_number(value: object) -> bool:
    return isinstance(value, float) or (
        isinstance(value, int) and not isinstance(value, bool) and abs(value) < 1 << 63
    )
