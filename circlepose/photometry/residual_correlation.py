"""The correlation of neighboring residuals along a rim, which inflates the covariance.

With the slopes J (8, k) of the parameters, the levels eliminated, the residuals r (k) and the information H = J J',
the score of a segment s moves the five modes by u_s = H^-1 sum over s of J r. Independent residuals with the variance
v give sum of u_s' P u_s = 5 v, with P the information on the five modes alone. The ratio of both sides, corrected for
what the fit absorbs, is the correlation. It is above 1 where neighbors err alike: texture, or a model that does not
hold.
"""

from __future__ import annotations

import numpy as np

from circlepose._typing import FloatArray, IntArray, RealArray
from circlepose.geometry.cone_perturbation import MODES
from circlepose.photometry.options import DEFAULT, PhotometryOptions
from circlepose.photometry.segments import segment_sums


def residual_correlation(
    slopes: RealArray,
    residual: RealArray,
    segment: IntArray,
    segments: IntArray,
    inverse: FloatArray,
    variance: FloatArray,
    *,
    options: PhotometryOptions = DEFAULT,
) -> FloatArray:
    """Return (m,) the scatter of the segments' scores over that of independent residuals; 1 if not significant.

    Coarse texture shows only in joined segments. There are few of them, so the limit of significance is higher.

    Parameters
    ----------
    slopes
        (m, 8, k) derivatives of the residuals to the five modes and the blur, the levels eliminated.
    residual
        (m, k) levels.
    segment
        (m, k) of each pixel.
    segments
        (m,) of each rim.
    inverse
        (m, 8, 8) inverse of the information, without the noise variance.
    variance
        (m,) of the noise, squared levels.
    options
        Tunable numbers.
    """
    rims, most = len(inverse), int(segments.max())
    index = segment + most * np.arange(rims)[:, None]
    moved = (inverse[:, :MODES].astype(slopes.dtype) @ slopes) * residual[:, None]
    scores = np.stack([segment_sums(moved[:, i], index, (rims, most)) for i in range(MODES)], axis=-1)
    information = np.linalg.inv(inverse[:, :MODES, :MODES])
    largest = np.ones(rims)
    joined = 1
    for more in options.joined_segments:
        if more > joined:
            scores = scores + np.concatenate([scores[:, joined:], scores[:, :joined]], axis=1)
            joined = more
        total = np.sum((scores @ information) * scores, axis=(1, 2)) / joined
        number = segments / joined
        ratio = total / (MODES * variance) * (1.0 + options.fitted_segments / number)
        limit = 1.0 + options.correlation_limit / np.sqrt(number)
        largest = np.maximum(largest, np.where(ratio > limit, ratio, 1.0))
    return largest
