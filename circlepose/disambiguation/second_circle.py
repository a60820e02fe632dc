"""Which candidate of one circle is right, told by a second circle of the same target.

A candidate pose of the first circle says where the second must be seen: at the same centre (coplanar rings),
or along the normal at the height of the part (coaxial). How far the second circle's measured edge is from
there, in px, is the cue.
"""

from __future__ import annotations

import math

import numpy as np

from circlepose._typing import FloatArray
from circlepose.cone import factor_from_circle
from circlepose.fitting.viewing_cone import rim_distance_px

INDEPENDENT_EDGES = 6.0
"""A rim's edge errors are correlated along it: a misfit is worth no more than so many independent edges."""
LEAST_NOISE_PX = 0.02


def misfit_px(
    center: FloatArray, normal: FloatArray, radius: float, rays: FloatArray, jacobians: FloatArray
) -> float:
    """Return the rms distance, px, of measured edges to the rim of a circle placed at `center`, `normal`.

    `rays` (n, 3) of the edges and `jacobians` (n, 3, 2) = d ray / d pixel. Infinite where the circle cannot
    be seen at all.
    """
    factor = factor_from_circle(center, normal, radius)
    if abs(float(np.linalg.det(factor))) < 1e-9 * radius**2 * float(np.linalg.norm(center)):
        return math.inf
    distance = rim_distance_px(factor, rays, jacobians)
    return float(np.sqrt(np.mean(distance**2))) if np.all(np.isfinite(distance)) else math.inf


def ambiguity(misfit_chosen_px: float, misfit_other_px: float, noise_px: float) -> float:
    """Return the probability that the candidate with the smaller misfit is the wrong one.

    Two hypotheses, equally likely before, with Gaussian edge errors of `noise_px`:
    log odds = (other^2 - chosen^2) n / (2 noise^2), n independent edges.
    """
    noise = max(noise_px, LEAST_NOISE_PX)
    log_odds = INDEPENDENT_EDGES * (misfit_other_px**2 - misfit_chosen_px**2) / (2.0 * noise**2)
    return 1.0 / (1.0 + math.exp(min(log_odds, 700.0))) if log_odds > 0.0 else 0.5


def generatrix_mm(big: tuple[FloatArray, FloatArray, float], small: tuple[FloatArray, FloatArray, float]) -> float:
    """Return the rim to rim distance of two circles (centre, normal, radius) in their plane of symmetry.

    Fu & Zhou, section 3.3: height along the mean normal and difference of the radii make a right triangle.
    """
    (c1, n1, r1), (c2, n2, r2) = big, small
    axis = n1 + n2
    axis = axis / np.linalg.norm(axis)
    height = float(np.dot(c1 - c2, axis))
    return math.hypot(height, r1 - r2)
