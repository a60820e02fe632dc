"""How far a second circle's edges are from where a pose of the first predicts them, and which pose that favors.

A candidate pose of the first circle predicts the image of the second: at the same center (coplanar rings), or along
the normal at the height of the part (coaxial). The rms distance of the measured edges from it, in px, is the cue.
"""

from __future__ import annotations

import numpy as np

from circlepose._numerics import logistic
from circlepose._typing import FloatArray
from circlepose.fitting.observations import rim_distances_px
from circlepose.geometry.cone import factor_from_circle
from circlepose.rings.options import DEFAULT, RingOptions

_FLAT = 1e-9
"""Relative determinant of a viewing cone's factor, below which the circle is seen edge-on; numerical."""


def misfits_px(
    centers: FloatArray, normal: FloatArray, radius: float, rays: FloatArray, jacobians: FloatArray
) -> FloatArray:
    """Return the rms distances of measured edges from the rim of a circle placed at each of several centers.

    Parameters
    ----------
    centers
        (h, 3) in the unit of `radius`, camera frame.
    normal
        (3,) unit vector.
    radius
        Of the circle.
    rays
        (n, 3) of the edges.
    jacobians
        (n, 3, 2) = d ray / d pixel.

    Returns
    -------
    (h,) px, root mean square of `fitting.cone_fit.rim_distance_px`. Infinite where the circle cannot be seen at all.
    """
    factors = factor_from_circle(centers, normal, radius)
    flat = np.abs(np.linalg.det(factors)) < _FLAT * radius**2 * np.linalg.norm(centers, axis=-1)
    number, edges = len(centers), len(rays)
    owner = np.repeat(np.arange(number), edges)
    with np.errstate(divide="ignore", invalid="ignore"):
        distances = rim_distances_px(
            np.where(flat[:, None, None], np.eye(3), factors),
            owner,
            np.tile(rays, (number, 1)),
            np.tile(jacobians, (number, 1, 1)),
        )
        squared = np.mean(distances.reshape(number, edges) ** 2, axis=-1)
    return np.where(flat | ~np.isfinite(squared), np.inf, np.sqrt(squared))


def ambiguity(
    misfit_chosen_px: float, misfit_other_px: float, noise_px: float, *, options: RingOptions = DEFAULT
) -> float:
    """Return the probability that the candidate with the smaller misfit is the wrong one.

    Two hypotheses, equally likely before, with n independent Gaussian edge errors:
    log odds = n (other^2 - chosen^2) / (2 noise^2).

    Parameters
    ----------
    misfit_chosen_px, misfit_other_px
        rms distances of the edges from both predictions, px.
    noise_px
        Standard deviation of an edge, px.
    options
        The numbers of ring targets.
    """
    noise = max(noise_px, options.misfit_noise_px)
    log_odds = options.misfit_edges * (misfit_other_px**2 - misfit_chosen_px**2) / (2.0 * noise**2)
    return float(logistic(-log_odds)) if log_odds > 0.0 else 0.5
