"""Which candidate of one circle is right, told by a second circle of the same target.

A candidate pose of the first circle says where the second must be seen: at the same centre (coplanar rings),
or along the normal at the height of the part (coaxial). How far the second circle's measured edge is from
there, in px, is the cue.
"""

from __future__ import annotations

import math

import numpy as np

from circlepose._typing import FloatArray
from circlepose.fitting.observations import rim_distance_px
from circlepose.geometry.cone import factor_from_circle

INDEPENDENT_EDGES = 6.0
"""A rim's edge errors are correlated along it: a misfit is worth no more than so many independent edges."""
LEAST_NOISE_PX = 0.02
_FLAT = 1e-9
"""Relative determinant of a viewing cone's factor below which the circle is seen edge-on."""


def misfits_px(
    centers: FloatArray, normal: FloatArray, radius: float, rays: FloatArray, jacobians: FloatArray
) -> FloatArray:
    """Return the rms distances (h,), px, of measured edges to the rim of a circle placed at each of `centers` (h, 3).

    With unit `normal` (3,), `rays` (n, 3) of the edges and `jacobians` (n, 3, 2) = d ray / d pixel; the distance is
    that of `fitting.observations.rim_distance_px`. Infinite where the circle cannot be seen at all.
    """
    factors = factor_from_circle(centers, normal, radius)
    flat = np.abs(np.linalg.det(factors)) < _FLAT * radius**2 * np.linalg.norm(centers, axis=-1)
    proper = np.where(flat[:, None, None], np.eye(3), factors)
    with np.errstate(divide="ignore", invalid="ignore"):
        squared = np.mean(rim_distance_px(proper, rays, jacobians) ** 2, axis=-1)
    return np.where(flat | ~np.isfinite(squared), np.inf, np.sqrt(squared))


def ambiguity(misfit_chosen_px: float, misfit_other_px: float, noise_px: float) -> float:
    """Return the probability that the candidate with the smaller misfit is the wrong one.

    Two hypotheses, equally likely before, with Gaussian edge errors of `noise_px`:
    log odds = (other^2 - chosen^2) n / (2 noise^2), n independent edges.
    """
    noise = max(noise_px, LEAST_NOISE_PX)
    log_odds = INDEPENDENT_EDGES * (misfit_other_px**2 - misfit_chosen_px**2) / (2.0 * noise**2)
    return 1.0 / (1.0 + math.exp(min(log_odds, 700.0))) if log_odds > 0.0 else 0.5
