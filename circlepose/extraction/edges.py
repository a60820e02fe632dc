"""Grey image -> connected edge chains at one scale (Canny on thresholds that follow the image)."""

from __future__ import annotations

import cv2
import numpy as np

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
_SAMPLES = 1 << 15
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
    dx = cv2.Sobel(smooth, cv2.CV_16S, 1, 0)
    dy = cv2.Sobel(smooth, cv2.CV_16S, 0, 1)
    apart = max(1, round(np.sqrt(grey8.size / _SAMPLES)))
    sample = np.abs(dx[::apart, ::apart].astype(np.int32)) + np.abs(dy[::apart, ::apart])
    quiet = np.partition(sample.ravel(), int(_QUIET_SHARE * sample.size))[int(_QUIET_SHARE * sample.size)]
    high = max(_NOISE_FACTOR * float(quiet), _LEAST_GRADIENT)
    return cv2.Canny(dx, dy, _HYSTERESIS * high, high)
