"""What other rims close by add to the levels around a rim: discs nearly touching, a ring around a disc."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from circlepose._typing import BoolArray, FloatArray, IntArray
from circlepose.conic import Ellipse, rim_distance
from circlepose.fitting.blurred_share import normal_share

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
    first, second = np.nonzero(_meet(every, reach_px + _REACH_SIGMA * sigma_px, contrast, rims))
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
    every = Ellipse.batch(ellipses)
    # In parts, so that what is in memory does not grow with the square of their number.
    parts = np.split(np.arange(len(ellipses)), np.arange(_AT_ONCE, len(ellipses), _AT_ONCE))
    return np.concatenate([_meet(every, reach_px, contrast, part).any(axis=1) for part in parts])


def _meet(every: Ellipse, reach_px: FloatArray, contrast: FloatArray, rims: IntArray) -> BoolArray:
    """Tell (m, n) whether rim j of n comes into the band of the i-th of the `rims` (m,), about."""
    met = np.zeros((len(rims), len(contrast)), dtype=np.bool_)
    others = np.flatnonzero(contrast != 0.0)
    if len(others) == 0:
        return met
    own, other = every[rims], every[others]
    (a, b), (other_a, other_b) = (own.semi_major, own.semi_minor), (other.semi_major, other.semi_minor)
    gap = np.linalg.norm(own.center[:, None] - other.center[None], axis=-1)
    reach = reach_px[rims, None]
    touching = gap < a[:, None] + other_a[None] + reach
    # Neither far inside the other.
    touching &= (gap + a[:, None] + reach > other_b[None]) & (gap + other_a[None] + reach > b[:, None])
    same = (gap < _SAME_PX) & (np.abs(a[:, None] - other_a[None]) < _SAME_PX)
    same &= np.abs(b[:, None] - other_b[None]) < _SAME_PX
    met[:, others] = touching & ~same
    return met
