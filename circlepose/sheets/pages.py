"""A figure on one page, or cut into tiles where the paper is smaller."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from circlepose.errors import UsageError
from circlepose.sheets.figure import Figure
from circlepose.sheets.furniture import (
    EDGE_MM,
    STRIP_MM,
    Footer,
    footer,
    furnished,
    page_mm,
    window_mm,
)
from circlepose.sheets.shapes import Box, Line, Page, Rings

Code = tuple[float, tuple[Box, ...]]
OVERLAP_MM = 10.0
"""Width of the strip that a tile shares with the next one, which is laid over it."""
SEAM_MM = 2.0
"""Least distance of a seam from a circle, where the circles leave room."""
MOST_TILES = 400
"""cost"""
_LEAST_MM = (110.0, 60.0)
"""Least room for a figure where no paper is given, so that the bars are worth measuring."""
_TICK_MM = 3.0
_TICKS_MM = 20.0
_HAIR_MM = 0.15


@dataclass(frozen=True, slots=True)
class Sheet:
    """The pages of a target."""

    pages: tuple[Page, ...]
    """from the top left, row by row"""
    columns: int = 1
    cut: tuple[str, ...] = ()
    """names of the circles through which a seam runs"""


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


def lay_out(
    figure: Figure,
    sentences: tuple[str, ...],
    code: Code | None = None,
    paper_mm: tuple[float, float] | None = None,
    *,
    is_dark_on_light: bool = True,
    scale: tuple[float, float] = (1.0, 1.0),
) -> Sheet:
    """Return the pages of a figure.

    Parameters
    ----------
    figure
        The circles.
    sentences
        The small print.
    code
        The side of the QR code and its dark parts.
    paper_mm
        Width and height of the paper, which is turned where that helps; None for one page as large as needed.
    is_dark_on_light
        Whether the circles are of ink, or of bare paper on a ground of ink.
    scale
        By which lengths in x and y are drawn; see `Page`.

    Raises
    ------
    UsageError
        Where the paper is too small for one circle, or for what is printed beside it.
    """
    if paper_mm is None:
        room = tuple(map(max, (figure.width_mm, figure.height_mm), _LEAST_MM))
        below = footer(sentences, code, room[0] + STRIP_MM)
        page = _single(figure, below, page_mm((room[0], room[1]), below), is_dark_on_light)
        return Sheet((replace(page, scale=scale),))
    width, height = paper_mm[0] / scale[0], paper_mm[1] / scale[1]
    turned = paper_mm[1] / scale[0], paper_mm[0] / scale[1]
    tries = [(width, height)] if width == height else [(width, height), turned]
    reasons: list[UsageError] = []
    tiled: list[Sheet] = []
    for size in tries:
        try:
            below = footer(sentences, code, size[0] - 2.0 * EDGE_MM)
            room = window_mm(size, below)
            if figure.width_mm <= room[0] and figure.height_mm <= room[1]:
                return Sheet((replace(_single(figure, below, size, is_dark_on_light), scale=scale),))
            tiled.append(_tiled(figure, sentences, code, size, is_dark_on_light))
        except UsageError as reason:
            reasons.append(reason)
    if not tiled:
        raise reasons[0]
    best = min(tiled, key=lambda sheet: (len(sheet.cut), len(sheet.pages)))
    return replace(best, pages=tuple(replace(page, scale=scale) for page in best.pages))


def _single(figure: Figure, below: Footer, size: tuple[float, float], is_dark_on_light: bool) -> Page:
    room = window_mm(size, below)
    window = Box(EDGE_MM + STRIP_MM, EDGE_MM, *room)
    # In the middle of the room there is.
    x = window.x_mm + (room[0] - figure.width_mm) / 2.0
    y = window.y_mm + (room[1] - figure.height_mm) / 2.0
    ground = None if is_dark_on_light else Box(x, y, figure.width_mm, figure.height_mm)
    rings = tuple(each.moved(x, y) for each in figure.rings)
    return furnished(Page(*size, window, rings, ground, (), ()), below)


def _tiled(
    figure: Figure,
    sentences: tuple[str, ...],
    code: Code | None,
    size: tuple[float, float],
    is_dark_on_light: bool,
) -> Sheet:
    # All tiles leave the room of the one with the longest text.
    below = footer((*sentences, _tile_words(88, 88, 8, 8)), code, size[0] - 2.0 * EDGE_MM)
    room = window_mm(size, below)
    largest = max(figure.rings, key=lambda each: each.radii_mm[0])
    needed = 2.0 * (largest.radii_mm[0] + SEAM_MM)
    if needed > min(room):
        raise UsageError(
            f"--paper: is too small for circle {largest.name} of radius {largest.radii_mm[0]:g} mm, which needs "
            f"{needed:g} x {needed:g} mm; {size[0]:g} x {size[1]:g} mm leaves {max(room[0], 0.0):.4g} x "
            f"{max(room[1], 0.0):.4g} mm between the margins, the bars and the small print."
        )
    across = _cut([(each.x_mm, each.radii_mm[0]) for each in figure.rings], figure.width_mm, room[0])
    down = _cut([(each.y_mm, each.radii_mm[0]) for each in figure.rings], figure.height_mm, room[1])
    number = len(across.starts) * len(down.starts)
    if number > MOST_TILES:
        raise UsageError(f"--paper: is too small: the sheet would have {number} tiles, at most {MOST_TILES} are made.")
    pages = []
    for row in range(len(down.starts)):
        for column in range(len(across.starts)):
            words = _tile_words(len(pages) + 1, number, row, column)
            own = footer((*sentences, words), code, size[0] - 2.0 * EDGE_MM)
            pages.append(furnished(_tile(figure, across, down, row, column, size, is_dark_on_light), own))
    cut = tuple(each.name for each in figure.rings if _is_cut(each.x_mm, each, across) or _is_cut(each.y_mm, each, down))
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
    rings = tuple(
        moved for each in figure.rings if _meets(moved := each.moved(x, y), window)
    )
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
    ticks = [Line(x, y, x + side * min(_TICK_MM, SEAM_MM * 0.75), y, _HAIR_MM, is_ink) for y in steps]
    return [Line(x, top, x, bottom, _HAIR_MM, is_ink), *ticks]


def _mirrored(line: Line) -> Line:
    """Return a line with x and y exchanged."""
    return replace(line, x0_mm=line.y0_mm, y0_mm=line.x0_mm, x1_mm=line.y1_mm, y1_mm=line.x1_mm)


def _cut(places: Sequence[tuple[float, float]], length: float, room: float) -> _Cells:
    """Return the parts of one axis, each as long as `room` allows, between circles (center, radius) where it can be."""
    extents = [(at - radius - SEAM_MM, at + radius + SEAM_MM) for at, radius in places]
    starts = [0.0]
    while length - starts[-1] > room:
        farthest = starts[-1] + room - OVERLAP_MM
        if farthest <= starts[-1]:
            raise UsageError(f"--paper: is too small to be cut into tiles that share {OVERLAP_MM:g} mm.")
        at = farthest
        while through := [low for low, high in extents if low < at < high]:
            at = min(through)
        # Where no gap runs through the circles, a seam does.
        starts.append(at if at > starts[-1] else farthest)
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
    sides = [side for side, there in (("left", column), ("upper", row)) if there]
    trim = ""
    if sides:
        trim = f" Trim the {' and the '.join(sides)} side along the line and lay it on the line of the sheet before it."
    return f"Sheet {number} of {of}: row {row + 1}, column {column + 1}.{trim}"
