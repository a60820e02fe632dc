"""Which parts of a rim's band are unlike the rest: something hides, crosses or touches the rim there."""

from __future__ import annotations

import numpy as np

from circlepose._typing import BoolArray, FloatArray, IntArray, RealArray

QUANTIZATION = 1.0 / 12.0
"""Variance of rounding to whole levels: the noise of an image without noise."""
ZONES, AT_RIM = 3, 1
"""A stretch of the rim has a zone inside, one at the rim and one outside."""
_ZONE_SIGMA = 2.0
_UNLIKELY = 6.0
_COVERED_SHARE = 0.05
_ODD = 4.0
"""Times the mean square of most stretches from which one is unlike them, if no chance and not faint."""
_LEAST_IN_CELL = 4


def cells_of(
    plane: tuple[RealArray, RealArray],
    distance_px: RealArray,
    sigma_px: FloatArray,
    stretches: IntArray,
    shape: tuple[int, int, int],
) -> IntArray:
    """Return (m, k) the cell that each pixel lies in, as an index into (m, stretches, zones) laid flat.

    The pixels are those about m rims, see `Places`, each blurred by `sigma_px` (m,) and cut in `stretches` (m,).
    """
    turn = np.arctan2(plane[1], plane[0]) / (2.0 * np.pi) + 0.5
    stretch = np.minimum((turn * stretches[:, None]).astype(np.int64), stretches[:, None] - 1)
    far = np.abs(distance_px) > _ZONE_SIGMA * sigma_px[:, None]
    zone = np.where(far, np.where(distance_px < 0.0, 0, 2), AT_RIM)
    rim = np.arange(shape[0])[:, None]
    return np.asarray((rim * shape[1] + stretch) * ZONES + zone)


def unlike_others(
    residual: RealArray,
    tells: BoolArray,
    weight: RealArray,
    cells: IntArray,
    contrast: FloatArray,
    shape: tuple[int, int, int],
) -> BoolArray:
    """Tell (m, stretches, zones) where residuals are unlike those of most of the rim in use, by `weight`.

    Something beside the rim (far zones) is left out alone; what crosses the rim takes the whole stretch with it,
    and a little of the stretches beside.
    """
    size = shape[0] * shape[1] * shape[2]
    count = np.bincount(cells.ravel(), tells.ravel(), size).reshape(shape)
    in_use = np.bincount(cells.ravel(), weight.ravel(), size).reshape(shape)
    mean = np.bincount(cells.ravel(), (residual**2 * tells).ravel(), size).reshape(shape) / np.maximum(count, 1.0)
    counted = (in_use > 0.5 * count) & (count >= _LEAST_IN_CELL)
    usual = np.maximum(_medians(mean, counted), QUANTIZATION)[:, None, :]
    unlikely = (mean / usual - 1.0) * np.sqrt(count / 2.0) > _UNLIKELY
    bad = unlikely & (mean > _ODD * usual) & (mean > (_COVERED_SHARE * contrast[:, None, None]) ** 2)
    crossed = bad[:, :, AT_RIM]
    return bad | crossed[:, :, None]


def _medians(mean: FloatArray, counted: BoolArray) -> FloatArray:
    """Return the median (m, zones) over the stretches of `mean` (m, stretches, zones) that are `counted`."""
    ordered = np.sort(np.where(counted, mean, np.inf), axis=1)
    number = np.sum(counted, axis=1)
    middle = ordered[np.arange(len(number))[:, None], np.maximum(number - 1, 0) // 2, np.arange(ZONES)]
    return np.where(number > 0, middle, 0.0)
