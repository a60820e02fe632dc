"""Gray levels of any depth -> the image in which edges are sought, in units that edge thresholds are made for.

An image of 8 bits stays as it is. Any other is divided by its level, the smallest difference that counts:

    level = min(range / 255, max(noise, range / 16384))

With the noise of an ordinary camera this is 1/255 of the range, and the image is stretched to 8 bits. Where the range
is much wider than the noise, as with a dead pixel, a row of metadata or a hot object in a thermal image, 8 bits would
hide what differs by a hundredth of it. Then a level is the noise, and the image is returned as float32.
"""

from __future__ import annotations

import cv2
import numpy as np

from circlepose._typing import Image
from circlepose.imaging.noise import noise_of

_LEAST_RANGE = 32
"""Levels; an 8 bit image that spans fewer is stretched before its edges are sought; empirical."""
COARSE, _FINE = 255.0, 16_384.0
"""Levels in the range of an image, at least, as of 8 bits; and at most, as gradients are held in 16; numerical."""
_ROUNDING = 0.29
"""Counts; standard deviation of rounding to whole ones; exact."""


def in_edge_levels(grey: Image) -> tuple[Image, float]:
    """Return the image in which edges are sought, and its level.

    Parameters
    ----------
    grey
        (h, w) levels without gaps, of any depth.

    Returns
    -------
    (h, w) uint8, or float32 where 8 bits do not hold the range; and the size of its level in counts of `grey`.
    """
    if grey.dtype == np.uint8 and not has_low_range(grey):
        return grey, 1.0
    low, high, _, _ = cv2.minMaxLoc(grey)
    if not high > low:
        return np.zeros(grey.shape, np.uint8), 1.0
    coarse, fine = (high - low) / COARSE, (high - low) / _FINE
    # Rounding is noise, too: an image of 8 bits is never divided more finely.
    level = max(noise_of(grey, least=_ROUNDING), fine)
    if level < coarse:
        return (grey.astype(np.float32) - np.float32(low)) * np.float32(1.0 / level), level
    stretched = cv2.convertScaleAbs(
        grey.astype(np.float32), alpha=255.0 / (high - low), beta=-255.0 * low / (high - low)
    )
    return stretched, coarse


def has_low_range(grey: Image) -> bool:
    """Return whether `grey` (h, w) has 8 bits and uses few of them, so that rounding between pixels matters."""
    if grey.dtype != np.uint8:
        return False
    low, high, _, _ = cv2.minMaxLoc(grey)
    return bool(high - low < _LEAST_RANGE)
