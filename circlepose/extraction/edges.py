"""Grey image -> connected edge chains at one scale (Canny on thresholds that follow the image)."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from circlepose._typing import Image
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
_SAMPLES = 1 << 12
"""About so many pixels tell the gradient of noise."""


def edge_chains(grey8: Image, shortest: int) -> Chains:
    """Return the borders of all connected edges of `grey8` (h, w) uint8 with at least `shortest` points.

    A closed edge gives two borders, its outer one and that of the hole within; an edge that something outside
    has merged with still has its hole.
    """
    borders, hierarchy = cv2.findContours(edge_map(grey8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    return Chains.of_borders(borders, hierarchy, shortest)


def edge_map(grey8: Image) -> Image:
    """Return the Canny edges of `grey8` (h, w) uint8: 255 on an edge, 0 elsewhere."""
    smooth = cv2.GaussianBlur(grey8, (5, 5), _BLUR_PX)
    high = max(_NOISE_FACTOR * _quiet_gradient(smooth), _LEAST_GRADIENT)
    return cv2.Canny(smooth, _HYSTERESIS * high, high)


def _quiet_gradient(smooth: Image) -> float:
    """Return the gradient (L1 Sobel units) that the quieter pixels of `smooth` (h, w) stay below."""
    if min(smooth.shape) < 3:
        return 0.0
    apart = max(1, round(np.sqrt(smooth.size / _SAMPLES)))
    height, width = smooth.shape

    def beside(dy: int, dx: int) -> NDArray[np.int16]:
        return smooth[1 + dy : height - 1 + dy : apart, 1 + dx : width - 1 + dx : apart].astype(np.int16)

    left, right = (beside(-1, dx) + 2 * beside(0, dx) + beside(1, dx) for dx in (-1, 1))
    above, below = (beside(dy, -1) + 2 * beside(dy, 0) + beside(dy, 1) for dy in (-1, 1))
    gradient = (np.abs(right - left) + np.abs(below - above)).ravel()
    place = int(_QUIET_SHARE * gradient.size)
    return float(np.partition(gradient, place)[place])
