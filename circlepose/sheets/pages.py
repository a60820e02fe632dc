"""A figure on one page, or on several where the paper is smaller."""

from __future__ import annotations

from dataclasses import replace

from circlepose.errors import UsageError
from circlepose.sheets.figure import Figure
from circlepose.sheets.furniture import EDGE_MM, STRIP_MM, Code, Footer, footer, furnished, page_mm, window_mm
from circlepose.sheets.shapes import Box, Page, Sheet
from circlepose.sheets.tiles import tiled

_LEAST_MM = (110.0, 60.0)
"""Least room for a figure where no paper is given, so that the bars are worth measuring."""


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
    cut: list[Sheet] = []
    for size in tries:
        try:
            below = footer(sentences, code, size[0] - 2.0 * EDGE_MM)
            room = window_mm(size, below)
            if figure.width_mm <= room[0] and figure.height_mm <= room[1]:
                return Sheet((replace(_single(figure, below, size, is_dark_on_light), scale=scale),))
            cut.append(tiled(figure, sentences, code, size, is_dark_on_light))
        except UsageError as reason:
            reasons.append(reason)
    if not cut:
        raise reasons[0]
    best = min(cut, key=lambda sheet: (len(sheet.cut), len(sheet.pages)))
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
