"""Which circles of an image are rings: their middle is unlike the band within their rim."""

from __future__ import annotations

import numpy as np

from circlepose._typing import BoolArray, FloatArray, Image
from circlepose.boards.options import DEFAULT, BoardOptions
from circlepose.geometry.ellipse import Ellipse
from circlepose.targets.board import BoardLayout

_POINTS = 16
_OUTSIDE = 1.3
"""Radii from the center, where the surroundings are seen."""


def are_rings(levels: Image, ellipse: Ellipse, layout: BoardLayout, options: BoardOptions = DEFAULT) -> BoolArray:
    """Return (m,) which of the ellipses, px, look like the rings of a layout; none where it has none.

    Parameters
    ----------
    levels
        (h, w) gray levels; NaN where a pixel is left out.
    ellipse
        (m,) rims, in px of the image.
    layout
        Of the board.
    options
        The numbers of boards.
    """
    if not layout.is_ring.any():
        return np.zeros(len(ellipse), np.bool_)
    inner = float(
        np.median([circle.radii_mm[1] / circle.radii_mm[0] for circle in layout.circles if len(circle.radii_mm) > 1])
    )
    middle, band, outside = (
        _levels_at(levels, ellipse, share) for share in (0.4 * inner, (1.0 + inner) / 2.0, _OUTSIDE)
    )
    with np.errstate(invalid="ignore"):
        return np.asarray(np.abs(middle - band) > options.ring_contrast * np.abs(outside - band))


def _levels_at(levels: Image, ellipse: Ellipse, share: float) -> FloatArray:
    """Return (m,) the median level along the rims shrunk to a share of their axes."""
    points = ellipse.center[:, None] + share * (ellipse.points(_POINTS) - ellipse.center[:, None])
    height, width = levels.shape
    x = np.rint(points[..., 0]).astype(np.int64).clip(0, width - 1)
    y = np.rint(points[..., 1]).astype(np.int64).clip(0, height - 1)
    with np.errstate(all="ignore"):
        return np.asarray(np.nanmedian(levels[y, x].astype(np.float64), axis=1))
