"""Small plots on a picture: a frame with ticks, points, lines and bars. For pictures that OpenCV writes anyway."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from circlepose._typing import BoolArray, FloatArray, Image
from circlepose.drawing.canvas import polylines
from circlepose.drawing.style import Color, Font

INK: Color = (60, 60, 60)
FAINT: Color = (215, 215, 215)


@dataclass(frozen=True, slots=True)
class Plot:
    """A frame on `canvas` whose inside shows data of the ranges `x` and `y` (upwards)."""

    canvas: Image
    font: Font
    left: int
    top: int
    width: int
    height: int
    x: tuple[float, float]
    y: tuple[float, float]

    def at(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return picture px (..., 2) of data."""
        across = self.left + (x - self.x[0]) / (self.x[1] - self.x[0]) * self.width
        down = self.top + (self.y[1] - y) / (self.y[1] - self.y[0]) * self.height
        return np.stack([across, down], axis=-1)

    def frame(self, title: str, x_ticks: Sequence[float], y_ticks: Sequence[float], x_unit: str = "") -> None:
        """Draw the frame, its ticks and the title above."""
        bottom, half_line = self.top + self.height, self.font.line_height / 2.0
        for value in x_ticks:
            (column, _) = self.at(np.array(value), np.array(self.y[0])).tolist()
            cv2.line(self.canvas, (round(column), self.top), (round(column), bottom), FAINT, 1)
            label = f"{value:g}{x_unit}"
            self._write(label, column - self.font.width(label) / 2.0, bottom)
        for value in y_ticks:
            (_, row) = self.at(np.array(self.x[0]), np.array(value)).tolist()
            cv2.line(self.canvas, (self.left, round(row)), (self.left + self.width, round(row)), FAINT, 1)
            label = f"{value:g}"
            self._write(label, self.left - self.font.margin - self.font.width(label), row - 1.1 * half_line)
        cv2.rectangle(self.canvas, (self.left, self.top), (self.left + self.width, bottom), INK, 1)
        self._write(title, self.left, self.top - 1.2 * self.font.line_height)

    def _write(self, words: str, left: float, top: float) -> None:
        """Write `words` with the corner of the text itself at (left, top)."""
        font = self.font.fitting([words], self.width)
        font.write(self.canvas, [words], left - font.margin, top - font.margin / 2.0, INK)

    def line(self, x: FloatArray, y: FloatArray, color: Color, width: int = 2) -> None:
        """Draw a line through data (n,), broken where it is NaN."""
        path = self.at(x, np.clip(y, *self.y))
        polylines(self.canvas, [path], color, width)

    def marks(self, x: FloatArray, y: FloatArray, colors: Image, size_px: tuple[float, float]) -> None:
        """Draw a box of `size_px` (width, height) at each of n data, in its color (n, 3)."""
        centers = self.at(x, y)
        low = np.round(centers - np.array(size_px) / 2.0).astype(int)
        high = np.maximum(np.round(centers + np.array(size_px) / 2.0).astype(int), low + 1)
        corner, end = np.array([self.left, self.top]), np.array([self.left + self.width, self.top + self.height])
        low, high = np.clip(low, corner, end), np.clip(high, corner, end)
        for (x0, y0), (x1, y1), color in zip(low.tolist(), high.tolist(), colors, strict=True):
            self.canvas[y0:y1, x0:x1] = color

    def bands(self, ranges: Sequence[tuple[float, float]], color: Color) -> None:
        """Shade ranges of x."""
        for first, last in ranges:
            for low, high in ((first, last), (first - 360.0, last - 360.0)):
                if high <= self.x[0] or low >= self.x[1]:
                    continue
                ends = self.at(np.clip([low, high], *self.x), np.array([self.y[1], self.y[0]]))
                (x0, y0), (x1, y1) = np.round(ends).astype(int).tolist()
                self.canvas[y0:y1, x0:x1] = color


def diverging(value: FloatArray) -> Image:
    """Return colors (n, 3) of values from -1 (blue) over 0 (white) to 1 (red)."""
    v = np.clip(value, -1.0, 1.0)
    blue, red = np.where(v > 0.0, 1.0 - v, 1.0), np.where(v < 0.0, 1.0 + v, 1.0)
    green = 1.0 - np.abs(v)
    ends = np.stack([0.12 + 0.88 * blue, 0.15 + 0.85 * green, 0.12 + 0.88 * red], axis=-1)
    return np.asarray(np.round(255.0 * ends).astype(np.uint8))


def means(x: FloatArray, y: FloatArray, used: BoolArray, edges: FloatArray) -> FloatArray:
    """Return the mean (n,) of `y` where `x` is between each two of `edges` (n + 1,); NaN where nothing is."""
    index = np.digitize(x[used], edges) - 1
    inside = (index >= 0) & (index < len(edges) - 1)
    count = np.bincount(index[inside], minlength=len(edges) - 1)
    total = np.bincount(index[inside], y[used][inside], len(edges) - 1)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)
