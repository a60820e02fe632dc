"""Coordinates of pixels relative to rims. Many rims at once.

A cone with the factor A has the rim |p| = 1 in the coordinates p = (y_1, y_2) / y_3 with y = A^-1 x, x the ray of a
pixel. From p, |p| and their derivatives to the pixel follow the distance d (px) of the pixel from the rim, to second
order, and the curvature kappa (1/px) of the rim's image at the foot point.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from circlepose._typing import FloatArray, RealArray
from circlepose.photometry.pixel_band import Bands

HARMONICS = 5
"""Harmonic polynomials of p up to second order."""
LEVELS = 2 * HARMONICS + 1
"""Levels of a rim: the coefficients of the harmonics inside and outside, and of the halo term."""
_LEAST_CONVERGENCE = 0.3
"""Lower bound of 1 - kappa d: pixels closer to the center of curvature have no unique foot point."""


@dataclass(frozen=True, slots=True, eq=False)
class RimCoordinates:
    """The coordinates of k pixels around each of m rims."""

    distance_px: RealArray
    """(m, k) from the rim, positive outside, to second order"""
    curvature: RealArray
    """(m, k) of the rim at the foot point, 1/px"""
    harmonics: RealArray
    """(m, 5, k) `harmonics` of p"""
    radius: RealArray
    """(m, k) |p|"""
    radial_across: RealArray
    """(m, k) radial component of dp per px across the rim, outwards"""
    tangential_across: RealArray
    """(m, k) tangential component of dp per px across the rim, outwards"""
    tangential_along: RealArray
    """(m, k) tangential component of dp per px along the rim; the radial one is 0"""
    double_angle: tuple[RealArray, RealArray]
    """cosine and sine, (m, k) each, of twice the direction across the rim in the image"""

    @property
    def plane(self) -> tuple[RealArray, RealArray]:
        """The two components of p, (m, k) each."""
        return self.harmonics[:, 1], self.harmonics[:, 2]


def rim_coordinates(bands: Bands, factors: FloatArray) -> RimCoordinates:
    """Return the coordinates of the pixels of `bands` relative to the rims of cones.

    Parameters
    ----------
    bands
        The pixels around m rims, k each.
    factors
        (m, 3, 3) factors of the cones, camera frame, any scale.
    """
    m, k = bands.levels.shape
    inverse = np.linalg.inv(factors).astype(bands.rays.dtype)
    local = (inverse @ bands.rays.reshape(m, 3, 3 * k)).reshape(m, 3, 3, k)
    per_depth = 1.0 / local[:, 2, 0]
    p = local[:, :2, 0] * per_depth[:, None]
    # d p / d pixel: (m, component, x or y, k)
    by_pixel = p[:, :, None] * local[:, 2:, 1:]
    np.subtract(local[:, :2, 1:], by_pixel, out=by_pixel)
    by_pixel *= per_depth[:, None, None]
    radius = np.sqrt(p[:, 0] * p[:, 0] + p[:, 1] * p[:, 1])
    per_radius = 1.0 / np.maximum(radius, 1e-9)
    u0, u1 = p[:, 0] * per_radius, p[:, 1] * per_radius
    # Its radial and tangential components, (m, x or y, k) each.
    radial = u0[:, None] * by_pixel[:, 0] + u1[:, None] * by_pixel[:, 1]
    tangential = u0[:, None] * by_pixel[:, 1] - u1[:, None] * by_pixel[:, 0]
    radial_across = np.maximum(np.sqrt(radial[:, 0] * radial[:, 0] + radial[:, 1] * radial[:, 1]), 1e-12)
    per_radial = 1.0 / radial_across
    n0, n1 = radial[:, 0] * per_radial, radial[:, 1] * per_radial
    tangential_across = n0 * tangential[:, 0] + n1 * tangential[:, 1]
    tangential_along = n0 * tangential[:, 1] - n1 * tangential[:, 0]
    bend = per_radius * per_radial
    distance = (radius - 1.0) * per_radial
    distance += 0.5 * bend * (tangential_across * distance) ** 2
    curvature = tangential_along * tangential_along * bend
    curvature /= np.maximum(1.0 - curvature * distance, _LEAST_CONVERGENCE)
    double_angle = (n0 * n0 - n1 * n1, 2.0 * n0 * n1)
    return RimCoordinates(
        distance, curvature, harmonics(p), radius, radial_across, tangential_across, tangential_along, double_angle
    )


def harmonics(p: RealArray) -> RealArray:
    """Return the harmonic polynomials 1, p1, p2, p1^2 - p2^2, 2 p1 p2 (..., 5, k) of p (..., 2, k)."""
    p0, p1 = p[..., 0, :], p[..., 1, :]
    values = np.empty((*p.shape[:-2], HARMONICS, p.shape[-1]), p.dtype)
    values[..., 0, :] = 1.0
    values[..., 1:3, :] = p
    np.subtract(p0 * p0, p1 * p1, out=values[..., 3, :])
    np.multiply(2.0 * p0, p1, out=values[..., 4, :])
    return values
