"""The setup of a fit to gray levels: first blur and its prior, limits of clipping, choice of the edge spread.

The blur starts at log sigma = log 0.8 (sigma in px), or at that of the contour, with no anisotropy, which has the
prior N(0, 0.03^2).
The edge spread is the curved one where the radius of curvature b^2 / a (px) at a tip is small.
"""

from __future__ import annotations

import numpy as np

from circlepose._typing import FloatArray, Image
from circlepose.geometry.ellipse import Ellipse
from circlepose.photometry.options import DEFAULT, PhotometryOptions


def start_blur(about_px: FloatArray, *, options: PhotometryOptions = DEFAULT) -> FloatArray:
    """Return the blurs (m, 3) at the start of fits, see `edge_spread`; `about_px` (m,) is what is known of them."""
    start = np.zeros((len(about_px), 3))
    start[:, 0] = np.log(np.maximum(about_px, options.start_sigma_px))
    return start


def first_information(number: int, *, options: PhotometryOptions = DEFAULT) -> FloatArray:
    """Return the information (number, 3) on the parameters of the blurs before any image is seen."""
    anisotropy = options.anisotropy_sigma**-2
    return np.tile([0.0, anisotropy, anisotropy], (number, 1))


def level_limits(
    grey: Image, full_scale: int | None = None, *, options: PhotometryOptions = DEFAULT
) -> tuple[float, float]:
    """Return the levels at which an image is clipped.

    Integer levels are clipped at the ends of their type, those of 16 bits at the end of fewer bits where many pixels
    have it exactly: a camera of 12 bits clips at 4095, or 65520. Floating levels are clipped at an extreme that many
    pixels have exactly; without clipping the limit is infinite.

    Parameters
    ----------
    grey
        (h, w) levels.
    full_scale
        The highest level of the type in which the levels were stored, where they are of a wider one now.
    options
        Tunable numbers.
    """
    if full_scale is None and grey.dtype.kind == "u":
        full_scale = int(np.iinfo(grey.dtype).max)
    least, most = (0.0, float(full_scale)) if full_scale is not None else (-np.inf, np.inf)
    if full_scale == np.iinfo(np.uint8).max:
        return least, most
    low, high = float(np.nanmin(grey)), float(np.nanmax(grey))
    if full_scale is not None and not _ends_bits(int(high)):
        return least, most
    if np.count_nonzero((grey > low) & (grey < high)) < options.least_between_share * grey.size:
        return least, most
    number = options.clipped_share * grey.size
    at_low, at_high = (
        np.count_nonzero(at) > max(number, options.clipped_ratio * np.count_nonzero(near & ~at))
        for at, near in ((grey == low, grey < low + 1.5), (grey == high, grey > high - 1.5))
    )
    return low if at_low and full_scale is None else least, high if at_high else most


def _ends_bits(level: int) -> bool:
    """Whether a level is the highest of 8 bits or more, or that shifted to the left: ones, then zeros."""
    while level and level % 2 == 0:
        level //= 2
    return level >= np.iinfo(np.uint8).max and level & (level + 1) == 0


def is_curved(ellipse: Ellipse, blur_px: float = 0.0, *, options: PhotometryOptions = DEFAULT) -> bool:
    """Whether the image (px) of a rim has tips so sharp, for a blur of `blur_px`, that it needs the curved spread."""
    least = max(options.curved_radius_px, options.curved_radius_sigmas * blur_px)
    return float(ellipse.semi_minor**2 / ellipse.semi_major) < least
