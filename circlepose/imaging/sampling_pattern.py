"""Images whose pixels are no plain grid of samples: raw color mosaics, interlaced fields, repeated pixels.

Each is recognized on strips of six neighboring rows by its own statistics:

- **repeated**: from the second row on, rows change only at every k-th one, k = 2, 3 or 4, to the last bit, and at
  half of these or more; columns alike. An image of 1 px squares enlarged is of this kind;
- **mosaic**: along rows and down columns, levels alternate over six pixels by more than six standard deviations of
  the noise while those two apart agree, in 3 % of the places or more, in an image of more than 16 levels;
- **interlaced**: levels alternate down columns but not along rows, and a shift along the rows brings odd rows to even
  ones: it takes away three quarters of their difference there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np

from circlepose._typing import BoolArray, FloatArray, Image

Kind = Literal["mosaic", "interlaced", "repeated"]

_STRIPS, _ROWS = 32, 6
"""Strips of an image that are looked at, and their rows; cost."""
_LEAST_SIDE_PX = 32
"""px; shorter side from which an image is looked at; numerical."""
_REPEATS = (4, 3, 2)
"""Numbers of equal rows or columns that are recognized, the largest first."""
_LEAST_CHANGES = 0.5
"""Share of the rows that may change of those that do; fewer are a drawing with large plain areas; empirical."""
_ALTERNATING_SIGMAS = 6.0
"""Noises by which each pixel differs from the next where levels alternate; statistical."""
_ALTERNATING_COUNTS = 8.0
"""Counts by which it does at least, more than the errors of compression; empirical."""
_LEAST_MOSAIC = 0.03
"""Share of the pixels from which an image that alternates both ways is a mosaic; empirical."""
_LEAST_LEVELS = 16
"""Levels in the strips; a dithered drawing has two; empirical."""
_LEAST_COMBED = 12
"""Pixels that alternate down columns, from which a shift is tried; statistical."""
_FARTHEST_PX = 32
"""px; largest shift between two fields; cost."""
_LEAST_GAIN = 4.0
"""Mean square difference of the fields over that after the shift; empirical."""


@dataclass(frozen=True, slots=True)
class SamplingPattern:
    """What the pixels of an image are."""

    kind: Kind
    repeats: tuple[int, int] = (1, 1)
    """how often each pixel is repeated along x and y"""
    shift_px: int = 0
    """by how much odd rows are shifted along x against even ones"""


def sampling_pattern(grey: Image) -> SamplingPattern | None:
    """Return what is special of the pixels of `grey` (h, w); None for an image of plain samples."""
    height, width = grey.shape
    if min(height, width) < _LEAST_SIDE_PX:
        return None
    down, across = _repeats(grey), _repeats(grey.T)
    if (across, down) != (1, 1):
        return SamplingPattern("repeated", (across, down))
    starts = 2 * np.linspace(0, (height - _ROWS) // 2, _STRIPS).astype(np.int64)
    if np.count_nonzero(_between(*(grey[starts + i] for i in (1, 2, 3)))) < _LEAST_COMBED:
        return None
    strips = grey[starts[:, None] + np.arange(_ROWS)].astype(np.float32)
    least = _least_step(strips)
    combed = _alternating(strips, 1, least)
    number = np.count_nonzero(combed)
    if number < _LEAST_COMBED:
        return None
    lines = _alternating(strips[:, :2], 2, least).any(axis=1)
    if number >= _LEAST_MOSAIC * combed.size and np.count_nonzero(lines) >= _LEAST_MOSAIC * lines.size:
        is_drawing = len(np.unique(strips)) <= _LEAST_LEVELS
        return None if is_drawing else SamplingPattern("mosaic")
    if np.count_nonzero(lines) * 4 > number:
        return None
    shift = _field_shift(strips, combed[:, 0])
    return None if shift == 0 else SamplingPattern("interlaced", shift_px=shift)


def _repeats(grey: Image) -> int:
    """Return how often each row of `grey` (h, w) is repeated, 1 for an image whose rows are not."""
    # The first two pairs of rows say no of nearly every image.
    if not any(np.array_equal(grey[i + 1], grey[i]) for i in range(2)):
        return 1
    step = max(1, grey.shape[1] // _STRIPS)
    few = np.ascontiguousarray(grey[:, ::step])
    for every in _REPEATS:
        for offset in range(every):
            if _changes_only_at(few, every, offset) and _changes_only_at(grey, every, offset):
                return every
    return 1


def _changes_only_at(rows: Image, every: int, offset: int) -> bool:
    """Return whether of `rows` (h, w) each `every`-th from `offset` differs from that before, and no other does."""
    # Two pairs of rows say no of nearly every image.
    first = offset + 1
    if not np.array_equal(rows[first], rows[first - 1]):
        return False
    changes = np.any(rows[1:] != rows[:-1], axis=1)
    may = (np.arange(1, len(rows)) - offset) % every == 0
    return not changes[~may].any() and bool(changes[may].mean() >= _LEAST_CHANGES)


def _between(before: Image, row: Image, after: Image) -> BoolArray:
    """Return where `row` (n, w) is above, or below, both rows beside it by what counts as alternating."""
    least = _ALTERNATING_COUNTS
    if row.dtype == np.uint8:
        # Saturated differences are faster than wider numbers.
        above = cv2.min(cv2.subtract(row, before), cv2.subtract(row, after))
        below = cv2.min(cv2.subtract(before, row), cv2.subtract(after, row))
        return np.asarray(cv2.max(above, below) > least)
    levels = row.astype(np.float32)
    first, second = levels - before, levels - after
    return np.asarray((np.minimum(np.abs(first), np.abs(second)) > least) & (first * second > 0.0))


def _least_step(strips: FloatArray) -> float:
    """Return by how much levels that alternate differ: from the noise between pixels two apart."""
    apart = np.abs(strips[:, 0, :-2] - strips[:, 0, 2:])
    middle = apart.size // 2
    noise = 1.4826 * float(np.partition(apart, middle, axis=None)[middle]) / np.sqrt(2.0)
    return max(_ALTERNATING_SIGMAS * noise, _ALTERNATING_COUNTS)


def _alternating(strips: FloatArray, axis: int, least: float) -> BoolArray:
    """Return where six neighbors of `strips` (n, rows, w) along `axis` alternate, those two apart being alike."""
    number = strips.shape[axis] - _ROWS + 1
    six = [
        np.take(strips, range(i, i + number), axis=axis) if axis == 1 else strips[:, :, i : i + number]
        for i in range(_ROWS)
    ]
    even, odd = six[0::2], six[1::2]
    lowest = [np.minimum(np.minimum(*each[:2]), each[2]) for each in (even, odd)]
    highest = [np.maximum(np.maximum(*each[:2]), each[2]) for each in (even, odd)]
    gap = np.maximum(lowest[0] - highest[1], lowest[1] - highest[0])
    spread = np.maximum(highest[0] - lowest[0], highest[1] - lowest[1])
    return np.asarray((gap > least) & (spread < gap))


def _field_shift(strips: FloatArray, combed: BoolArray) -> int:
    """Return by how many px the odd rows of `strips` (n, rows, w) are shifted where they are `combed` (n, w).

    0 where no shift brings them to the even rows.
    """
    even, odd = strips[:, 0::2].mean(axis=1), strips[:, 1::2].mean(axis=1)
    farthest = min(_FARTHEST_PX, even.shape[1] // 4)
    strip, x = np.nonzero(combed)
    inside = (x >= farthest) & (x < even.shape[1] - farthest)
    strip, x = strip[inside], x[inside]
    if len(x) < _LEAST_COMBED:
        return 0
    shifts = np.arange(-farthest, farthest + 1)
    apart = np.array([np.mean((even[strip, x] - odd[strip, x + shift]) ** 2) for shift in shifts])
    best = int(np.argmin(apart))
    return int(shifts[best]) if apart[farthest] > _LEAST_GAIN * apart[best] else 0
