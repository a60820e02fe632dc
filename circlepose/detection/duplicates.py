"""Which of many ellipses are the same edge twice, or lie within another of the same center.

Rims of one center that lie within each other are nested: a disc with a ring around it, a washer, a countersunk hole.
One of them is the target's rim, and taking another is a mistake of scale. Not every contour inside another can be
mistaken for it: `nested_in` leaves out what is far smaller, and the two sides of one drawn line.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from circlepose._typing import BoolArray, FloatArray, IntArray
from circlepose.detection.options import DEFAULT, DetectionOptions
from circlepose.geometry.ellipse import Ellipse


def same(first: Ellipse, others: Ellipse, options: DetectionOptions = DEFAULT) -> BoolArray:
    """Return which of `others` are the same edge as `first`; either is a batch or a single ellipse."""
    near = np.maximum(options.same_px, options.same_share * first.semi_major)
    return np.asarray(
        (np.linalg.norm(others.center - first.center, axis=-1) < near)
        & (np.abs(others.semi_major - first.semi_major) < near)
        & (np.abs(others.semi_minor - first.semi_minor) < near)
    )


def repeats(ellipse: Ellipse, ranked: IntArray, options: DetectionOptions = DEFAULT) -> IntArray:
    """Return those of the candidates `ranked` that are the same edge as one ranked higher."""
    if len(ranked) < 2:
        return ranked[:0]
    chosen = ellipse[ranked]
    near = np.maximum(options.same_px, options.same_share * chosen.semi_major)
    higher, lower = neighbors(chosen.center, float(near.max(initial=0.0)))
    return np.unique(ranked[lower[same(chosen[higher], chosen[lower], options)]])


def inside_others(ellipse: Ellipse, which: IntArray, options: DetectionOptions = DEFAULT) -> IntArray:
    """Return those of `which` that lie within another of them with the same center and nearly the same shape."""
    return np.unique(_within(ellipse, which, options)[0])


def nested_in(
    ellipse: Ellipse,
    polarity: FloatArray,
    outer: Sequence[int],
    inner: Sequence[int],
    options: DetectionOptions = DEFAULT,
) -> dict[int, list[int]]:
    """Return, of each of the candidates `outer`, those of `inner` that are nested in it, largest first.

    They are listed only where one of them could be taken for the outer one, by its size and `polarity` (m,).
    """
    within, around = _within(ellipse, np.array([*outer, *inner], np.int64), options)
    nested: dict[int, list[int]] = {}
    for i, o in zip(within.tolist(), around.tolist(), strict=True):
        nested.setdefault(o, []).append(i)
    size = ellipse.semi_major
    found = {}
    for o in outer:
        large = [i for i in nested.get(o, []) if size[i] >= options.least_nested_ratio * size[o]]
        if any(are_confusable(size[i], polarity[i], size[o], polarity[o], options) for i in large):
            found[o] = sorted(large, key=lambda i: -float(size[i]))
    return found


def are_confusable(
    first: float, first_polarity: float, second: float, second_polarity: float, options: DetectionOptions = DEFAULT
) -> bool:
    """Return whether one of two concentric rims, by semi-major axes (px), could be taken for the other.

    Not a small thing in the middle of a large one, and not the two sides of one drawn line.
    """
    ratio = min(first, second) / max(first, second)
    return options.least_nested_ratio <= ratio and (
        first_polarity * second_polarity > 0.0 or ratio < options.most_line_ratio
    )


def _within(ellipse: Ellipse, which: IntArray, options: DetectionOptions) -> tuple[IntArray, IntArray]:
    """Return the pairs (inner, outer) of `which` of the same center and nearly the same shape."""
    if len(which) < 2:
        return which[:0], which[:0]
    chosen = ellipse[which]
    farthest = options.concentric_share * float(chosen.semi_minor.max(initial=0.0)) + 1.0
    first, second = neighbors(chosen.center, farthest)
    swap = chosen.semi_major[first] > chosen.semi_major[second]
    inner, outer = np.where(swap, second, first), np.where(swap, first, second)
    ratio = chosen.semi_major[inner] / chosen.semi_major[outer]
    apart = np.linalg.norm(chosen.center[outer] - chosen.center[inner], axis=1)
    alike = (
        np.abs(chosen.semi_minor[inner] - ratio * chosen.semi_minor[outer])
        < options.alike_share * chosen.semi_major[inner]
    )
    inside = (
        (apart < options.concentric_share * chosen.semi_minor[outer] + 1.0)
        & alike
        & (ratio > options.least_inner_ratio)
        & (ratio < 1.0)
    )
    return which[inner[inside]], which[outer[inside]]


def neighbors(centers: FloatArray, distance: float) -> tuple[IntArray, IntArray]:
    """Return the pairs (i, j), i < j, of points (m, 2) whose x and y both differ by `distance` at most."""
    order = np.argsort(centers[:, 0], kind="stable")
    x = centers[order, 0]
    last = np.searchsorted(x, x + distance, side="right")
    number = last - np.arange(len(x)) - 1
    left = np.repeat(np.arange(len(x)), number)
    right = left + 1 + np.arange(len(left)) - np.repeat(np.cumsum(number) - number, number)
    close = np.abs(centers[order[left], 1] - centers[order[right], 1]) <= distance
    first, second = order[left[close]], order[right[close]]
    return np.minimum(first, second), np.maximum(first, second)
