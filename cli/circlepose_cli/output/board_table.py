"""Boards as a table for people: a row per candidate, or two lines of it where the terminal is narrow."""

from __future__ import annotations

import math
from collections.abc import Sequence

from circlepose.io.tables.columns import Row, fixed
from circlepose_cli.output import grid
from circlepose_cli.output.digits import aligned, decimals, number_text
from circlepose_cli.output.grid import Column, Grid
from circlepose_cli.output.pose_table import common_folder, doubt, headed, remarks, row_styles, shown

_PLACE = {"x mm": "x_mm", "y mm": "y_mm", "z mm": "z_mm"}
_TURN = {"qw": "qw", "qx": "qx", "qy": "qy", "qz": "qz"}
_MM, _DEG, _CIRCLES, _RMS, _AMBIGUITY = "± mm", "± deg", "circles", "rms px", "ambiguity"
_RANKS = {_MM: 2, _DEG: 3, _RMS: 4, _CIRCLES: 1}
"""what is left out first on a narrow terminal: the highest"""


def board_forms(rows: Sequence[Row]) -> tuple[Grid, ...]:
    """Return the forms of a table of `rows`, the widest first."""
    folder = common_folder([str(row["image"]) for row in rows])
    rows = [{**row, "image": str(row["image"]).removeprefix(folder)} for row in rows]
    title = f"images in {shown(folder)}" if folder else ""
    wide = _wide(rows, title)
    return wide, headed(wide), _stacked(rows, title)


def _wide(rows: Sequence[Row], title: str) -> Grid:
    numbers = {header: aligned(cells) for header, cells in _numbers(rows).items()}
    columns = [
        Column("image", "name"),
        Column("#"),
        *(Column(header, "number", _RANKS.get(header, 0)) for header in numbers),
        Column("remarks"),
    ]
    colored = [n for n, column in enumerate(columns) if column.header in (_AMBIGUITY, "remarks")]
    made = [
        grid.Row(
            (
                shown(row["image"]),
                shown(row.get("instance")),
                *(cells[place] for cells in numbers.values()),
                ", ".join(remarks(row)),
            ),
            *row_styles(row, colored),
        )
        for place, row in enumerate(rows)
    ]
    return Grid(tuple(columns), grid.without_repeats(made, 2), title)


def _stacked(rows: Sequence[Row], title: str) -> Grid:
    """Return a table of two lines a candidate, place and quaternion, with the names of images above."""
    numbers = {header: aligned(cells) for header, cells in _numbers(rows).items()}
    nothing = [""] * len(rows)
    both = {
        "x": (numbers["x mm"], numbers["qx"]),
        "y": (numbers["y mm"], numbers["qy"]),
        "z": (numbers["z mm"], numbers["qz"]),
        "w": (nothing, numbers["qw"]),
        "± mm/deg": (numbers[_MM], numbers[_DEG]),
    }
    made = []
    heading = label = ""
    for place, row in enumerate(rows):
        new_heading, new_label = shown(row["image"]), shown(row.get("instance"))
        is_new = new_heading != heading
        cells = [f"{above[place]}\n{below[place]}" if below[place] else "" for above, below in both.values()]
        circles, rms = (numbers[header][place].strip() for header in (_CIRCLES, _RMS))
        notes = [", ".join(remarks(row)), doubt(row), f"{circles}, rms {rms}" if circles else ""]
        texts = (
            new_label if is_new or new_label != label else "",
            "mm\nq" if any(cells) else "",
            *cells,
            "\n".join(filter(None, notes)),
        )
        style, styles = row_styles(row, (len(texts) - 1,))
        made.append(grid.Row(texts, style, styles, new_heading if is_new else ""))
        heading, label = new_heading, new_label
    columns = (
        Column("#"),
        Column(""),
        *(Column(header, "number", int(header.startswith("±"))) for header in both),
        Column("remarks"),
    )
    return Grid(columns, tuple(made), title)


def _numbers(rows: Sequence[Row]) -> dict[str, list[str]]:
    """Return the numbers of all rows, by header."""
    numbers = {header: [number_text(row, key) for row in rows] for header, key in (_PLACE | _TURN).items()}
    numbers[_MM] = [_joint_sigma(row, "sigma_{}_mm") for row in rows]
    numbers[_DEG] = [_joint_sigma(row, "sigma_r{}_deg") for row in rows]
    numbers[_CIRCLES] = [
        f"{row['circles_used']}/{row['circles_in_layout']}" if "circles_used" in row else "" for row in rows
    ]
    numbers[_RMS] = [number_text(row, "rms_px") for row in rows]
    numbers[_AMBIGUITY] = ["" if row.get("chosen") is False else number_text(row, _AMBIGUITY) for row in rows]
    return numbers


def _joint_sigma(row: Row, name: str) -> str:
    """Return the standard deviation of all three axes together."""
    sigmas = [sigma for axis in "xyz" if isinstance(sigma := row.get(name.format(axis)), float)]
    if len(sigmas) < 3:
        return ""
    sigma = math.hypot(*sigmas)
    return fixed(sigma, decimals(sigma))
