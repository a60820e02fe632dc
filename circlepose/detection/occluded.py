"""Rims of which a part is hidden: the samples along a candidate whose edges lie on one ellipse.

What hides a rim has edges of its own along it, which pull an ellipse that is fitted to all edges. So the ellipse is
fitted to the samples that agree with each other. They must form long runs along the rim: chance agreement is short.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from circlepose._typing import BoolArray, FloatArray
from circlepose.detection.options import DEFAULT, DetectionOptions
from circlepose.fitting.arc_precision import axis_errors, curvature_radius
from circlepose.fitting.direct import fit_each
from circlepose.fitting.ransac import on_one_ellipse_each
from circlepose.geometry.ellipse import Ellipse, rim_distance
from circlepose.imaging.pyramid import Reduced
from circlepose.imaging.subpixel_edges import RimEdges, edge_noise_px, edges_along, noise_share


@dataclass(frozen=True, slots=True, eq=False)
class PartialRim:
    """An ellipse that long runs of edges lie on."""

    ellipse: Ellipse
    edges: RimEdges
    """along it, a batch of one"""
    on_rim: BoolArray
    """(k,) the samples whose edge lies on it"""


def partial_rim(image: Reduced, start: Ellipse, options: DetectionOptions = DEFAULT) -> PartialRim | None:
    """Fit the ellipse near `start` that most of the edges along it agree on; None when they do not agree."""
    return partial_rims(image, start[None], options)[0]


def partial_rims(
    image: Reduced, start: Ellipse, options: DetectionOptions = DEFAULT, *, of_either_sign: bool = False
) -> list[PartialRim | None]:
    """Fit, near each of the ellipses `start` (batch), the ellipse that most of the edges along it agree on.

    Lengths are px of `image`; for `of_either_sign` see `locate_edges`. Where a thin ellipse starts from one of its
    sides, or a part of one, its edge leads on to the rest in further rounds.
    """
    last_round = len(options.partial_draws) - 1
    rims: list[PartialRim | None] = [None] * len(start)
    which, ellipse = np.arange(len(start)), start
    for turn, draws in enumerate(options.partial_draws):
        if len(which) == 0:
            break
        edges = edges_along(
            image.levels,
            ellipse,
            options.last_half_width_px,
            options.samples,
            quick=True,
            of_either_sign=of_either_sign,
        )
        usable = edges.valid & (curvature_radius(ellipse, options.samples) >= options.sharpest_px)
        noise_px = edge_noise_px(noise_share(image.seen_noise, edges.step, edges.valid), edges.blur_px)
        near_px = options.partial_near_px + options.partial_near_share * ellipse.semi_major
        near_px = np.maximum(near_px, options.rim_tolerance_sigmas * noise_px)
        alive = np.count_nonzero(usable, axis=1) >= options.least_run_samples
        chosen = on_one_ellipse_each(edges.points, usable, near_px, draws)
        fitted = ellipse
        for _ in range(options.partial_refits):
            fitted, found = fit_each(edges.points, np.maximum(chosen, 1e-9))
            alive &= found
            chosen = usable & (np.abs(rim_distance(fitted, edges.points)) <= near_px[:, None])
        alive &= np.count_nonzero(chosen, axis=1) >= options.least_run_samples
        settled = alive & ((_moved(ellipse, fitted) < options.partial_settled_px) | (turn == last_round))
        for i in np.flatnonzero(settled).tolist():
            rims[which[i]] = _determined(fitted[i], edges[[i]], in_runs(chosen[i], options), options)
        which, ellipse = which[alive & ~settled], fitted[alive & ~settled]
    return rims


def _determined(ellipse: Ellipse, edges: RimEdges, on_rim: BoolArray, options: DetectionOptions) -> PartialRim | None:
    """Return the rim if the samples on it determine its axes."""
    used = edges.points[0][on_rim]
    if len(used) < options.least_run_samples:
        return None
    error_px = float(axis_errors(ellipse, used, options.partial_edge_error_px)[0])
    if error_px > options.worst_partial_major * ellipse.semi_major:
        return None
    return PartialRim(ellipse, edges, on_rim)


def _moved(first: Ellipse, second: Ellipse) -> FloatArray:
    """Return (m,) about how far (px) the ends of the axes moved."""
    center = np.linalg.norm(second.center - first.center, axis=-1)
    axes = np.abs(second.semi_major - first.semi_major) + np.abs(second.semi_minor - first.semi_minor)
    return np.asarray(center + axes)


def in_runs(which: BoolArray, options: DetectionOptions = DEFAULT) -> BoolArray:
    """Keep, of the samples `which` (k,) along a closed contour, the runs too long to be chance."""
    if which.all():
        return which
    first = int(np.flatnonzero(~which)[0])
    rolled = np.roll(which, -first)
    bounds = np.flatnonzero(np.diff(np.concatenate([[False], rolled, [False]]).astype(np.int8)))
    for begin, end in bounds.reshape(-1, 2):
        if end - begin < options.shortest_run:
            rolled[begin:end] = False
    return np.asarray(np.roll(rolled, first))
