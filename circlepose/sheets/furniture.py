"""What stands around the circles of a page: bars to measure with a ruler, the small print and the QR code."""

from __future__ import annotations

from dataclasses import dataclass, replace

from circlepose.errors import UsageError
from circlepose.sheets.letters import text_length, wrapped
from circlepose.sheets.shapes import Box, Line, Page, Text

Code = tuple[float, tuple[Box, ...]]
"""The side of a QR code, mm, and its dark parts."""
EDGE_MM = 8.0
"""Margin of a page that stays empty; laser printers leave 4 to 6 mm."""
STRIP_MM = 9.0
"""Width of the strips left of the circles and below them, with the bars."""
SIZE_MM = 1.8
"""Height of a capital, as of a font of 7 points."""
LEADING_MM = 3.5
BAR_MM = 10.0
"""Bars are a multiple of this."""
MOST_BAR_MM = 300.0
"""Longest bar: a usual steel ruler."""
_GAP_MM = 4.0
_HAIR_MM = 0.15
_LINE_MM = 0.3
_LEAST_WORDS_MM = 45.0
"""Width from which the small print stands beside the code, not below it."""
_END_MM, _TICK_MM = 4.0, 1.5


@dataclass(frozen=True, slots=True)
class Footer:
    """The small print and the code below the circles, from (0, 0)."""

    height_mm: float
    texts: tuple[Text, ...]
    code: tuple[Box, ...]


def footer(sentences: tuple[str, ...], code: Code | None, width_mm: float) -> Footer:
    """Return the small print in lines that are no longer than `width_mm`, right of the code or below it."""
    side = 0.0 if code is None else code[0]
    is_beside = code is not None and width_mm - side - _GAP_MM >= _LEAST_WORDS_MM
    left = side + _GAP_MM if is_beside else 0.0
    top = 0.0 if is_beside or code is None else side
    if side > width_mm:
        raise UsageError(
            f"--paper: is too narrow for the QR code, which is {side:g} mm wide; give --no-qr, or a larger paper."
        )
    lines = [line for each in sentences for line in wrapped(each.split(), width_mm - left, SIZE_MM)]
    texts = tuple(Text(left, top + SIZE_MM + i * LEADING_MM, SIZE_MM, line) for i, line in enumerate(lines))
    height = max(side, top + len(lines) * LEADING_MM)
    return Footer(height, texts, () if code is None else code[1])


def bar_mm(room_mm: float) -> float:
    """Return the length of a bar that stands beside `room_mm`."""
    return min(BAR_MM * int((room_mm + 1e-9) / BAR_MM), MOST_BAR_MM)


def around(window: Box) -> tuple[tuple[Line, ...], tuple[Text, ...]]:
    """Return the bars, from end line to end line, below a window and left of it, with their lengths."""
    lines: list[Line] = []
    texts: list[Text] = []
    across, down = bar_mm(window.width_mm), bar_mm(window.height_mm)
    y = window.bottom_mm + STRIP_MM - 6.0
    lines += [
        Line(a, b, c, d, w)
        for a, b, c, d, w in _bar(across)
        for a, b, c, d in [(window.x_mm + a, y + b, window.x_mm + c, y + d)]
    ]
    label = _label("x", across, window.width_mm)
    texts.append(Text(window.x_mm + 1.0, y + _END_MM / 2.0 + SIZE_MM, SIZE_MM, label))
    x = window.x_mm - STRIP_MM + 6.0
    bottom = window.bottom_mm
    lines += [
        Line(a, b, c, d, w) for a, b, c, d, w in _bar(down) for a, b, c, d in [(x + b, bottom - a, x + d, bottom - c)]
    ]
    label = _label("y", down, window.height_mm)
    texts.append(Text(x - _END_MM / 2.0 - 1.0, bottom - 1.0, SIZE_MM, label, is_upright=True))
    return tuple(lines), tuple(texts)


def _label(axis: str, length_mm: float, room_mm: float) -> str:
    long = f"{axis}: {length_mm:g} mm between the end lines"
    return long if text_length(long, SIZE_MM) < room_mm else f"{axis}: {length_mm:g} mm"


def _bar(length_mm: float) -> list[tuple[float, float, float, float, float]]:
    """Return the lines of a bar along x from 0, as x, y, x, y and width; ticks each 10 mm."""
    ends = [(each, -_END_MM / 2.0, each, _END_MM / 2.0, _HAIR_MM) for each in (0.0, length_mm)]
    ticks = [(BAR_MM * i, -_TICK_MM, BAR_MM * i, 0.0, _HAIR_MM) for i in range(1, round(length_mm / BAR_MM))]
    return [(0.0, 0.0, length_mm, 0.0, _LINE_MM), *ends, *ticks]


def furnished(page: Page, below: Footer) -> Page:
    """Return `page` with bars, small print and code around the room that it leaves for circles."""
    room = Box(EDGE_MM + STRIP_MM, EDGE_MM, *window_mm((page.width_mm, page.height_mm), below))
    lines, texts = around(room)
    left, top = EDGE_MM, room.bottom_mm + STRIP_MM + _GAP_MM
    words = tuple(replace(each, x_mm=each.x_mm + left, y_mm=each.y_mm + top) for each in below.texts)
    code = tuple(replace(each, x_mm=each.x_mm + left, y_mm=each.y_mm + top) for each in below.code)
    return replace(page, lines=(*page.lines, *lines), texts=(*page.texts, *texts, *words), code=code)


def window_mm(paper_mm: tuple[float, float], below: Footer) -> tuple[float, float]:
    """Return width and height that a page leaves for the circles; raises `UsageError` where a bar has no room."""
    width, height = paper_mm
    room = width - 2.0 * EDGE_MM - STRIP_MM, height - 2.0 * EDGE_MM - STRIP_MM - _GAP_MM - below.height_mm
    if min(room) < BAR_MM:
        raise UsageError(
            f"--paper: {width:g} x {height:g} mm is too small: margins, bars and small print leave no {BAR_MM:g} mm "
            "for circles; give a larger paper."
        )
    return room


def page_mm(window: tuple[float, float], below: Footer) -> tuple[float, float]:
    """Return width and height of the page that leaves `window` for the circles."""
    width, height = window
    return width + 2.0 * EDGE_MM + STRIP_MM, height + 2.0 * EDGE_MM + STRIP_MM + _GAP_MM + below.height_mm
