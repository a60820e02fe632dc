"""Circle pose from the fitted conic's eigenvalues: Kanatani & Liu, 3-D Interpretation of Conics (1993).

Scale the cone `Q` to determinant -1 with eigenvalues l2 >= l1 > 0 > l3 and unit eigenvectors u2, u1, u3. Then

    n = +-sqrt((l2 - l1)/(l2 - l3)) u2 + sqrt((l1 - l3)/(l2 - l3)) u3,    d = l1^(3/2) R

with d the distance of the supporting plane, and the center is where the plane meets the ray Q^-1 n.
Exact on an exact ellipse. It needs one: seen edge-on the image is a segment, Q is singular and there is no
answer.
"""

from __future__ import annotations

import numpy as np

from circlepose._typing import FloatArray
from circlepose.errors import ArgumentError
from circlepose.geometry.cone import principal_frame

_LEAST_SHARE = 1e3 * float(np.finfo(np.float64).eps)
"""Least eigenvalue, as a share of the largest, of which three digits are left."""


def poses_from_cone(cone: FloatArray, radius: FloatArray | float) -> tuple[FloatArray, FloatArray]:
    """Return both poses of a circle of `radius` (...) with the cone `Q` (..., 3, 3): centers, normals (..., 2, 3).

    `Q` may have any scale; its sign must make it negative inside. Centres in the unit of `radius`, normals
    towards the camera, the cone taken on the side of z > 0 or, where it spans z = 0, of its larger part.

    Raises
    ------
    ArgumentError
        When Q is singular, or so nearly that rounding leaves less than three digits of an eigenvalue: edge-on view.
    """
    q = np.asarray(cone, dtype=np.float64)
    if not np.all(np.isfinite(q)):
        raise ArgumentError("cone: expected finite numbers.")
    # A cone has the signature (+, +, -), so its determinant is negative, whatever sign it comes with.
    q = q * np.where(np.linalg.det(q) > 0.0, -1.0, 1.0)[..., None, None]
    eigenvalues, vectors = np.linalg.eigh(q)
    l3, l1, l2 = (eigenvalues[..., i] for i in range(3))
    if not np.all(np.minimum(l1, -l3) > _LEAST_SHARE * np.maximum(l2, -l3)):
        raise ArgumentError("cone: is singular (edge-on view), the method needs an ellipse.")
    return _poses(np.stack([l3, l1, l2], axis=-1), vectors, np.asarray(radius, dtype=np.float64))


def poses_from_factor(factor: FloatArray, radius: float) -> tuple[FloatArray, FloatArray] | None:
    """As `poses_from_cone` for the cone with `factor` (3, 3); None when it is degenerate.

    The eigenvalues are those of the cone's own axes, 1/s^2, 1/t^2 and -1, to all digits however flat the cone is.
    """
    frame = principal_frame(factor)
    if bool(frame.is_degenerate):
        return None
    s, t = float(frame.tan_half_major), float(frame.tan_half_minor)
    return _poses(np.array([-1.0, s**-2, t**-2]), frame.rotation[:, [2, 0, 1]], np.asarray(radius, dtype=np.float64))


def _poses(eigenvalues: FloatArray, vectors: FloatArray, radius: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return both poses from l3 < 0 < l1 <= l2 (..., 3), of any scale, and their unit eigenvectors in columns."""
    scale = np.cbrt(-np.prod(eigenvalues, axis=-1))
    l3, l1, l2 = (eigenvalues[..., i] / scale for i in range(3))
    u3, u2 = vectors[..., :, 0], vectors[..., :, 2]
    u3 = np.where(u3[..., 2:] < 0.0, -u3, u3)
    across = np.sqrt(np.maximum(l2 - l1, 0.0) / (l2 - l3))
    along = np.sqrt((l1 - l3) / (l2 - l3))
    signs = np.array([1.0, -1.0])
    away = signs[:, None] * (across[..., None] * u2)[..., None, :] + (along[..., None] * u3)[..., None, :]
    # Q^-1 n, in the eigenvectors.
    ray = (
        signs[:, None] * (across / l2)[..., None, None] * u2[..., None, :]
        + ((along / l3)[..., None] * u3)[..., None, :]
    )
    depth = across**2 / l2 + along**2 / l3
    centers = ray * (l1**1.5 * radius / depth)[..., None, None]
    return centers, -away
