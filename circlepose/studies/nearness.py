"""Poses compared: angles, differences, and the candidate that is nearest to a known pose."""

from __future__ import annotations

import numpy as np

from circlepose._numerics import angle_between
from circlepose._typing import FloatArray
from circlepose.studies.published import Triple


def angle_deg(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return the angle (...), deg, between directions (..., 3) of any length."""
    a = first / np.linalg.norm(first, axis=-1, keepdims=True)
    b = second / np.linalg.norm(second, axis=-1, keepdims=True)
    return np.asarray(np.degrees(angle_between(a, b)))


def distance_mm(first: FloatArray, second: FloatArray) -> float:
    """Return the distance of two points (3,)."""
    return float(np.linalg.norm(first - second))


def nearest(normals: FloatArray, normal: FloatArray) -> int:
    """Return which of the candidates' `normals` (k, 3) is nearest to `normal` (3,)."""
    return int(np.argmax(normals @ normal))


def triple(values: FloatArray) -> Triple:
    """Return (3,) as plain numbers."""
    x, y, z = values.tolist()
    return x, y, z
