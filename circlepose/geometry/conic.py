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
"""Axis ratio below which a matrix in float64 does not tell an ellipse from a pair of lines."""


def conic_from_ellipse(ellipse: Ellipse) -> FloatArray:
    """Return the conic (..., 3, 3) of a proper ellipse: negative inside, scaled so that F = -1 at the centre."""
    if np.any(ellipse.semi_minor <= 0.0):
        raise ArgumentError("ellipse: a segment (semi_minor 0) has no conic; use its factor or its dual.")
    inverse = np.linalg.inv(ellipse.factor)
    return np.swapaxes(inverse, -1, -2) @ (np.array([1.0, 1.0, -1.0])[:, None] * inverse)


def is_ellipse(conic: FloatArray) -> BoolArray:
    """Tell, shape (...), whether `conic` (..., 3, 3) is a real, non-degenerate ellipse."""
    c = np.asarray(conic, dtype=np.float64)
    minor = c[..., 0, 0] * c[..., 1, 1] - c[..., 0, 1] ** 2
    trace = c[..., 0, 0] + c[..., 1, 1]
    closed = minor > _FLATTEST**2 * trace**2
    return np.asarray(closed & (trace * np.linalg.det(c) < 0.0), dtype=np.bool_)


def ellipse_from_conic(conic: FloatArray) -> Ellipse:
    """Return centre, semi-axes and angle of `conic` (..., 3, 3).

    Raises
    ------
    ArgumentError
        When a conic is no real ellipse; ask `is_ellipse` first where that can happen.
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
    """Return the polar line (..., 3) of a homogeneous `point` (..., 3): l = C x (Fu & Zhou, section 2.2)."""
    return np.einsum("...ij,...j->...i", conic, point)


def pole(conic: FloatArray, line: FloatArray) -> FloatArray:
    """Return the pole (..., 3), homogeneous, of a `line` (..., 3): the inverse of `polar`."""
    return polar(dual(conic), line)


def dual(conic: FloatArray) -> FloatArray:
    """Return the dual conic (..., 3, 3), the adjugate: a line l touches the conic when l' C* l = 0."""
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
    """Return the conic of the points `H x`: H^-T C H^-1, for `homography` (..., 3, 3)."""
    inverse = np.linalg.inv(homography)
    return np.swapaxes(inverse, -1, -2) @ conic @ inverse


def sampson_distance(conic: FloatArray, points: FloatArray) -> FloatArray:
    """Return the first-order signed distance (..., n) of `points` (..., n, 2), positive where x'Cx is."""
    homogeneous = np.concatenate([points, np.ones_like(points[..., :1])], axis=-1)
    lines = np.einsum("...ij,...nj->...ni", conic, homogeneous)
    value = np.einsum("...ni,...ni->...n", homogeneous, lines)
    gradient = 2.0 * np.hypot(lines[..., 0], lines[..., 1])
    return value / np.maximum(gradient, np.finfo(np.float64).tiny)
