"""How much of a rim's inside is in the level of a pixel near it, under Gaussian blur. Many rims at once.

Two ways, which agree where the rim is nearly straight on the scale of the blur:

- `straight`: Phi(-(d + tau^2 kappa/2)/sigma), d the distance to the rim, kappa its curvature, sigma and tau the blur
  across and along it; an error of order (sigma kappa)^2.
- `curved`: along lines across the rim, spread like the blur, the stretch inside is exact; in the sum over them only
  the lens is taken as linear, over a few px. For elongated and small discs; at sharp tips as `blurred_tip` has it.

The blur need not be the same in all directions (demosaicking, sharpening along rows, motion): with theta the
direction across the rim in the image its variance is sigma^2 (1 + alpha cos 2 theta + beta sin 2 theta), its
parameters log sigma, alpha and beta. On a small disc unequal blur looks like a tilt.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from circlepose._typing import FloatArray, RealArray
from circlepose.geometry.cone_perturbation import MODES
from circlepose.photometry.gaussian import ROOT_TWO_PI, normal_share
from circlepose.photometry.pixel_band import Bands
from circlepose.photometry.tips import Blurred, near_tips, tip_sums

_TIGHTEST = 0.3
"""Least 1 - kappa d: a pixel nearer to the centre of curvature has no foot point to speak of."""
BLUR = 3
SHAPES = 5
_MOST_BEND = 0.7
_SUMS = 3 + MODES
"""The share, its derivatives to the logarithms of both widths, and to the modes."""
_FAR_SIGMAS = 5.0
_FEW = 0.5
_LINES, _LINE_WEIGHTS = np.polynomial.hermite_e.hermegauss(5)
_LINE_WEIGHTS = _LINE_WEIGHTS / ROOT_TWO_PI


@dataclass(frozen=True, slots=True, eq=False)
class Places:
    """Where k pixels lie about each of m rims, in the coordinates y = A^-1 x of the cone's factor."""

    distance_px: RealArray
    """(m, k) positive outside, to second order"""
    curvature: RealArray
    """(m, k) of the rim at the foot point, 1/px"""
    shapes: RealArray
    """(m, 5, k) `harmonics` of p = y_12/y_3: the rim is the unit circle"""
    radius: RealArray
    """(m, k) of p"""
    slope: RealArray
    """(m, k) change of p per px across the rim, outwards: of its radius"""
    sideways: RealArray
    """(m, k) and that around the circle"""
    turning: RealArray
    """(m, k) change of p per px along the rim: around the circle alone"""
    doubled: tuple[RealArray, RealArray]
    """cosine and sine, (m, k) each, of twice the direction across the rim in the image"""

    @property
    def plane(self) -> tuple[RealArray, RealArray]:
        """The two components of p, (m, k) each."""
        return self.shapes[:, 1], self.shapes[:, 2]


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
    # d p / d pixel: (m, component, x or y, k)
    by_pixel = p[:, :, None] * local[:, 2:, 1:]
    np.subtract(local[:, :2, 1:], by_pixel, out=by_pixel)
    by_pixel *= per_depth[:, None, None]
    radius = np.sqrt(p[:, 0] * p[:, 0] + p[:, 1] * p[:, 1])
    per_radius = 1.0 / np.maximum(radius, 1e-9)
    u0, u1 = p[:, 0] * per_radius, p[:, 1] * per_radius
    # Its parts outwards and around the circle, (m, x or y, k) each.
    outwards = u0[:, None] * by_pixel[:, 0] + u1[:, None] * by_pixel[:, 1]
    around = u0[:, None] * by_pixel[:, 1] - u1[:, None] * by_pixel[:, 0]
    slope = np.maximum(np.sqrt(outwards[:, 0] * outwards[:, 0] + outwards[:, 1] * outwards[:, 1]), 1e-12)
    per_slope = 1.0 / slope
    n0, n1 = outwards[:, 0] * per_slope, outwards[:, 1] * per_slope
    sideways = n0 * around[:, 0] + n1 * around[:, 1]
    turning = n0 * around[:, 1] - n1 * around[:, 0]
    bend = per_radius * per_slope
    distance = (radius - 1.0) * per_slope
    distance += 0.5 * bend * (sideways * distance) ** 2
    curvature = turning * turning * bend
    curvature /= np.maximum(1.0 - curvature * distance, _TIGHTEST)
    doubled = (n0 * n0 - n1 * n1, 2.0 * n0 * n1)
    return Places(distance, curvature, harmonics(p), radius, slope, sideways, turning, doubled)


def straight(at: Places, blur: FloatArray) -> Share:
    """Return the shares of pixels `at` their places with `blur` (m, 3), for rims of little curvature."""
    widths = _widths(at, blur)
    shift = 0.5 * at.curvature * widths.along**2
    z = -(at.distance_px + shift) / widths.across
    density, share = normal_share(z)
    by_growth = density / (widths.across * at.slope)
    by_parameters = np.empty((len(z), MODES + BLUR, z.shape[1]), z.dtype)
    np.multiply(by_growth, at.radius, out=by_parameters[:, 0])
    by_growth /= np.maximum(at.radius, 1e-9)
    np.multiply(at.shapes[:, 1:], by_growth[:, None], out=by_parameters[:, 1:MODES])
    widths.fill(by_parameters, -density * z, density * (-2.0 * shift / widths.across))
    return Share(share, by_parameters, z, share, widths)


def curved(at: Places, blur: FloatArray) -> Share:
    """As `straight`, for any curvature."""
    widths = _widths(at, blur)
    shape, kind = at.distance_px.shape, at.distance_px.dtype
    sums = np.zeros((_SUMS, *shape), kind)
    flat_sums = sums.reshape(_SUMS, -1)
    p0, p1 = at.plane
    per_radius = 1.0 / np.maximum(at.radius, 1e-9)
    u0, u1 = p0 * per_radius, p1 * per_radius
    # d p / d px across the rim, outwards, and along it.
    v0, v1 = at.slope * u0 - at.sideways * u1, at.slope * u1 + at.sideways * u0
    t0, t1 = -at.turning * u1, at.turning * u0
    flat = [each.ravel() for each in (p0, p1, v0, v1, t0, t1, v0 * v0 + v1 * v1, widths.across, widths.along)]
    for line, weight in zip(_LINES.tolist(), _LINE_WEIGHTS.tolist(), strict=True):
        for sign in (1.0, -1.0):
            _add_end(flat_sums, flat, line, weight, sign)
    pixels = Blurred((flat[0], flat[1]), (flat[2], flat[3]), (flat[4], flat[5]), flat[7], flat[8])
    tips = near_tips(pixels)
    if len(tips):
        flat_sums[:, tips] = tip_sums(pixels.rows(tips))
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


def harmonics(p: RealArray) -> RealArray:
    """Return the harmonic polynomials (..., 5, k) up to second order of places p (..., 2, k)."""
    p0, p1 = p[..., 0, :], p[..., 1, :]
    shapes = np.empty((*p.shape[:-2], SHAPES, p.shape[-1]), p.dtype)
    shapes[..., 0, :] = 1.0
    shapes[..., 1:3, :] = p
    np.subtract(p0 * p0, p1 * p1, out=shapes[..., 3, :])
    np.multiply(2.0 * p0, p1, out=shapes[..., 4, :])
    return shapes


def _widths(at: Places, blur: FloatArray) -> Widths:
    log_sigma, alpha, beta = (blur[:, i, None].astype(at.distance_px.dtype) for i in range(BLUR))
    cos, sin = at.doubled
    bend = np.clip(alpha * cos + beta * sin, -_MOST_BEND, _MOST_BEND)
    sigma = np.exp(log_sigma)
    return Widths(sigma * np.sqrt(1.0 + bend), sigma * np.sqrt(1.0 - bend), bend, at.doubled)
