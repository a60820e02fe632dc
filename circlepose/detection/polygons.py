"""Which rims are those of regular polygons in perspective: corners at equal angles, as high as their number asks.

Seen at an angle a regular polygon is one in the frame in which its ellipse is the unit circle. There its border is
1 / cos(p) between two corners, about its mean. So its residuals are nearly all in the harmonic n, with an amplitude
of about 2 / (n^2 - 1), of which blur of sigma (px) leaves exp(-(n sigma / r)^2 / 2). What is merely rough has its
residuals in many harmonics, or in one of another height. By Fisher's test one of M harmonics has a share g or more of
them with the probability M (1 - g)^(M - 1) by chance.
"""

from __future__ import annotations

import numpy as np

from circlepose._typing import BoolArray, FloatArray, IntArray
from circlepose.detection.options import DEFAULT, DetectionOptions
from circlepose.geometry.ellipse import Ellipse, own_normals


def are_polygons(
    ellipse: Ellipse,
    residual_px: FloatArray,
    on_rim: BoolArray,
    blur_px: FloatArray,
    options: DetectionOptions = DEFAULT,
) -> BoolArray:
    """Return (m,) which rims are those of regular polygons.

    Parameters
    ----------
    ellipse
        (m,) px.
    residual_px
        (m, k) of edges from it, positive outwards, at k eccentric angles.
    on_rim
        (m, k) the edges that count.
    blur_px
        (m,) of the edges.
    options
        The numbers of the detection.
    """
    found = np.zeros(len(residual_px), np.bool_)
    # A harmonic is no larger than the residuals.
    count = np.maximum(np.count_nonzero(on_rim, axis=1), 1)
    rms_px = np.sqrt(np.sum(np.where(on_rim, residual_px, 0.0) ** 2, axis=1) / count)
    radius = ellipse.size
    least = (1.0 - options.polygon_slack) * _expected(np.array([options.most_corners]), blur_px, radius)[:, 0]
    may = np.flatnonzero(np.sqrt(2.0) * rms_px >= least * ellipse.semi_minor)
    if len(may):
        found[may] = _have_corners(ellipse[may], residual_px[may], on_rim[may], blur_px[may], options)
    return found


def _expected(corners: IntArray, blur_px: FloatArray, radius_px: FloatArray) -> FloatArray:
    """Return (m, k) the harmonic of regular polygons with `corners` (k,), over the radius (m,)."""
    blurred = np.exp(-0.5 * (corners * blur_px[:, None] / radius_px[:, None]) ** 2)
    return np.asarray(2.0 / (corners**2 - 1.0) * blurred)


def _have_corners(
    ellipse: Ellipse, residual_px: FloatArray, on_rim: BoolArray, blur_px: FloatArray, options: DetectionOptions
) -> BoolArray:
    """Return (m,) which rims have corners: see `are_polygons`."""
    samples = residual_px.shape[1]
    _, _, per_norm = own_normals(ellipse, samples)
    # By how much an edge moves when the ellipse grows by itself.
    growth = (ellipse.semi_major * ellipse.semi_minor)[:, None] * per_norm
    count = np.maximum(np.count_nonzero(on_rim, axis=1), 1)
    relative = np.where(on_rim, residual_px / growth, 0.0)
    spectrum = 2.0 * np.abs(np.fft.rfft(relative, axis=1)) / count[:, None]
    perimeter_px = ellipse.perimeter
    harmonics = np.arange(options.least_corners, samples // 2)
    # Shorter sides cannot be seen, and closer samples share their edges.
    is_seen = harmonics * options.least_side_px <= perimeter_px[:, None]
    square = np.where(is_seen, spectrum[:, harmonics] ** 2, 0.0)
    share = square / np.maximum(square.sum(axis=1), 1e-30)[:, None]
    number = np.count_nonzero(is_seen, axis=1)[:, None]
    by_chance = number * np.maximum(1.0 - share, 0.0) ** np.maximum(number - 1, 0)
    expected = _expected(harmonics, blur_px, ellipse.size)
    is_high = np.abs(spectrum[:, harmonics] - expected) <= options.polygon_slack * expected
    few = harmonics <= options.most_corners
    return np.asarray((few & is_seen & is_high & (by_chance < options.polygon_chance)).any(axis=1))
