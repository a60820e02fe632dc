"""An image at halved sizes, and which of them a circle can be seen in."""

from __future__ import annotations

import cv2
import numpy as np

from circlepose._typing import FloatArray, Image

_COARSEST_PIXELS = 60_000.0
"""About as many pixels as the coarsest image has: large circles are found in it at hardly any cost."""


def pyramid(grey8: Image) -> list[Image]:
    """Return `grey8` (h, w) and its successive halvings by averaging, down to some 60 000 pixels."""
    levels = max(0, round(np.log2(max(grey8.size, 1.0) / _COARSEST_PIXELS) / 2.0))
    images = [grey8]
    for _ in range(max(levels, int(min(grey8.shape) >= 64))):
        images.append(cv2.resize(images[-1], None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA))
    return images


def to_full_size(points: FloatArray, scale: float) -> FloatArray:
    """Turn px of an image reduced by `scale` into those of the full one; averaging shifts pixel centres."""
    return (points + 0.5) * scale - 0.5


def to_reduced(points: FloatArray, scale: float) -> FloatArray:
    """Turn px of the full image into those of the one reduced by `scale`."""
    return (points + 0.5) / scale - 0.5
