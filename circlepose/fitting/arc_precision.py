"""How well points along part of an ellipse determine its axes, and how sharply its rim bends."""

from __future__ import annotations

import numpy as np

from circlepose._typing import FloatArray
from circlepose.geometry.ellipse import Ellipse


def axis_errors(ellipse: Ellipse, points: FloatArray, error: float) -> FloatArray:
    """Return the standard deviations of the semi-axes of an ellipse fitted to points.

    Parameters
    ----------
    ellipse
        A single one.
    points
        (n, 2) near its rim, in the same plane unit.
    error
        Standard deviation of each point across the rim, independent of the others, in that unit.

    Returns
    -------
    (2,) in that unit, semi-major first: linear propagation through the least-squares fit of center, axes and angle.
    Infinite where the points do not determine an axis.
    """
    cos, sin = np.cos(ellipse.angle), np.sin(ellipse.angle)
    offset = points - ellipse.center
    x, y = offset @ np.array([cos, sin]), offset @ np.array([-sin, cos])
    eccentric = np.arctan2(y / ellipse.semi_minor, x / ellipse.semi_major)
    along, across = np.cos(eccentric), np.sin(eccentric)
    normal = np.stack([along * ellipse.semi_minor, across * ellipse.semi_major], axis=-1)
    normal = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    # The normal motion of the rim with the center, the semi-axes and the angle.
    turning = (
        -normal[:, 0] * ellipse.semi_minor * across + normal[:, 1] * ellipse.semi_major * along
    ) / ellipse.semi_major
    slopes = np.column_stack([normal, normal[:, 0] * along, normal[:, 1] * across, turning])
    values, vectors = np.linalg.eigh(slopes.T @ slopes)
    if values[0] < 1e-9 * values[-1]:
        return np.full(2, np.inf)
    covariance = (vectors / values) @ vectors.T
    return np.asarray(error * np.sqrt(np.diag(covariance)[2:4]))


def curvature_radius(ellipse: Ellipse, samples: int) -> FloatArray:
    """Return the radius of curvature along the rim.

    Parameters
    ----------
    ellipse
        (...) in any plane unit.
    samples
        Points along the rim, evenly spaced in the eccentric angle p.

    Returns
    -------
    (..., samples) in that unit: |(a sin p, b cos p)|^3 / (a b).
    """
    eccentric = np.linspace(0.0, 2.0 * np.pi, samples, endpoint=False)
    major, minor = np.asarray(ellipse.semi_major)[..., None], np.asarray(ellipse.semi_minor)[..., None]
    speed = np.hypot(major * np.sin(eccentric), minor * np.cos(eccentric))
    return np.asarray(speed**3 / np.maximum(major * minor, 1e-12))
