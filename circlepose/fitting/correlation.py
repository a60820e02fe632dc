"""How far the residuals of neighbouring pixels go together: then they tell less than as many independent ones."""

from __future__ import annotations

import numpy as np

from circlepose._typing import FloatArray, IntArray, RealArray

_JOINED = (1, 2, 4)
"""Neighbouring stretches taken together, each time twice as many."""
_CHANCE = 2.5
"""Standard deviations of the sum over independent residuals that a correlation must be above to count."""


def correlation_of(
    scores: RealArray, stretch: IntArray, numbers: IntArray, matrix: FloatArray, variance: FloatArray
) -> FloatArray:
    """Return (m,) how much more the residuals of a stretch add up to than independent ones would; at least 1.

    The scores (m, 8, k) of independent residuals, summed by stretch, scatter as the information says. Where
    neighbours err alike (texture, a model that does not hold), they scatter more, and so does the estimate.
    `stretch` (m, k) of each pixel, of `numbers` (m,) in all for each rim. Coarse texture shows in joined stretches
    only, of which there are few: there chance makes more of it.
    """
    rims, most, parameters = len(matrix), int(numbers.max()), matrix.shape[-1]
    flat = (stretch + most * np.arange(rims)[:, None]).ravel()
    sums = np.stack(
        [np.bincount(flat, scores[:, i].ravel(), rims * most) for i in range(parameters)], axis=-1
    ).reshape(rims, most, parameters)
    inverse = np.linalg.inv(matrix)
    largest = np.ones(rims)
    joined = 1
    for more in _JOINED:
        if more > joined:
            sums = sums + np.concatenate([sums[:, joined:], sums[:, :joined]], axis=1)
            joined = more
        total = np.sum((sums @ inverse) * sums, axis=(1, 2)) / joined
        # The fit has taken out as much as its parameters could: of so many stretches, about this share is left. Both
        # this and the scatter by chance are as rendered discs of 12 to 72 stretches have them.
        number = numbers / joined
        ratio = total / (parameters * variance) * (1.0 + parameters / number)
        largest = np.maximum(largest, np.where(ratio > 1.0 + _CHANCE / np.sqrt(number), ratio, 1.0))
    return largest
