"""A figure that is larger than the paper, cut into tiles that overlap."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from circlepose.errors import UsageError
from circlepose.sheets.figure import Figure
from circlepose.sheets.furniture import EDGE_MM, STRIP_MM, Code, footer, furnished, window_mm
from circlepose.sheets.shapes import Box, Line, Page, Rings, Sheet

OVERLAP_MM = 10.0
"""Width of the strip that a tile shares with the next one, which is laid over it."""
SEAM_MM = 2.0
"""Least distance of a seam from a circle, where the circles leave room."""
MOST_TILES = 400
"""cost"""
_LEAST_SHARE = 0.25
"""Of the room of a page, that a tile fills."""
_NEIGHBORS = (("left", "to its left", 1), ("upper", "above it", 0))
"""Side, where the neighbor is, and which of row and column says whether there is one."""
_LONGEST_WORDS = 88, MOST_TILES, 88, 88
_TICK_MM = 1.5
_TICKS_MM = 20.0
_HAIR_MM = 0.15


@dataclass(frozen=True, slots=True)
class _Cells:
    """Where one axis is cut: the tiles begin at `starts`, the last one ends at `length_mm`."""

    starts: tuple[float, ...]
    length_mm: float

    def cell(self, i: int) -> tuple[float, float]:
        """Return where the part of tile `i` begins and ends."""
        return (*self.starts, self.length_mm)[i], (*self.starts, self.length_mm)[i + 1]

    def flap(self, i: int) -> float:
        """Return how far tile `i` goes on below the next one."""
        return OVERLAP_MM if i + 1 < len(self.starts) else 0.0


def tiled(
    figure: Figure,
    sentences: tuple[str, ...],
    code: Code | None,
    size: tuple[float, float],
    is_dark_on_light: bool,
) -> Sheet:
    """Return the tiles of a figure on paper of this size, mm, row by row.

    Raises `UsageError` where the paper is too small for one circle, or for what is printed beside it.
    """
    # All tiles leave the room of the one with the longest text.
    below = footer((*sentences, _tile_words(*_LONGEST_WORDS)), code, size[0] - 2.0 * EDGE_MM)
    room = window_mm(size, below)
    largest = max(figure.rings, key=lambda each: each.radii_mm[0])
    needed = 2.0 * (largest.radii_mm[0] + SEAM_MM) + OVERLAP_MM
    too_small = UsageError(
        f"--paper: is too small for circle {largest.name} of radius {largest.radii_mm[0]:g} mm: {size[0]:g} x "
        f"{size[1]:g} mm leaves {room[0]:.4g} x {room[1]:.4g} mm between the margins, the bars and the small print."
    )
    if needed > min(room):
        raise too_small
    across = _cut([(each.x_mm, each.radii_mm[0]) for each in figure.rings], figure.width_mm, room[0])
    down = _cut([(each.y_mm, each.radii_mm[0]) for each in figure.rings], figure.height_mm, room[1])
    cut = tuple(
        each.name for each in figure.rings if _is_cut(each.x_mm, each, across) or _is_cut(each.y_mm, each, down)
    )
    if len(cut) == len(figure.rings):
        raise too_small
    number = len(across.starts) * len(down.starts)
    if number > MOST_TILES:
        raise UsageError(
            f"--paper: is too small: the sheet would have {number} tiles, at most {MOST_TILES} are made."
        )
    pages: list[Page] = []
    for row in range(len(down.starts)):
        for column in range(len(across.starts)):
            words = _tile_words(len(pages) + 1, number, row, column)
            own = replace(footer((*sentences, words), code, size[0] - 2.0 * EDGE_MM), height_mm=below.height_mm)
            pages.append(furnished(_tile(figure, across, down, row, column, size, is_dark_on_light), own))
    return Sheet(tuple(pages), len(across.starts), cut)


def _tile(
    figure: Figure,
    across: _Cells,
    down: _Cells,
    row: int,
    column: int,
    size: tuple[float, float],
    is_dark_on_light: bool,
) -> Page:
    (left, right), (top, bottom) = across.cell(column), down.cell(row)
    right_flap, bottom_flap = across.flap(column), down.flap(row)
    # The flap of the last tile but one may reach beyond the figure.
    wide = min(right + right_flap, figure.width_mm) - left
    high = min(bottom + bottom_flap, figure.height_mm) - top
    window = Box(EDGE_MM + STRIP_MM, EDGE_MM, wide, high)
    x, y = window.x_mm - left, window.y_mm - top
    rings = tuple(moved for each in figure.rings if _meets(moved := each.moved(x, y), window))
    ground = None if is_dark_on_light else Box(x, y, figure.width_mm, figure.height_mm)
    lines: list[Line] = []
    if column:
        lines += _seam(window.x_mm, window.y_mm, window.y_mm + bottom - top, 1.0, is_dark_on_light)
    if right_flap:
        lines += _seam(window.x_mm + right - left, window.y_mm, window.y_mm + bottom - top, -1.0, is_dark_on_light)
    if row:
        lines += map(_mirrored, _seam(window.y_mm, window.x_mm, window.x_mm + right - left, 1.0, is_dark_on_light))
    if bottom_flap:
        at = window.y_mm + bottom - top
        lines += map(_mirrored, _seam(at, window.x_mm, window.x_mm + right - left, -1.0, is_dark_on_light))
    return Page(*size, window, rings, ground, tuple(lines), ())


def _seam(x: float, top: float, bottom: float, side: float, is_ink: bool) -> list[Line]:
    """Return the line along a vertical seam, and ticks that meet those of the neighbor."""
    number = max(2, round((bottom - top) / _TICKS_MM))
    steps = [top + (bottom - top) * (i + 0.5) / number for i in range(number)]
    ticks = [Line(x, y, x + side * _TICK_MM, y, _HAIR_MM, is_ink) for y in steps]
    return [Line(x, top, x, bottom, _HAIR_MM, is_ink), *ticks]


def _mirrored(line: Line) -> Line:
    """Return a line with x and y exchanged."""
    return replace(line, x0_mm=line.y0_mm, y0_mm=line.x0_mm, x1_mm=line.y1_mm, y1_mm=line.x1_mm)


def _cut(places: Sequence[tuple[float, float]], length: float, room: float) -> _Cells:
    """Return the parts of an axis along which circles lie (center, radius), each no longer than `room`.

    A seam runs where it meets the fewest circles, and of such places where the part is longest.
    """
    if length / room > MOST_TILES:
        raise UsageError(f"--paper: is too small: the sheet is {length:.0f} mm long, {room:.0f} mm fit on one page.")
    centers, radii = np.array(places).T
    low, high = np.sort(centers - radii - SEAM_MM), np.sort(centers + radii + SEAM_MM)
    starts = [0.0]
    while length - starts[-1] > room:
        farthest = starts[-1] + room - OVERLAP_MM
        least = starts[-1] + _LEAST_SHARE * room
        if farthest <= least:
            raise UsageError(f"--paper: is too small to be cut into tiles that share {OVERLAP_MM:g} mm.")
        seams = np.append(low[(low > least) & (low < farthest)], farthest)
        met = np.searchsorted(low, seams) - np.searchsorted(high, seams, side="right")
        starts.append(float(seams[met == met.min()].max()))
    return _Cells(tuple(starts), length)


def _is_cut(at: float, rings: Rings, cells: _Cells) -> bool:
    return any(abs(start - at) < rings.radii_mm[0] for start in cells.starts[1:])


def _meets(rings: Rings, window: Box) -> bool:
    reach = rings.radii_mm[0]
    return (
        window.x_mm - reach < rings.x_mm < window.right_mm + reach
        and window.y_mm - reach < rings.y_mm < window.bottom_mm + reach
    )


def _tile_words(number: int, of: int, row: int, column: int) -> str:
    neighbors = [(side, where) for side, where, is_there in _NEIGHBORS if (row, column)[is_there]]
    trims = [
        f" Trim its {side} side along the line and lay it on the line of the sheet {where}."
        for side, where in neighbors
    ]
    return f"Sheet {number} of {of}: row {row + 1}, column {column + 1}.{''.join(trims)}"
