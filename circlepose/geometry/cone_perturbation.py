"""Small changes of a viewing cone as five modes of growth of its rim, and the pose's share in each. Pure NumPy.

In the coordinates y = A^-1 x of a cone's factor A the rim is the unit circle, and a cone close to it has the rim
|y_12|/y_3 = 1 + m0 + m1 cos p + m2 sin p + m3 cos 2p + m4 sin 2p. The five amounts m are coordinates of all cones
near A: linear in the dual cone, the same for every lens, and without the singularity that a pose has where its cone
is right. What is known of a rim, from pixels or from edges, is a mean and an information matrix in them.
"""

from __future__ import annotations

import numpy as np

from circlepose._typing import FloatArray
from circlepose.geometry.cone import SIGNATURE, plane_basis

MODES = 5


def mode_shapes(angle: FloatArray) -> FloatArray:
    """Return the growth (..., 5) of each mode at the factor's `angle` (...), per unit amount."""
    p = np.asarray(angle, dtype=np.float64)
    return np.stack([np.ones_like(p), np.cos(p), np.sin(p), np.cos(2.0 * p), np.sin(2.0 * p)], axis=-1)


def grown(factor: FloatArray, amounts: FloatArray) -> FloatArray:
    """Return the factors (..., 3, 3) of cones whose rims depart from those of `factor` by `amounts` (..., 5)."""
    m0, m1, m2, m3, m4 = (amounts[..., i] for i in range(MODES))
    change = np.zeros((*amounts.shape[:-1], 3, 3))
    change[..., 0, 0], change[..., 0, 1], change[..., 0, 2] = m0 + m3, m4, m1
    change[..., 1, 0], change[..., 1, 1], change[..., 1, 2] = m4, m0 - m3, m2
    return np.asarray(factor + factor @ change)


def amounts_between(factor: FloatArray, dual: FloatArray) -> FloatArray:
    """Return the amounts (..., 5) by which the cone with `dual` (..., 3, 3), any scale, departs from `factor`."""
    local = _local(factor, dual)
    return _amounts(local / _scale(local)[..., None, None] - np.diag(SIGNATURE))


def pose_amounts(factor: FloatArray, center: FloatArray, normal: FloatArray, radius: float) -> FloatArray:
    """Return the amounts (5,) by which the cone of a circle departs from that of `factor` (3, 3)."""
    return amounts_between(factor, dual_circle(center, normal, radius))


def dual_circle(center: FloatArray, normal: FloatArray, radius: float) -> FloatArray:
    """Return the dual cone R^2 (I - n n') - c c' (..., 3, 3) of circles; length unit squared."""
    return np.asarray(radius**2 * (np.eye(3) - _outer(normal, normal)) - _outer(center, center))


def pose_derivatives(factor: FloatArray, center: FloatArray, normal: FloatArray, radius: float) -> FloatArray:
    """Return d amounts / d pose (..., 5, 6): centre (3, per length unit), tilts of the normal (2, per rad), radius.

    A tilt turns `normal` (..., 3) towards the first or the second vector of `cone.plane_basis(normal)`. The cone of
    each circle is that of its `factor` (..., 3, 3), or close to it.
    """
    tilts = np.stack(plane_basis(normal), axis=-2)
    changes = np.empty((*normal.shape[:-1], 6, 3, 3))
    changes[..., :3, :, :] = _both(-np.eye(3), center[..., None, :])
    changes[..., 3:5, :, :] = _both(-(radius**2) * tilts, normal[..., None, :])
    changes[..., 5, :, :] = 2.0 * radius * (np.eye(3) - _outer(normal, normal))
    local = _local(factor, dual_circle(center, normal, radius))
    scale = _scale(local)[..., None, None, None]
    derivative = _local(factor[..., None, :, :], changes)
    # The scale changes too, which takes out what is only a multiple of the dual cone itself.
    relative = _scale(derivative)[..., None, None] / scale**2 * local[..., None, :, :]
    return np.swapaxes(_amounts(derivative / scale - relative), -1, -2)


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


def _amounts(change: FloatArray) -> FloatArray:
    """Half the dual form of the tangent lines (cos p, sin p, -1), by harmonics."""
    mean = (change[..., 0, 0] + change[..., 1, 1]) / 4.0 + change[..., 2, 2] / 2.0
    second = (change[..., 0, 0] - change[..., 1, 1]) / 4.0
    amounts = np.empty((*mean.shape, MODES))
    amounts[..., 0], amounts[..., 1], amounts[..., 2] = mean, -change[..., 0, 2], -change[..., 1, 2]
    amounts[..., 3], amounts[..., 4] = second, change[..., 0, 1] / 2.0
    return amounts
