"""Rims of which a good part is hidden: the places along a candidate that lie on one ellipse, without the rest.

What hides a rim has edges of its own along it, which pull an ellipse fitted to all. So the fit is made to the
places that agree with each other, and these must be long runs of the rim: chance agrees here and there only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from circlepose._typing import BoolArray, FloatArray, Image
from circlepose.fitting.arc_precision import axis_errors, curvature_radius
from circlepose.fitting.direct import fit_each
from circlepose.fitting.ransac import on_one_ellipse_each
from circlepose.geometry.ellipse import Ellipse, rim_distance
from circlepose.imaging.subpixel_edges import RimEdges, edges_along

_ROUNDS = 5
_DRAWS = (120, 60, 40, 40, 40)
"""Of each round: the first may start far off."""
_SETTLED_PX = 0.7
_REACH_PX = 2.5
_NEAR_PX = 0.2
_NEAR_SHARE = 0.003
"""An edge is on the ellipse when it is within this (px, plus share of the semi-major axis): noise and lens."""
_SHORTEST_RUN = 5
"""Fewer neighbouring places may agree by chance."""
_LEAST_PLACES = 20
_POLISHES = 2
_SHARPEST_PX = 4.0
"""Radius of curvature below which a profile across the rim meets its other side."""
_ERROR_PX = 0.1
_WORST_MAJOR = 0.04
"""Standard deviation of the semi-major axis, as a share of it, beyond which the arcs leave it open."""


@dataclass(frozen=True, slots=True, eq=False)
class PartialRim:
    """An ellipse that long runs of edges lie on."""

    ellipse: Ellipse
    edges: RimEdges
    """along it, a batch of one"""
    on_rim: BoolArray
    """(k,) the places that lie on it"""


def partial_rim(levels: Image, start: Ellipse, places: int) -> PartialRim | None:
    """Fit the ellipse near `start` that most of the edges at `places` along it agree on; None when they do not."""
    return partial_rims(levels, start[None], places)[0]


def partial_rims(levels: Image, start: Ellipse, places: int) -> list[PartialRim | None]:
    """Fit, near each of the ellipses `start` (batch), that on which most of the edges at `places` along it agree.

    Of a thin ellipse the start may be one of its sides, or a part; the ends of its edge tell how it goes on.
    """
    rims: list[PartialRim | None] = [None] * len(start)
    which, ellipse = np.arange(len(start)), start
    for turn in range(_ROUNDS):
        if len(which) == 0:
            break
        edges = edges_along(levels, ellipse, _REACH_PX, places, quick=True)
        usable = edges.valid & (curvature_radius(ellipse, places) >= _SHARPEST_PX)
        near_px = _NEAR_PX + _NEAR_SHARE * ellipse.semi_major
        alive = np.count_nonzero(usable, axis=1) >= _LEAST_PLACES
        chosen = on_one_ellipse_each(edges.points, usable, near_px, _DRAWS[turn])
        fitted = ellipse
        for _ in range(_POLISHES):
            fitted, found = fit_each(edges.points, np.maximum(chosen, 1e-9))
            alive &= found
            chosen = usable & (np.abs(rim_distance(fitted, edges.points)) <= near_px[:, None])
        alive &= np.count_nonzero(chosen, axis=1) >= _LEAST_PLACES
        settled = alive & ((_moved(ellipse, fitted) < _SETTLED_PX) | (turn == _ROUNDS - 1))
        for i in np.flatnonzero(settled).tolist():
            rims[which[i]] = _held(fitted[i], edges[[i]], in_runs(chosen[i]))
        which, ellipse = which[alive & ~settled], fitted[alive & ~settled]
    return rims


def _held(ellipse: Ellipse, edges: RimEdges, on_rim: BoolArray) -> PartialRim | None:
    """Return the rim when the places on it settle its axes."""
    used = edges.points[0][on_rim]
    if len(used) < _LEAST_PLACES or axis_errors(ellipse, used, _ERROR_PX)[0] > _WORST_MAJOR * ellipse.semi_major:
        return None
    return PartialRim(ellipse, edges, on_rim)


def _moved(first: Ellipse, second: Ellipse) -> FloatArray:
    """Return (m,) by how much (px) the ends of the axes differ, about."""
    center = np.linalg.norm(second.center - first.center, axis=-1)
    axes = np.abs(second.semi_major - first.semi_major) + np.abs(second.semi_minor - first.semi_minor)
    return np.asarray(center + axes)


def in_runs(which: BoolArray) -> BoolArray:
    """Keep, of places along a closed contour (k,), the runs that are long enough not to be chance."""
    if which.all():
        return which
    first = int(np.flatnonzero(~which)[0])
    rolled = np.roll(which, -first)
    bounds = np.flatnonzero(np.diff(np.concatenate([[False], rolled, [False]]).astype(np.int8)))
    for begin, end in bounds.reshape(-1, 2):
        if end - begin < _SHORTEST_RUN:
            rolled[begin:end] = False
    return np.asarray(np.roll(rolled, first))
