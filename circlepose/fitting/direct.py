"""Direct least-squares ellipse fit: Fitzgibbon's constraint in the stable form of Halir & Flusser (1998).

Minimises the algebraic distance sum (x'Cx)^2 under 4ac - b^2 = 1, which only ellipses satisfy, in float64 on
centred and scaled points. It never falls back on another fit: what has no ellipse is said to have none.
Many contours are fitted at once, without a Python loop over them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from circlepose._typing import BoolArray, FloatArray, IntArray
from circlepose.geometry.conic import ellipse_from_conic, is_ellipse
from circlepose.geometry.ellipse import Ellipse

MINIMUM_POINTS = 6
"""Five determine a conic; with one more there is something to fit."""
_FLAT = 1e-7
"""Ratio of the points' spreads below which they lie on a line as far as a fit in float64 can tell."""
_LONGEST = 1e4
"""Semi-major axis, in units of the points' spread, from which an ellipse is as good as a parabola."""


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
        """(n,) which contour each point belongs to."""
        return np.repeat(np.arange(len(self.starts)), self.sizes)

    def total(self, values: FloatArray) -> FloatArray:
        """Sum `values` (n, ...) over each contour, shape (m, ...)."""
        return np.asarray(np.add.reduceat(values, self.starts, axis=0))


def fit_ellipse(points: FloatArray, weights: FloatArray | None = None) -> Ellipse | None:
    """Fit an ellipse to `points` (n, 2), any plane unit, with optional `weights` (n,) of the squared residuals.

    None when there are fewer than 6 points, or they coincide or lie on a line.
    """
    if len(points) < MINIMUM_POINTS:
        return None
    ellipses, found = fit_ellipses(Contours.of([points]), weights)
    return ellipses[0] if found[0] else None


def fit_ellipses(contours: Contours, weights: FloatArray | None = None) -> tuple[Ellipse, BoolArray]:
    """Fit an ellipse to each contour; returns a batch of m and whether each was found (m,).

    `weights` (n,) of the squared residuals. Where none was found the batch holds a unit circle.
    """
    w = np.ones(len(contours.points)) if weights is None else weights
    owner = contours.owner
    mass = np.maximum(contours.total(w), np.finfo(np.float64).tiny)[:, None]
    middle = contours.total(w[:, None] * contours.points) / mass
    centered = contours.points - middle[owner]
    scale = np.sqrt(contours.total(w[:, None] * centered**2).sum(axis=1) / mass[:, 0] / 2.0)
    usable = (contours.sizes >= MINIMUM_POINTS) & (scale > 0.0)
    scale = np.where(usable, scale, 1.0)
    x, y = (centered / scale[owner, None]).T
    terms = np.stack([x * x, x * y, y * y, x, y, np.ones_like(x)], axis=-1)
    scatter = contours.total((w[:, None] * terms)[:, :, None] * terms[:, None, :]) / mass[:, :, None]
    spread = np.linalg.eigvalsh(scatter[:, 3:5, 3:5])
    usable &= spread[:, 0] > _FLAT**2 * spread[:, 1]
    scatter = np.where(usable[:, None, None], scatter, np.eye(6))
    conics, solved = _solve(scatter)
    usable &= solved & is_ellipse(conics)
    found = ellipse_from_conic(np.where(usable[:, None, None], conics, np.diag([1.0, 1.0, -1.0])))
    usable &= found.semi_major < _LONGEST
    return found.enlarged(scale, middle), usable


def _solve(scatter: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Solve the constrained problem for scatter matrices (m, 6, 6) of (x^2, xy, y^2, x, y, 1)."""
    s1, s2, s3 = scatter[:, :3, :3], scatter[:, :3, 3:], scatter[:, 3:, 3:]
    # The linear terms that are best for given quadratic ones; s3 is regular as the points are not on a line.
    back = -np.linalg.solve(s3, np.swapaxes(s2, 1, 2))
    reduced = s1 + s2 @ back
    # Inverse of the constraint's matrix [[0, 0, 2], [0, -1, 0], [2, 0, 0]], applied from the left.
    system = np.stack([reduced[:, 2] / 2.0, -reduced[:, 1], reduced[:, 0] / 2.0], axis=1)
    vectors = np.real(np.linalg.eig(system)[1])
    constraint = 4.0 * vectors[:, 0] * vectors[:, 2] - vectors[:, 1] ** 2
    best = np.argmax(constraint, axis=1)
    rows = np.arange(len(best))
    quadratic = vectors[rows, :, best]
    linear = np.einsum("mij,mj->mi", back, quadratic)
    a, b, c = quadratic.T
    d, e, f = linear.T
    conic = np.stack([a, b / 2.0, d / 2.0, b / 2.0, c, e / 2.0, d / 2.0, e / 2.0, f], axis=-1)
    return conic.reshape(-1, 3, 3), constraint[rows, best] > 0.0
