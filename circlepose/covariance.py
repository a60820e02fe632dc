"""How well a rim alone determines its circle's pose: the covariance of a candidate, from that of the rim's modes.

To first order a pose with errors x has a rim with mode amounts J x (`rim_modes.pose_derivatives`), so the amounts'
covariance C gives J^-1 C J^-T. Both candidates of a circle have the same rim but each its own J, and so its own
covariance. Seen along its axis a circle's tilt changes its rim to second order only: J is singular, and no
covariance tells how the tilt is off. Pure NumPy.
"""

from __future__ import annotations

import numpy as np

from circlepose._typing import FloatArray
from circlepose.cone import principal_frame
from circlepose.rim_modes import pose_derivatives
from circlepose.vectors import cross

_FLATTEST = 1e-12
"""Relative determinant of a factor, below which the circle is seen edge-on and its modes have no meaning."""
_LEAST_SIGMAS = 2.0
"""The tilt from the cone's axis, where both candidates meet, in its own standard deviations."""


def pose_covariance(
    factor: FloatArray, modes_covariance: FloatArray, center: FloatArray, normal: FloatArray, radius: float
) -> FloatArray | None:
    """Return the covariance (5, 5) of a circle's pose, measured by its rim alone.

    Parameters
    ----------
    factor
        (3, 3) of the viewing cone that was measured (`cone`).
    modes_covariance
        (5, 5) of the `rim_modes` amounts about that factor.
    center, normal
        (3,) a candidate pose of a circle of `radius`, which has this cone; the centre in the unit of `radius`.

    Returns
    -------
    Of the centre (three, length unit squared) and two tilts (rad^2) of the normal, towards the vectors of
    `cone.plane_basis(normal)`. None where first order does not hold: edge-on within rounding, and where the tilt
    from the cone's axis, at which both candidates are one, is less than twice its own standard deviation.
    """
    distance = float(np.linalg.norm(center))
    columns = factor / np.linalg.norm(factor, axis=0)
    if not np.all(np.isfinite(modes_covariance)) or abs(float(np.linalg.det(columns))) < _FLATTEST:
        return None
    # In shares of the distance all parameters are of one kind, which keeps the inverse precise.
    scale = np.array([distance, distance, distance, 1.0, 1.0])
    slopes = pose_derivatives(factor, center, normal, radius)[:, :5] * scale
    try:
        inverse = np.linalg.inv(slopes) * scale[:, None]
    except np.linalg.LinAlgError:
        return None
    covariance = np.asarray(inverse @ modes_covariance @ inverse.T)
    if not np.all(np.isfinite(covariance)) or not is_first_order(factor, normal, covariance):
        return None
    return (covariance + covariance.T) / 2.0


def is_first_order(factor: FloatArray, normal: FloatArray, covariance: FloatArray) -> bool:
    """Tell whether a `normal` with a pose's `covariance` is surely tilted from its cone's axis, where none holds."""
    axis = principal_frame(factor).rotation[:, 2]
    from_axis = float(np.arctan2(np.linalg.norm(cross(normal, axis)), -float(normal @ axis)))
    return from_axis >= _LEAST_SIGMAS * tilt_sigma(covariance)


def tilt_sigma(covariance: FloatArray) -> float:
    """Return the largest standard deviation, rad, of a normal in any direction, of a pose's covariance (5, 5)."""
    return float(np.sqrt(max(float(np.linalg.eigvalsh(covariance[3:, 3:])[-1]), 0.0)))
