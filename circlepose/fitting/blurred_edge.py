"""The level of pixels near the rim of a viewing cone, seen as a blurred edge, and its derivatives. Many rims at once.

With c the share of the inside in a pixel's level (see `blurred_share`), z = (c's distance)/sigma and p = y_12/y_3 the
place in the coordinates y = A^-1 x of the cone's factor,

    I = out(p) (1 - c) + in(p) c + w (Phi(z') - Phi(z)).

`in` and `out` are harmonic polynomials of p: even shading is met exactly, texture in the main. The last term stands
for what blur is beside a Gaussian (halos of sharpening, tails of focus; z' is of a wider blur); odd about the edge,
it cannot move it. These eleven levels are linear, and so eliminated; there remain the five `rim_modes` and sigma.
All but the two mean levels are expected to be small beside the contrast, so that a disc of few pixels is not
overfitted: `stiffness` says how small.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from circlepose._typing import FloatArray, RealArray
from circlepose.fitting.band import Bands
from circlepose.fitting.blurred_share import Places, Share

LINEAR = 11
_SHAPES = 5
_RIDGE = 1e-9
"""Relative to the mean square of the columns: levels that no pixel tells of stay finite."""
_WIDER = 2.5
_EXPECTED = np.array([np.inf, 0.2, 0.2, 0.1, 0.1, np.inf, 0.2, 0.2, 0.1, 0.1, 0.3])
"""Standard deviation of each level before the image is seen, as a share of the contrast."""
_PLAIN = np.array([*_EXPECTED[:-1], 1e-4])


@dataclass(frozen=True, slots=True, eq=False)
class Levels:
    """The levels that fit best, for given cones and blurs; what is said of pixels has the root of their weight."""

    residual: RealArray
    """(m, k) model minus measured"""
    slopes: RealArray
    """(m, 8, k) derivatives to the five modes and the blur, at fixed levels"""
    linear: RealArray
    """(m, 11, k) derivatives to the levels"""
    gram: FloatArray
    """(m, 11, 12) information on the levels, times the noise's variance"""
    model: RealArray
    """(m, k) the level, whatever the weight"""
    contrast: FloatArray
    """(m,) levels inside minus outside, on average around the rim"""
    square: FloatArray
    """(m,) sum of squares of the residual"""
    cost: FloatArray
    """(m,) the same, and that of levels that are not as expected"""

    def normal_equations(self) -> tuple[FloatArray, FloatArray]:
        """Return matrix (m, 8, 8) and right side (m, 8) for modes and blur, the levels eliminated."""
        across = (self.linear @ self.slopes.transpose(0, 2, 1)).astype(np.float64)
        matrix = (self.slopes @ self.slopes.transpose(0, 2, 1)).astype(np.float64)
        matrix -= across.transpose(0, 2, 1) @ self._made_up(across)
        # The cost is least in the levels, so their change with the modes does not count.
        return matrix, (self.slopes @ self.residual[..., None])[..., 0].astype(np.float64)

    def projected_slopes(self) -> RealArray:
        """Return the slopes (m, 8, k) less what the levels make up for, which is no information."""
        across = self.linear @ self.slopes.transpose(0, 2, 1)
        return self.slopes - self._made_up(across).transpose(0, 2, 1) @ self.linear

    def _made_up(self, across: FloatArray) -> FloatArray:
        """Return (m, 11, 8) the change of levels that makes up best for each of the slopes."""
        return np.asarray(np.linalg.solve(self.gram, across))


def stiffness(variance: FloatArray, contrast: FloatArray, *, plain: bool = False) -> FloatArray:
    """Return (m, 11) the weight of squared levels beside squared residuals with `variance` (m,).

    An edge that is `plain` has no more than its Gaussian blur.
    """
    expected = np.maximum(np.abs(contrast), 1e-9)[:, None] * (_PLAIN if plain else _EXPECTED)
    return np.asarray(variance[:, None] / expected**2)


def fit_levels(bands: Bands, at: Places, share: Share, stiff: FloatArray) -> Levels:
    """Fit the levels of m blurred edges to the pixels of `bands`, with their `share` and `stiff` levels (m, 11)."""
    z = share.z
    root = bands.weight
    shapes = _shapes(at)
    linear = np.empty((len(z), LINEAR, z.shape[1]), z.dtype)
    np.multiply(shapes, share.share[:, None], out=linear[:, :_SHAPES])
    np.subtract(shapes, linear[:, :_SHAPES], out=linear[:, _SHAPES:-1])
    across, along = share.widths.across, share.widths.along
    wide = -(at.distance_px / _WIDER + 0.5 * _WIDER * at.curvature * along**2) / across
    linear[:, -1] = ndtr(wide) - share.straight
    weighted = linear * root[:, None]
    gram = (weighted @ weighted.transpose(0, 2, 1)).astype(np.float64)
    ridge = _RIDGE * np.trace(gram, axis1=1, axis2=2) / LINEAR + 1e-30
    gram += (stiff + ridge[:, None])[:, :, None] * np.eye(LINEAR)
    levels = np.linalg.solve(gram, (weighted @ (bands.levels * root)[..., None]).astype(np.float64))[..., 0]
    few = levels.astype(z.dtype)
    model = (few[:, None] @ linear)[:, 0]
    residual = (model - bands.levels) * root
    step = ((few[:, None, :_SHAPES] - few[:, None, _SHAPES:-1]) @ shapes)[:, 0]
    # The odd term moves with the edge.
    step += few[:, -1:] * (np.exp(np.minimum(0.5 * (z * z - wide * wide), 8.0)) / _WIDER - 1.0)
    square = np.einsum("mk,mk->m", residual, residual).astype(np.float64)
    return Levels(
        residual=residual,
        slopes=share.by_parameters * (step * root)[:, None],
        linear=weighted,
        gram=gram,
        model=model,
        contrast=levels[:, 0] - levels[:, _SHAPES],
        square=square,
        cost=square + np.sum(stiff * levels**2, axis=1),
    )


def _shapes(at: Places) -> RealArray:
    """Return the harmonic polynomials (m, 5, k) of p up to second order."""
    p0, p1 = at.plane
    shapes = np.empty((len(p0), _SHAPES, p0.shape[1]), p0.dtype)
    shapes[:, 0], shapes[:, 1], shapes[:, 2] = 1.0, p0, p1
    np.subtract(p0 * p0, p1 * p1, out=shapes[:, 3])
    np.multiply(2.0 * p0, p1, out=shapes[:, 4])
    return shapes
