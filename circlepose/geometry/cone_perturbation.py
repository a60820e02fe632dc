"""Small changes of a viewing cone as five modes of growth of its rim, and their derivatives by the pose. Pure NumPy.

In the coordinates y = A^-1 x of a cone's factor A the rim is the unit circle, and a cone close to it has the rim
|y_12|/y_3 = 1 + m0 + m1 cos p + m2 sin p + m3 cos 2p + m4 sin 2p. The five coefficients m are coordinates of all
cones near A: linear in the dual cone, the same for every lens, and without the singularity that a pose has where its
cone is right. A measured rim, from pixels or from edges, is a mean and an information matrix in them.
"""

from __future__ import annotations

import numpy as np

from circlepose._typing import FloatArray
from circlepose.geometry.cone import SIGNATURE, plane_basis

MODES = 5
"""Number of modes."""


def mode_shapes(angle: FloatArray) -> FloatArray:
    """Return the growth of the rim in each mode, per unit coefficient.

    Parameters
    ----------
    angle
        (...) rad, the factor's angle p along the rim.

    Returns
    -------
    (..., 5) 1, cos p, sin p, cos 2p, sin 2p.
    """
    p = np.asarray(angle, dtype=np.float64)
    return np.stack([np.ones_like(p), np.cos(p), np.sin(p), np.cos(2.0 * p), np.sin(2.0 * p)], axis=-1)


def grown(factor: FloatArray, coefficients: FloatArray) -> FloatArray:
    """Return the factors of cones whose rims have grown by given coefficients.

    Parameters
    ----------
    factor
        (..., 3, 3) in the camera frame.
    coefficients
        (..., 5) of the modes, small.

    Returns
    -------
    (..., 3, 3) A (I + M), to first order in the coefficients.
    """
    m0, m1, m2, m3, m4 = (coefficients[..., i] for i in range(MODES))
    change = np.zeros((*coefficients.shape[:-1], 3, 3))
    change[..., 0, 0], change[..., 0, 1], change[..., 0, 2] = m0 + m3, m4, m1
    change[..., 1, 0], change[..., 1, 1], change[..., 1, 2] = m4, m0 - m3, m2
    return np.asarray(factor + factor @ change)


def coefficients_between(factor: FloatArray, dual: FloatArray) -> FloatArray:
    """Return the coefficients by which one cone differs from another close to it.

    Parameters
    ----------
    factor
        (..., 3, 3) of the one cone, camera frame.
    dual
        (..., 3, 3) the dual cone of the other, any scale: see `cone.dual_cone`.

    Returns
    -------
    (..., 5) of the modes at `factor`: the harmonics of A^-1 Q* A^-T, to first order.
    """
    local = _local(factor, dual)
    return _coefficients(local / _scale(local)[..., None, None] - np.diag(SIGNATURE))


def pose_coefficients(
    factor: FloatArray, center: FloatArray, normal: FloatArray, radius: float | FloatArray
) -> FloatArray:
    """Return the coefficients by which the cone of a circle differs from a cone close to it.

    Parameters
    ----------
    factor
        (..., 3, 3) of the cone, camera frame.
    center, normal, radius
        (..., 3), unit (..., 3) and length: the circle, in the camera frame and one length unit.

    Returns
    -------
    (..., 5) of the modes at `factor`.
    """
    return coefficients_between(factor, dual_circle(center, normal, radius))


def dual_circle(center: FloatArray, normal: FloatArray, radius: float | FloatArray) -> FloatArray:
    """Return the dual cones of circles: see `cone.dual_cone`.

    Parameters
    ----------
    center, normal, radius
        (..., 3), unit (..., 3) and length, in the camera frame and one length unit.

    Returns
    -------
    (..., 3, 3) R^2 (I - n n') - c c', length unit squared.
    """
    return np.asarray(radius**2 * (np.eye(3) - _outer(normal, normal)) - _outer(center, center))


def pose_derivatives(
    factor: FloatArray, center: FloatArray, normal: FloatArray, radius: float | FloatArray
) -> FloatArray:
    """Return the derivatives of the modes' coefficients by the pose of a circle.

    Parameters
    ----------
    factor
        (..., 3, 3) of cones that are those of the circles, or close to them; camera frame.
    center, normal, radius
        (..., 3), unit (..., 3) and length: the circles, in the camera frame and one length unit.

    Returns
    -------
    (..., 5, 6) by the center (3, per length unit), two tilts of the normal (2, per rad) and the radius (per length
    unit). A tilt turns the normal towards the first or the second vector of `cone.plane_basis(normal)`.
    """
    tilts = np.stack(plane_basis(normal), axis=-2)
    changes = np.empty((*normal.shape[:-1], 6, 3, 3))
    changes[..., :3, :, :] = _both(-np.eye(3), center[..., None, :])
    changes[..., 3:5, :, :] = _both(-(radius**2) * tilts, normal[..., None, :])
    changes[..., 5, :, :] = 2.0 * radius * (np.eye(3) - _outer(normal, normal))
    local = _local(factor, dual_circle(center, normal, radius))
    scale = _scale(local)[..., None, None, None]
    derivative = _local(factor[..., None, :, :], changes)
    # The scale changes too; that removes what is only a multiple of the dual cone itself.
    relative = _scale(derivative)[..., None, None] / scale**2 * local[..., None, :, :]
    return np.swapaxes(_coefficients(derivative / scale - relative), -1, -2)


def _outer(first: FloatArray, second: FloatArray) -> FloatArray:
    return first[..., :, None] * second[..., None, :]


def _both(first: FloatArray, second: FloatArray) -> FloatArray:
    outer = _outer(first, second)
    return np.asarray(outer + np.swapaxes(outer, -1, -2))


def _local(factor: FloatArray, dual: FloatArray) -> FloatArray:
    inverse = np.linalg.inv(factor)
    return np.asarray(inverse @ dual @ np.swapaxes(inverse, -1, -2))


def _scale(local: FloatArray) -> FloatArray:
    return np.asarray((local[..., 0, 0] + local[..., 1, 1] - local[..., 2, 2]) / 3.0)


def _coefficients(change: FloatArray) -> FloatArray:
    """Return the harmonics (..., 5) of half the dual form of the tangent lines (cos p, sin p, -1)."""
    mean = (change[..., 0, 0] + change[..., 1, 1]) / 4.0 + change[..., 2, 2] / 2.0
    second = (change[..., 0, 0] - change[..., 1, 1]) / 4.0
    coefficients = np.empty((*mean.shape, MODES))
    coefficients[..., 0], coefficients[..., 1], coefficients[..., 2] = mean, -change[..., 0, 2], -change[..., 1, 2]
    coefficients[..., 3], coefficients[..., 4] = second, change[..., 0, 1] / 2.0
    return coefficients
