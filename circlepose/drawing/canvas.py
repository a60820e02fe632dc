"""Lines, arrows and crosses on a picture, in the coordinates of the image that it shows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from circlepose._typing import FloatArray, Image
from circlepose.drawing.style import CENTER, SHADOW, Color

_SUBPIXEL_BITS = 4
_FARTHEST = 30000.0
"""px; beyond it OpenCV's fixed-point coordinates overflow"""
_SHADOW_UNITS = 1.0
_LEAST_SHADED = 3.5
"""Units that a cross reaches at least to have a shadow, or it would be a blob."""


@dataclass(frozen=True, slots=True)
class Pen:
    """Draws on `canvas` in the image's own pixel coordinates, whatever the enlargement."""

    canvas: Image
    enlargement: int
    unit: float
    """picture px; a thousandth of the picture's longer side"""

    def at(self, points: FloatArray) -> FloatArray:
        """Return image `points` (..., 2) in the picture; pixel centers are integers in both."""
        return (points + 0.5) * self.enlargement - 0.5

    def hairline(self, points: FloatArray, color: Color, *, closed: bool = False) -> None:
        """Draw the image points (n, 2), a picture px wide: thin enough to see whether it lies on an edge."""
        path = self.at(np.concatenate([points, points[:1]]) if closed else points)
        polylines(self.canvas, [path], color, 1)

    def lines(self, paths: Sequence[FloatArray], color: Color, units: float) -> None:
        """Draw lines through image points (n, 2), leaving out those that are NaN."""
        polylines(self.canvas, [self.at(path) for path in paths], color, max(1, round(units * self.unit)))

    def arrow(
        self, tail: FloatArray, head: FloatArray, color: Color, units: float, *, has_shadow: bool = True
    ) -> None:
        """Draw an arrow between two image points (2,), by default with a shadow that parts it from the background."""
        if not np.all(np.isfinite([tail, head])):
            return
        along = head - tail
        length = float(np.linalg.norm(along))
        # A short arrow is a slim one, or it would be a blob.
        units = min(units, 0.08 * length * self.enlargement / self.unit)
        tip = min(9.0 * self.unit / self.enlargement, 0.35 * length)
        shape = [np.stack([tail, head])]
        if length > 0.0:
            back = along / length * tip
            side = 0.42 * np.array([-back[1], back[0]])
            shape.append(np.stack([head - back + side, head, head - back - side]))
        if has_shadow:
            self.lines(shape, SHADOW, units + _SHADOW_UNITS)
        self.lines(shape, color, units)

    def cross(self, center: FloatArray, reach_px: float) -> None:
        """Draw a white cross at an image point (2,), that reaches `reach_px` of the image, or less."""
        reach = min(5.0 * self.unit / self.enlargement, reach_px)
        bars = center + reach * np.array([[[-1.0, 0.0], [1.0, 0.0]], [[0.0, -1.0], [0.0, 1.0]]])
        if reach * self.enlargement > _LEAST_SHADED * self.unit:
            self.lines(list(bars), SHADOW, 1.0 + _SHADOW_UNITS)
            self.lines(list(bars), CENTER, 1.0)
        else:
            polylines(self.canvas, [self.at(bar) for bar in bars], CENTER, 1)


def polylines(canvas: Image, paths: Sequence[FloatArray], color: Color | int, width: int) -> None:
    """Draw lines through picture points (n, 2), broken where they are NaN."""
    fixed = [_fixed(run) for path in paths for run in _runs(path)]
    cv2.polylines(canvas, fixed, False, color, width, cv2.LINE_AA, shift=_SUBPIXEL_BITS)


def filled(canvas: Image, outline: FloatArray, color: Color | int) -> None:
    """Fill the inside of picture points (n, 2); those that are NaN are left out."""
    known = outline[np.all(np.isfinite(outline), axis=1)]
    if len(known) > 2:
        cv2.fillPoly(canvas, [_fixed(known)], color, shift=_SUBPIXEL_BITS)


def _runs(path: FloatArray) -> list[FloatArray]:
    """Return the stretches of a path (n, 2) without NaN."""
    known = np.isfinite(path).all(axis=1)
    if known.all():
        return [path] if len(path) else []
    runs = [run[np.isfinite(run).all(axis=1)] for run in np.split(path, np.flatnonzero(~known))]
    return [run for run in runs if len(run)]


def _fixed(points: FloatArray) -> Image:
    return np.round(np.clip(points, -_FARTHEST, _FARTHEST) * 2**_SUBPIXEL_BITS).astype(np.int32)
