"""Grey image -> connected edge chains at one scale (Canny on thresholds that follow the image)."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np

from circlepose._typing import Image, IntArray
from circlepose.extraction.chains import Chains

_BLUR_PX = 0.8
"""Enough against pixel noise; more would join the edges of discs that nearly touch."""
_QUIET_SHARE = 0.25
_NOISE_FACTOR = 9.5
"""High threshold in units of the gradient that this share of the pixels stays below: that of noise and texture, also
where most of an image is full of edges. (In white noise 6 times the median.)"""
_LEAST_GRADIENT = 40.0
"""Floor of the high threshold (L1 Sobel units, 8 per grey level and px): a ramp of 5 levels a px."""
_HYSTERESIS = 0.4
_SAMPLES = 1 << 11
"""So many pixels tell the gradient of noise."""
_SOBEL = np.array([[-1, 0, 1, -2, 0, 2, -1, 0, 1], [-1, -2, -1, 0, 0, 0, 1, 2, 1]], np.float32)
_PLASTIC = 1.324717957244746 ** -np.array([1.0, 2.0])


def edge_chains(grey8: Image, shortest: int) -> Chains:
    """Return the borders of all connected edges of `grey8` (h, w) uint8 with at least `shortest` points.

    A closed edge gives two borders, its outer one and that of the hole within; an edge that something outside
    has merged with still has its hole.
    """
    borders, hierarchy = cv2.findContours(edge_map(grey8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    return Chains.of_borders(borders, hierarchy, shortest, size=max(grey8.shape))


def edge_map(grey8: Image) -> Image:
    """Return the Canny edges of `grey8` (h, w) uint8: 255 on an edge, 0 elsewhere."""
    smooth = cv2.GaussianBlur(grey8, (5, 5), _BLUR_PX)
    high = max(_NOISE_FACTOR * _quiet_gradient(smooth), _LEAST_GRADIENT)
    return cv2.Canny(smooth, _HYSTERESIS * high, high)


def _quiet_gradient(smooth: Image) -> float:
    """Return the gradient (L1 Sobel units) that the quieter pixels of `smooth` (h, w) stay below."""
    if min(smooth.shape) < 3:
        return 0.0
    around = np.ascontiguousarray(smooth).take(_scattered(*smooth.shape)).astype(np.float32)
    across, down = _SOBEL @ around
    gradient = np.abs(across) + np.abs(down)
    place = int(_QUIET_SHARE * gradient.size)
    return float(np.partition(gradient, place)[place])


@lru_cache(maxsize=8)
def _scattered(height: int, width: int) -> IntArray:
    """Return places (9, n) in an image laid flat: the neighbourhoods of pixels that cover it evenly.

    In no regular grid, which would see every line of a page of text, or every field of a chessboard, alike: the
    additive recurrence of the plastic number (Roberts' R2).
    """
    number = np.arange(_SAMPLES)[:, None]
    y, x = np.floor((number * _PLASTIC % 1.0) * [height - 2, width - 2]).astype(np.int64).T
    beside = np.add.outer(width * np.arange(3), np.arange(3)).ravel()
    return beside[:, None] + np.sort(y * width + x)
