"""Direct least-squares ellipse fit: Fitzgibbon's constraint in the stable form of Halir & Flusser (1998).

The fit has the least algebraic distance sum (x'Cx)^2 under 4ac - b^2 = 1, which only ellipses satisfy, on centered
and scaled points. There is no fallback to another fit: where no ellipse fits, none is returned. Many contours are
fitted at once, without a Python loop over them, in one of two ways:

- `fit_ellipses` takes contours of any length and is as exact as float64 allows: for measuring.
- `fit_each` and `fit_scatter` solve the eigenvalue problem in closed form and in a fifth of the time, with errors
  of some 1e-6 of the size: for hypotheses, of which there are thousands. Scatter matrices add up, so the ellipse
  through several arcs costs no pass over their points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from circlepose._typing import BoolArray, FloatArray, IntArray
from circlepose.geometry.conic import ellipse_from_conic, is_ellipse
from circlepose.geometry.ellipse import Ellipse

MINIMUM_POINTS = 6
"""Points; five determine a conic, so with six there is something to fit."""
_LEAST_SPREAD_RATIO = 1e-7
"""Ratio of the points' spreads below which, in float64, they lie on a line; numerical."""
_LONGEST = 1e4
"""Semi-major axis, in units of the points' spread, from which an ellipse is as good as a parabola; numerical."""
_TINY = 1e-300
_RIDGE = 1e-12
"""Share of its trace that is added to the scatter of the linear terms, so that points on a line have a solution."""


@dataclass(frozen=True, slots=True, eq=False)
class Contours:
    """Several contours in one array: contour i holds `points[starts[i] : starts[i + 1]]`."""

    points: FloatArray
    """(n, 2)"""
    starts: IntArray
    """(m,) ascending, the first 0; no contour is empty"""

    @classmethod
    def of(cls, contours: list[FloatArray]) -> Contours:
        """Join a non-empty list of non-empty (k, 2) arrays."""
        sizes = np.array([len(c) for c in contours])
        return cls(np.concatenate(contours).astype(np.float64), np.concatenate([[0], np.cumsum(sizes)[:-1]]))

    @property
    def sizes(self) -> IntArray:
        """(m,) number of points of each contour."""
        return np.diff(np.append(self.starts, len(self.points)))

    @property
    def owner(self) -> IntArray:
        """(n,) index of the contour of each point."""
        return np.repeat(np.arange(len(self.starts)), self.sizes)

    def total(self, values: FloatArray) -> FloatArray:
        """Sum `values` (n, ...) over each contour, shape (m, ...)."""
        return np.asarray(np.add.reduceat(values, self.starts, axis=0))


def fit_ellipse(points: FloatArray, weights: FloatArray | None = None) -> Ellipse | None:
    """Fit an ellipse to one contour.

    Parameters
    ----------
    points
        (n, 2) in any plane unit.
    weights
        (n,) of the squared residuals; 1 by default.

    Returns
    -------
    The ellipse with the least algebraic distance (Halir & Flusser, 1998). None with fewer than 6 points, or where
    they coincide or lie on a line.
    """
    if len(points) < MINIMUM_POINTS:
        return None
    ellipses, found = fit_ellipses(Contours.of([points]), weights)
    return ellipses[0] if found[0] else None


def fit_ellipses(contours: Contours, weights: FloatArray | None = None) -> tuple[Ellipse, BoolArray]:
    """Fit an ellipse to each contour, as exactly as float64 allows.

    Parameters
    ----------
    contours
        m contours, n points in all, any plane unit.
    weights
        (n,) of the squared residuals; 1 by default.

    Returns
    -------
    The ellipses (m,) and which were found (m,): see `fit_ellipse`. Where none was found the batch holds a unit
    circle.
    """
    w = np.ones(len(contours.points)) if weights is None else weights
    owner = contours.owner
    mass = np.maximum(contours.total(w), np.finfo(np.float64).tiny)[:, None]
    middle = contours.total(w[:, None] * contours.points) / mass
    centered = contours.points - middle[owner]
    scale = np.sqrt(contours.total(w[:, None] * centered**2).sum(axis=1) / mass[:, 0] / 2.0)
    usable = (contours.sizes >= MINIMUM_POINTS) & (scale > 0.0)
    scale = np.where(usable, scale, 1.0)
    terms = _terms(centered / scale[owner, None])
    scatter = contours.total((w[:, None] * terms)[:, :, None] * terms[:, None, :]) / mass[:, :, None]
    spread = np.linalg.eigvalsh(scatter[:, 3:5, 3:5])
    usable &= spread[:, 0] > _LEAST_SPREAD_RATIO**2 * spread[:, 1]
    scatter = np.where(usable[:, None, None], scatter, np.eye(6))
    conics, solved = _conics(scatter)
    usable &= solved & is_ellipse(conics)
    found = ellipse_from_conic(np.where(usable[:, None, None], conics, np.diag([1.0, 1.0, -1.0])))
    usable &= found.semi_major < _LONGEST
    return found.enlarged(scale, middle), usable


def scatter_of(points: FloatArray, weights: FloatArray | None = None) -> FloatArray:
    """Return the scatter matrices that `fit_scatter` takes.

    Parameters
    ----------
    points
        (m, k, 2) in a plane unit in which they are of about unit size.
    weights
        (m, k) of the squared residuals; 1 by default.

    Returns
    -------
    (m, 6, 6) sums over k of the products of (x^2, xy, y^2, x, y, 1).
    """
    terms = _terms(points)
    weighted = terms if weights is None else terms * weights[..., None]
    return np.asarray(np.swapaxes(weighted, -1, -2) @ terms)


def fit_each(points: FloatArray, weights: FloatArray | None = None) -> tuple[Ellipse, BoolArray]:
    """Fit an ellipse to each of many contours of equal length, fast: see `fit_scatter`.

    Parameters
    ----------
    points
        (m, k, 2) in any plane unit.
    weights
        (m, k) of the squared residuals; 1 by default.

    Returns
    -------
    The ellipses (m,) and which were found (m,). Where none was found the batch holds a unit circle.
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
    """Fit an ellipse to each scatter matrix, in closed form.

    Parameters
    ----------
    scatter
        (m, 6, 6), see `scatter_of`, of points in coordinates of about unit size.

    Returns
    -------
    The ellipses (m,), in those coordinates, and which were found (m,).
    """
    s3 = scatter[:, 3:, 3:]
    ridge = _RIDGE * np.trace(s3, axis1=1, axis2=2)[:, None, None] * np.eye(3) + _TINY * np.eye(3)
    system, back = _reduced(scatter, ridge)
    quadratic = _eigenvector(system)
    return _ellipses(quadratic, np.einsum("mij,mj->mi", back, quadratic))


def _terms(points: FloatArray) -> FloatArray:
    """Return (x^2, xy, y^2, x, y, 1), shape (..., 6), of `points` (..., 2)."""
    x, y = points[..., 0], points[..., 1]
    return np.stack([x * x, x * y, y * y, x, y, np.ones_like(x)], axis=-1)


def _reduced(scatter: FloatArray, ridge: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
    """Return the eigenproblem of the quadratic terms (m, 3, 3), and the matrix from these to the linear ones.

    `ridge` (m, 3, 3) is added to the scatter of the linear terms; without it the points must not lie on a line.
    """
    s1, s2, s3 = scatter[:, :3, :3], scatter[:, :3, 3:], scatter[:, 3:, 3:]
    # The linear terms that are best for given quadratic ones.
    back = -np.linalg.solve(s3 if ridge is None else s3 + ridge, np.swapaxes(s2, 1, 2))
    reduced = s1 + s2 @ back
    # Inverse of the constraint's matrix [[0, 0, 2], [0, -1, 0], [2, 0, 0]], applied from the left.
    return np.stack([reduced[:, 2] / 2.0, -reduced[:, 1], reduced[:, 0] / 2.0], axis=1), np.asarray(back)


def _conics(scatter: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return the conics (m, 3, 3) of scatter matrices (m, 6, 6) of points not on a line, and which are ellipses."""
    system, back = _reduced(scatter)
    vectors = np.real(np.linalg.eig(system)[1])
    constraint = 4.0 * vectors[:, 0] * vectors[:, 2] - vectors[:, 1] ** 2
    best = np.argmax(constraint, axis=1)
    rows = np.arange(len(best))
    quadratic = vectors[rows, :, best]
    a, b, c = quadratic.T
    d, e, f = np.einsum("mij,mj->mi", back, quadratic).T
    conic = np.stack([a, b / 2.0, d / 2.0, b / 2.0, c, e / 2.0, d / 2.0, e / 2.0, f], axis=-1)
    return conic.reshape(-1, 3, 3), constraint[rows, best] > 0.0


def _eigenvector(system: FloatArray) -> FloatArray:
    """Return the eigenvector (m, 3) of the largest eigenvalue, the only positive one, in closed form."""
    third = np.trace(system, axis1=1, axis2=2) / 3.0
    shifted = system - third[:, None, None] * np.eye(3)
    p = np.sqrt(np.maximum(np.einsum("mij,mji->m", shifted, shifted) / 6.0, 1e-60))
    half_det = np.linalg.det(shifted / p[:, None, None]) / 2.0
    largest = third + 2.0 * p * np.cos(np.arccos(np.clip(half_det, -1.0, 1.0)) / 3.0)
    rows = system - largest[:, None, None] * np.eye(3)
    # The longest of the cross products of the rows is the most precise.
    following, last = rows[:, [1, 2, 0]], rows[:, [2, 0, 1]]
    crossed = following[..., [1, 2, 0]] * last[..., [2, 0, 1]] - following[..., [2, 0, 1]] * last[..., [1, 2, 0]]
    best = np.argmax(np.einsum("mij,mij->mi", crossed, crossed), axis=1)
    vector = crossed[np.arange(len(best)), best]
    return np.asarray(vector / np.maximum(np.linalg.norm(vector, axis=1, keepdims=True), _TINY))


def _ellipses(quadratic: FloatArray, linear: FloatArray) -> tuple[Ellipse, BoolArray]:
    """Return the ellipses of conics ax^2 + bxy + cy^2 + dx + ey + f = 0, in closed form, and which are one.

    `geometry.conic.ellipse_from_conic` keeps more digits of slender ellipses, but is slower.
    """
    a, b, c = quadratic.T
    d, e, f = linear.T
    minor = 4.0 * a * c - b * b
    found = minor > 1e-12 * (a * a + b * b + c * c)
    minor = np.where(found, minor, 1.0)
    cx, cy = (b * e - 2.0 * c * d) / minor, (b * d - 2.0 * a * e) / minor
    at_center = f + 0.5 * (d * cx + e * cy)
    middle, half = (a + c) / 2.0, np.hypot((a - c) / 2.0, b / 2.0)
    sign = np.where(middle < 0.0, -1.0, 1.0)
    # Both eigenvalues, over minus the value at the center, are 1 / semi-axis^2.
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
