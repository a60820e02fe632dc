"""Which of many ellipses are the same edge twice, or lie within another of the same centre."""

from __future__ import annotations

import numpy as np

from circlepose._typing import BoolArray, FloatArray, IntArray
from circlepose.geometry.ellipse import Ellipse

_SAME_PX = 1.5
_SAME_SHARE = 0.03
_CENTER_SHARE = 0.1
_SHAPE_SHARE = 0.15
_LEAST_RATIO = 0.1


def same(first: Ellipse, others: Ellipse) -> BoolArray:
    """Tell which of `others` are the same edge as `first` (either a batch, or one): all within 1.5 px or 3 %."""
    near = np.maximum(_SAME_PX, _SAME_SHARE * first.semi_major)
    return np.asarray(
        (np.linalg.norm(others.center - first.center, axis=-1) < near)
        & (np.abs(others.semi_major - first.semi_major) < near)
        & (np.abs(others.semi_minor - first.semi_minor) < near)
    )


def repeats(ellipse: Ellipse, ranked: IntArray) -> IntArray:
    """Return those of the candidates `ranked` that are the same edge as one ranked higher."""
    if len(ranked) < 2:
        return ranked[:0]
    chosen = ellipse[ranked]
    near = np.maximum(_SAME_PX, _SAME_SHARE * chosen.semi_major)
    higher, lower = _neighbours(chosen.center, float(near.max(initial=0.0)))
    return np.unique(ranked[lower[same(chosen[higher], chosen[lower])]])


def inside_others(ellipse: Ellipse, which: IntArray) -> IntArray:
    """Return those of `which` that lie within another of them, of the same centre and nearly the same shape."""
    if len(which) < 2:
        return which[:0]
    chosen = ellipse[which]
    first, second = _neighbours(chosen.center, _CENTER_SHARE * float(chosen.semi_minor.max(initial=0.0)) + 1.0)
    swap = chosen.semi_major[first] > chosen.semi_major[second]
    inner, outer = np.where(swap, second, first), np.where(swap, first, second)
    ratio = chosen.semi_major[inner] / chosen.semi_major[outer]
    apart = np.linalg.norm(chosen.center[outer] - chosen.center[inner], axis=1)
    alike = (
        np.abs(chosen.semi_minor[inner] - ratio * chosen.semi_minor[outer]) < _SHAPE_SHARE * chosen.semi_major[inner]
    )
    inside = (apart < _CENTER_SHARE * chosen.semi_minor[outer] + 1.0) & alike & (ratio > _LEAST_RATIO) & (ratio < 1.0)
    return np.unique(which[inner[inside]])


def _neighbours(centers: FloatArray, reach: float) -> tuple[IntArray, IntArray]:
    """Return the pairs (i, j), i < j, of points (m, 2) whose x differ by no more than `reach`, and y neither."""
    order = np.argsort(centers[:, 0], kind="stable")
    x = centers[order, 0]
    last = np.searchsorted(x, x + reach, side="right")
    number = last - np.arange(len(x)) - 1
    left = np.repeat(np.arange(len(x)), number)
    right = left + 1 + np.arange(len(left)) - np.repeat(np.cumsum(number) - number, number)
    close = np.abs(centers[order[left], 1] - centers[order[right], 1]) <= reach
    first, second = order[left[close]], order[right[close]]
    return np.minimum(first, second), np.maximum(first, second)
