"""How far the residuals of neighbouring pixels go together: then they tell less than as many independent ones."""

from __future__ import annotations

import numpy as np

from circlepose._typing import FloatArray, IntArray, RealArray
from circlepose.geometry.cone_perturbation import MODES

_JOINED = (1, 2, 4)
"""Neighbouring stretches taken together, each time twice as many."""
_TAKEN_OUT = 12.0
"""The fit takes out what it can: of n stretches about n/(n + 12) of the scatter is left."""
_CHANCE = 4.5
"""Correlation that counts: above 1 + 4.5/sqrt(n), three standard deviations of that of independent residuals. Both as
rendered discs of 3 to 72 stretches, single or joined, have it."""


def correlation_of(
    slopes: RealArray,
    residual: RealArray,
    stretch: IntArray,
    numbers: IntArray,
    inverse: FloatArray,
    variance: FloatArray,
) -> FloatArray:
    """Return (m,) how much more the residuals of a stretch move the rim than independent ones would; at least 1.

    By the slopes (m, 8, k), of which the first five are to the rim's modes, with what else is fitted taken out, and
    the `inverse` (m, 8, 8) of their information, each residual (m, k) moves the rim. Summed by stretch, independent
    ones with that `variance` (m,) scatter as the information says. Where neighbours err alike (texture, a model that
    does not hold), they scatter more, and so does the estimate. `stretch` (m, k) of each pixel, of `numbers` (m,) in
    all for each rim. Coarse texture shows in joined stretches only, of which there are few: there chance makes more
    of it.
    """
    rims, most = len(inverse), int(numbers.max())
    flat = (stretch + most * np.arange(rims)[:, None]).ravel()
    moved = (inverse[:, :MODES].astype(slopes.dtype) @ slopes) * residual[:, None]
    # By how much each stretch moves the rim, beside how much it moves in all.
    sums = [np.bincount(flat, moved[:, i].ravel(), rims * most) for i in range(MODES)]
    moves = np.stack(sums, axis=-1).reshape(rims, most, MODES)
    information = np.linalg.inv(inverse[:, :MODES, :MODES])
    largest = np.ones(rims)
    joined = 1
    for more in _JOINED:
        if more > joined:
            moves = moves + np.concatenate([moves[:, joined:], moves[:, :joined]], axis=1)
            joined = more
        total = np.sum((moves @ information) * moves, axis=(1, 2)) / joined
        number = numbers / joined
        ratio = total / (MODES * variance) * (1.0 + _TAKEN_OUT / number)
        largest = np.maximum(largest, np.where(ratio > 1.0 + _CHANCE / np.sqrt(number), ratio, 1.0))
    return largest
