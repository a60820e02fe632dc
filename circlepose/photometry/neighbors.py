"""The levels that neighboring rims add around a rim: discs that nearly touch, a ring around a disc.

A rim with the contrast C (levels) and the blur sigma (px) adds C Phi(-(d / sigma + sigma kappa / 2)) at the distance
d (px) from it, with its mean curvature kappa = (a b)^(-1/2).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from circlepose._numerics import normal_pdf_cdf
from circlepose._typing import BoolArray, FloatArray, IntArray
from circlepose.geometry.ellipse import Ellipse, rim_distance
from circlepose.photometry.options import DEFAULT, PhotometryOptions

_AT_ONCE = 64
"""Rims whose pairs are formed together, which bounds memory."""


def neighbor_intensity(
    pixels: FloatArray,
    rims: IntArray,
    ellipses: Sequence[Ellipse],
    sigma_px: FloatArray,
    contrast: FloatArray,
    half_width_px: FloatArray,
    *,
    options: PhotometryOptions = DEFAULT,
) -> FloatArray:
    """Return the levels (m, k) that the other of n rims add in the bands of m of them.

    Parameters
    ----------
    pixels
        (m, k, 2) of the bands, px.
    rims
        (m,) indices of the rims of these bands.
    ellipses
        n in the raw image, px.
    sigma_px
        (n,) blurs, px.
    contrast
        (n,) levels inside minus outside; 0 where it is unknown.
    half_width_px
        (n,) of the bands, px.
    options
        Tunable numbers.
    """
    intensity = np.zeros(pixels.shape[:2])
    if len(ellipses) < 2:
        return intensity
    every = Ellipse.batch(ellipses)
    first, second = _pairs_that_meet(
        every, half_width_px + options.neighbor_sigmas * sigma_px, contrast, rims, options
    )
    if len(first) == 0:
        return intensity
    other = every[second]
    distance = rim_distance(other, pixels[first])
    sigma = sigma_px[second][:, None]
    curvature = ((other.semi_major * other.semi_minor) ** -0.5)[:, None]
    _, coverage = normal_pdf_cdf(-(distance / sigma + 0.5 * sigma * curvature))
    np.add.at(intensity, first, contrast[second][:, None] * coverage)
    return intensity


def bands_that_meet(
    ellipses: Sequence[Ellipse],
    half_width_px: FloatArray,
    contrast: FloatArray,
    *,
    options: PhotometryOptions = DEFAULT,
) -> BoolArray:
    """Return (n,) which of n rims have another rim of known `contrast` (n,) within `half_width_px` (n,)."""
    if len(ellipses) < 2:
        return np.zeros(len(ellipses), bool)
    every, met = Ellipse.batch(ellipses), np.zeros(len(ellipses), np.bool_)
    # In parts, so that memory does not grow with the square of their number.
    for start in range(0, len(ellipses), _AT_ONCE):
        part = np.arange(start, min(start + _AT_ONCE, len(ellipses)))
        met[part[_pairs_that_meet(every, half_width_px, contrast, part, options)[0]]] = True
    return met


def _pairs_that_meet(
    every: Ellipse, half_width_px: FloatArray, contrast: FloatArray, rims: IntArray, options: PhotometryOptions
) -> tuple[IntArray, IntArray]:
    """Return the pairs (i, j) where rim j of n may enter the band of the i-th of the `rims` (m,)."""
    others = np.flatnonzero(contrast != 0.0)
    own, other = every[rims], every[others]
    apart = own.center[:, None] - other.center
    gap_square = apart[..., 0] ** 2 + apart[..., 1] ** 2
    first, second = np.nonzero(gap_square < ((own.semi_major + half_width_px[rims])[:, None] + other.semi_major) ** 2)
    gap, half_width = np.sqrt(gap_square[first, second]), half_width_px[rims[first]]
    own, other = own[first], other[second]
    # Without pairs where one rim is far inside the other.
    met = gap + own.semi_major + half_width > other.semi_minor
    met &= gap + other.semi_major + half_width > own.semi_minor
    met &= ~(
        (gap < options.same_rim_px)
        & (np.abs(own.semi_major - other.semi_major) < options.same_rim_px)
        & (np.abs(own.semi_minor - other.semi_minor) < options.same_rim_px)
    )
    return first[met], others[second[met]]
