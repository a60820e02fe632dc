"""The noise of an image."""

from __future__ import annotations

import numpy as np

from circlepose._typing import Image

_NOISE_ROWS, _NOISE_COLUMNS = 64, 128
"""Rows and columns of the image from which its noise is estimated."""
LEAST_NOISE = 0.5
"""Gray levels; about the rounding to whole levels."""
_PER_BEND = 1.4826 / float(np.sqrt(1.5))
"""Standard deviation of white noise over the median of its absolute second differences."""


def noise_of(gray: Image, *, least: float = LEAST_NOISE) -> float:
    """Return about the standard deviation of the noise of `gray` (h, w), at `least` that many levels.

    From the second differences of neighbors in sampled rows; by their median, so that edges do not count. NaN, where
    a pixel has no level, is passed over.
    """
    bends = _bends(gray, 1)
    if gray.dtype.kind != "f":
        middle = bends.size // 2
        return max(_PER_BEND * float(np.partition(np.abs(bends), middle, axis=None)[middle]), least)
    if np.isnan(bends).all():
        # Every second pixel, or every second row, has none.
        known = np.isfinite(gray)
        gray = gray[known.any(axis=1)][:, known.any(axis=0)]
        bends = _bends(gray, 1)
        if np.isnan(bends).all():
            bends = _bends(gray, 2)
    if np.isnan(bends).all():
        return least
    return max(_PER_BEND * float(np.nanmedian(np.abs(bends))), least)


def _bends(gray: Image, apart: int) -> Image:
    """Return levels less the mean of those `apart` px to the left and right, in sampled rows and columns."""
    height, width = gray.shape
    down, across = max(1, height // _NOISE_ROWS), max(1, width // _NOISE_COLUMNS)
    last = max(width - 2 * apart, 0)
    left, middle, right = (gray[::down, i * apart : last + i * apart : across].astype(np.float32) for i in range(3))
    return middle - (left + right) / 2.0
