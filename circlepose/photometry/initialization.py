"""How a fit to grey levels is set up, for the estimate and for what explains it: reach, first blur, clipping."""

from __future__ import annotations

import numpy as np

from circlepose._typing import FloatArray, Image
from circlepose.geometry.ellipse import Ellipse

REACH_PX = 3.0
REACH_SIGMA = 3.5
"""How far from the rim a band reaches: px, or blurs."""
LOOSE = 0.03
"""Standard deviation of the inequality of the blur before any image is seen."""
_START_SIGMA_PX = 0.8
_LEAST_PILE, _PILE = 0.001, 2.0
"""Floating levels are clipped at their end if this share of the pixels has exactly that, and so many times those of
the step next to it."""
_LEAST_BETWEEN = 0.1
"""Share of the pixels that must lie between both ends: two levels, or nearly, are no clipped light."""
_CURVED_PX = 8.0
"""Least radius of curvature of a rim that is taken as nearly straight."""


def start_blur(number: int) -> FloatArray:
    """Return (number, 3) the blurs that fits start at, see `blurred_share`."""
    return np.tile([np.log(_START_SIGMA_PX), 0.0, 0.0], (number, 1))


def first_information(number: int) -> FloatArray:
    """Return (number, 3) the information on each parameter of the blurs that there is at the start."""
    return np.tile([0.0, LOOSE**-2, LOOSE**-2], (number, 1))


def level_limits(grey: Image) -> tuple[float, float]:
    """Return the levels at which `grey` (h, w) is clipped: the ends of its depth.

    Floating levels are clipped where many pixels have exactly the least, or the greatest.
    """
    if grey.dtype.kind == "u":
        return 0.0, float(np.iinfo(grey.dtype).max)
    low, high = float(np.nanmin(grey)), float(np.nanmax(grey))
    if np.count_nonzero((grey > low) & (grey < high)) < _LEAST_BETWEEN * grey.size:
        return -np.inf, np.inf
    at_low, at_high = (
        np.count_nonzero(at) > max(_LEAST_PILE * grey.size, _PILE * np.count_nonzero(near & ~at))
        for at, near in ((grey == low, grey < low + 1.5), (grey == high, grey > high - 1.5))
    )
    return low if at_low else -np.inf, high if at_high else np.inf


def is_curved(ellipse: Ellipse) -> bool:
    """Tell whether the sharpest curve of a rim's image (px) is sharp on the scale of the blur."""
    return float(ellipse.semi_minor**2 / ellipse.semi_major) < _CURVED_PX
