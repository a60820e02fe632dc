"""The segments of rims: the segment of each pixel, and sums and mean squares of residuals over segments.

A rim is divided into segments of equal angle in its coordinates p (`rim_coordinates`). A segment has three cells, by
the distance d (px) of the pixel from the rim with the blur sigma (px): inside, |d| < 2 sigma, and outside.
"""

from __future__ import annotations

import math

import numpy as np

from circlepose._typing import BoolArray, FloatArray, IntArray, RealArray
from circlepose.photometry.options import DEFAULT, PhotometryOptions

ZONES, AT_RIM = 3, 1
"""The zones of a segment are inside (0), at the rim (1) and outside (2)."""


def cell_indices(
    plane: tuple[RealArray, RealArray],
    distance_px: RealArray,
    sigma_px: FloatArray,
    segments: IntArray,
    shape: tuple[int, int, int],
    *,
    options: PhotometryOptions = DEFAULT,
) -> IntArray:
    """Return (m, k) the cell of each pixel, as a flat index into `shape`, which is (m, segments, zones).

    Parameters
    ----------
    plane, distance_px
        Those of `RimCoordinates`, (m, k) each.
    sigma_px
        (m,) blurs, px.
    segments
        (m,) segments of each rim.
    shape
        Of the cells; its second number is the largest of `segments`.
    options
        Tunable numbers.
    """
    turn = np.arctan2(plane[1], plane[0]) / (2.0 * np.pi) + 0.5
    segment = np.minimum((turn * segments[:, None]).astype(np.int64), segments[:, None] - 1)
    far = np.abs(distance_px) > options.zone_sigmas * sigma_px[:, None]
    zone = np.where(far, np.where(distance_px < 0.0, 0, 2), AT_RIM)
    rim = np.arange(shape[0])[:, None]
    return np.asarray((rim * shape[1] + segment) * ZONES + zone)


def segment_sums(values: RealArray | BoolArray, index: IntArray, shape: tuple[int, ...]) -> FloatArray:
    """Return the sums (`shape`) of values with the flat `index` of the segment of each, same shape as the values."""
    return np.asarray(np.bincount(index.ravel(), values.ravel(), math.prod(shape)).reshape(shape), dtype=np.float64)


def mean_squares(
    squares: RealArray, weights: RealArray | BoolArray, index: IntArray, shape: tuple[int, ...]
) -> tuple[FloatArray, FloatArray]:
    """Return the mean of weighted squares in each segment, and the sum of the weights there, `shape` each.

    `index` is the flat index of the segment of each square. A segment with a weight below 1 is divided by 1.
    """
    weight = segment_sums(weights, index, shape)
    return segment_sums(squares, index, shape) / np.maximum(weight, 1.0), weight
