"""A mask, whose pixels have one of two levels each, as the fits to grey levels take it.

Behind a lens, or averaged over its pixels, a rim has levels between those of its two sides. Where there are none the
pixels were decided upon, and their levels are neither rounded nor clipped light: the least and the greatest level of
the image's depth are levels as any other two.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from circlepose._typing import Image
from circlepose.geometry.ellipse import Ellipse

_PLACES = 90
_OFFSETS_PX = np.array([-2.0, -1.0, 0.0, 1.0, 2.0])
"""Where a rim is looked at: places along it, and beside it."""
_BETWEEN = 0.125
"""Share of the step from either of its ends that counts as that end."""
_MOST_BETWEEN = 0.03
"""Share of the pixels between the levels. (Of the sharpest image that is averaged over pixels it is 0.2.)"""
_CONTRAST = 255.0


def as_fitted(grey: Image, ellipses: Sequence[Ellipse]) -> Image:
    """Return `grey` (h, w), or of a mask floating levels with the contrast of 8 bits, which are not clipped."""
    if not ellipses or not is_mask(grey, Ellipse.batch(ellipses)):
        return grey
    low, high = float(np.nanmin(grey)), float(np.nanmax(grey))
    return (grey.astype(np.float32) - np.float32(low)) * np.float32(_CONTRAST / (high - low))


def is_mask(grey: Image, ellipses: Ellipse) -> bool:
    """Whether the pixels about the rims of `ellipses` (m,) have two levels each and next to none between."""
    axes = np.stack([ellipses.semi_major, ellipses.semi_minor], axis=-1)[:, None] + _OFFSETS_PX[:, None]
    around = Ellipse(
        np.broadcast_to(ellipses.center[:, None], axes.shape),
        np.maximum(axes[..., 0], 0.0),
        np.maximum(axes[..., 1], 0.0),
        np.broadcast_to(ellipses.angle[:, None], axes.shape[:-1]),
    )
    x, y = np.moveaxis(np.rint(around.points(_PLACES)), -1, 0)
    height, width = grey.shape
    seen = (x >= 0.0) & (x < width) & (y >= 0.0) & (y < height)
    levels = grey[np.where(seen, y, 0).astype(np.intp), np.where(seen, x, 0).astype(np.intp)].astype(np.float64)
    levels[~seen] = np.nan
    levels = levels.reshape(len(axes), -1)
    known = levels[np.isfinite(levels).any(axis=1)]
    low, high = np.nanmin(known, axis=1, keepdims=True), np.nanmax(known, axis=1, keepdims=True)
    step = high - low
    between = (known > low + _BETWEEN * step) & (known < high - _BETWEEN * step)
    return bool(np.any(step > 0.0) and np.sum(between) <= _MOST_BETWEEN * np.sum(np.isfinite(known)))
