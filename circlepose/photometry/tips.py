"""The share of a rim's inside in the level of a pixel near a sharp tip, under Gaussian blur. Many pixels at once.

At the tips of a sliver the radius of curvature b^2/a is far below the blur. A few lines across the rim then miss
the tip, whose width is below their distance, and the ellipse is fitted too short. In the coordinates p the rim is the
unit circle. With the pixel at p = (alpha, beta), the blur is a Gaussian with principal deviations s (along alpha) and
S >= s (along beta), and the share is

    c = integral over u of G(sin u - alpha; s) [Phi((cos u - beta)/S) - Phi((-cos u - beta)/S)] cos u du,

exact across the sliver, and smooth in u up to the tip, u = pi/2. A rim that grows by g(u) adds the integral of the
Gaussian times g along it. The lens is taken as linear over the blur. `blurred_ellipse` uses the same integral in px.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from circlepose._typing import IntArray, RealArray
from circlepose.photometry.gaussian import ROOT_TWO_PI, normal_share

_NODES, _NODE_WEIGHTS = np.polynomial.legendre.leggauss(24)
_REACH_SIGMA = 4.5
_SHARP = 0.2
"""Blur over radius of curvature from which the lines across the rim are too few; below it they err by 1e-4."""
_WIDE, _NARROW = 0.2, 0.1
"""The same of their spread over half the width of a sliver, for pixels on its axis, whose lines run along it; and
blur over semi-minor axis of what is a sliver. With less the quadrature is too coarse for pixels not at a tip."""


@dataclass(frozen=True, slots=True, eq=False)
class Blurred:
    """Pixels in the coordinates p, (n,) each, and what a px across the rim and one along it are there."""

    p: tuple[RealArray, RealArray]
    outwards: tuple[RealArray, RealArray]
    """change of p per px across the rim"""
    sideways: tuple[RealArray, RealArray]
    """change of p per px along the rim"""
    across: RealArray
    """blur across the rim, px"""
    along: RealArray
    """blur along the rim, px"""

    def rows(self, which: IntArray) -> Blurred:
        """Return those of the pixels."""
        (p, outwards, sideways) = ((a[which], b[which]) for a, b in (self.p, self.outwards, self.sideways))
        return Blurred(p, outwards, sideways, self.across[which], self.along[which])


@dataclass(frozen=True, slots=True, eq=False)
class _Principal:
    """The blur's Gaussian in the coordinates p, by its principal axes, (n,) each."""

    large: RealArray
    small: RealArray
    cos: RealArray
    """of the direction of the large one"""
    sin: RealArray
    alpha: RealArray
    """the pixel's place along the small one"""
    beta: RealArray

    @classmethod
    def of(cls, pixels: Blurred) -> _Principal:
        (p0, p1), (v0, v1), (t0, t1) = pixels.p, pixels.outwards, pixels.sideways
        v0, v1, t0, t1 = pixels.across * v0, pixels.across * v1, pixels.along * t0, pixels.along * t1
        xx, xy, yy = v0 * v0 + t0 * t0, v0 * v1 + t0 * t1, v1 * v1 + t1 * t1
        large = np.sqrt(0.5 * (xx + yy) + np.hypot(0.5 * (xx - yy), xy))
        # By the determinant: the difference would lose the digits of a small one.
        small = np.abs(v0 * t1 - v1 * t0) / large
        angle = 0.5 * np.arctan2(2.0 * xy, xx - yy)
        cos, sin = np.cos(angle), np.sin(angle)
        return cls(large, small, cos, sin, cos * p1 - sin * p0, cos * p0 + sin * p1)


def near_tips(pixels: Blurred) -> IntArray:
    """Return the indices of the pixels in reach of a part of the rim that is sharp on the scale of the blur.

    And of those where lines across the rim are spread over the whole width of a sliver.
    """
    blur = _Principal.of(pixels)
    # Towards the tip the rim is sharper.
    place = np.minimum(np.abs(blur.alpha) + _REACH_SIGMA * blur.small, 1.0) ** 2
    squared = place * blur.small**2 + (1.0 - place) * blur.large**2
    is_sharp = (blur.small * blur.large) ** 2 > _SHARP * squared**1.5
    spread = pixels.along**2 * (pixels.sideways[0] ** 2 + pixels.sideways[1] ** 2)
    is_wide = (blur.large > _NARROW) & (spread > _WIDE**2 * (1.0 - blur.alpha**2))
    return np.flatnonzero(is_sharp | is_wide)


def tip_sums(pixels: Blurred) -> RealArray:
    """Return (8, n): the share, its derivatives to the logarithms of both widths, and to the five `rim_modes`."""
    blur = _Principal.of(pixels)
    kind = blur.alpha.dtype
    nodes, weights = _NODES.astype(kind), _NODE_WEIGHTS.astype(kind)
    low, high = (np.arcsin(np.clip(blur.alpha + side * _REACH_SIGMA * blur.small, -1.0, 1.0)) for side in (-1.0, 1.0))
    half = 0.5 * (high - low)
    u = (0.5 * (high + low))[:, None] + half[:, None] * nodes
    c_alpha, width = np.sin(u), np.cos(u)
    small, large = blur.small[:, None], blur.large[:, None]
    density = np.exp(-0.5 * ((c_alpha - blur.alpha[:, None]) / small) ** 2) / (ROOT_TWO_PI * small)
    density *= half[:, None] * weights
    sums = np.zeros((8, len(u)), kind)
    for side in (1.0, -1.0):
        at_end, inside = normal_share((side * width - blur.beta[:, None]) / large)
        sums[0] += side * np.sum(density * width * inside, axis=1)
        sums[1:] += _by_growth(pixels, blur, c_alpha, side * width, density * at_end / large)
    return sums


def _by_growth(
    pixels: Blurred, blur: _Principal, c_alpha: RealArray, c_beta: RealArray, density: RealArray
) -> RealArray:
    """Return (7, n) the derivatives by one side of the rim, at places (n, nodes) with the Gaussian's `density`."""
    cos, sin = blur.cos[:, None], blur.sin[:, None]
    c0, c1 = cos * c_beta - sin * c_alpha, sin * c_beta + cos * c_alpha
    p0, p1 = (each[:, None] for each in pixels.p)
    v0, v1 = (each[:, None] for each in pixels.outwards)
    t0, t1 = (each[:, None] for each in pixels.sideways)
    determinant = v0 * t1 - v1 * t0
    # How far the place is from the pixel, in px across the rim and along it.
    off_v, off_t = (t1 * (c0 - p0) - t0 * (c1 - p1)) / determinant, (v0 * (c1 - p1) - v1 * (c0 - p0)) / determinant
    # The heat equation: wider blur moves light through the rim as the Gaussian's gradient there says.
    wider = (-(v0 * c0 + v1 * c1) * off_v, -(t0 * c0 + t1 * c1) * off_t)
    modes = (1.0, c0, c1, c0 * c0 - c1 * c1, 2.0 * c0 * c1)
    return np.stack([np.sum(density * each, axis=1) for each in (*wider, *modes)])
