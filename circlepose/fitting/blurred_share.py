"""How much of a rim's inside is in the level of a pixel near it, under Gaussian blur. Many rims at once.

Two ways, which agree where the rim is nearly straight on the scale of the blur:

- `straight`: Phi(-(d + tau^2 kappa/2)/sigma), d the distance to the rim, kappa its curvature, sigma and tau the blur
  across and along it; an error of order (sigma kappa)^2.
- `curved`: along lines across the rim, spread like the blur, the stretch inside is exact; in the sum over them only
  the lens is taken as linear, over a few px. For tips and small discs.

The blur need not be the same in all directions (demosaicking, sharpening along rows, motion): with theta the
direction across the rim in the image its variance is sigma^2 (1 + alpha cos 2 theta + beta sin 2 theta), its
parameters log sigma, alpha and beta. On a small disc unequal blur looks like a tilt.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from circlepose._typing import FloatArray, RealArray
from circlepose.fitting.band import Bands
from circlepose.rim_modes import MODES

_TIGHTEST = 0.3
"""Least 1 - kappa d: a pixel nearer to the centre of curvature has no foot point to speak of."""
BLUR = 3
_MOST_BEND = 0.7
_ROOT_TWO_PI = float(np.sqrt(2.0 * np.pi))
_TAIL_SCALE = 0.2316419
_TAIL = (1.330274429, -1.821255978, 1.781477937, -0.356563782, 0.319381530)
_SUMS = 3 + MODES
"""The share, its derivatives to the logarithms of both widths, and to the modes."""
_FAR_SIGMAS = 5.0
_FEW = 0.5
_LINES, _LINE_WEIGHTS = np.polynomial.hermite_e.hermegauss(5)
_LINE_WEIGHTS = _LINE_WEIGHTS / _ROOT_TWO_PI


@dataclass(frozen=True, slots=True, eq=False)
class Places:
    """Where k pixels lie about each of m rims, in the coordinates y = A^-1 x of the cone's factor."""

    distance_px: RealArray
    """(m, k) positive outside, to second order"""
    curvature: RealArray
    """(m, k) of the rim at the foot point, 1/px"""
    plane: tuple[RealArray, RealArray]
    """p = y_12/y_3, (m, k) each: the rim is the unit circle"""
    radius: RealArray
    """(m, k) of p"""
    across: tuple[RealArray, RealArray]
    """d p / d px across the rim, outwards"""
    along: tuple[RealArray, RealArray]
    """d p / d px along the rim"""
    slope: RealArray
    """(m, k) change of the radius of p per px across the rim"""
    doubled: tuple[RealArray, RealArray]
    """cosine and sine, (m, k) each, of twice the direction across the rim in the image"""


@dataclass(frozen=True, slots=True, eq=False)
class Widths:
    """The blur across and along the rim at each pixel: sigma^2 (1 + bend) and sigma^2 (1 - bend)."""

    across: RealArray
    """(m, k) px"""
    along: RealArray
    """(m, k) px"""
    bend: RealArray
    """(m, k)"""
    doubled: tuple[RealArray, RealArray]

    def fill(self, by_parameters: RealArray, by_across: RealArray, by_along: RealArray) -> None:
        """Write the derivatives to the blur's parameters, from those to the logarithms of both widths."""
        by_bend = 0.5 * (by_across / (1.0 + self.bend) - by_along / (1.0 - self.bend))
        by_parameters[:, MODES] = by_across + by_along
        by_parameters[:, MODES + 1] = by_bend * self.doubled[0]
        by_parameters[:, MODES + 2] = by_bend * self.doubled[1]


@dataclass(frozen=True, slots=True, eq=False)
class Share:
    """The share of the inside in the level of k pixels about each of m rims, and its derivatives."""

    share: RealArray
    """(m, k) 0 to 1"""
    by_parameters: RealArray
    """(m, 8, k) to the five `rim_modes` and the three of the blur"""
    z: RealArray
    """(m, k) distance from the blurred edge inwards, in sigmas"""
    straight: RealArray
    """(m, k) Phi(z)"""
    widths: Widths


def places(bands: Bands, factors: FloatArray) -> Places:
    """Find where the pixels of `bands` lie about the rims of cones with `factors` (m, 3, 3)."""
    m, k = bands.levels.shape
    inverse = np.linalg.inv(factors).astype(bands.rays.dtype)
    local = (inverse @ bands.rays.reshape(m, 3, 3 * k)).reshape(m, 3, 3, k)
    per_depth = 1.0 / local[:, 2, 0]
    p = local[:, :2, 0] * per_depth[:, None]
    # d p / d x and d p / d y of the pixel
    by_x, by_y = ((local[:, :2, j] - p * local[:, 2:, j]) * per_depth[:, None] for j in (1, 2))
    p0, p1 = p[:, 0], p[:, 1]
    radius = np.sqrt(p0 * p0 + p1 * p1)
    per_radius = 1.0 / np.maximum(radius, 1e-9)
    u0, u1 = p0 * per_radius, p1 * per_radius
    g0, g1 = u0 * by_x[:, 0] + u1 * by_x[:, 1], u0 * by_y[:, 0] + u1 * by_y[:, 1]
    slope = np.maximum(np.sqrt(g0 * g0 + g1 * g1), 1e-12)
    per_slope = 1.0 / slope
    n0, n1 = g0 * per_slope, g1 * per_slope
    across = by_x * n0[:, None] + by_y * n1[:, None]
    along = by_y * n0[:, None] - by_x * n1[:, None]
    sideways = u0 * across[:, 1] - u1 * across[:, 0]
    bend = per_radius * per_slope
    distance = (radius - 1.0) * per_slope
    distance += 0.5 * bend * (sideways * distance) ** 2
    curvature = (along[:, 0] ** 2 + along[:, 1] ** 2) * bend
    curvature /= np.maximum(1.0 - curvature * distance, _TIGHTEST)
    doubled = (n0 * n0 - n1 * n1, 2.0 * n0 * n1)
    return Places(
        distance,
        curvature,
        (p0, p1),
        radius,
        (across[:, 0], across[:, 1]),
        (along[:, 0], along[:, 1]),
        slope,
        doubled,
    )


def straight(at: Places, blur: FloatArray) -> Share:
    """Return the shares of pixels `at` their places with `blur` (m, 3), for rims of little curvature."""
    widths = _widths(at, blur)
    shift = 0.5 * at.curvature * widths.along**2
    z = -(at.distance_px + shift) / widths.across
    density, share = normal_share(z)
    by_growth = density / (widths.across * at.slope)
    p0, p1 = at.plane
    per_radius = by_growth / np.maximum(at.radius, 1e-9)
    by_parameters = np.empty((len(z), MODES + BLUR, z.shape[1]), z.dtype)
    by_parameters[:, 0] = by_growth * at.radius
    by_parameters[:, 1], by_parameters[:, 2] = p0 * per_radius, p1 * per_radius
    by_parameters[:, 3], by_parameters[:, 4] = (p0 * p0 - p1 * p1) * per_radius, 2.0 * p0 * p1 * per_radius
    widths.fill(by_parameters, -density * z, density * (-2.0 * shift / widths.across))
    return Share(share, by_parameters, z, share, widths)


def curved(at: Places, blur: FloatArray) -> Share:
    """As `straight`, for any curvature."""
    widths = _widths(at, blur)
    shape, kind = at.distance_px.shape, at.distance_px.dtype
    vv = at.across[0] ** 2 + at.across[1] ** 2
    sums = np.zeros((_SUMS, *shape), kind)
    flat = [each.ravel() for each in (*at.plane, *at.across, *at.along, vv, widths.across, widths.along)]
    for line, weight in zip(_LINES.tolist(), _LINE_WEIGHTS.tolist(), strict=True):
        for sign in (1.0, -1.0):
            _add_end(sums.reshape(_SUMS, -1), flat, line, weight, sign)
    by_parameters = np.empty((shape[0], MODES + BLUR, shape[1]), kind)
    by_parameters[:, :MODES] = np.moveaxis(sums[3:], 0, 1)
    share, by_across, by_along = sums[:3]
    widths.fill(by_parameters, by_across, by_along)
    z = -(at.distance_px + 0.5 * at.curvature * widths.along**2) / widths.across
    return Share(share, by_parameters, z, normal_share(z)[1], widths)


def _add_end(sums: RealArray, flat: Sequence[RealArray], line: float, weight: float, sign: float) -> None:
    """Add the ends of one line through each pixel, those outwards (`sign` 1) or inwards, to the sums of `curved`."""
    p0, p1, v0, v1, t0, t1, vv, across, along = flat
    step = line * along
    q0, q1 = p0 + step * t0, p1 + step * t1
    qv = (q0 * v0 + q1 * v1) / vv
    under_root = qv * qv - (q0 * q0 + q1 * q1 - 1.0) / vv
    root = sign * np.sqrt(np.maximum(under_root, 1e-12))
    s = root - qv
    at_end = s / across
    if sign < 0.0:
        # Across a disc that is not small the other side of the rim is far off: there is next to none of it.
        near = np.flatnonzero(at_end > -_FAR_SIGMAS)
        if len(near) == 0:
            return
        if len(near) < _FEW * len(at_end):
            some = np.zeros((len(sums), len(near)), sums.dtype)
            _add_end(some, [each[near] for each in flat], line, weight, sign)
            sums[:, near] += some
            return
    c0, c1 = q0 + s * v0, q1 + s * v1
    density, inside = normal_share(at_end)
    density *= sign * weight
    # A line that misses the rim has both ends in one place.
    density *= under_root > 1e-12
    moved = density / (across * root * vv)
    sums[0] += (sign * weight) * inside
    sums[1] -= density * at_end
    sums[2] -= moved * step * (c0 * t0 + c1 * t1)
    sums[3] += moved
    sums[4] += moved * c0
    sums[5] += moved * c1
    sums[6] += moved * (c0 * c0 - c1 * c1)
    sums[7] += moved * (2.0 * c0 * c1)


def normal_share(z: RealArray) -> tuple[RealArray, RealArray]:
    """Return the density of the normal distribution and its share below z, to 1e-7.

    That is as good as float32 holds, and three times faster than `scipy.special.ndtr` (Abramowitz & Stegun 26.2.17).
    """
    density = np.exp(-0.5 * z * z)
    density *= 1.0 / _ROOT_TWO_PI
    t = 1.0 / (1.0 + _TAIL_SCALE * np.abs(z))
    tail = t * _TAIL[0]
    for coefficient in _TAIL[1:]:
        tail += coefficient
        tail *= t
    tail *= density
    return density, 0.5 + np.copysign(0.5 - tail, z)


def _widths(at: Places, blur: FloatArray) -> Widths:
    log_sigma, alpha, beta = (blur[:, i, None].astype(at.distance_px.dtype) for i in range(BLUR))
    cos, sin = at.doubled
    bend = np.clip(alpha * cos + beta * sin, -_MOST_BEND, _MOST_BEND)
    sigma = np.exp(log_sigma)
    return Widths(sigma * np.sqrt(1.0 + bend), sigma * np.sqrt(1.0 - bend), bend, at.doubled)
