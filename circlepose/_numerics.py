"""Small numerics that NumPy lacks, or is slow at. Importing SciPy for them takes longer than all the rest."""

from __future__ import annotations

import numpy as np

from circlepose._typing import FloatArray


def logistic(log_odds: FloatArray | float) -> FloatArray:
    """Return 1 / (1 + exp(-x)) of log odds x (...), which are free to be large."""
    small = np.exp(-np.abs(log_odds))
    return np.asarray(np.where(np.less(log_odds, 0.0), small, 1.0) / (1.0 + small))


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the vector product (..., 3); `np.cross` takes five times longer for a single one."""
    a0, a1, a2 = a[..., 0], a[..., 1], a[..., 2]
    b0, b1, b2 = b[..., 0], b[..., 1], b[..., 2]
    product = np.empty(np.broadcast_shapes(a.shape, b.shape))
    product[..., 0], product[..., 1], product[..., 2] = a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0
    return product


STUDENT_FREEDOM = 10.0
"""Degrees of freedom behind the errors that rims are measured with: of Student's t."""


def student_log_likelihood(misfit: float, freedom: int) -> float:
    """Return the logarithm of Student's t of a chi-square `misfit` of `freedom` dimensions, up to a constant."""
    return float(-0.5 * (STUDENT_FREEDOM + freedom) * np.log1p(misfit / STUDENT_FREEDOM))
