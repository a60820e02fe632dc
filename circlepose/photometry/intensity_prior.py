"""The prior of the levels inside and outside a rim, from pixels outside its band. Many rims at once.

The level of a pixel far from the edge is in(p) or out(p), harmonic polynomials of its coordinates p. Its squared
residuals add up to l' G l - 2 r' l + s at levels l. These pixels do not depend on where the rim is, but without them
the levels are known only from a few px near the rim, which loses a third of the information on a disc's size. As no
edge is in them, their sums are computed once. A side is used only where it continues the levels at the rim; texture
or another object may stand there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from circlepose._typing import BoolArray, FloatArray
from circlepose.photometry.options import DEFAULT, PhotometryOptions
from circlepose.photometry.pixel_band import OuterSamples
from circlepose.photometry.rim_coordinates import HARMONICS, LEVELS, harmonics


@dataclass(frozen=True, slots=True, eq=False)
class IntensityPrior:
    """Quadratic forms l' G l - 2 r' l + s of the levels l of m rims, in squared levels."""

    gram: FloatArray
    """G (m, 11, 11)"""
    right: FloatArray
    """r (m, 11)"""
    square: FloatArray
    """s (m,)"""
    is_continued: BoolArray
    """(m,) both sides continue in the first ring"""

    @classmethod
    def of(
        cls,
        outer: OuterSamples,
        factors: FloatArray,
        near: tuple[FloatArray, FloatArray],
        variance: FloatArray,
        *,
        options: PhotometryOptions = DEFAULT,
    ) -> Self:
        """Sum over the sides, inside and outside, that continue the levels at the rims.

        Parameters
        ----------
        outer
            Samples outside the bands.
        factors
            (m, 3, 3) of the cones, camera frame.
        near
            Levels (m, 11) fitted to the bands, and their covariance (m, 11, 11).
        variance
            (m,) of the pixels in the bands about their model, squared levels.
        options
            Tunable numbers.
        """
        local = np.linalg.inv(factors).astype(outer.rays.dtype) @ outer.rays
        basis = harmonics(local[..., :2, :] / local[..., 2:, :])
        weighted = basis * outer.weight[..., None, :]
        gram = (weighted @ np.swapaxes(basis, -1, -2)).astype(np.float64)
        right = (weighted @ outer.levels[..., None])[..., 0].astype(np.float64)
        ridge = 1e-6 * np.trace(gram, axis1=-2, axis2=-1)[..., None, None] + 1e-9
        covariance = np.linalg.inv(gram + ridge * np.eye(HARMONICS))
        levels = (covariance @ right[..., None])[..., 0]
        residual = (levels.astype(basis.dtype)[..., None, :] @ basis)[..., 0, :] - outer.levels
        count = np.sum(outer.weight, axis=-1)
        freedom = np.maximum(count - HARMONICS, 1.0)
        scatter = np.einsum("smk,smk->sm", residual * residual, outer.weight) / freedom
        sides = (slice(HARMONICS), slice(HARMONICS, 2 * HARMONICS)) * (len(outer.levels) // 2)
        difference = levels - np.stack([near[0][:, side] for side in sides])
        both = covariance * scatter[..., None, None] + np.stack([near[1][:, side, side] for side in sides])
        distance = np.sum(difference * np.linalg.solve(both, difference[..., None])[..., 0], axis=-1)
        is_continued = (
            (count >= options.prior_least_pixels)
            & (scatter < options.prior_variance_ratio * variance)
            & (distance < options.prior_distance_square)
        )
        square = np.einsum("smk,smk->sm", outer.levels * outer.levels, outer.weight)
        all_gram, all_right = np.zeros((len(factors), LEVELS, LEVELS)), np.zeros((len(factors), LEVELS))
        for i, side in enumerate(sides):
            all_gram[:, side, side] += is_continued[i, :, None, None] * gram[i]
            all_right[:, side] += is_continued[i, :, None] * right[i]
        return cls(all_gram, all_right, np.sum(is_continued * square, axis=0), is_continued[:2].all(axis=0))

    def misfit(self, levels: FloatArray) -> FloatArray:
        """Return (m,) the sum of squares at `levels` (m, 11)."""
        quadratic = np.sum((self.gram @ levels[..., None])[..., 0] * levels, axis=1)
        return np.asarray(quadratic - 2.0 * np.sum(self.right * levels, axis=1) + self.square)
