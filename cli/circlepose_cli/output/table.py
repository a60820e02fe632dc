"""Results as a table for people; the data formats hold more."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TextIO

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from circlepose.io.tables import Layout, paper_layouts
from circlepose.io.tables import columns as tables
from circlepose.io.tables.columns import Row
from circlepose.io.tables.reference import Reference
from circlepose.io.text.escaping import printable, quoted
from circlepose.results import ImageResult

_PIPE_WIDTH = 200
_NAMES = {"image": "image", "#": "instance", "circle": "circle", "method": "method"}
_ALWAYS = ("image", "#", "x mm", "y mm", "z mm", "n x", "n y", "n z")
"""columns that are there even where all their cells are empty"""
_CENTER_SIGMA = "sigma_center_mm"
_NUMBERS = {
    "x mm": ("center_x_mm", 3),
    "y mm": ("center_y_mm", 3),
    "z mm": ("center_z_mm", 3),
    "n x": ("normal_x", 4),
    "n y": ("normal_y", 4),
    "n z": ("normal_z", 4),
    "± mm": (_CENTER_SIGMA, 3),
    "± deg": ("sigma_normal_deg", 3),
    "ambiguity": ("ambiguity", 3),
}


def write_table(
    results: Iterable[ImageResult], handle: TextIO, layout: Layout, reference: Reference | None = None
) -> None:
    """Write a table of all `results` when they have ended: the chosen candidates, the others dimmed."""
    is_terminal = handle.isatty()
    console = Console(file=handle, width=None if is_terminal else _PIPE_WIDTH)
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    if layout == "poses":
        _fill_poses(table, results)
    else:
        _fill_printed(table, results, layout, reference)
    console.print(table)


def _fill_poses(table: Table, results: Iterable[ImageResult]) -> None:
    rows = [row for result in results for row in tables.pose_rows(result)]
    folder = _common_folder([str(row["image"]) for row in rows])
    if folder:
        table.title = Text(f"images in {_shown(folder)}")
        rows = [{**row, "image": str(row["image"]).removeprefix(folder)} for row in rows]
    names = {header: key for header, key in _NAMES.items() if header in _ALWAYS or _varies(rows, key)}
    numbers = {header: [_number(row, *column) for row in rows] for header, column in _NUMBERS.items()}
    numbers = {header: cells for header, cells in numbers.items() if header in _ALWAYS or any(cells)}
    for header in names:
        table.add_column(header, overflow="fold")
    for header in numbers:
        table.add_column(header, justify="right", overflow="fold")
    table.add_column("remarks", overflow="fold")
    above: list[str] = []
    for row, *row_numbers in zip(rows, *numbers.values(), strict=True):
        cells = [_shown(row.get(key)) for key in names.values()]
        shown = [*_without_repeats(cells, above), *row_numbers, _remarks(row)]
        above = cells
        table.add_row(*map(Text, shown), style="dim" if row.get("chosen") is False else "")


def _common_folder(names: Sequence[str]) -> str:
    """Return the folder, with its slash, that all names begin with: it would only make the table wider."""
    folder = names[0][: names[0].rfind("/") + 1] if names else ""
    while not all(name.startswith(folder) for name in names):
        folder = folder[: folder[:-1].rfind("/") + 1]
    return folder


def _varies(rows: Sequence[Row], key: str) -> bool:
    return len({row[key] for row in rows if key in row}) > 1


def _fill_printed(table: Table, results: Iterable[ImageResult], layout: Layout, reference: Reference | None) -> None:
    columns, rows_of = paper_layouts.columns_and_rows(layout, reference)
    for header in columns:
        table.add_column(header, overflow="fold")
    rows = [paper_layouts.printed(row, columns) for result in results for row in rows_of(result)]
    if layout == "table1":
        # In print the methods are compared one below the other; data formats go image by image.
        order = {method: place for place, method in enumerate(dict.fromkeys(row["Method"] for row in rows))}
        rows.sort(key=lambda row: order[row["Method"]])
    above: list[str] = []
    for row in rows:
        cells = ["--" if value in (None, "") else _shown(value) for value in row.values()]
        table.add_row(*map(Text, _without_repeats(cells[:1], above) + cells[1:]))
        above = cells[:1]


def _without_repeats(cells: list[str], above: list[str]) -> list[str]:
    """Blank the leading cells that say what the line above says."""
    same = 0
    while same < min(len(cells), len(above)) and cells[same] == above[same]:
        same += 1
    return [""] * same + cells[same:]


def _remarks(row: Row) -> str:
    if row["status"] != "ok":
        return _shown(row["status"])
    return "other" if row["chosen"] is False else _shown(row["flags"])


def _number(row: Row, key: str, decimals: int) -> str:
    value = row.get(key)
    if key == "ambiguity" and row.get("chosen") is False:
        return ""
    if key == _CENTER_SIGMA:
        sigmas = [row.get(f"sigma_{axis}_mm") for axis in "xyz"]
        value = math.hypot(*(s for s in sigmas if isinstance(s, float))) if None not in sigmas else None
    return tables.fixed(value, decimals) if isinstance(value, float) else ""


def _shown(value: object) -> str:
    return "" if value is None else printable(quoted(str(value)))
