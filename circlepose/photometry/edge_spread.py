"""The edge spread function of rims: the blurred coverage of each pixel by the inside of a rim. Many rims at once.

The coverage c of a pixel is the integral over the inside of the rim of a Gaussian around the pixel. Two formulas,
which agree where the rim is nearly straight on the scale of the blur:

- `straight_edge_spread`: c = Phi(-(d + tau^2 kappa / 2) / sigma), with the distance d (px) from the rim, its
  curvature kappa (1/px), and the blurs sigma across and tau along the rim (px). The error is of order
  (sigma kappa)^2.
- `curved_edge_spread`: c = sum over i of w_i [Phi(s_i+ / sigma) - Phi(s_i- / sigma)], with Gauss-Hermite nodes i
  along the rim and s_i the intersections of the line across the rim with it (px). The lens is linear over a few px.
  For elongated and small discs; sharp tips use `tips`.

The blur may be anisotropic (demosaicking, sharpening along rows, motion): with theta the direction across the rim in
the image, its variance is sigma^2 (1 + alpha cos 2 theta + beta sin 2 theta). Its parameters are log sigma (sigma in
px), alpha and beta. On a small disc anisotropic blur looks like a tilt.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from circlepose._numerics import ROOT_TWO_PI, normal_pdf_cdf
from circlepose._typing import FloatArray, RealArray
from circlepose.geometry.cone_perturbation import MODES
from circlepose.photometry.rim_coordinates import RimCoordinates
from circlepose.photometry.tips import BlurredPixels, near_tips, tip_sums

BLUR = 3
"""Parameters of the blur."""
_MOST_ANISOTROPY = 0.7
"""Bound of the anisotropy at a pixel, so that both variances stay positive."""
_SUMS = 3 + MODES
"""The coverage, its derivatives to the logarithms of both blurs, and to the modes."""
_FAR_SIGMAS = 5.0
"""Blurs from which the opposite side of the rim does not contribute: Phi(-5) = 3e-7."""
_SMALL_SHARE = 0.5
"""Share of pixels below which a sum over a selection is faster than one over all."""
_NODES, _NODE_WEIGHTS = np.polynomial.hermite_e.hermegauss(5)
_NODE_WEIGHTS = _NODE_WEIGHTS / ROOT_TWO_PI


@dataclass(frozen=True, slots=True, eq=False)
class BlurWidths:
    """The blur across and along the rim at each pixel: sigma^2 (1 + e) and sigma^2 (1 - e), e the anisotropy."""

    across: RealArray
    """(m, k) px"""
    along: RealArray
    """(m, k) px"""
    anisotropy: RealArray
    """(m, k)"""
    double_angle: tuple[RealArray, RealArray]
    """see `RimCoordinates`"""

    @classmethod
    def of(cls, coordinates: RimCoordinates, blur: FloatArray) -> BlurWidths:
        """Return those of blurs (m, 3) at the pixels."""
        kind = coordinates.distance_px.dtype
        log_sigma, alpha, beta = (blur[:, i, None].astype(kind) for i in range(BLUR))
        cos, sin = coordinates.double_angle
        anisotropy = np.clip(alpha * cos + beta * sin, -_MOST_ANISOTROPY, _MOST_ANISOTROPY)
        sigma = np.exp(log_sigma)
        across, along = sigma * np.sqrt(1.0 + anisotropy), sigma * np.sqrt(1.0 - anisotropy)
        return cls(across, along, anisotropy, coordinates.double_angle)

    def fill(self, derivatives: RealArray, by_across: RealArray, by_along: RealArray) -> None:
        """Write the `derivatives` to the blur's parameters, from those to the logarithms of both widths."""
        by_anisotropy = 0.5 * (by_across / (1.0 + self.anisotropy) - by_along / (1.0 - self.anisotropy))
        derivatives[:, MODES] = by_across + by_along
        derivatives[:, MODES + 1] = by_anisotropy * self.double_angle[0]
        derivatives[:, MODES + 2] = by_anisotropy * self.double_angle[1]


@dataclass(frozen=True, slots=True, eq=False)
class EdgeSpread:
    """The coverage of k pixels around each of m rims, and its derivatives."""

    coverage: RealArray
    """(m, k) from 0 to 1"""
    derivatives: RealArray
    """(m, 8, k) to the coefficients of the five modes (`cone_perturbation`) and the three parameters of the blur"""
    z: RealArray
    """(m, k) distance from the blurred edge, positive inside, in blurs across the rim"""
    straight_coverage: RealArray
    """(m, k) Phi(z)"""
    widths: BlurWidths


EdgeSpreadFunction = Callable[[RimCoordinates, FloatArray], EdgeSpread]


def straight_edge_spread(coordinates: RimCoordinates, blur: FloatArray) -> EdgeSpread:
    """Return the edge spread of nearly straight rims.

    Parameters
    ----------
    coordinates
        Those of k pixels around each of m rims.
    blur
        (m, 3) log sigma (px), alpha, beta; see the module.
    """
    widths = BlurWidths.of(coordinates, blur)
    shift = 0.5 * coordinates.curvature * widths.along**2
    z = -(coordinates.distance_px + shift) / widths.across
    density, coverage = normal_pdf_cdf(z)
    by_growth = density / (widths.across * coordinates.radial_across)
    derivatives = np.empty((len(z), MODES + BLUR, z.shape[1]), z.dtype)
    np.multiply(by_growth, coordinates.radius, out=derivatives[:, 0])
    by_growth /= np.maximum(coordinates.radius, 1e-9)
    np.multiply(coordinates.harmonics[:, 1:], by_growth[:, None], out=derivatives[:, 1:MODES])
    widths.fill(derivatives, -density * z, density * (-2.0 * shift / widths.across))
    return EdgeSpread(coverage, derivatives, z, coverage, widths)


def curved_edge_spread(coordinates: RimCoordinates, blur: FloatArray) -> EdgeSpread:
    """Return the edge spread of rims of any curvature; parameters as of `straight_edge_spread`."""
    widths = BlurWidths.of(coordinates, blur)
    shape, kind = coordinates.distance_px.shape, coordinates.distance_px.dtype
    sums = np.zeros((_SUMS, *shape), kind)
    flat_sums = sums.reshape(_SUMS, -1)
    p0, p1 = coordinates.plane
    radial, tangential, along = (
        coordinates.radial_across,
        coordinates.tangential_across,
        coordinates.tangential_along,
    )
    per_radius = 1.0 / np.maximum(coordinates.radius, 1e-9)
    u0, u1 = p0 * per_radius, p1 * per_radius
    # dp per px across the rim, outwards, and along it.
    v0, v1 = radial * u0 - tangential * u1, radial * u1 + tangential * u0
    t0, t1 = -along * u1, along * u0
    flat = [each.ravel() for each in (p0, p1, v0, v1, t0, t1, v0 * v0 + v1 * v1, widths.across, widths.along)]
    for node, weight in zip(_NODES.tolist(), _NODE_WEIGHTS.tolist(), strict=True):
        for sign in (1.0, -1.0):
            _add_end(flat_sums, flat, node, weight, sign)
    pixels = BlurredPixels((flat[0], flat[1]), (flat[2], flat[3]), (flat[4], flat[5]), flat[7], flat[8])
    tips = near_tips(pixels)
    if len(tips):
        flat_sums[:, tips] = tip_sums(pixels.rows(tips))
    derivatives = np.empty((shape[0], MODES + BLUR, shape[1]), kind)
    derivatives[:, :MODES] = np.moveaxis(sums[3:], 0, 1)
    coverage, by_across, by_along = sums[:3]
    widths.fill(derivatives, by_across, by_along)
    z = -(coordinates.distance_px + 0.5 * coordinates.curvature * widths.along**2) / widths.across
    return EdgeSpread(coverage, derivatives, z, normal_pdf_cdf(z)[1], widths)


def _add_end(sums: RealArray, flat: Sequence[RealArray], node: float, weight: float, sign: float) -> None:
    """Add the outer (`sign` 1) or inner end of one line through each pixel to the sums of `curved_edge_spread`."""
    p0, p1, v0, v1, t0, t1, vv, across, along = flat
    step = node * along
    q0, q1 = p0 + step * t0, p1 + step * t1
    qv = (q0 * v0 + q1 * v1) / vv
    under_root = qv * qv - (q0 * q0 + q1 * q1 - 1.0) / vv
    root = sign * np.sqrt(np.maximum(under_root, 1e-12))
    s = root - qv
    at_end = s / across
    if sign < 0.0:
        # Across a large disc the opposite side of the rim is too far to contribute.
        near = np.flatnonzero(at_end > -_FAR_SIGMAS)
        if len(near) == 0:
            return
        if len(near) < _SMALL_SHARE * len(at_end):
            some = np.zeros((len(sums), len(near)), sums.dtype)
            _add_end(some, [each[near] for each in flat], node, weight, sign)
            sums[:, near] += some
            return
    c0, c1 = q0 + s * v0, q1 + s * v1
    density, inside = normal_pdf_cdf(at_end)
    density *= sign * weight
    # Both ends of a line that misses the rim coincide.
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
