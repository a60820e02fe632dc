"""The viewing cone of a circle: from a circle or an image ellipse to its principal frame. Pure NumPy.

A cone is held by a factor `A`, shape (..., 3, 3): its rays are `A (cos p, sin p, 1)`. For a circle the
columns are two perpendicular radii and the center; for an ellipse in a plane, its semi-axes and center.
The factor, unlike the matrix `Q` of `x'Qx = 0`, keeps its meaning and precision when the cone flattens
to a plane sector (a circle seen edge-on): then `Q` loses the apex angle, the factor does not.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from circlepose._numerics import cross
from circlepose._typing import FloatArray

SIGNATURE = np.array([1.0, 1.0, -1.0])

RIGHT_TOLERANCE = 1e-14
"""Relative (s^2 - t^2) below which two apex angles are equal in float64; numerical."""
DEGENERATE_TOLERANCE = 1e-9
"""t/s below which a cone is degenerate: at 1 m, a 60 mm circle is then within 1e-7 deg of edge-on; numerical."""
_NO_TILT = 1e-15
"""rad; a tilt that rounding may make."""


class ConeKind(StrEnum):
    """The three viewing conditions of Chen & Huang."""

    RIGHT = "right"
    ELLIPTICAL = "elliptical"
    DEGENERATE = "degenerate"


@dataclass(frozen=True, slots=True, eq=False)
class PrincipalFrame:
    """A viewing cone in its own axes (Chen & Huang, section II).

    In the frame (u, v, w) the cone is (x/s)^2 + (y/t)^2 = z^2, z > 0.
    """

    rotation: FloatArray
    """(..., 3, 3), right-handed; columns u, v, w in the camera frame; w along the bisector, w_z > 0 or nearest"""
    tan_half_major: FloatArray
    """(...) s = tan(LAA/2), LAA the largest apex angle, in the plane of u and w"""
    tan_half_minor: FloatArray
    """(...) t, of the apex angle in the perpendicular plane of v and w; 0 <= t <= s"""

    @property
    def is_right(self) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
        """(...) whether both apex angles are equal."""
        s2, t2 = self.tan_half_major**2, self.tan_half_minor**2
        return np.asarray(s2 - t2 <= RIGHT_TOLERANCE * s2)

    @property
    def is_degenerate(self) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
        """(...) whether the cone is a plane sector."""
        return np.asarray(self.tan_half_minor <= DEGENERATE_TOLERANCE * self.tan_half_major)


def factor_from_circle(center: FloatArray, normal: FloatArray, radius: FloatArray | float) -> FloatArray:
    """Return the factors of the viewing cones of circles.

    Parameters
    ----------
    center, normal, radius
        (..., 3), unit (..., 3) and (...), in the camera frame and one length unit.

    Returns
    -------
    (..., 3, 3) two perpendicular radii and the center as columns.
    """
    n = np.asarray(normal, dtype=np.float64)
    c = np.asarray(center, dtype=np.float64)
    first, second = plane_basis(n)
    r = np.asarray(radius, dtype=np.float64)[..., None]
    return np.stack(np.broadcast_arrays(r * first, r * second, c), axis=-1)


def plane_basis(normal: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return two unit vectors that complete a normal to a right-handed frame.

    Parameters
    ----------
    normal
        (..., 3) unit length.

    Returns
    -------
    The first and the second vector, (..., 3) each; first x second = normal.
    """
    n = np.asarray(normal, dtype=np.float64)
    # The axis least parallel to the normal keeps the cross product long.
    helper = np.eye(3)[np.argmin(np.abs(n), axis=-1)]
    first = cross(helper, n)
    first = first / np.linalg.norm(first, axis=-1, keepdims=True)
    return first, cross(n, first)


def circle_frame(normal: FloatArray) -> FloatArray:
    """Return the rotations (..., 3, 3) from a frame with z along unit `normal` (..., 3) to the camera's.

    The columns are x, y and z. Where the normal is the camera's -z, x is the camera's x and y its -y; any other frame
    is that one turned by the smallest rotation that takes -z to the normal. At the normal +z, which is seen only by a
    lens of more than 180 deg, that rotation has no one axis, and the one about y is taken.
    """
    n = np.asarray(normal, dtype=np.float64)
    x, y, z = n[..., 0], n[..., 1], n[..., 2]
    across = x * x + y * y
    is_behind = (z > 0.0) & (across < _NO_TILT**2)
    # 1 / (1 - z), which would lose its digits where z is nearly 1.
    from_across = (1.0 + z) / np.where(across < _NO_TILT**2, 1.0, across)
    per = np.where(z > 0.0, from_across, 1.0 / (1.0 - np.minimum(z, 0.0)))
    first = np.stack([np.where(is_behind, -1.0, 1.0 - x * x * per), -x * y * per, x], axis=-1)
    second = np.stack([x * y * per, y * y * per - 1.0, -y], axis=-1)
    return np.stack([first, second, n], axis=-1)


def cone_from_circle(center: FloatArray, normal: FloatArray, radius: FloatArray | float) -> FloatArray:
    """Return the matrices of the viewing cones of circles.

    Parameters
    ----------
    center, normal, radius
        (..., 3), unit (..., 3) and (...), in the camera frame and one length unit.

    Returns
    -------
    (..., 3, 3) Q = d^2 I - d (n c' + c n') + (c.c - R^2) n n' with d = n.c, length unit squared. A ray x is on the
    rim where x'Qx = 0, inside where it is negative.
    """
    c, n = np.asarray(center, dtype=np.float64), np.asarray(normal, dtype=np.float64)
    r = np.asarray(radius, dtype=np.float64)
    d = np.einsum("...i,...i->...", c, n)[..., None, None]
    outer = n[..., :, None] * c[..., None, :]
    along = (np.einsum("...i,...i->...", c, c) - r**2)[..., None, None]
    return d**2 * np.eye(3) - d * (outer + np.swapaxes(outer, -1, -2)) + along * n[..., :, None] * n[..., None, :]


def cone_from_factor(factor: FloatArray) -> FloatArray:
    """Return the matrices of cones given by their factors.

    Parameters
    ----------
    factor
        (..., 3, 3) A, not flat.

    Returns
    -------
    (..., 3, 3) Q = A^-T diag(1, 1, -1) A^-1.
    """
    inverse = np.linalg.inv(factor)
    return np.asarray(np.swapaxes(inverse, -1, -2) @ (SIGNATURE[:, None] * inverse))


def dual_cone(factor: FloatArray) -> FloatArray:
    """Return the dual cones of cones given by their factors.

    Parameters
    ----------
    factor
        (..., 3, 3) A, also flat.

    Returns
    -------
    (..., 3, 3) Q* = A diag(1, 1, -1) A'; of a circle R^2 (I - n n') - c c'.
    """
    return (factor * SIGNATURE) @ np.swapaxes(factor, -1, -2)


def factor_from_cone(cone: FloatArray) -> FloatArray:
    """Return factors of elliptical cones given by their matrices.

    Parameters
    ----------
    cone
        (..., 3, 3) Q, any scale and sign.

    Returns
    -------
    (..., 3, 3) of the half of the double cone whose axis has z > 0.
    """
    q = np.asarray(cone, dtype=np.float64)
    # A cone has the signature (+, +, -), so its determinant is negative: that determines the sign of Q.
    q = q * np.where(np.linalg.det(q) > 0.0, -1.0, 1.0)[..., None, None]
    eigenvalues, vectors = np.linalg.eigh(q)
    factor = vectors[..., [2, 1, 0]] / np.sqrt(np.abs(eigenvalues[..., None, [2, 1, 0]]))
    return np.asarray(factor * np.where(factor[..., 2:3, 2:3] < 0.0, np.array([1.0, 1.0, -1.0]), 1.0))


def principal_frame(factor: FloatArray) -> PrincipalFrame:
    """Return the principal frames of cones (Chen & Huang, section II).

    Parameters
    ----------
    factor
        (..., 3, 3) in the camera frame, any length unit.

    Returns
    -------
    The axes u, v, w and the tangents of both half apex angles.

    Notes
    -----
    The eigenvalues of the dual cone are, up to scale, s^2, t^2 and -1 on u, v and w. A first decomposition
    gives the axis w; a second, of the 2 x 2 block across it, keeps the relative precision of s^2 and t^2,
    which are small compared with 1. Close to edge-on t^2 is lost in rounding all the same and is taken from the
    determinant, the product of the three, which the factor gives to full relative precision.
    """
    a = np.asarray(factor, dtype=np.float64)
    a = a / np.linalg.norm(a[..., :, 2], axis=-1)[..., None, None]
    _, vectors = np.linalg.eigh(dual_cone(a))
    w = vectors[..., :, 0]
    # Of the double cone the half on the side of its own center ray.
    w = w * np.where(np.einsum("...i,...i->...", w, a[..., :, 2]) < 0.0, -1.0, 1.0)[..., None]
    across = vectors[..., :, 1:]
    block = dual_cone(np.swapaxes(np.concatenate([across, w[..., None]], axis=-1), -1, -2) @ a)
    axial = -block[..., 2, 2]
    values, turn = np.linalg.eigh(block[..., :2, :2])
    s2 = values[..., 1] / axial
    t2_from_determinant = np.linalg.det(a) ** 2 / (values[..., 1] * axial**2)
    t2_from_eigenvalue = np.maximum(values[..., 0] / axial, 0.0)
    t2 = np.where(t2_from_eigenvalue < 1e-3 * s2, t2_from_determinant, t2_from_eigenvalue)
    u = (across @ turn[..., :, 1:])[..., 0]
    v = cross(w, u)
    return PrincipalFrame(
        rotation=np.stack([u, v, w], axis=-1),
        tan_half_major=np.sqrt(s2),
        tan_half_minor=np.minimum(np.sqrt(t2), np.sqrt(s2)),
    )


def cone_kinds(frame: PrincipalFrame) -> np.ndarray[tuple[int, ...], np.dtype[np.str_]]:
    """Return the viewing condition of each cone.

    Parameters
    ----------
    frame
        (...) principal frames.

    Returns
    -------
    (...) the values of `ConeKind`.
    """
    kinds = np.where(frame.is_right, ConeKind.RIGHT.value, ConeKind.ELLIPTICAL.value)
    return np.where(frame.is_degenerate, ConeKind.DEGENERATE.value, kinds)
