"""Outliers among the cells of a rim's band: something hides, crosses or touches the rim there.

With s2 the mean squared residual (squared levels) of a cell of n pixels (`segments`), s0 the median over the segments
of the same zone and C the contrast (levels), a cell is an outlier if three conditions hold:

    (s2 / s0 - 1) sqrt(n / 2) > 6    significant: for independent noise the left side has a standard deviation of 1,
    s2 / s0 > 4                      large relative to the noise,
    sqrt(s2) > 0.05 C                large relative to the edge.

The numbers are the defaults of `PhotometryOptions`.
"""

from __future__ import annotations

import numpy as np

from circlepose._numerics import ROUNDING_VARIANCE
from circlepose._typing import BoolArray, FloatArray, IntArray, RealArray
from circlepose.photometry.options import DEFAULT, PhotometryOptions
from circlepose.photometry.segments import AT_RIM, ZONES, mean_squares, segment_sums


def outlier_cells(
    residual: RealArray,
    is_informative: BoolArray,
    weight: RealArray,
    cells: IntArray,
    contrast: FloatArray,
    shape: tuple[int, int, int],
    *,
    options: PhotometryOptions = DEFAULT,
) -> BoolArray:
    """Return (m, segments, zones) the cells whose residuals are outliers.

    Outliers away from the rim concern their own cell; an outlier at the rim concerns the whole segment.

    Parameters
    ----------
    residual
        (m, k) levels.
    is_informative
        (m, k) pixels that may be fitted: not clipped, no padding.
    weight
        (m, k) weights in use; the median is over segments of which more than half is in use.
    cells, shape
        See `segments.cell_indices`.
    contrast
        (m,) levels.
    options
        Tunable numbers.
    """
    in_use = segment_sums(weight, cells, shape)
    mean, count = mean_squares(residual**2 * is_informative, is_informative, cells, shape)
    counted = (in_use > 0.5 * count) & (count >= options.least_cell_pixels)
    usual = np.maximum(_medians(mean, counted), ROUNDING_VARIANCE)[:, None, :]
    is_significant = (mean / usual - 1.0) * np.sqrt(count / 2.0) > options.outlier_sigmas
    is_strong = mean > (options.outlier_contrast_share * contrast[:, None, None]) ** 2
    outliers = is_significant & (mean > options.outlier_ratio * usual) & is_strong
    return outliers | outliers[:, :, AT_RIM][:, :, None]


def _medians(mean: FloatArray, counted: BoolArray) -> FloatArray:
    """Return the median (m, zones) over the segments of `mean` (m, segments, zones) that are `counted`."""
    ordered = np.sort(np.where(counted, mean, np.inf), axis=1)
    number = np.sum(counted, axis=1)
    middle = ordered[np.arange(len(number))[:, None], np.maximum(number - 1, 0) // 2, np.arange(ZONES)]
    return np.where(number > 0, middle, 0.0)
