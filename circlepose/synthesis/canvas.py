"""The pixel grid of a render, and where on it each part lies: which pixels its rim crosses, which are inside."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeAlias

import cv2
import numpy as np

from circlepose._typing import BoolArray, FloatArray, IntArray
from circlepose.camera.camera import Camera
from circlepose.synthesis.coverage import Cells, cells_of
from circlepose.synthesis.layers import Part
from circlepose.synthesis.regions import Region

PixelIndex: TypeAlias = tuple[IntArray, IntArray]
"""rows and columns (n,) on the canvas"""
_CHUNK = 1 << 16
"""Pixels asked at a time, to bound the memory."""


@dataclass(frozen=True, slots=True, eq=False)
class Canvas:
    """The image with a margin, so that light from just outside it is not lost."""

    camera: Camera
    size: tuple[int, int]
    """(width, height) px of the image"""
    margin: int
    """px on every side"""

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the canvas."""
        return self.size[1] + 2 * self.margin, self.size[0] + 2 * self.margin

    def cells(self, index: PixelIndex, number: int = 1, tent: bool = False) -> Cells:
        """Return the `number` x `number` cells of the pixels at `index`."""
        pixels = np.stack([index[1] - self.margin, index[0] - self.margin], axis=-1)
        return cells_of(self.camera, pixels.astype(np.float64), number, tent)


def chunks(mask: BoolArray) -> Iterator[PixelIndex]:
    """Yield the rows and columns of the true pixels of `mask` (h, w), some rows at a time."""
    step = max(1, _CHUNK // max(mask.shape[1], 1))
    for top in range(0, mask.shape[0], step):
        rows, columns = np.nonzero(mask[top : top + step])
        if len(rows) > 0:
            yield rows + top, columns


@dataclass(frozen=True, slots=True, eq=False)
class Traced:
    """A part on the canvas: the pixels its rim crosses and those wholly inside, in a window."""

    part: Part
    rows: slice
    columns: slice
    crossed: BoolArray
    inside: BoolArray

    def covered(self, cells: Cells, index: PixelIndex) -> tuple[IntArray, FloatArray]:
        """Return which of the pixels the part touches (m,), and its coverage of their cells (m, number, number)."""
        rows, columns = index[0] - self.rows.start, index[1] - self.columns.start
        height, width = self.crossed.shape
        held = np.nonzero((rows >= 0) & (rows < height) & (columns >= 0) & (columns < width))[0]
        crossed = self.crossed[rows[held], columns[held]]
        touched = held[crossed | self.inside[rows[held], columns[held]]]
        crossed = self.crossed[rows[touched], columns[touched]]
        covered = np.ones((len(touched), *cells.pixels.shape[1:-1]))
        covered[crossed] = self.part.region.coverage(cells.take(touched[crossed]))
        return touched, covered


def trace(canvas: Canvas, part: Part) -> Traced:
    """Find where `part` lies on the canvas."""
    rims = part.region.rims(canvas.camera)
    points = np.concatenate(rims) + canvas.margin
    seen = np.isfinite(points[:, 0])
    height, width = canvas.shape
    # A rim that is partly unseen does not part inside from outside: then every pixel is asked.
    whole = bool(np.all(seen))
    points = points[seen]
    low, high = np.array([0, 0]), np.array([width, height])
    if whole:
        low = np.clip(np.floor(points.min(axis=0)) - 3, 0, high).astype(np.int64)
        high = np.clip(np.ceil(points.max(axis=0)) + 4, low, high).astype(np.int64)
    window = (slice(int(low[1]), int(high[1])), slice(int(low[0]), int(high[0])))
    marks = np.zeros((high[1] - low[1], high[0] - low[0]), dtype=np.uint8)
    if marks.size == 0:
        nothing = marks.astype(np.bool_)
        return Traced(part, *window, nothing, nothing)
    points = points[np.all((points > low - 3) & (points < high + 3), axis=1)]
    at = np.rint(points).astype(np.int64) - low
    # Half a pixel between points at most: the pixel of each and its neighbors hold the rim.
    for down in (-1, 0, 1):
        for right in (-1, 0, 1):
            y, x = at[:, 1] + down, at[:, 0] + right
            held = (y >= 0) & (y < marks.shape[0]) & (x >= 0) & (x < marks.shape[1])
            marks[y[held], x[held]] = 1
    crossed = marks.astype(np.bool_)
    inside = _inside(canvas, part.region, window, crossed, whole)
    return Traced(part, *window, crossed, inside)


def _inside(
    canvas: Canvas, region: Region, window: tuple[slice, slice], crossed: BoolArray, whole: bool
) -> BoolArray:
    """Return which uncrossed pixels of the window are inside: one question per connected area, or per pixel."""
    offset = np.array([window[0].start, window[1].start])
    if not whole:
        inside = np.zeros(crossed.shape, dtype=np.bool_)
        for rows, columns in chunks(~crossed):
            inside[rows, columns] = _asked(canvas, region, (rows + offset[0], columns + offset[1]))
        return inside
    number, labels = cv2.connectedComponents((~crossed).astype(np.uint8), connectivity=4)
    # Any one pixel of each area stands for it.
    sample = np.zeros(number, dtype=np.int64)
    sample[labels.ravel()] = np.arange(labels.size)
    rows, columns = np.divmod(sample, crossed.shape[1])
    answer = _asked(canvas, region, (rows + offset[0], columns + offset[1]))
    # Label 0 is the crossed pixels themselves.
    answer[0] = False
    return np.asarray(answer[labels])


def _asked(canvas: Canvas, region: Region, index: PixelIndex) -> BoolArray:
    return np.asarray(region.coverage(canvas.cells(index))[:, 0, 0] > 0.5)
