"""The covariance of a candidate pose, from that of the modes of its rim.

To first order a pose with errors x has a rim with mode coefficients J x (`cone_perturbation.pose_derivatives`), so
with the covariance C of the coefficients that of the pose is J^-1 C J^-T. Both candidates of a circle have the same
rim, but each its own J and so its own covariance. Where a circle is seen along its axis, a tilt changes the rim only
to second order: J is singular, and no covariance describes the tilt. Where a circle is seen edge-on, a segment, the
modes have no meaning, but the pose is a smooth function of the axes of its image, which are used instead. Pure NumPy.
"""

from __future__ import annotations

import numpy as np

from circlepose._numerics import angle_between
from circlepose._typing import BoolArray, FloatArray
from circlepose.camera.camera import Camera
from circlepose.fitting.cone_projection import factor_from_ellipse
from circlepose.geometry.cone import plane_basis, principal_frame
from circlepose.geometry.cone_perturbation import pose_derivatives
from circlepose.geometry.ellipse import Ellipse
from circlepose.solvers.chen_huang import poses_from_frame

_FLATTEST = 1e-12
"""Relative determinant of a factor, below which the circle is seen edge-on and its modes have no meaning."""
_STEP_PX = 0.01
_SEGMENT_PX, _SURELY_WIDE_PX = 0.35, 1.0
"""Standard deviation of a segment's semi-minor axis, at least and at most: a wider one is seen to be one."""
_LEAST_SIGMAS = 2.0
"""The tilt from the cone's axis, where both candidates meet, in its own standard deviations."""


def pose_covariance(
    factor: FloatArray, modes_covariance: FloatArray, center: FloatArray, normal: FloatArray, radius: float
) -> FloatArray | None:
    """Return the covariance (5, 5) of the pose of a circle that was measured by its rim alone.

    Parameters
    ----------
    factor
        (3, 3) of the measured viewing cone, camera frame.
    modes_covariance
        (5, 5) of the coefficients of the modes of that factor (`geometry.cone_perturbation`).
    center, normal
        (3,) a candidate pose that has this cone, camera frame; the center in the unit of `radius`.
    radius
        Of the circle.

    Returns
    -------
    Of the center (three, length unit squared) and two tilts (rad^2) of the normal, towards the vectors of
    `cone.plane_basis(normal)`. None where first order does not hold: edge-on within rounding, and where the tilt
    from the cone's axis, at which both candidates coincide, is less than twice its own standard deviation. Source:
    J^-1 C J^-T, see the head of this module.
    """
    axis = principal_frame(factor).rotation[:, 2]
    covariance = pose_covariances(factor, axis, modes_covariance, center, normal, radius)
    return covariance if np.all(np.isfinite(covariance)) else None


def segment_covariance(
    camera: Camera, ellipse: Ellipse, covariance: FloatArray, center: FloatArray, normal: FloatArray, radius: float
) -> FloatArray | None:
    """Return the covariance (5, 5) of the pose of a circle that is taken as seen edge-on.

    Parameters
    ----------
    camera, ellipse, covariance
        The ellipse measured in the raw image, so thin that it may be a segment, and the covariance (5, 5) of its
        center x, y, semi-major, semi-minor (px) and angle (rad).
    center, normal
        (3,) one of the two poses that have this segment, camera frame; the center in the unit of `radius`.
    radius
        Of the circle.

    Returns
    -------
    As `pose_covariance`, by numerical derivatives; None outside the valid field of the lens model, or where first
    order does not hold.
    """
    theta = np.array([*ellipse.center, ellipse.semi_major, 0.0, ellipse.angle])
    spread = covariance.copy()
    # Width and contrast of a segment are correlated; its levels give an upper limit of its width.
    wide = np.hypot(float(ellipse.semi_minor), min(float(np.sqrt(covariance[3, 3])), _SURELY_WIDE_PX))
    spread[3, :], spread[:, 3] = 0.0, 0.0
    spread[3, 3] = max(float(wide), _SEGMENT_PX) ** 2
    basis = np.stack(plane_basis(normal))
    slopes = np.empty((5, 5))
    for i in range(5):
        step = _STEP_PX / (float(ellipse.semi_major) if i == 4 else 1.0)
        # No width is negative.
        ends = [
            _pose_of(camera, theta + end * (np.arange(5) == i), normal, radius) for end in (step, -step * (i != 3))
        ]
        if ends[0] is None or ends[1] is None:
            return None
        (center_1, normal_1), (center_0, normal_0) = ends[0], ends[1]
        change = np.concatenate([center_1 - center_0, basis @ (normal_1 - normal_0)])
        slopes[:, i] = change / (step if i == 3 else 2.0 * step)
    propagated = np.asarray(slopes @ spread @ slopes.T)
    axis = center / np.linalg.norm(center)
    is_valid = np.all(np.isfinite(propagated)) and is_first_order(axis, normal, propagated)
    return propagated if is_valid else None


def _pose_of(
    camera: Camera, theta: FloatArray, normal: FloatArray, radius: float
) -> tuple[FloatArray, FloatArray] | None:
    """Return the pose with the normal nearest to `normal` of a circle whose image has the parameters `theta` (5,)."""
    factor = factor_from_ellipse(camera, Ellipse(theta[:2], theta[2], theta[3], theta[4]))
    if factor is None:
        return None
    centers, normals = poses_from_frame(principal_frame(factor), radius)
    nearest = int(np.argmax(normals @ normal))
    return centers[nearest], normals[nearest]


def pose_covariances(
    factor: FloatArray,
    axis: FloatArray,
    modes_covariance: FloatArray,
    center: FloatArray,
    normal: FloatArray,
    radius: float,
) -> FloatArray:
    """As `pose_covariance` for many at once (..., 5, 5), the axes (..., 3) of their cones known; NaN for None."""
    distance = np.linalg.norm(center, axis=-1)
    # In shares of the distance all parameters are of one kind, which keeps the inverse precise.
    scale = np.ones((*distance.shape, 5))
    scale[..., :3] = distance[..., None]
    with np.errstate(all="ignore"):
        columns = factor / np.linalg.norm(factor, axis=-2, keepdims=True)
        is_known = np.isfinite(modes_covariance).all(axis=(-2, -1)) & (np.abs(np.linalg.det(columns)) >= _FLATTEST)
        proper = np.where(is_known[..., None, None], factor, np.eye(3))
        slopes = pose_derivatives(proper, center, normal, radius)[..., :5] * scale[..., None, :]
        is_known = is_known & np.isfinite(slopes).all(axis=(-2, -1))
        is_known = is_known & (np.linalg.det(np.where(is_known[..., None, None], slopes, 0.0)) != 0.0)
        inverse = np.linalg.inv(np.where(is_known[..., None, None], slopes, np.eye(5))) * scale[..., None]
        modes = np.where(is_known[..., None, None], modes_covariance, np.nan)
        covariance = inverse @ modes @ np.swapaxes(inverse, -1, -2)
    covariance = (covariance + np.swapaxes(covariance, -1, -2)) / 2.0
    is_known = is_known & np.isfinite(covariance).all(axis=(-2, -1))
    is_known = is_known & is_first_order(axis, normal, np.where(is_known[..., None, None], covariance, np.eye(5)))
    return np.where(is_known[..., None, None], covariance, np.nan)


def is_first_order(axis: FloatArray, normal: FloatArray, covariance: FloatArray) -> BoolArray:
    """(...) Whether normals (..., 3) with covariances of their poses are surely tilted from their cones' axes.

    Along the axis (..., 3) of its cone no such covariance holds.
    """
    return np.asarray(angle_between(-normal, axis) >= _LEAST_SIGMAS * tilt_sigma(covariance))


def tilt_sigma(covariance: FloatArray) -> FloatArray:
    """Return the largest standard deviation (...), rad, of a normal in any direction, of covariances (..., 5, 5)."""
    return np.asarray(np.sqrt(np.maximum(np.linalg.eigvalsh(covariance[..., 3:, 3:])[..., -1], 0.0)))
