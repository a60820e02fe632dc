"""The covariance of a cone that was fitted to the edges of a rough rim, from the residuals along it.

The edges of a coin or a worn hole depart from an ellipse by their own shape, which neighbors share. With the slopes
J (n, 5) of the distances by the modes and the residuals r, the covariance is s^2 c (J'J)^-1, where s^2 is
r'r / (n - 5). The sums of J r over segments of the rim scatter c times as much as those of independent residuals.
"""

from __future__ import annotations

import numpy as np

from circlepose._typing import FloatArray
from circlepose.fitting.observations import rim_distance_px
from circlepose.geometry.cone_perturbation import MODES, grown

_STEP = 1e-4
"""Of each mode, for its slopes; numerical."""
_SEGMENTS = (24, 12, 6)
"""Segments of the rim, from fine to coarse: the correlation is the largest that one of these shows; empirical."""
_FITTED = 12.0
"""The fit leaves n / (n + this) of the scatter of n segments; measured on rendered discs, as for the levels."""


def edge_covariance(factor: FloatArray, rays: FloatArray, jacobians: FloatArray) -> FloatArray | None:
    """Return the covariance (5, 5) of the coefficients of a cone's modes; None where the edges do not determine them.

    Parameters
    ----------
    factor
        (3, 3) of the cone with the least squared distances, camera frame.
    rays, jacobians
        (n, 3) and (n, 3, 2) of the edges, in order along the rim; see `Observations`.
    """
    number = len(rays)
    if number < 2 * _SEGMENTS[0]:
        return None
    moved = np.stack(
        [
            rim_distance_px(grown(factor, sign * _STEP * mode), rays, jacobians)
            for mode in np.eye(MODES)
            for sign in (1.0, -1.0)
        ]
    )
    slopes = (moved[::2] - moved[1::2]) / (2.0 * _STEP)
    information = slopes @ slopes.T
    values = np.linalg.eigvalsh(information)
    if not values[0] > 1e-9 * values[-1]:
        return None
    residuals = rim_distance_px(factor, rays, jacobians)
    variance = float(residuals @ residuals) / (number - MODES)
    inverse = np.linalg.inv(information)
    correlation = 1.0
    for segments in _SEGMENTS:
        starts = np.arange(segments) * number // segments
        scores = np.add.reduceat(slopes * residuals, starts, axis=1)
        scatter = float(np.einsum("is,ij,js->", scores, inverse, scores)) / (MODES * variance)
        correlation = max(correlation, scatter * (1.0 + _FITTED / segments))
    return np.asarray(variance * correlation * inverse)
