"""What stands above a picture: its title, what is said of it, the legend in its colors, and rows of numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from circlepose._typing import Image
from circlepose.drawing.canvas import Pen
from circlepose.drawing.style import OTHER, PANEL, SMALL_SIZE, TEXT_SIZE, TITLE_SIZE, Color, Font, plain

Sample: TypeAlias = Literal["line", "dashes", "bold arrow", "thin arrow", "cross", "patch", "number"]


@dataclass(frozen=True, slots=True)
class LegendItem:
    """A thing that is drawn, as a sample of it and in words."""

    sample: Sample
    color: Color
    words: str


@dataclass(frozen=True, slots=True)
class Heading:
    """The texts above a picture; what is not ASCII is shown as `plain` does."""

    title: str
    sentences: tuple[str, ...] = ()
    legend: tuple[LegendItem, ...] = ()
    rows: tuple[tuple[str, ...], ...] = ()
    """a table, its column names first; the last columns are left out where there is no room"""
    color: Color = PANEL

    def drawn(self, width: int, unit: float) -> Image:
        """Return the heading (height, width, 3)."""
        title, text, small = (Font.of_scale(size * unit) for size in (TITLE_SIZE, TEXT_SIZE, SMALL_SIZE))
        parts = [self._texts(width, [self.title], title)] if self.title else []
        if self.sentences:
            parts.append(self._texts(width, self.sentences, text))
        if self.rows:
            parts.append(self._table(width, small))
        if self.legend:
            parts.append(self._legend(width, small, unit))
        edge = np.full((round(0.25 * small.line_height), width, 3), self.color, np.uint8)
        return np.concatenate([edge, *parts, edge])

    def _texts(self, width: int, texts: Sequence[str], font: Font) -> Image:
        lines = [line for each in texts for line in font.wrapped(plain(each), width - 2.0 * font.margin)]
        part = np.full((round(len(lines) * font.line_height + font.margin), width, 3), self.color, np.uint8)
        font.write(part, lines, 0.0, 0.0)
        return part

    def _legend(self, width: int, font: Font, unit: float) -> Image:
        """Return the items in as few rows as they fit in, in columns of equal width where there are several rows."""
        swatch, gap = 24.0 * unit, 4.0 * font.margin
        wide = [swatch + font.width(plain(item.words)) + gap + font.margin for item in self.legend]
        places, left, row = [], 0.0, 0
        for each in wide:
            if left > 0.0 and left + each > width:
                left, row = 0.0, row + 1
            places.append((left, row))
            left += each
        lines = [
            font.wrapped(plain(item.words), width - swatch - gap - font.margin)
            if each > width
            else [plain(item.words)]
            for item, each in zip(self.legend, wide, strict=True)
        ]
        heights = [
            max(len(own) for own, (_, at) in zip(lines, places, strict=True) if at == n) for n in range(row + 1)
        ]
        tops = np.concatenate([[0], np.cumsum(heights)]) * font.line_height
        part = np.full((round(float(tops[-1]) + font.margin), width, 3), self.color, np.uint8)
        pen = Pen(part, 1, unit)
        for item, own, (left, at) in zip(self.legend, lines, places, strict=True):
            top = float(tops[at])
            _draw_sample(pen, item, left + font.margin, top + font.margin / 2.0 + 0.5 * font.line_height, swatch)
            font.write(part, own, left + swatch + font.margin, top)
        return part

    def _table(self, width: int, font: Font) -> Image:
        gap = 2.0 * font.margin
        rows = [tuple(plain(cell) for cell in row) for row in self.rows]
        wide = [max(font.width(row[n]) for row in rows) + gap for n in range(len(rows[0]))]
        shown = max(1, int(np.searchsorted(np.cumsum(wide), width - font.margin, side="right")))
        part = np.full((round(len(rows) * font.line_height + font.margin), width, 3), self.color, np.uint8)
        lefts = np.concatenate([[0.0], np.cumsum(wide)])
        for column in range(shown):
            font.write(part, [rows[0][column]], float(lefts[column]), 0.0, OTHER)
            font.write(part, [row[column] for row in rows[1:]], float(lefts[column]), font.line_height)
        return part


def _draw_sample(pen: Pen, item: LegendItem, left: float, middle: float, width: float) -> None:
    start, end = np.array([left, round(middle)]), np.array([left + 0.9 * width, round(middle)])
    if item.sample == "line":
        pen.lines([np.stack([start, end])], item.color, max(1.4, 2.0 / pen.unit))
    elif item.sample == "dashes":
        parts = np.linspace(start, end, 6).reshape(3, 2, 2)
        pen.lines(list(parts), item.color, max(1.4, 2.0 / pen.unit))
    elif item.sample == "bold arrow":
        pen.arrow(start, end, item.color, 2.2)
    elif item.sample == "thin arrow":
        pen.arrow(start, end, item.color, 1.0)
    elif item.sample == "cross":
        pen.cross((start + end) / 2.0, 6.0 * pen.unit)
    elif item.sample == "number":
        font = Font.of_scale(SMALL_SIZE * pen.unit).tight
        wide, high = font.plate(["0"])
        box = (left, middle - high / 2.0, left + wide, middle + high / 2.0)
        font.plated(pen.canvas, ["0"], box, item.color)
    else:
        pen.lines([np.stack([start, end])], item.color, 9.0)
