"""Many rough ellipses at once: the direct fit (Halir & Flusser, 1998) from scatter matrices, in closed form.

For hypotheses, of which there are thousands: `fitting.direct` is as good as float64 allows, this one fast. Scatter
matrices add up, so that an ellipse through several arcs costs no pass over their points.
"""

from __future__ import annotations

import numpy as np

from circlepose._typing import BoolArray, FloatArray
from circlepose.geometry.ellipse import Ellipse

_TINY = 1e-300


def scatter_of(points: FloatArray, weights: FloatArray | None = None) -> FloatArray:
    """Return the scatter (m, 6, 6) of (x^2, xy, y^2, x, y, 1) over `points` (m, k, 2), `weights` (m, k)."""
    x, y = points[..., 0], points[..., 1]
    terms = np.stack([x * x, x * y, y * y, x, y, np.ones_like(x)], axis=-1)
    weighted = terms if weights is None else terms * weights[..., None]
    return np.asarray(np.swapaxes(weighted, -1, -2) @ terms)


def fit_each(points: FloatArray, weights: FloatArray | None = None) -> tuple[Ellipse, BoolArray]:
    """Fit an ellipse to each row of `points` (m, k, 2); returns them and which were found (m,).

    Where none was found the batch holds a unit circle.
    """
    w = np.ones(points.shape[:-1]) if weights is None else weights
    mass = np.maximum(w.sum(axis=1), _TINY)
    middle = np.einsum("mk,mki->mi", w, points) / mass[:, None]
    offset = points - middle[:, None, :]
    scale = np.sqrt(np.einsum("mk,mki,mki->m", w, offset, offset) / mass)
    scale = np.where(scale > 0.0, scale, 1.0)
    ellipse, found = fit_scatter(scatter_of(offset / scale[:, None, None], w))
    return ellipse.enlarged(scale, middle), found


def fit_scatter(scatter: FloatArray) -> tuple[Ellipse, BoolArray]:
    """Fit an ellipse to each scatter matrix (m, 6, 6) of points in coordinates of about unit size."""
    s1, s2, s3 = scatter[:, :3, :3], scatter[:, :3, 3:], scatter[:, 3:, 3:]
    ridge = 1e-12 * np.trace(s3, axis1=1, axis2=2)[:, None, None] * np.eye(3) + _TINY * np.eye(3)
    back = -np.linalg.solve(s3 + ridge, np.swapaxes(s2, 1, 2))
    reduced = s1 + s2 @ back
    # The inverse of the constraint's matrix [[0, 0, 2], [0, -1, 0], [2, 0, 0]], applied from the left.
    system = np.stack([reduced[:, 2] / 2.0, -reduced[:, 1], reduced[:, 0] / 2.0], axis=1)
    quadratic = _eigenvector(system)
    linear = np.einsum("mij,mj->mi", back, quadratic)
    return _ellipses(quadratic, linear)


def _eigenvector(system: FloatArray) -> FloatArray:
    """Return the eigenvector (m, 3) of the largest eigenvalue: the only positive one, as of the constraint."""
    third = np.trace(system, axis1=1, axis2=2) / 3.0
    shifted = system - third[:, None, None] * np.eye(3)
    p = np.sqrt(np.maximum(np.einsum("mij,mji->m", shifted, shifted) / 6.0, 1e-60))
    half_det = np.linalg.det(shifted / p[:, None, None]) / 2.0
    largest = third + 2.0 * p * np.cos(np.arccos(np.clip(half_det, -1.0, 1.0)) / 3.0)
    rows = system - largest[:, None, None] * np.eye(3)
    # The cross products of the rows, of which the longest is the most precise.
    following, last = rows[:, [1, 2, 0]], rows[:, [2, 0, 1]]
    crossed = following[..., [1, 2, 0]] * last[..., [2, 0, 1]] - following[..., [2, 0, 1]] * last[..., [1, 2, 0]]
    best = np.argmax(np.einsum("mij,mij->mi", crossed, crossed), axis=1)
    vector = crossed[np.arange(len(best)), best]
    return np.asarray(vector / np.maximum(np.linalg.norm(vector, axis=1, keepdims=True), _TINY))


def _ellipses(quadratic: FloatArray, linear: FloatArray) -> tuple[Ellipse, BoolArray]:
    a, b, c = quadratic.T
    d, e, f = linear.T
    minor = 4.0 * a * c - b * b
    found = minor > 1e-12 * (a * a + b * b + c * c)
    minor = np.where(found, minor, 1.0)
    cx, cy = (b * e - 2.0 * c * d) / minor, (b * d - 2.0 * a * e) / minor
    at_center = f + 0.5 * (d * cx + e * cy)
    middle, half = (a + c) / 2.0, np.hypot((a - c) / 2.0, b / 2.0)
    sign = np.where(middle < 0.0, -1.0, 1.0)
    # Both eigenvalues, over minus the value at the centre, are 1 / semi-axis^2.
    level = -sign * at_center
    middle = np.abs(middle)
    found &= (level > 0.0) & (middle > half)
    level = np.where(found, level, 1.0)
    semi_major = np.sqrt(np.where(found, level / np.where(found, middle - half, 1.0), 1.0))
    semi_minor = np.sqrt(np.where(found, level / np.where(found, middle + half, 1.0), 1.0))
    # The major axis lies along the eigenvector of the smaller eigenvalue.
    angle = 0.5 * np.arctan2(-sign * b, -sign * (a - c))
    return (
        Ellipse(
            center=np.where(found[:, None], np.stack([cx, cy], axis=1), 0.0),
            semi_major=semi_major,
            semi_minor=semi_minor,
            angle=np.where(found, angle, 0.0),
        ),
        found,
    )
