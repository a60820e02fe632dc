"""Basis functions of the levels of textured surfaces on either side of a rim. Many rims at once.

With phi the angle of a pixel in the coordinates p of the rim (`rim_coordinates`) and d its distance (px), the basis
is the harmonic polynomials of p up to second order, cos n phi and sin n phi for n from 3 to N, and (d / 4 px) times
1, cos n phi and sin n phi for n from 1 to N. It is the first-order expansion, across the band, of levels that vary on
the scale of the band or slower.
"""

from __future__ import annotations

import numpy as np

from circlepose._typing import RealArray
from circlepose.photometry.rim_coordinates import HARMONICS, RimCoordinates

_BAND_PX = 4.0
"""px; unit of the distance, about that of the pixels farthest from the rim."""


def texture_functions(order: int) -> int:
    """Return the number of basis functions for texture on each side, with harmonics up to `order`."""
    return 1 + 2 * order + 2 * (order - 2)


def texture_basis(coordinates: RimCoordinates, order: int) -> RealArray:
    """Return the basis (m, 5 + t, k): the harmonics up to second order, then the t functions for texture."""
    p0, p1 = coordinates.plane
    basis = np.empty((len(p0), HARMONICS + texture_functions(order), p0.shape[1]), p0.dtype)
    basis[:, :HARMONICS] = coordinates.harmonics
    per_radius = 1.0 / np.maximum(coordinates.radius, 1e-6)
    u0, u1 = p0 * per_radius, p1 * per_radius
    slope = coordinates.distance_px * (1.0 / _BAND_PX)
    cos, sin = np.ones_like(u0), np.zeros_like(u0)
    basis[:, HARMONICS] = slope
    i = HARMONICS + 1
    for n in range(1, order + 1):
        cos, sin = cos * u0 - sin * u1, cos * u1 + sin * u0
        if n > 2:
            basis[:, i], basis[:, i + 1] = cos, sin
            i += 2
        np.multiply(slope, cos, out=basis[:, i])
        np.multiply(slope, sin, out=basis[:, i + 1])
        i += 2
    return basis
