"""Masks: images whose pixels have one of two levels each.

A photographed or area-averaged rim has pixels between the levels of its two sides. Without such pixels the image is a
segmentation, and its levels are neither rounded nor clipped intensities. A mask g is scaled to floating levels
255 (g - min g) / (max g - min g), which have no limits of clipping.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from circlepose._typing import Image
from circlepose.geometry.ellipse import Ellipse
from circlepose.photometry.options import DEFAULT, PhotometryOptions


def with_mask_scaled(grey: Image, ellipses: Sequence[Ellipse], *, options: PhotometryOptions = DEFAULT) -> Image:
    """Return the image to fit to: a mask with its levels scaled, any other image as it is.

    Parameters
    ----------
    grey
        (h, w) levels.
    ellipses
        Rims in the image, px.
    options
        Tunable numbers.
    """
    if not ellipses or not is_mask(grey, Ellipse.batch(ellipses), options=options):
        return grey
    low, high = float(np.nanmin(grey)), float(np.nanmax(grey))
    return (grey.astype(np.float32) - np.float32(low)) * np.float32(options.mask_contrast / (high - low))


def is_mask(grey: Image, ellipses: Ellipse, *, options: PhotometryOptions = DEFAULT) -> bool:
    """Whether the pixels near each of the rims have two levels and hardly any level between.

    Parameters
    ----------
    grey
        (h, w) levels.
    ellipses
        Batch of m rims, px.
    options
        Tunable numbers.
    """
    offsets = np.array(options.mask_offsets_px)
    axes = np.stack([ellipses.semi_major, ellipses.semi_minor], axis=-1)[:, None] + offsets[:, None]
    around = Ellipse(
        np.broadcast_to(ellipses.center[:, None], axes.shape),
        np.maximum(axes[..., 0], 0.0),
        np.maximum(axes[..., 1], 0.0),
        np.broadcast_to(ellipses.angle[:, None], axes.shape[:-1]),
    )
    x, y = np.moveaxis(np.rint(around.points(options.mask_samples)), -1, 0)
    height, width = grey.shape
    is_inside = (x >= 0.0) & (x < width) & (y >= 0.0) & (y < height)
    levels = grey[np.where(is_inside, y, 0).astype(np.intp), np.where(is_inside, x, 0).astype(np.intp)].astype(
        np.float64
    )
    levels[~is_inside] = np.nan
    levels = levels.reshape(len(axes), -1)
    known = levels[np.isfinite(levels).any(axis=1)]
    low, high = np.nanmin(known, axis=1, keepdims=True), np.nanmax(known, axis=1, keepdims=True)
    step = high - low
    end = options.mask_end_share * step
    between = (known > low + end) & (known < high - end)
    return bool(np.any(step > 0.0) and np.sum(between) <= options.mask_between_share * np.sum(np.isfinite(known)))
