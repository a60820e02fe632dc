"""Poses as a table for people: a row per candidate, or two where the terminal is narrow."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from circlepose.drawing.words import DOUBTFUL_FROM, SURE
from circlepose.io.tables.columns import TEXT_COLUMNS, Row, cell, fixed
from circlepose.io.text.escaping import printable, quoted
from circlepose.results import Flag, Status
from circlepose_cli.output import grid
from circlepose_cli.output.digits import aligned, decimals, number_text
from circlepose_cli.output.grid import Column, Grid

_NAMES = {"image": "image", "#": "instance", "circle": "circle", "method": "method"}
_ALWAYS = ("image", "#", "x mm", "y mm", "z mm", "n x", "n y", "n z")
"""columns that are there even where all their cells are empty"""
_CENTER = {"x mm": "center_x_mm", "y mm": "center_y_mm", "z mm": "center_z_mm"}
_NORMAL = {"n x": "normal_x", "n y": "normal_y", "n z": "normal_z"}
_MM, _DEG = "± mm", "± deg"
_RANKS = {_MM: 1, _DEG: 2}
"""what is left out first: the digits of the numbers say nearly the same"""
_AMBIGUITY = "ambiguity"
_STYLES = {"ok": "green", "doubtful": "yellow", "failed": "red", "other": "dim"}


def pose_forms(rows: Sequence[Row]) -> tuple[Grid, ...]:
    """Return the forms of a table of `rows`, the widest first."""
    folder = common_folder([str(row["image"]) for row in rows])
    rows = [{**row, "image": str(row["image"]).removeprefix(folder)} for row in rows]
    title = f"images in {shown(folder)}" if folder else ""
    wide = _wide(rows, title)
    return wide, headed(wide), _stacked(rows, title)


def chosen_columns_form(rows: Sequence[Row], columns: Sequence[str]) -> Grid:
    """Return a table of the columns that the user chose, under their own names."""
    cells = []
    for column in columns:
        if column in TEXT_COLUMNS or column == "chosen":
            cells.append([shown(None if row.get(column) is None else cell(column, row[column])) for row in rows])
        else:
            cells.append(aligned([number_text(row, column) for row in rows]))
    return Grid(
        tuple(Column(column, _kind(column)) for column in columns),
        tuple(
            grid.Row(texts, style=_STYLES["other"] if row.get("chosen") is False else "")
            for row, texts in zip(rows, zip(*cells, strict=True), strict=True)
        ),
    )


def _kind(column: str) -> grid.Kind:
    if column == "image":
        return "name"
    return "words" if column in TEXT_COLUMNS or column == "chosen" else "number"


def common_folder(names: Sequence[str]) -> str:
    """Return the folder, with its slash, that all names begin with: it would only make the table wider."""
    folder = names[0][: names[0].rfind("/") + 1] if names else ""
    while not all(name.startswith(folder) for name in names):
        folder = folder[: folder[:-1].rfind("/") + 1]
    return folder


def shown(value: object) -> str:
    """Return a text as it may go to a terminal."""
    return "" if value is None else printable(quoted(str(value)))


def _wide(rows: Sequence[Row], title: str) -> Grid:
    names = {header: key for header, key in _NAMES.items() if header in _ALWAYS or _varies(rows, key)}
    numbers = {header: aligned(cells) for header, cells in _numbers(rows).items()}
    numbers = {header: cells for header, cells in numbers.items() if header in _ALWAYS or any(cells)}
    columns = [
        *(Column(header, "name" if header == "image" else "words") for header in names),
        *(Column(header, "number", _RANKS.get(header, 0)) for header in numbers),
        Column("remarks"),
    ]
    colored = [n for n, column in enumerate(columns) if column.header in (_AMBIGUITY, "remarks")]
    made = []
    for place, row in enumerate(rows):
        texts = (
            *(shown(row.get(key)) for key in names.values()),
            *(cells[place] for cells in numbers.values()),
            ", ".join(remarks(row)),
        )
        made.append(grid.Row(texts, *row_styles(row, colored)))
    return Grid(tuple(columns), grid.without_repeats(made, len(names)), title)


def headed(wide: Grid) -> Grid:
    """Return the table `wide` with the images, its first column, on lines of their own."""
    rows = tuple(
        replace(
            row,
            cells=row.cells[1:],
            whole=(),
            heading=row.cells[0],
            styles=tuple((n - 1, style) for n, style in row.styles),
        )
        for row in wide.rows
    )
    return replace(wide, columns=wide.columns[1:], rows=rows)


def _stacked(rows: Sequence[Row], title: str) -> Grid:
    """Return a table of two lines a candidate, center and normal, with the names of images above."""
    numbers = _numbers(rows)
    headers = {"x": ("x mm", "n x"), "y": ("y mm", "n y"), "z": ("z mm", "n z"), "± mm/deg": (_MM, _DEG)}
    columns = {header: [aligned(numbers[each]) for each in both] for header, both in headers.items()}
    columns = {header: both for header, both in columns.items() if not header.startswith("±") or any(map(any, both))}
    above_all = ["image", *(["method"] if _varies(rows, "method") else [])]
    made = []
    heading = label = ""
    for place, row in enumerate(rows):
        new_heading = ", ".join(shown(row[key]) for key in above_all if row.get(key) is not None)
        new_label = " ".join(shown(row[key]) for key in ("instance", "circle") if row.get(key) is not None)
        is_new = new_heading != heading
        cells = [f"{center[place]}\n{normal[place]}".rstrip("\n") for center, normal in columns.values()]
        texts = (
            new_label if is_new or new_label != label else "",
            "mm\nn" if any(cells) else "",
            *cells,
            "\n".join(part for part in (", ".join(remarks(row)), doubt(row)) if part),
        )
        style, styles = row_styles(row, (len(texts) - 1,))
        made.append(grid.Row(texts, style, styles, new_heading if is_new else ""))
        heading, label = new_heading, new_label
    return Grid(
        (Column("#"), Column(""), *(Column(header, "number") for header in columns), Column("remarks")),
        tuple(made),
        title,
    )


def _numbers(rows: Sequence[Row]) -> dict[str, list[str]]:
    """Return the numbers of all rows, by header."""
    numbers = {header: [number_text(row, key) for row in rows] for header, key in (_CENTER | _NORMAL).items()}
    numbers[_MM] = [_center_sigma(row) for row in rows]
    numbers[_DEG] = [number_text(row, "sigma_normal_deg") for row in rows]
    numbers[_AMBIGUITY] = ["" if row.get("chosen") is False else number_text(row, _AMBIGUITY) for row in rows]
    return numbers


def _center_sigma(row: Row) -> str:
    """Return the standard deviation of the center, of all three coordinates together."""
    sigmas = [sigma for axis in "xyz" if isinstance(sigma := row.get(f"sigma_{axis}_mm"), float)]
    if len(sigmas) < 3:
        return ""
    sigma = math.hypot(*sigmas)
    return fixed(sigma, decimals(sigma))


def doubt(row: Row) -> str:
    """Return the ambiguity of a chosen pose that is not certain and is not flagged, in one word."""
    ambiguity = row.get(_AMBIGUITY)
    if row.get("chosen") is False or not isinstance(ambiguity, float) or ambiguity < SURE:
        return ""
    return "" if Flag.AMBIGUOUS in remarks(row) else f"{_AMBIGUITY}={number_text(row, _AMBIGUITY)}"


def _varies(rows: Sequence[Row], key: str) -> bool:
    return len({row[key] for row in rows if key in row}) > 1


def _state(row: Row) -> str:
    """Return what a row is, of the keys of `_STYLES`."""
    if row["status"] != Status.OK:
        return "failed"
    if row.get("chosen") is False:
        return "other"
    ambiguity = row.get(_AMBIGUITY)
    is_doubtful = bool(row.get("flags")) or (isinstance(ambiguity, float) and ambiguity >= DOUBTFUL_FROM)
    return "doubtful" if is_doubtful else "ok"


def row_styles(row: Row, colored: Sequence[int]) -> tuple[str, tuple[tuple[int, str], ...]]:
    """Return the style of a row, and of its cells in the columns `colored`."""
    state = _state(row)
    if state == "other":
        return _STYLES[state], ()
    return "", tuple((column, _STYLES[state]) for column in colored)


def remarks(row: Row) -> list[str]:
    """Return the flags of a chosen candidate, or why there is none."""
    if row["status"] != Status.OK:
        return [shown(row["status"])]
    return (
        ["other"]
        if row.get("chosen") is False
        else [shown(flag) for flag in str(row.get("flags") or "").split(";") if flag]
    )
