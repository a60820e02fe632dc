"""Tables of poses, of circles or of boards, as rows of texts, whatever the form of the file."""

from __future__ import annotations

import csv
import io
import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from circlepose._arguments import shown
from circlepose.errors import UsageError
from circlepose.io.tables.board_records import BOARDS_SCHEMA
from circlepose.io.tables.board_rows import BOARD_COLUMNS
from circlepose.io.tables.columns import COLUMNS, csv_text
from circlepose.io.tables.json_records import POSES_SCHEMA
from circlepose.io.tables.pair_rows import PAIRS_SCHEMA
from circlepose.io.text.escaping import unquoted
from circlepose.io.text.validation import brief
from circlepose.results import Status

Form = Literal["csv", "tsv", "json", "jsonl"]


@dataclass(frozen=True, slots=True)
class TableRow:
    """One row: its cells by column, and where it stands, for messages."""

    where: str
    cells: Mapping[str, str]

    def text(self, column: str) -> str:
        """Return a cell; an absent one is empty."""
        return self.cells.get(column, "")


def read_rows(content: bytes, name: str) -> tuple[Form, Sequence[str], list[TableRow]]:
    """Return the form, the columns and the rows of the table in `content`, which messages call `name`.

    Raises `UsageError` when it is empty, no text, or breaks the rules of its form.
    """
    text = _decoded(content, name)
    if text.lstrip().startswith(("{", "[")):
        form, images = _json_images(text, name)
        kind = _KINDS[BOARDS_SCHEMA if _is_of_boards(images) else POSES_SCHEMA]
        columns: Sequence[str] = kind.columns
        rows = [row for where, image in images for row in _rows_of_image(where, image, kind)]
    else:
        first = text.partition("\n")[0]
        form = "tsv" if "\t" in first and "," not in first else "csv"
        columns, rows = _csv_rows(text, name, "\t" if form == "tsv" else ",")
    if not rows:
        raise UsageError(f"{name}: has no rows; expected a table of poses.")
    return form, columns, rows


def _decoded(content: bytes, name: str) -> str:
    if content.startswith(b"PAR1"):
        raise UsageError(f"{name}: is Parquet; expected csv, tsv, json or jsonl, plain or gzipped.")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as reason:
        raise UsageError(f"{name}: is not UTF-8 text (byte {reason.start}); expected a table of poses.") from None
    if "\0" in text:
        raise UsageError(f"{name}: is a binary file; expected a table of poses.")
    if not text.strip():
        raise UsageError(f"{name}: is empty; expected a table of poses.")
    return text


def _csv_rows(text: str, name: str, delimiter: str) -> tuple[Sequence[str], list[TableRow]]:
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter, strict=True)
    try:
        lines = [(reader.line_num, line) for line in reader if any(cell.strip() for cell in line)]
    except csv.Error as reason:
        raise UsageError(f"{name}, line {reader.line_num}: is no valid CSV ({reason}).") from None
    columns = [cell.strip() for cell in lines[0][1]] if lines else []
    if len(columns) == 1 and ";" in columns[0]:
        raise UsageError(f"{name}: its columns are parted by semicolons; expected commas or tabs.")
    if lines and "image" not in columns:
        raise UsageError(f"{name}: has no column image; expected a table of poses.")
    twice = [column for column, times in Counter(columns).items() if times > 1]
    if twice:
        raise UsageError(f"{name}: has two columns {brief(twice[0]) or 'without a name'}.")
    rows = []
    for number, line in lines[1:]:
        where = f"{name}, line {number}"
        if len(line) != len(columns):
            raise UsageError(f"{where}: has {len(line)} cells, the header {len(columns)}; is the file cut short?")
        rows.append(TableRow(where, dict(zip(columns, map(csv_text, line), strict=True))))
    return columns, rows


def _json_images(text: str, name: str) -> tuple[Form, list[tuple[str, dict[str, Any]]]]:
    """Return the images of a JSON document, or of JSON lines, each with where it stands."""
    try:
        document = json.loads(text)
    except (ValueError, RecursionError):
        return "jsonl", [_json_line(f"{name}, line {n}", line) for n, line in _lines(text)]
    if isinstance(document, dict) and "images" not in document and "image" in document:
        return "jsonl", [_json_line(f"{name}, line 1", text)]
    _check_schema(document, name)
    images = document.get("images")
    if not isinstance(images, list):
        raise UsageError(f"{name}: images: expected a list, got {shown(images)}.")
    return "json", [(f"{name}, image {number}", image) for number, image in enumerate(images)]


def _lines(text: str) -> Iterator[tuple[int, str]]:
    # Not splitlines, which would also break a line at marks that may stand in a name.
    return ((number, line) for number, line in enumerate(text.split("\n"), start=1) if line.strip())


def _json_line(where: str, line: str) -> tuple[str, dict[str, Any]]:
    try:
        image = json.loads(line)
    except (ValueError, RecursionError):
        raise UsageError(f"{where}: is no valid JSON; is the file cut short?") from None
    _check_schema(image, where)
    return where, image


def _check_schema(document: object, where: str) -> None:
    schema = document.get("schema") if isinstance(document, dict) else None
    if schema == PAIRS_SCHEMA:
        raise UsageError(f"{where}: {PAIRS_OF_CIRCLES}")
    if not isinstance(schema, str) or schema not in _KINDS:
        raise UsageError(f"{where}: schema: expected {POSES_SCHEMA!r} or {BOARDS_SCHEMA!r}, got {shown(schema)}.")


@dataclass(frozen=True, slots=True)
class _Kind:
    """What the images of a JSON hold."""

    key: str
    columns: tuple[str, ...]


_KINDS = {POSES_SCHEMA: _Kind("circles", COLUMNS), BOARDS_SCHEMA: _Kind("boards", BOARD_COLUMNS)}
PAIRS_OF_CIRCLES = "is of the layout pairs, without poses; expected the layout poses or boards."


def _is_of_boards(images: Sequence[tuple[str, object]]) -> bool:
    """Return whether JSON is of boards; its lines, or the document, have a known schema."""
    return any(isinstance(image, dict) and "boards" in image for _, image in images)


def _rows_of_image(where: str, image: object, kind: _Kind) -> Iterator[TableRow]:
    """Yield the rows that the CSV of an image has."""
    own = _object(where, "image", image)
    # A board that is there has a pose; its circles may not have one.
    usual = {"status": Status.OK} if kind.key == "boards" else {}
    parts = [usual | _object(where, kind.key, part) for part in _list(where, own, kind.key)]
    for part in parts:
        shared = {"image": own.get("image"), **part}
        solutions = _list(where, part, "solutions")
        for solution in solutions or [{}]:
            yield TableRow(where, _cells(shared | _object(where, "solutions", solution), kind))
    status = own.get("status")
    if not parts or (status != Status.OK and all(part.get("status") != status for part in parts)):
        yield TableRow(where, _cells({"image": own.get("image"), "status": status}, kind))


def _cells(fields: Mapping[str, Any], kind: _Kind) -> dict[str, str]:
    return {column: _cell(value) for column, value in fields.items() if column in kind.columns and value is not None}


def _cell(value: object) -> str:
    if isinstance(value, list):
        return ";".join(map(str, value))
    return str(value).lower() if isinstance(value, bool) else unquoted(str(value))


def _list(where: str, fields: Mapping[str, Any], key: str) -> list[Any]:
    value = fields.get(key)
    if not isinstance(value, list):
        raise UsageError(f"{where}: {key}: expected a list, got {shown(value)}.")
    return value


def _object(where: str, key: str, value: object) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise UsageError(f"{where}: {key}: expected an object with keys, got {shown(value)}.")
    return value
