"""Vectors in space. Pure NumPy."""

from __future__ import annotations

import numpy as np

from circlepose._typing import FloatArray


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the vector product (..., 3); `np.cross` takes five times longer for a single one."""
    a0, a1, a2 = a[..., 0], a[..., 1], a[..., 2]
    b0, b1, b2 = b[..., 0], b[..., 1], b[..., 2]
    product = np.empty(np.broadcast_shapes(a.shape, b.shape))
    product[..., 0], product[..., 1], product[..., 2] = a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0
    return product
