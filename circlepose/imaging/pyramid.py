"""An image at halved sizes, and the positions of its pixels in them."""

from __future__ import annotations

from functools import cached_property

import cv2
import numpy as np

from circlepose._typing import FloatArray, Image
from circlepose.geometry.ellipse import Ellipse
from circlepose.imaging.noise import LEAST_NOISE, noise_of

_COARSEST_PIXELS = 15_000.0
"""About how many pixels the coarsest image has: large circles are found in it at hardly any cost; cost."""
_MOST_BLURRED = 3
"""Halvings that show a blur of 16 px as one of 2 px, which an edge may have; numerical."""
_SMALLEST_SIDE_PX = 56
"""px; shorter side from which an image is halved so often; numerical."""


def pyramid(levels: Image) -> list[Image]:
    """Return an image and its successive halvings by averaging.

    Parameters
    ----------
    levels
        (h, w) uint8 or float32.

    Returns
    -------
    Images from full size down to some 15 000 pixels, or to what shows the widest blur, each half as wide and high as
    the one before.
    """
    halvings = max(0, round(np.log2(max(levels.size, 1.0) / _COARSEST_PIXELS) / 2.0))
    images = [levels]
    while len(images) <= halvings or (len(images) <= _MOST_BLURRED and min(images[-1].shape) >= _SMALLEST_SIDE_PX):
        images.append(cv2.resize(images[-1], None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA))
    return images


def to_full_size(points: FloatArray, scale: float) -> FloatArray:
    """Return positions (..., 2) px of an image reduced by `scale` in the full one; averaging shifts pixel centers."""
    return (points + 0.5) * scale - 0.5


def to_reduced(points: FloatArray, scale: float) -> FloatArray:
    """Return positions (..., 2) px of the full image in the one reduced by `scale`."""
    return (points + 0.5) / scale - 0.5


class Reduced:
    """An image of any depth at halved sizes, each made when it is asked for, with its noise.

    Averaging four pixels halves white noise, and the blur in px, so what drowns in the full image stands out here.
    """

    def __init__(self, levels: Image, scale: int = 1, finest: Reduced | None = None) -> None:
        self.levels = levels
        """(h, w); float32 where the image is reduced"""
        self.scale = scale
        """px of the full image in one px of this"""
        self._finest = self if finest is None else finest

    def ellipse(self, full: Ellipse) -> Ellipse:
        """Return ellipses of the full image in this one."""
        if self.scale == 1:
            return full
        return Ellipse(
            to_reduced(full.center, self.scale),
            full.semi_major / self.scale,
            full.semi_minor / self.scale,
            full.angle,
        )

    def full(self, own: Ellipse) -> Ellipse:
        """Return ellipses of this image in the full one."""
        if self.scale == 1:
            return own
        scale = self.scale
        return Ellipse(to_full_size(own.center, scale), own.semi_major * scale, own.semi_minor * scale, own.angle)

    @cached_property
    def seen_noise(self) -> float:
        """About the standard deviation of the noise, levels; 0 where most pixels are as their neighbors."""
        return noise_of(self.levels, least=0.0)

    @cached_property
    def noise(self) -> float:
        """The same, or that of rounding if it is more: what may be noise."""
        return max(self.seen_noise, LEAST_NOISE)

    @cached_property
    def stairs_range(self) -> float:
        """Range of the levels of the image that it was reduced from, if that shows only rounding as noise; else 0."""
        if self._finest is not self:
            return self._finest.stairs_range
        return float(np.ptp(self.levels)) if self.seen_noise < LEAST_NOISE else 0.0

    @cached_property
    def half(self) -> Reduced:
        """The same image, half as wide and high."""
        height, width = (side // 2 for side in self.levels.shape)
        # Without the last of an odd number of rows and columns, so that the scale is exact.
        levels = np.ascontiguousarray(self.levels[: 2 * height, : 2 * width], dtype=np.float32)
        return Reduced(
            cv2.resize(levels, (width, height), interpolation=cv2.INTER_AREA), 2 * self.scale, self._finest
        )

    def reduced_to(self, scale: int) -> Reduced:
        """Return the same image at the scale `scale`, a power of two times this one's."""
        return self if self.scale >= scale else self.half.reduced_to(scale)
