"""What other rims close by add to the levels around a rim: discs nearly touching, a ring around a disc."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from circlepose._typing import BoolArray, FloatArray, IntArray
from circlepose.geometry.conic import Ellipse, rim_distance
from circlepose.photometry.gaussian import normal_share

_REACH_SIGMA = 3.5
_AT_ONCE = 64
_SAME_PX = 1.5
"""Rims whose axes' ends are closer than this are one edge, found twice."""


def light_of_neighbours(
    pixels: FloatArray,
    rims: IntArray,
    ellipses: Sequence[Ellipse],
    sigma_px: FloatArray,
    contrast: FloatArray,
    reach_px: FloatArray,
) -> FloatArray:
    """Return (m, k) what the other rims change in the levels of `pixels` (m, k, 2), of the bands of m of n rims.

    `rims` (m,) are their numbers; the n `ellipses` (image, px) have blurs `sigma_px` (n,), levels inside minus
    outside of `contrast` (n,), 0 where that is not known, and bands of `reach_px` (n,).
    """
    light = np.zeros(pixels.shape[:2])
    if len(ellipses) < 2:
        return light
    every = Ellipse.batch(ellipses)
    first, second = _pairs_that_meet(every, reach_px + _REACH_SIGMA * sigma_px, contrast, rims)
    if len(first) == 0:
        return light
    other = every[second]
    distance = rim_distance(other, pixels[first])
    sigma = sigma_px[second][:, None]
    curvature = ((other.semi_major * other.semi_minor) ** -0.5)[:, None]
    _, share = normal_share(-(distance / sigma + 0.5 * sigma * curvature))
    np.add.at(light, first, contrast[second][:, None] * share)
    return light


def bands_that_meet(ellipses: Sequence[Ellipse], reach_px: FloatArray, contrast: FloatArray) -> BoolArray:
    """Tell (n,) which of n rims have another within `reach_px` (n,) whose `contrast` (n,) is known."""
    if len(ellipses) < 2:
        return np.zeros(len(ellipses), bool)
    every, met = Ellipse.batch(ellipses), np.zeros(len(ellipses), np.bool_)
    # In parts, so that what is in memory does not grow with the square of their number.
    for start in range(0, len(ellipses), _AT_ONCE):
        part = np.arange(start, min(start + _AT_ONCE, len(ellipses)))
        met[part[_pairs_that_meet(every, reach_px, contrast, part)[0]]] = True
    return met


def _pairs_that_meet(
    every: Ellipse, reach_px: FloatArray, contrast: FloatArray, rims: IntArray
) -> tuple[IntArray, IntArray]:
    """Return the pairs of i and j where rim j of n comes into the band of the i-th of the `rims` (m,), about."""
    others = np.flatnonzero(contrast != 0.0)
    own, other = every[rims], every[others]
    apart = own.center[:, None] - other.center
    gap_square = apart[..., 0] ** 2 + apart[..., 1] ** 2
    first, second = np.nonzero(gap_square < ((own.semi_major + reach_px[rims])[:, None] + other.semi_major) ** 2)
    gap, reach = np.sqrt(gap_square[first, second]), reach_px[rims[first]]
    own, other = own[first], other[second]
    # Neither far inside the other.
    met = (gap + own.semi_major + reach > other.semi_minor) & (gap + other.semi_major + reach > own.semi_minor)
    met &= ~(
        (gap < _SAME_PX)
        & (np.abs(own.semi_major - other.semi_major) < _SAME_PX)
        & (np.abs(own.semi_minor - other.semi_minor) < _SAME_PX)
    )
    return first[met], others[second[met]]
