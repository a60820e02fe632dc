"""Which contours are round by chance: most shapes of their size around them are not.

Of small shapes some look round whatever they are: a letter's bowl, the cell of a marker, the corner of a leaf. If a
share q of all shapes of b px (semi-minor axis) does, n such shapes around a place hold about q n that look round, and
k round ones prove nothing where k < q n. What a few px show is the same for any shape, and larger ones differ by more
px: q falls with the area. Shapes much fainter than the contour are not of its kind.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from circlepose._typing import BoolArray, FloatArray, Image, IntArray
from circlepose.detection.edges.chains import Chains
from circlepose.detection.options import DEFAULT, DetectionOptions
from circlepose.geometry.ellipse import Ellipse

_APART = 3
"""Of the points of the edges, every such one is looked at."""
_POINTS = 8
"""Points of a contour at which the height of its edge is measured."""
_SQUARE = np.ones((5, 5), np.uint8)
"""Pixels around a point that show the height of an edge through it."""


@dataclass(frozen=True, slots=True, eq=False)
class Surroundings:
    """Points of all edges of an image, from left to right."""

    points: NDArray[np.signedinteger[Any]]
    """(n, 2) px"""
    x: NDArray[np.signedinteger[Any]]
    """(n,) px, of the points"""
    extent: IntArray
    """(n,) longer side of the edge that each is of, px"""
    image: Image
    """(h, w) levels in which they were found"""

    @classmethod
    def of(cls, chains: Chains, image: Image) -> Surroundings:
        """Return the edges of a full-size `image`."""
        points = chains.points[::_APART]
        order = np.argsort(points[:, 0], kind="stable")
        points = points[order]
        return cls(points, np.ascontiguousarray(points[:, 0]), chains.extents()[chains.owner[::_APART][order]], image)

    def within(self, center: FloatArray, distance_px: float) -> tuple[IntArray, FloatArray]:
        """Return the indices (j,) of the points up to `distance_px` from `center` (2,), and the distances squared."""
        first = int(np.searchsorted(self.x, math.ceil(center[0] - distance_px)))
        last = int(np.searchsorted(self.x, math.floor(center[0] + distance_px), side="right"))
        apart = self.points[first:last] - center
        square = np.einsum("ij,ij->i", apart, apart)
        close = np.flatnonzero(square <= distance_px**2)
        return first + close, square[close]


def chance_scores(
    ellipse: Ellipse,
    own_scores: FloatArray,
    edges: Surroundings,
    is_evident: BoolArray | None = None,
    options: DetectionOptions = DEFAULT,
) -> FloatArray:
    """Return (m,) the largest score that each contour can have beside the `edges` around it that no contour is.

    It is `chance_score` for one that is round by chance as likely as not, and falls with what is around. The length
    of the edges counts, in perimeters of the contour, as those of many shapes may be joined. What has less, or less
    by its `own_scores` (m,), is one of these shapes for the others. What `is_evident` (m,) is not round by chance.
    """
    number = len(ellipse)
    most = np.ones(number)
    may = np.ones(number, np.bool_) if is_evident is None else ~is_evident
    # The border of an edge runs along both of its sides.
    perimeters = ellipse.perimeter * 2.0 / _APART
    if not (len(edges.points) > options.chance_score * options.least_around * perimeters[may]).any():
        return most
    size = ellipse.size
    heights = cv2.subtract(cv2.dilate(edges.image, _SQUARE), cv2.erode(edges.image, _SQUARE))
    height = np.median(_at(heights, ellipse.points(_POINTS)), axis=1)
    of_edges = _at(heights, edges.points)
    left = own_scores >= options.chance_score
    owners = np.zeros(len(edges.points), np.int64)
    own: dict[int, IntArray] = {}
    close: list[IntArray] = []
    near: list[BoolArray] = []
    for k in np.flatnonzero(left | may).tolist():
        own_reach = options.own_semi_majors * ellipse.semi_major[k]
        reach = options.around_semi_majors * ellipse.semi_major[k] if may[k] else own_reach
        each, square = edges.within(ellipse.center[k], max(reach, own_reach))
        is_own = square <= own_reach**2
        if left[k]:
            own[k] = each[is_own]
            owners[own[k]] += 1
        if may[k]:
            each = each[~is_own]
            is_large = edges.extent[each] >= options.least_alike * 2.0 * ellipse.semi_major[k]
            close.append(each[is_large & (of_edges[each] >= options.alike_height * height[k])])
            is_near = np.linalg.norm(ellipse.center - ellipse.center[k], axis=1) < reach
            is_near &= (size > options.least_alike * size[k]) & (size < size[k] / options.least_alike)
            near.append(is_near)
    odds = options.chance_odds * np.maximum(1.0, (ellipse.semi_minor[may] / options.chance_px) ** 2)
    while True:
        around = np.array([np.count_nonzero(owners[each] == 0) for each in close]) / perimeters[may]
        # Each contour is its own kin.
        kin = np.maximum(np.count_nonzero(np.array(near) & left, axis=1), 1)
        # As likely as not where it is 1.
        ratio = around / np.maximum(options.least_around, odds * kin)
        most[may] = np.minimum(1.0, options.chance_score / np.maximum(ratio, 1e-9))
        more = left & (most < options.chance_score)
        if not more.any():
            return most
        left &= ~more
        for k in np.flatnonzero(more).tolist():
            owners[own[k]] -= 1


def _at(image: Image, points: NDArray[Any]) -> Image:
    """Return the levels (...) of the pixels at `points` (..., 2), px, or of those nearest in the image."""
    height, width = image.shape
    x, y = np.rint(points[..., 0]).astype(np.int64), np.rint(points[..., 1]).astype(np.int64)
    return np.asarray(image[y.clip(0, height - 1), x.clip(0, width - 1)])
