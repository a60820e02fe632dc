"""An image at halved sizes, and the positions of its pixels in them."""

from __future__ import annotations

import cv2
import numpy as np

from circlepose._typing import FloatArray, Image

_COARSEST_PIXELS = 60_000.0
"""About how many pixels the coarsest image has: large circles are found in it at hardly any cost; cost."""
_SMALLEST_SIDE_PX = 64
"""px; shorter side from which an image is halved at least once; empirical."""


def pyramid(grey8: Image) -> list[Image]:
    """Return an image and its successive halvings by averaging.

    Parameters
    ----------
    grey8
        (h, w) uint8.

    Returns
    -------
    Images from full size down to some 60 000 pixels, each half as wide and high as the one before.
    """
    levels = max(0, round(np.log2(max(grey8.size, 1.0) / _COARSEST_PIXELS) / 2.0))
    images = [grey8]
    for _ in range(max(levels, int(min(grey8.shape) >= _SMALLEST_SIDE_PX))):
        images.append(cv2.resize(images[-1], None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA))
    return images


def to_full_size(points: FloatArray, scale: float) -> FloatArray:
    """Return positions (..., 2) px of an image reduced by `scale` in the full one; averaging shifts pixel centers."""
    return (points + 0.5) * scale - 0.5


def to_reduced(points: FloatArray, scale: float) -> FloatArray:
    """Return positions (..., 2) px of the full image in the one reduced by `scale`."""
    return (points + 0.5) / scale - 0.5
