"""Distances and angles of pairs of circles as a table for people."""

from __future__ import annotations

from collections.abc import Sequence

from circlepose.io.tables.columns import Row
from circlepose_cli.output import grid
from circlepose_cli.output.digits import aligned, number_text
from circlepose_cli.output.grid import Column, Grid
from circlepose_cli.output.pose_table import common_folder, headed, shown

_NAMES = ("image", "first", "second")
_NUMBERS = {"distance mm": "distance_mm", "± mm": "sigma_mm", "angle deg": "angle_deg", "± deg": "sigma_deg"}


def pair_forms(rows: Sequence[Row]) -> tuple[Grid, ...]:
    """Return the forms of a table of `rows`, the widest first."""
    folder = common_folder([str(row["image"]) for row in rows])
    names = [
        [shown(str(row["image"]).removeprefix(folder)), *(shown(row.get(name)) for name in _NAMES[1:])]
        for row in rows
    ]
    numbers = [aligned([number_text(row, key) for row in rows]) for key in _NUMBERS.values()]
    columns = (
        *(Column(name, "name" if name == "image" else "words") for name in _NAMES),
        *(Column(header, "number", 2 if header == "± deg" else 1 if header == "± mm" else 0) for header in _NUMBERS),
    )
    made = [grid.Row((*texts, *cells)) for texts, *cells in zip(names, *numbers, strict=True)]
    wide = Grid(columns, grid.without_repeats(made, 2), f"images in {shown(folder)}" if folder else "")
    return wide, headed(wide)
