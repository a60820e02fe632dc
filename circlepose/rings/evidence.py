"""What a measured rim says of the cone of its circle: the modes of the cone, with their information. Pure NumPy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from circlepose._typing import FloatArray
from circlepose.fitting.observations import Observations, rim_growth
from circlepose.geometry.cone_perturbation import MODES, mode_shapes
from circlepose.geometry.ellipse import signed_distance
from circlepose.measurement.rim import Rim, modes_covariance
from circlepose.rings.hypotheses import SolvedRim
from circlepose.rings.options import DEFAULT, RingOptions
from circlepose.targets.target import Target

_SAMPLES = 90
"""Points of one rim whose distance from another is measured."""


@dataclass(frozen=True, slots=True, eq=False)
class RimEvidence:
    """What is known of a circle's cone from its rim."""

    factor: FloatArray
    """(3, 3) of the measured cone"""
    radius: float
    coefficients: FloatArray
    """(5,) of the modes about that factor (`geometry.cone_perturbation`), most likely"""
    information: FloatArray
    """(5, 5) inverse of their covariance; singular where a part of the rim does not determine some of them"""


def evidence_of_rims(rims: tuple[SolvedRim, ...], target: Target, options: RingOptions) -> tuple[RimEvidence, ...]:
    """Return what is known of each circle's cone: from its gray levels, unless its edges contradict them.

    Parameters
    ----------
    rims
        (k) the rims of one target, the largest circle's first.
    target
        The ring target.
    options
        The numbers of ring targets.
    """
    # One circle hides a part of the other, or nearly does, so that the surroundings change along the rim.
    beside = target.kind == "coaxial" and _gap_px(rims[0].rim, rims[1].rim) < options.beside_px
    return tuple(
        evidence_of_rim(each.rim, radius, each.seen, options, beside=beside)
        for each, radius in zip(rims, target.radii_mm, strict=True)
    )


def from_levels(factor: FloatArray, radius: float, modes_covariance: FloatArray) -> RimEvidence:
    """Return the evidence of a rim fitted to gray levels.

    Parameters
    ----------
    factor
        (3, 3) of the fitted cone.
    radius
        Of the circle.
    modes_covariance
        (5, 5) of the modes about that factor.
    """
    return RimEvidence(factor, radius, np.zeros(MODES), np.asarray(np.linalg.inv(modes_covariance)))


def from_edges(
    factor: FloatArray,
    radius: float,
    rays: FloatArray,
    jacobians: FloatArray,
    scatter_px: float,
    common_px: float,
    *,
    options: RingOptions = DEFAULT,
) -> RimEvidence:
    """Return the evidence of edges near the rim of a cone, also along a part of it alone.

    Parameters
    ----------
    factor
        (3, 3) of the cone.
    radius
        Of the circle.
    rays
        (n, 3) of the edges.
    jacobians
        (n, 3, 2) = d ray / d pixel.
    scatter_px
        Standard deviation of each edge, px.
    common_px
        Standard deviation of the error that all edges have in common, px.
    options
        The numbers of ring targets.
    """
    local, growth, per_px = rim_growth(np.asarray(np.linalg.inv(factor)), rays, jacobians)
    slopes = mode_shapes(np.arctan2(local[:, 1], local[:, 0])) / per_px[:, None]
    variance = scatter_px**2 * max(len(rays) / options.independent_edges, 1.0) + common_px**2 * len(rays)
    coefficients = np.asarray(np.linalg.lstsq(slopes, growth / per_px, rcond=1e-6)[0], dtype=np.float64)
    return RimEvidence(factor, radius, coefficients, slopes.T @ slopes / variance)


def evidence_of_rim(
    rim: Rim, radius: float, observations: Observations, options: RingOptions = DEFAULT, *, beside: bool = False
) -> RimEvidence:
    """Return what one rim says of its circle's cone, from its levels unless its edges contradict them.

    Parameters
    ----------
    rim
        The measured rim.
    radius
        Of its circle.
    observations
        The points of the rim, with their rays.
    options
        The numbers of ring targets.
    beside
        Whether it is disturbed by another rim.
    """
    seen = _within_model(observations)
    semi_major, semi_minor = float(rim.ellipse.semi_major), float(rim.ellipse.semi_minor)
    common = min(options.common_error_px3 / semi_minor**2, options.most_common_error_px)
    common = common * (options.beside_edge_ratio if beside else 1.0)
    scatter = max(rim.cone.rms_px, options.least_scatter_px)
    edges = from_edges(rim.cone.factor, radius, seen.rays, seen.jacobians, scatter, common, options=options)
    modes = modes_covariance(rim)
    if modes is None or not np.all(np.linalg.eigvalsh(modes) > 0.0):
        return edges
    offset = edges.coefficients
    if beside:
        is_contradicted = float(np.linalg.norm(offset)) * semi_major > options.beside_contradicted_px
        additional = (options.beside_levels_px / semi_major) ** 2 * np.eye(MODES)
    else:
        is_contradicted = bool(offset @ edges.information @ offset > options.contradicted_chi_square * MODES)
        additional = np.zeros((MODES, MODES))
    return edges if is_contradicted else from_levels(rim.cone.factor, radius, modes + additional)


def _within_model(seen: Observations) -> Observations:
    """Return the points that the lens model reaches."""
    return seen[np.all(np.isfinite(seen.rays), axis=-1)]


def _gap_px(first: Rim, second: Rim) -> float:
    """Return the least distance, px, between two rims in the image."""
    return float(np.min(np.abs(signed_distance(first.ellipse, second.ellipse.points(_SAMPLES)))))
