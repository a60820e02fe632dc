"""The coverage of pixels near sharp tips of a rim, under Gaussian blur. Many pixels at once.

At the tips of a sliver the radius of curvature b^2/a is far below the blur. The tip is then narrower than the
distance of the lines of `curved_edge_spread`, and the fitted ellipse would be too short. In the coordinates p the rim
is the unit circle. With the pixel at p = (alpha, beta), the blur is a Gaussian with principal deviations s (along
alpha) and S >= s (along beta), all without unit, and the coverage is

    c = integral over u of G(sin u - alpha; s) [Phi((cos u - beta)/S) - Phi((-cos u - beta)/S)] cos u du,

which is exact across the sliver and smooth in u up to the tip, u = pi/2. If the rim grows by g(u), the coverage grows
by the integral of the Gaussian times g along the rim. The lens is linear over the blur. `thin.model` has the same
integral in px.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from circlepose._numerics import ROOT_TWO_PI, normal_pdf_cdf
from circlepose._typing import IntArray, RealArray

_NODES, _NODE_WEIGHTS = np.polynomial.legendre.leggauss(24)
_HALF_WIDTH_SIGMAS = 4.5
"""Half-width of the integral, in blurs: what is outside is below 1e-5."""
_SHARP = 0.2
"""Blur over radius of curvature from which this integral is used; below, five lines across the rim err by 1e-4."""
_WIDE = 0.2
"""Spread of the lines over the half-width of a sliver from which this integral is used: pixels on its axis have lines
along it."""
_NARROW = 0.1
"""Blur over semi-minor axis from which a rim is a sliver. Below, the quadrature is too coarse away from a tip."""


@dataclass(frozen=True, slots=True, eq=False)
class BlurredPixels:
    """Pixels in the coordinates p, (n,) each, with the derivatives of p across and along the rim."""

    p: tuple[RealArray, RealArray]
    outwards: tuple[RealArray, RealArray]
    """change of p per px across the rim"""
    sideways: tuple[RealArray, RealArray]
    """change of p per px along the rim"""
    across: RealArray
    """blur across the rim, px"""
    along: RealArray
    """blur along the rim, px"""

    def rows(self, which: IntArray) -> BlurredPixels:
        """Return the pixels `which` (n,)."""
        (p, outwards, sideways) = ((a[which], b[which]) for a, b in (self.p, self.outwards, self.sideways))
        return BlurredPixels(p, outwards, sideways, self.across[which], self.along[which])


@dataclass(frozen=True, slots=True, eq=False)
class _Principal:
    """The blur's Gaussian in the coordinates p, along its principal axes, (n,) each."""

    large: RealArray
    """standard deviation S"""
    small: RealArray
    """standard deviation s"""
    cos: RealArray
    """of the direction of the large axis"""
    sin: RealArray
    alpha: RealArray
    """the pixel's coordinate along the small axis"""
    beta: RealArray
    """the pixel's coordinate along the large axis"""

    @classmethod
    def of(cls, pixels: BlurredPixels) -> _Principal:
        (p0, p1), (v0, v1), (t0, t1) = pixels.p, pixels.outwards, pixels.sideways
        v0, v1, t0, t1 = pixels.across * v0, pixels.across * v1, pixels.along * t0, pixels.along * t1
        xx, xy, yy = v0 * v0 + t0 * t0, v0 * v1 + t0 * t1, v1 * v1 + t1 * t1
        large = np.sqrt(0.5 * (xx + yy) + np.hypot(0.5 * (xx - yy), xy))
        # From the determinant: a difference would lose the digits of a small value.
        small = np.abs(v0 * t1 - v1 * t0) / large
        angle = 0.5 * np.arctan2(2.0 * xy, xx - yy)
        cos, sin = np.cos(angle), np.sin(angle)
        return cls(large, small, cos, sin, cos * p1 - sin * p0, cos * p0 + sin * p1)


def near_tips(pixels: BlurredPixels) -> IntArray:
    """Return the indices of the pixels that need `tip_sums`.

    These are the pixels near a part of the rim that is sharp on the scale of the blur, and those where the lines
    across the rim spread over the whole width of a sliver.
    """
    blur = _Principal.of(pixels)
    # The curvature is evaluated at the end of the integral that is closer to the tip.
    place = np.minimum(np.abs(blur.alpha) + _HALF_WIDTH_SIGMAS * blur.small, 1.0) ** 2
    squared = place * blur.small**2 + (1.0 - place) * blur.large**2
    is_sharp = (blur.small * blur.large) ** 2 > _SHARP * squared**1.5
    spread = pixels.along**2 * (pixels.sideways[0] ** 2 + pixels.sideways[1] ** 2)
    is_wide = (blur.large > _NARROW) & (spread > _WIDE**2 * (1.0 - blur.alpha**2))
    return np.flatnonzero(is_sharp | is_wide)


def tip_sums(pixels: BlurredPixels) -> RealArray:
    """Return (8, n): the coverage, its derivatives to the logarithms of both blurs, and those to the five modes."""
    blur = _Principal.of(pixels)
    kind = blur.alpha.dtype
    nodes, weights = _NODES.astype(kind), _NODE_WEIGHTS.astype(kind)
    low, high = (
        np.arcsin(np.clip(blur.alpha + side * _HALF_WIDTH_SIGMAS * blur.small, -1.0, 1.0)) for side in (-1.0, 1.0)
    )
    half = 0.5 * (high - low)
    u = (0.5 * (high + low))[:, None] + half[:, None] * nodes
    c_alpha, width = np.sin(u), np.cos(u)
    small, large = blur.small[:, None], blur.large[:, None]
    density = np.exp(-0.5 * ((c_alpha - blur.alpha[:, None]) / small) ** 2) / (ROOT_TWO_PI * small)
    density *= half[:, None] * weights
    sums = np.zeros((8, len(u)), kind)
    for side in (1.0, -1.0):
        at_end, inside = normal_pdf_cdf((side * width - blur.beta[:, None]) / large)
        sums[0] += side * np.sum(density * width * inside, axis=1)
        sums[1:] += _by_growth(pixels, blur, c_alpha, side * width, density * at_end / large)
    return sums


def _by_growth(
    pixels: BlurredPixels, blur: _Principal, c_alpha: RealArray, c_beta: RealArray, density: RealArray
) -> RealArray:
    """Return (7, n) the derivatives from one side of the rim, at nodes (n, nodes) with the Gaussian's `density`."""
    cos, sin = blur.cos[:, None], blur.sin[:, None]
    c0, c1 = cos * c_beta - sin * c_alpha, sin * c_beta + cos * c_alpha
    p0, p1 = (each[:, None] for each in pixels.p)
    v0, v1 = (each[:, None] for each in pixels.outwards)
    t0, t1 = (each[:, None] for each in pixels.sideways)
    determinant = v0 * t1 - v1 * t0
    # Offset of the node from the pixel, in px across and along the rim.
    offset_v = (t1 * (c0 - p0) - t0 * (c1 - p1)) / determinant
    offset_t = (v0 * (c1 - p1) - v1 * (c0 - p0)) / determinant
    # Heat equation: with growing blur, light flows through the rim in proportion to the Gaussian's gradient there.
    wider = (-(v0 * c0 + v1 * c1) * offset_v, -(t0 * c0 + t1 * c1) * offset_t)
    modes = (1.0, c0, c1, c0 * c0 - c1 * c1, 2.0 * c0 * c1)
    return np.stack([np.sum(density * each, axis=1) for each in (*wider, *modes)])
