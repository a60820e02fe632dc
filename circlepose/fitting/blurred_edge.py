"""The level of pixels near the rim of a viewing cone, seen as a blurred edge, and its derivatives. Many rims at once.

With d the distance to the rim (px, positive outside), kappa the rim's curvature, sigma the blur (the pixel's own box
included) and p = y_12/y_3 the place in the coordinates y = A^-1 x of the cone's factor,

    I = out(p) + (in(p) - out(p)) Phi(z) + w H(z),    z = -(d + sigma^2 kappa/2)/sigma.

`in` and `out` are harmonic polynomials of p: even shading is met exactly, texture in the main. H = He3(z) phi(z)
stands for what blur is beside a Gaussian (the pixel's box, sharpening, focus); being odd about the edge it cannot
move it. These eleven levels are linear, and so eliminated; there remain the five `rim_modes` and sigma.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from circlepose._typing import FloatArray
from circlepose.fitting.band import Bands

LINEAR = 11
_SHAPES = 5
_RIDGE = 1e-9
"""Relative to the mean square of the columns: levels that no pixel tells of stay finite."""
_TIGHTEST = 0.3
"""Least 1 - kappa d: a pixel nearer to the centre of curvature has no foot point to speak of."""


@dataclass(frozen=True, slots=True, eq=False)
class Places:
    """Where k pixels lie about each of m rims."""

    distance_px: FloatArray
    """(m, k) positive outside"""
    curvature: FloatArray
    """(m, k) of the rim at the foot point, 1/px"""
    plane: tuple[FloatArray, FloatArray]
    """p, (m, k) each: the rim is the unit circle"""
    radius: FloatArray
    """(m, k) of p"""
    slope: FloatArray
    """(m, k) change of that radius per px across the rim"""


@dataclass(frozen=True, slots=True, eq=False)
class Levels:
    """The levels that fit best, for given cones and blurs; what is said of pixels has the root of their weight."""

    residual: FloatArray
    """(m, k) model minus measured"""
    slopes: FloatArray
    """(m, 6, k) derivatives to the five modes and the logarithm of sigma, at fixed levels"""
    linear: FloatArray
    """(m, 11, k) derivatives to the levels"""
    model: FloatArray
    """(m, k) the level, whatever the weight"""
    contrast: FloatArray
    """(m,) levels inside minus outside, on average around the rim"""

    @property
    def cost(self) -> FloatArray:
        """(m,) sum of squares of the residual."""
        return np.asarray(np.einsum("mk,mk->m", self.residual, self.residual))

    def made_up(self) -> FloatArray:
        """Return (m, 11, 6) the change of levels that makes up best for each of the slopes."""
        across = self.linear @ self.slopes.transpose(0, 2, 1)
        return np.asarray(np.linalg.solve(_gram(self.linear), across))

    def normal_equations(self) -> tuple[FloatArray, FloatArray]:
        """Return matrix (m, 6, 6) and right side (m, 6) for modes and log sigma, the levels eliminated."""
        matrix = self.slopes @ self.slopes.transpose(0, 2, 1)
        matrix -= (self.slopes @ self.linear.transpose(0, 2, 1)) @ self.made_up()
        # The residual of the best levels is across all columns of `linear`, so it needs no projection.
        return matrix, (self.slopes @ self.residual[..., None])[..., 0]

    def projected_slopes(self) -> FloatArray:
        """Return the slopes (m, 6, k) less what the levels make up for, which is no information."""
        return self.slopes - self.made_up().transpose(0, 2, 1) @ self.linear


def places(bands: Bands, factors: FloatArray) -> Places:
    """Find where the pixels of `bands` lie about the rims of cones with `factors` (m, 3, 3), to second order."""
    inverse = np.linalg.inv(factors)
    (m, k) = bands.levels.shape
    y = inverse @ np.moveaxis(bands.rays, 0, 1)
    yj = (inverse @ np.moveaxis(bands.jacobians, 2, 0).reshape(m, 3, 2 * k)).reshape(m, 3, 2, k)
    per_depth = 1.0 / y[:, 2]
    p0, p1 = y[:, 0] * per_depth, y[:, 1] * per_depth
    # d p / d pixel
    d00, d01 = ((yj[:, 0, j] - p0 * yj[:, 2, j]) * per_depth for j in (0, 1))
    d10, d11 = ((yj[:, 1, j] - p1 * yj[:, 2, j]) * per_depth for j in (0, 1))
    radius = np.sqrt(p0 * p0 + p1 * p1)
    per_radius = 1.0 / np.maximum(radius, 1e-9)
    u0, u1 = p0 * per_radius, p1 * per_radius
    g0, g1 = u0 * d00 + u1 * d10, u0 * d01 + u1 * d11
    slope = np.sqrt(g0 * g0 + g1 * g1)
    n0, n1 = g0 / slope, g1 / slope
    # Across the rim (the normal's image in p) and along it.
    across = u0 * (d10 * n0 + d11 * n1) - u1 * (d00 * n0 + d01 * n1)
    along0, along1 = d01 * n0 - d00 * n1, d11 * n0 - d10 * n1
    distance = (radius - 1.0) / slope
    distance = distance + 0.5 * across * across * per_radius / slope * distance * distance
    curvature = (along0 * along0 + along1 * along1) * per_radius / slope
    curvature = curvature / np.maximum(1.0 - curvature * distance, _TIGHTEST)
    return Places(distance, curvature, (p0, p1), radius, slope)


def fit_levels(bands: Bands, at: Places, sigma_px: FloatArray) -> Levels:
    """Fit the levels of m blurred edges to the pixels of `bands`, `at` their places, with blurs `sigma_px` (m,)."""
    sigma = sigma_px[:, None]
    z = -(at.distance_px / sigma + 0.5 * sigma * at.curvature)
    share = ndtr(z)
    density = np.exp(-0.5 * z * z) * (1.0 / np.sqrt(2.0 * np.pi))
    root = np.sqrt(bands.weight)
    shapes = _shapes(at)
    linear = np.empty((len(z), LINEAR, z.shape[1]))
    linear[:, :_SHAPES] = shapes * (share * root)[:, None]
    linear[:, _SHAPES:-1] = shapes * root[:, None] - linear[:, :_SHAPES]
    odd = (z * z - 3.0) * z * density
    linear[:, -1] = odd * root
    measured = bands.levels * root
    coefficients = np.linalg.solve(_gram(linear), linear @ measured[..., None])[..., 0]
    residual = (coefficients[:, None] @ linear)[:, 0] - measured
    step = ((coefficients[:, None, :_SHAPES] - coefficients[:, None, _SHAPES:-1]) @ shapes)[:, 0]
    # d level / d z
    z2 = z * z
    by_z = (step + coefficients[:, -1:] * ((6.0 - z2) * z2 - 3.0)) * density
    slopes = np.empty((len(z), 6, z.shape[1]))
    by_growth = by_z * root / (sigma * at.slope)
    slopes[:, 0] = by_growth * at.radius
    slopes[:, 1:5] = shapes[:, 1:] * (by_growth / np.maximum(at.radius, 1e-9))[:, None]
    slopes[:, 5] = by_z * root * (at.distance_px / sigma - 0.5 * sigma * at.curvature)
    inside, outside = coefficients[:, None, :_SHAPES] @ shapes, coefficients[:, None, _SHAPES:-1] @ shapes
    model = inside[:, 0] * share + outside[:, 0] * (1.0 - share) + coefficients[:, -1:] * odd
    return Levels(residual, slopes, linear, model, coefficients[:, 0] - coefficients[:, _SHAPES])


def _gram(linear: FloatArray) -> FloatArray:
    gram = linear @ linear.transpose(0, 2, 1)
    ridge = _RIDGE * np.trace(gram, axis1=1, axis2=2) / LINEAR + 1e-30
    return np.asarray(gram + ridge[:, None, None] * np.eye(LINEAR))


def _shapes(at: Places) -> FloatArray:
    """Return the harmonic polynomials (m, 5, k) of p up to second order."""
    p0, p1 = at.plane
    return np.stack([np.ones_like(p0), p0, p1, p0 * p0 - p1 * p1, 2.0 * p0 * p1], axis=1)
