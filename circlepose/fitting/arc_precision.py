"""How well points along part of an ellipse determine its axes: an arc leaves open how far the hidden rest reaches."""

from __future__ import annotations

import numpy as np

from circlepose._typing import FloatArray
from circlepose.geometry.ellipse import Ellipse


def axis_errors(ellipse: Ellipse, points: FloatArray, error: float) -> FloatArray:
    """Return the standard deviations (2,) of the semi-axes, major first, of an ellipse fitted to `points` (n, 2).

    Each point has an `error` across the rim of its own, in the plane's unit. Infinite where the points leave an
    axis open.
    """
    cos, sin = np.cos(ellipse.angle), np.sin(ellipse.angle)
    offset = points - ellipse.center
    x, y = offset @ np.array([cos, sin]), offset @ np.array([-sin, cos])
    eccentric = np.arctan2(y / ellipse.semi_minor, x / ellipse.semi_major)
    along, across = np.cos(eccentric), np.sin(eccentric)
    normal = np.stack([along * ellipse.semi_minor, across * ellipse.semi_major], axis=-1)
    normal = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    # How far the rim moves across itself with the centre, the semi-axes and the angle.
    turning = (
        -normal[:, 0] * ellipse.semi_minor * across + normal[:, 1] * ellipse.semi_major * along
    ) / ellipse.semi_major
    slopes = np.column_stack([normal, normal[:, 0] * along, normal[:, 1] * across, turning])
    values, vectors = np.linalg.eigh(slopes.T @ slopes)
    if values[0] < 1e-9 * values[-1]:
        return np.full(2, np.inf)
    covariance = (vectors / values) @ vectors.T
    return np.asarray(error * np.sqrt(np.diag(covariance)[2:4]))


def curvature_radius(ellipse: Ellipse, places: int) -> FloatArray:
    """Return the radius of curvature (..., places) at points evenly spaced in the eccentric angle."""
    eccentric = np.linspace(0.0, 2.0 * np.pi, places, endpoint=False)
    major, minor = np.asarray(ellipse.semi_major)[..., None], np.asarray(ellipse.semi_minor)[..., None]
    speed = np.hypot(major * np.sin(eccentric), minor * np.cos(eccentric))
    return np.asarray(speed**3 / np.maximum(major * minor, 1e-12))
