"""Conics in a plane as matrices: polars, duals, and the ellipses among them. Pure NumPy.

A conic is a symmetric matrix `C`, shape (..., 3, 3), defined up to scale: the point `x = (x, y, 1)`
is on it when `x' C x = 0`. All functions take leading batch axes.
"""

from __future__ import annotations

import numpy as np

from circlepose._numerics import cross
from circlepose._typing import BoolArray, FloatArray
from circlepose.errors import ArgumentError
from circlepose.geometry.ellipse import Ellipse

_FLATTEST = 1e-7
"""Axis ratio below which a matrix in float64 does not distinguish an ellipse from a pair of lines; numerical.

Other limits of flatness differ by purpose: a factor keeps its digits where a conic's matrix does not
(`cone.DEGENERATE_TOLERANCE`), and an ellipse fit loses them sooner (`fitting.segment_cone`)."""


def conic_from_ellipse(ellipse: Ellipse) -> FloatArray:
    """Return the conics of ellipses.

    Parameters
    ----------
    ellipse
        (...) not segments.

    Returns
    -------
    (..., 3, 3) C, with x'Cx negative inside and -1 at the center.

    Raises
    ------
    ArgumentError
        When an ellipse is a segment.
    """
    if np.any(ellipse.semi_minor <= 0.0):
        raise ArgumentError("ellipse: a segment (semi_minor 0) has no conic; use its factor or its dual.")
    inverse = np.linalg.inv(ellipse.factor)
    return np.swapaxes(inverse, -1, -2) @ (np.array([1.0, 1.0, -1.0])[:, None] * inverse)


def is_ellipse(conic: FloatArray) -> BoolArray:
    """Return whether each conic is a real, non-degenerate ellipse.

    Parameters
    ----------
    conic
        (..., 3, 3) any scale.

    Returns
    -------
    (...) by the signs of the determinants, with a margin for rounding.
    """
    c = np.asarray(conic, dtype=np.float64)
    minor = c[..., 0, 0] * c[..., 1, 1] - c[..., 0, 1] ** 2
    trace = c[..., 0, 0] + c[..., 1, 1]
    closed = minor > _FLATTEST**2 * trace**2
    return np.asarray(closed & (trace * np.linalg.det(c) < 0.0), dtype=np.bool_)


def ellipse_from_conic(conic: FloatArray) -> Ellipse:
    """Return the ellipses of conics.

    Parameters
    ----------
    conic
        (..., 3, 3) any scale and sign.

    Returns
    -------
    (...) center, semi-axes and angle, from the eigenvalues of the quadratic part.

    Raises
    ------
    ArgumentError
        When a conic is not a real ellipse; call `is_ellipse` first where that can happen.
    """
    c = np.asarray(conic, dtype=np.float64)
    if not np.all(is_ellipse(c)):
        raise ArgumentError("conic: expected a real ellipse.")
    c = c / np.max(np.abs(c), axis=(-2, -1), keepdims=True)
    quadratic = c[..., :2, :2]
    linear = c[..., :2, 2]
    adjugate = dual(c)
    # The pole of the line at infinity.
    center = adjugate[..., :2, 2] / adjugate[..., 2, 2, None]
    at_center = c[..., 2, 2] + np.einsum("...i,...i->...", linear, center)
    eigenvalues, eigenvectors = np.linalg.eigh(quadratic / -at_center[..., None, None])
    # Both eigenvalues are positive now: 1/semi_axis^2, ascending, so the first belongs to the major axis.
    semi_axes = 1.0 / np.sqrt(eigenvalues)
    major = eigenvectors[..., :, 0]
    return Ellipse.from_axes(center, semi_axes, np.arctan2(major[..., 1], major[..., 0]))


def polar(conic: FloatArray, point: FloatArray) -> FloatArray:
    """Return the polar line of a point: l = C x (Fu & Zhou, section 2.2).

    Parameters
    ----------
    conic
        (..., 3, 3).
    point
        (..., 3) homogeneous.

    Returns
    -------
    (..., 3) the line l, with l'x = 0 for its points x.
    """
    return np.einsum("...ij,...j->...i", conic, point)


def pole(conic: FloatArray, line: FloatArray) -> FloatArray:
    """Return the pole of a line: the inverse of `polar`.

    Parameters
    ----------
    conic
        (..., 3, 3).
    line
        (..., 3).

    Returns
    -------
    (..., 3) the point, homogeneous.
    """
    return polar(dual(conic), line)


def dual(conic: FloatArray) -> FloatArray:
    """Return the dual conic, the adjugate: a line l touches the conic when l' C* l = 0.

    Parameters
    ----------
    conic
        (..., 3, 3).

    Returns
    -------
    (..., 3, 3).
    """
    c = np.asarray(conic, dtype=np.float64)
    rows = np.stack(
        [
            cross(c[..., 1, :], c[..., 2, :]),
            cross(c[..., 2, :], c[..., 0, :]),
            cross(c[..., 0, :], c[..., 1, :]),
        ],
        axis=-1,
    )
    return rows


def transform_conic(conic: FloatArray, homography: FloatArray) -> FloatArray:
    """Return the conic of the points H x: H^-T C H^-1.

    Parameters
    ----------
    conic
        (..., 3, 3) C.
    homography
        (..., 3, 3) H.

    Returns
    -------
    (..., 3, 3).
    """
    inverse = np.linalg.inv(homography)
    return np.swapaxes(inverse, -1, -2) @ conic @ inverse


def sampson_distance(conic: FloatArray, points: FloatArray) -> FloatArray:
    """Return the first-order distances of points to a conic (Sampson, 1982).

    Parameters
    ----------
    conic
        (..., 3, 3).
    points
        (..., n, 2).

    Returns
    -------
    (..., n) x'Cx / |grad x'Cx|, with the sign of x'Cx.
    """
    homogeneous = np.concatenate([points, np.ones_like(points[..., :1])], axis=-1)
    lines = np.einsum("...ij,...nj->...ni", conic, homogeneous)
    value = np.einsum("...ni,...ni->...n", homogeneous, lines)
    gradient = 2.0 * np.hypot(lines[..., 0], lines[..., 1])
    return value / np.maximum(gradient, np.finfo(np.float64).tiny)
