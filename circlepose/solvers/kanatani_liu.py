"""Circle pose from the fitted conic's eigenvalues: Kanatani & Liu, 3-D Interpretation of Conics (1993).

Scale the cone `Q` to determinant -1 with eigenvalues l2 >= l1 > 0 > l3 and unit eigenvectors u2, u1, u3. Then

    n = +-sqrt((l2 - l1)/(l2 - l3)) u2 + sqrt((l1 - l3)/(l2 - l3)) u3,    d = l1^(3/2) R

with d the distance of the supporting plane, and the centre is where the plane meets the ray Q^-1 n.
Exact on an exact ellipse. It needs one: seen edge-on the image is a segment, Q is singular and there is no
answer.
"""

from __future__ import annotations

import numpy as np

from circlepose._typing import FloatArray
from circlepose.cone import principal_frame
from circlepose.errors import ArgumentError


def poses_from_cone(cone: FloatArray, radius: FloatArray | float) -> tuple[FloatArray, FloatArray]:
    """Return both poses of a circle of `radius` (...) with the cone `Q` (..., 3, 3): centres, normals (..., 2, 3).

    `Q` may have any scale; its sign must make it negative inside. Centres in the unit of `radius`, normals
    towards the camera, the cone taken on the side of z > 0 or, where it spans z = 0, of its larger part.

    Raises
    ------
    ArgumentError
        When Q is singular: a degenerate viewing cone.
    """
    q = np.asarray(cone, dtype=np.float64)
    determinant = np.linalg.det(q)
    if np.any(determinant == 0.0) or not np.all(np.isfinite(determinant)):
        raise ArgumentError("cone: is singular (edge-on view), the method needs an ellipse.")
    q = -q / np.cbrt(determinant)[..., None, None]
    eigenvalues, vectors = np.linalg.eigh(q)
    l3, l1, l2 = (eigenvalues[..., i] for i in range(3))
    u3, u2 = vectors[..., :, 0], vectors[..., :, 2]
    u3 = np.where(u3[..., 2:] < 0.0, -u3, u3)
    across = np.sqrt(np.maximum(l2 - l1, 0.0) / (l2 - l3))
    along = np.sqrt((l1 - l3) / (l2 - l3))
    away = np.stack([sign * across[..., None] * u2 + along[..., None] * u3 for sign in (1.0, -1.0)], axis=-2)
    distance = l1**1.5 * np.asarray(radius, dtype=np.float64)
    centers = np.swapaxes(np.linalg.solve(q, np.swapaxes(away, -1, -2)), -1, -2)
    centers = centers * (distance[..., None] / np.sum(centers * away, axis=-1))[..., None]
    return centers, -away


def poses_from_factor(factor: FloatArray, radius: float) -> tuple[FloatArray, FloatArray] | None:
    """As `poses_from_cone` for the cone with `factor` (3, 3); None when it is degenerate."""
    if bool(principal_frame(factor).is_degenerate):
        return None
    inverse = np.linalg.inv(factor)
    return poses_from_cone(inverse.T @ (np.array([1.0, 1.0, -1.0])[:, None] * inverse), radius)
