"""What other rims close by add to the levels around a rim: discs nearly touching, a ring around a disc."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields

import numpy as np
from scipy.special import ndtr

from circlepose._typing import BoolArray, FloatArray, IntArray
from circlepose.conic import Ellipse, rim_distance

_REACH_SIGMA = 3.5
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
    every = _batch(ellipses)
    first, second = np.nonzero(_meet(every, reach_px + _REACH_SIGMA * sigma_px, contrast)[rims])
    if len(first) == 0:
        return light
    other = every[second]
    distance = rim_distance(other, pixels[first])
    sigma = sigma_px[second][:, None]
    curvature = ((other.semi_major * other.semi_minor) ** -0.5)[:, None]
    share = ndtr(-(distance / sigma + 0.5 * sigma * curvature))
    np.add.at(light, first, contrast[second][:, None] * share)
    return light


def bands_that_meet(ellipses: Sequence[Ellipse], reach_px: FloatArray, contrast: FloatArray) -> BoolArray:
    """Tell (n,) which of n rims have another within `reach_px` (n,) whose `contrast` (n,) is known."""
    return np.asarray(_meet(_batch(ellipses), reach_px, contrast).any(axis=1)) if len(ellipses) else np.zeros(0, bool)


def _batch(ellipses: Sequence[Ellipse]) -> Ellipse:
    return Ellipse(*(np.stack([getattr(e, field.name) for e in ellipses]) for field in fields(Ellipse)))


def _meet(every: Ellipse, reach_px: FloatArray, contrast: FloatArray) -> BoolArray:
    """Tell (n, n) whether rim j comes into the band of rim i, about."""
    a, b = every.semi_major, every.semi_minor
    gap = np.linalg.norm(every.center[:, None] - every.center[None], axis=-1)
    reach = reach_px[:, None]
    touching = gap < a[:, None] + a[None] + reach
    # Neither far inside the other.
    touching &= (gap + a[:, None] + reach > b[None]) & (gap + a[None] + reach > b[:, None])
    same = (gap < _SAME_PX) & (np.abs(a[:, None] - a[None]) < _SAME_PX) & (np.abs(b[:, None] - b[None]) < _SAME_PX)
    return np.asarray(touching & ~same & (contrast != 0.0)[None])
