"""What the pixels farther from a rim say of the levels inside and outside. Many rims at once.

Of where the rim is they tell nothing, but with the levels known from a few px beside it alone, a third of what the
pixels tell of a disc's size is lost. As no part of the edge is in them, they enter as sums that are made once. A side
that does not go on as it is at the rim (texture, another object) is not asked.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from circlepose._typing import BoolArray, FloatArray
from circlepose.photometry.edge_spread import SHAPES, harmonics
from circlepose.photometry.intensity_model import LINEAR
from circlepose.photometry.pixel_band import Beyond

_LEAST_PIXELS = 24
_MOST_SCATTER = 1.5
"""Times the variance at the rim."""
_UNLIKELY = 16.0
"""Square of the distance between both sets of five levels, in standard errors, from which they are not the same."""


@dataclass(frozen=True, slots=True, eq=False)
class FarLevels:
    """Sums over the far pixels of m rims: the squares of what they miss add up to l'Gl - 2 r'l + s, at levels l."""

    gram: FloatArray
    """(m, 11, 11)"""
    right: FloatArray
    """(m, 11)"""
    square: FloatArray
    """(m,)"""
    goes_on: BoolArray
    """(m,) both sides are asked, in the first ring at least"""

    @classmethod
    def of(
        cls, beyond: Beyond, factors: FloatArray, near: tuple[FloatArray, FloatArray], variance: FloatArray
    ) -> Self:
        """Sum over the sides, inside and outside, that go on as the levels do that were fitted near the rims.

        The rims are those of cones with `factors` (m, 3, 3); `near` are those levels (m, 11) and their covariance
        (m, 11, 11), and `variance` (m,) is that of the pixels about their model.
        """
        local = np.linalg.inv(factors).astype(beyond.rays.dtype) @ beyond.rays
        shapes = harmonics(local[..., :2, :] / local[..., 2:, :])
        weighted = shapes * beyond.weight[..., None, :]
        gram = (weighted @ np.swapaxes(shapes, -1, -2)).astype(np.float64)
        right = (weighted @ beyond.levels[..., None])[..., 0].astype(np.float64)
        ridge = 1e-6 * np.trace(gram, axis1=-2, axis2=-1)[..., None, None] + 1e-9
        covariance = np.linalg.inv(gram + ridge * np.eye(SHAPES))
        levels = (covariance @ right[..., None])[..., 0]
        missed = (levels.astype(shapes.dtype)[..., None, :] @ shapes)[..., 0, :] - beyond.levels
        count = np.sum(beyond.weight, axis=-1)
        scatter = np.einsum("smk,smk->sm", missed * missed, beyond.weight) / np.maximum(count - SHAPES, 1.0)
        own = (slice(SHAPES), slice(SHAPES, 2 * SHAPES)) * (len(beyond.levels) // 2)
        apart = levels - np.stack([near[0][:, each] for each in own])
        both = covariance * scatter[..., None, None] + np.stack([near[1][:, each, each] for each in own])
        distance = np.sum(apart * np.linalg.solve(both, apart[..., None])[..., 0], axis=-1)
        like = (count >= _LEAST_PIXELS) & (scatter < _MOST_SCATTER * variance) & (distance < _UNLIKELY)
        square = np.einsum("smk,smk->sm", beyond.levels * beyond.levels, beyond.weight)
        asked, all_right = np.zeros((len(factors), LINEAR, LINEAR)), np.zeros((len(factors), LINEAR))
        for side, each in enumerate(own):
            asked[:, each, each] += like[side, :, None, None] * gram[side]
            all_right[:, each] += like[side, :, None] * right[side]
        return cls(asked, all_right, np.sum(like * square, axis=0), like[:2].all(axis=0))

    def misfit(self, levels: FloatArray) -> FloatArray:
        """Return (m,) the sum of squares at `levels` (m, 11)."""
        quadratic = np.sum((self.gram @ levels[..., None])[..., 0] * levels, axis=1)
        return np.asarray(quadratic - 2.0 * np.sum(self.right * levels, axis=1) + self.square)
