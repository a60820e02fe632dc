"""The setup of a fit to gray levels: first blur and its prior, limits of clipping, choice of the edge spread.

The blur starts at log sigma = log 0.8 (sigma in px) with no anisotropy; the anisotropy has the prior N(0, 0.03^2).
The edge spread is the curved one where the radius of curvature b^2 / a (px) at a tip is small.
"""

from __future__ import annotations

import numpy as np

from circlepose._typing import FloatArray, Image
from circlepose.geometry.ellipse import Ellipse
from circlepose.photometry.options import DEFAULT, PhotometryOptions


def start_blur(number: int, *, options: PhotometryOptions = DEFAULT) -> FloatArray:
    """Return the blurs (number, 3) at the start of fits, see `edge_spread`."""
    return np.tile([np.log(options.start_sigma_px), 0.0, 0.0], (number, 1))


def first_information(number: int, *, options: PhotometryOptions = DEFAULT) -> FloatArray:
    """Return the information (number, 3) on the parameters of the blurs before any image is seen."""
    anisotropy = options.anisotropy_sigma**-2
    return np.tile([0.0, anisotropy, anisotropy], (number, 1))


def level_limits(grey: Image, *, options: PhotometryOptions = DEFAULT) -> tuple[float, float]:
    """Return the levels at which an image is clipped.

    Integer levels are clipped at the ends of their type. Floating levels are clipped at an extreme that many pixels
    have exactly; without clipping the limit is infinite.

    Parameters
    ----------
    grey
        (h, w) levels.
    options
        Tunable numbers.
    """
    if grey.dtype.kind == "u":
        return 0.0, float(np.iinfo(grey.dtype).max)
    low, high = float(np.nanmin(grey)), float(np.nanmax(grey))
    if np.count_nonzero((grey > low) & (grey < high)) < options.least_between_share * grey.size:
        return -np.inf, np.inf
    least = options.clipped_share * grey.size
    at_low, at_high = (
        np.count_nonzero(at) > max(least, options.clipped_ratio * np.count_nonzero(near & ~at))
        for at, near in ((grey == low, grey < low + 1.5), (grey == high, grey > high - 1.5))
    )
    return low if at_low else -np.inf, high if at_high else np.inf


def is_curved(ellipse: Ellipse, *, options: PhotometryOptions = DEFAULT) -> bool:
    """Whether the image (px) of a rim has tips so sharp that it needs the curved edge spread."""
    return float(ellipse.semi_minor**2 / ellipse.semi_major) < options.curved_radius_px
