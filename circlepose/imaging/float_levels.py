"""A floating image in units of its own quantization, so that neither its gain nor its offset matters.

The fits assume the noise of rounding to whole levels, 1/12 of a level squared, as 8 and 16 bit images have it. So a
floating image is divided by the smallest step between its levels: for a scaled copy of an 8 bit image, that is the
step of the original.
"""

from __future__ import annotations

import cv2
import numpy as np

from circlepose._typing import BoolArray, FloatArray, Image
from circlepose.errors import ArgumentError

_SAMPLES = 1 << 16
"""Pixels from which the step is estimated; cost."""
_MOST_STEPS = 65_535
"""Steps in the usual range of levels at most, as in a 16 bit image; numerical."""
_USUAL = (1.0, 50.0, 99.0)
"""Percentiles of the usual range, with its middle: a hot pixel does not stretch it; empirical."""
_ROUNDING = 2.0
"""Machine epsilons; levels closer than this are one level; numerical."""
_FARTHEST = 2.0**22
"""Steps from the median beyond which a level is clipped: float32 holds these to half a step; numerical."""


def in_steps(image: Image) -> Image:
    """Return floating `image` (...) as float32, in steps from its median; NaN where it is not finite.

    Raises
    ------
    ArgumentError
        When no pixel is finite.
    """
    finite = np.isfinite(image)
    sample = _sample(image, finite)
    low, middle, high = np.percentile(sample, _USUAL, method="nearest").tolist()
    if low < high:
        sample = sample[(sample >= low) & (sample <= high)]
    # By a power of two, which is exact, so that nothing overflows.
    exponent = int(np.frexp(np.max(np.abs(sample)))[1])
    middle = float(np.ldexp(middle, -exponent))
    step = _step(np.ldexp(sample, -exponent), float(np.finfo(image.dtype).eps))
    with np.errstate(over="ignore", invalid="ignore"):
        levels = np.ldexp(image, -exponent)
        levels -= image.dtype.type(middle)
        levels /= image.dtype.type(step)
        np.clip(levels, -_FARTHEST, _FARTHEST, out=levels)
    levels = levels.astype(np.float32, copy=False)
    if not finite.all():
        levels[~finite] = np.nan
    return levels


def without_gaps(grey: Image) -> Image:
    """Return `grey` (h, w) with the level of the nearest pixel that has one where it is NaN."""
    if grey.dtype.kind != "f":
        return grey
    gaps = np.isnan(grey)
    return filled(grey, gaps) if gaps.any() else grey


def filled(image: Image, gaps: BoolArray) -> Image:
    """Return `image` (h, w, ...) with the levels of the nearest other pixel in the pixels `gaps` (h, w)."""
    _, nearest = cv2.distanceTransformWithLabels(
        gaps.view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    levels = np.zeros((int(nearest.max()) + 1, *image.shape[2:]), image.dtype)
    levels[nearest[~gaps]] = image[~gaps]
    return levels[nearest]


def _sample(image: Image, finite: Image) -> FloatArray:
    """Return finite levels (n,) of pixels that cover the image evenly; all of them where these are equal."""
    flat = np.linspace(0, image.size - 1, min(_SAMPLES, image.size)).astype(np.int64)
    some = image.ravel()[flat][finite.ravel()[flat]]
    if len(some) == 0 or np.min(some) == np.max(some):
        some = image[finite]
    if len(some) == 0:
        raise ArgumentError("image: none of its levels is a finite number.")
    return some.astype(np.float64)


def _step(sample: FloatArray, epsilon: float) -> float:
    """Return the least step between different levels of `sample` (n,), within (-1, 1); 1 with a single level."""
    levels = np.unique(sample)
    gaps = np.diff(levels)
    gaps = gaps[gaps > _ROUNDING * epsilon]
    return max(float(gaps.min()), float(np.ptp(levels)) / _MOST_STEPS) if len(gaps) else 1.0
