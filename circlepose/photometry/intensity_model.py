"""The model of the gray levels near a rim, and its linear least squares. Many rims at once.

With the coverage c of a pixel (`edge_spread`), z its distance from the blurred edge in blurs, and p its coordinates
(`rim_coordinates`), the level is

    I = out(p) (1 - c) + in(p) c + w (Phi(z') - Phi(z)).

`in` and `out` are harmonic polynomials of p: even shading is modeled exactly, texture approximately. The last term is
the halo: it stands for the part of the blur that is not Gaussian (sharpening, tails of defocus); z' belongs to a
wider blur. It is odd about the edge, so it cannot displace it. The model is linear in these eleven levels (gray
levels), which are eliminated (variable projection); the coefficients of the five modes of the cone and the blur
remain. All levels but the two means have a prior around zero, relative to the contrast, so that a disc of few pixels
is not overfitted (`level_prior_precision`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from circlepose._numerics import normal_pdf_cdf
from circlepose._typing import FloatArray, RealArray
from circlepose.photometry.edge_spread import EdgeSpread
from circlepose.photometry.intensity_prior import IntensityPrior
from circlepose.photometry.options import DEFAULT, PhotometryOptions
from circlepose.photometry.pixel_band import Bands
from circlepose.photometry.rim_coordinates import RimCoordinates
from circlepose.photometry.texture_basis import texture_basis

_RIDGE = 1e-9
"""Relative to the mean square of the columns: keeps levels finite that no pixel determines."""
_HALO_WIDTH = 2.5
"""Ratio of the halo's blur to that of the edge."""
_QUADRATIC = np.array([3, 4, 8, 9])
"""Indices of the quadratic levels."""


@dataclass(frozen=True, slots=True, eq=False)
class Equations:
    """Normal equations of modes and blur, the levels eliminated."""

    matrix: FloatArray
    """(m, 8, 8)"""
    gradient: FloatArray
    """(m, 8)"""
    level_response: FloatArray
    """(m, l, 8) the change of levels that best compensates each derivative"""


@dataclass(frozen=True, slots=True, eq=False)
class FittedLevels:
    """The levels of least squares for given cones and blurs; each pixel has the weight 0 or 1."""

    residual: RealArray
    """(m, k) model minus measured"""
    slopes: RealArray
    """(m, 8, k) derivatives to the five modes and the blur, at fixed levels"""
    linear: RealArray
    """(m, l + 1, k) derivatives to the levels; the last row is the measured levels"""
    gram: FloatArray
    """(m, l, l) information on the levels, times the noise variance"""
    levels: FloatArray
    """(m, l) with l 11, or more with texture"""
    model: RealArray
    """(m, k) predicted levels, also of pixels with weight 0"""
    square: FloatArray
    """(m,) sum of squared residuals"""
    cost: FloatArray
    """(m,) `square` plus the prior's sum of squares"""

    @property
    def contrast(self) -> FloatArray:
        """Mean level inside minus outside, around the rim (m,)."""
        return self.levels[:, 0] - self.levels[:, self.levels.shape[1] // 2]

    def normal_equations(self) -> Equations:
        """Return the equations of the modes and the blur, the levels eliminated."""
        across = (self.linear @ self.slopes.transpose(0, 2, 1)).astype(np.float64)[:, :-1]
        level_response = np.linalg.solve(self.gram, across)
        # In halves: BLAS takes another routine for a matrix times its own transpose, four times slower at this size.
        half = self.slopes.shape[1] // 2
        transposed = self.slopes.transpose(0, 2, 1)
        parts = (self.slopes[:, :half] @ transposed, self.slopes[:, half:] @ transposed)
        matrix = np.concatenate(parts, axis=1).astype(np.float64)
        matrix -= across.transpose(0, 2, 1) @ level_response
        # The derivative of the cost to the levels is zero, so their change with the modes has no effect here.
        gradient = (self.slopes @ self.residual[..., None])[..., 0].astype(np.float64)
        return Equations(matrix, gradient, np.asarray(level_response))

    def updated(self, prior: IntensityPrior, equations: Equations) -> tuple[FittedLevels, Equations]:
        """Return the levels after the `prior` is added, and the `equations` that belong to them.

        For a small change of the levels: the derivatives, which are proportional to them, and the model are kept.
        """
        gram = self.gram + prior.gram
        change = np.linalg.solve(gram, (prior.right - (prior.gram @ self.levels[..., None])[..., 0])[..., None])
        levels = self.levels + change[..., 0]
        across = self.gram @ equations.level_response
        level_response = np.asarray(np.linalg.solve(gram, across))
        transposed = across.transpose(0, 2, 1)
        updated = Equations(
            equations.matrix + transposed @ (equations.level_response - level_response),
            equations.gradient + (transposed @ change)[..., 0],
            level_response,
        )
        moved = (change.transpose(0, 2, 1).astype(self.linear.dtype) @ self.linear[:, :-1])[:, 0]
        cost = self.cost + np.sum(change * (self.gram @ change), axis=(1, 2)) + prior.misfit(levels)
        return replace(self, residual=self.residual + moved, gram=gram, levels=levels, cost=cost), updated

    def projected_slopes(self, equations: Equations) -> RealArray:
        """Return the derivatives (m, 8, k) less their projection on those to the levels."""
        level_response = equations.level_response.transpose(0, 2, 1).astype(self.slopes.dtype)
        return self.slopes - level_response @ self.linear[:, :-1]


@dataclass(frozen=True, slots=True, eq=False)
class DesignMatrix:
    """The derivatives of the model to the levels, and the sums over pixels of their products."""

    edge_spread: EdgeSpread
    basis: RealArray
    """(m, s, k) functions of `in` and `out`, 5 or more"""
    columns: RealArray
    """(m, 2 s + 2, k) derivatives to the levels, then the measured levels, without weight"""
    weighted: RealArray
    """(m, 2 s + 2, k) the same with weight"""
    weight: RealArray
    """(m, k)"""
    products: FloatArray
    """(m, 2 s + 2, 2 s + 2)"""
    halo_slope: RealArray
    """(m, k) derivative of the halo term to the edge's displacement, relative to that of the coverage"""

    @classmethod
    def of(
        cls, bands: Bands, coordinates: RimCoordinates, edge_spread: EdgeSpread, *, texture_order: int = 0
    ) -> Self:
        """Return that of the pixels of `bands`.

        Parameters
        ----------
        bands
            The pixels, their levels and weights.
        coordinates, edge_spread
            Those of the same pixels.
        texture_order
            Order of the finest harmonic of texture; 0 for no texture.
        """
        z = edge_spread.z
        basis = texture_basis(coordinates, texture_order) if texture_order else coordinates.harmonics
        number = basis.shape[1]
        # An even number of rows makes the product faster; the measured levels give the right-hand side.
        columns = np.empty((len(z), 2 * number + 2, z.shape[1]), z.dtype)
        np.multiply(basis, edge_spread.coverage[:, None], out=columns[:, :number])
        np.subtract(basis, columns[:, :number], out=columns[:, number:-2])
        across, along = edge_spread.widths.across, edge_spread.widths.along
        shift = 0.5 * _HALO_WIDTH * coordinates.curvature * along**2
        wide = -(coordinates.distance_px / _HALO_WIDTH + shift) / across
        columns[:, -2] = normal_pdf_cdf(wide)[1] - edge_spread.straight_coverage
        columns[:, -1] = bands.levels
        halo_slope = np.exp(np.minimum(0.5 * (z * z - wide * wide), 8.0)) / _HALO_WIDTH - 1.0
        weighted = columns * bands.weight[:, None]
        products = (weighted @ columns.transpose(0, 2, 1)).astype(np.float64)
        return cls(edge_spread, basis, columns, weighted, bands.weight, products, halo_slope)

    def noise_and_contrast(self) -> tuple[FloatArray, FloatArray]:
        """Return the sum of squared residuals (m,) and the contrast (m,) without a prior on the levels.

        From the sums alone: fast, and accurate to a few hundredths of a squared level per pixel.
        """
        gram, right = _regularized(self.products[:, :-1, :-1]), self.products[:, :-1, -1]
        levels = np.asarray(np.linalg.solve(gram, right[..., None])[..., 0])
        square = self.products[:, -1, -1] - np.sum(levels * right, axis=1)
        return square, levels[:, 0] - levels[:, self.basis.shape[1]]


def level_prior_precision(
    variance: FloatArray,
    contrast: FloatArray,
    radius_px: FloatArray,
    *,
    plain: bool = False,
    options: PhotometryOptions = DEFAULT,
) -> FloatArray:
    """Return the precision (m, 11) of the levels' prior, times the noise variance.

    Parameters
    ----------
    variance
        (m,) of the noise, squared levels.
    contrast
        (m,) levels inside minus outside.
    radius_px
        (m,) of the rims, px; infinite for shading as strong as on a large disc.
    plain
        Suppress the halo term: the blur is Gaussian only.
    options
        Tunable numbers.
    """
    linear, quadratic = [options.linear_shading] * 2, [options.quadratic_shading] * 2
    side = [np.inf, *linear, *quadratic]
    relative = np.array([*side, *side, options.plain_halo if plain else options.halo])
    sigma = np.maximum(np.abs(contrast), 1e-9)[:, None] * relative
    sigma[:, _QUADRATIC] *= np.minimum(radius_px / options.large_radius_px, 1.0)[:, None] ** 2
    return np.asarray(variance[:, None] / sigma**2)


def fit_levels(
    design: DesignMatrix, prior_precision: FloatArray, prior: IntensityPrior | None = None
) -> FittedLevels:
    """Fit the levels of m rims.

    Parameters
    ----------
    design
        Derivatives to the levels, at given cones and blurs.
    prior_precision
        (m, l) of each level around zero, times the noise variance.
    prior
        What samples outside the band add about the levels.
    """
    basis = design.basis
    number = basis.shape[1]
    gram = _regularized(design.products[:, :-1, :-1], prior_precision)
    right = design.products[:, :-1, -1]
    if prior is not None:
        gram, right = gram + prior.gram, right + prior.right
    levels = np.asarray(np.linalg.solve(gram, right[..., None])[..., 0])
    few = levels.astype(basis.dtype)[:, None]
    model = (few @ design.columns[:, :-1])[:, 0]
    residual = (model - design.columns[:, -1]) * design.weight
    step = ((few[..., :number] - few[..., number:-1]) @ basis)[:, 0]
    # The halo moves with the edge.
    step += few[..., -1] * design.halo_slope
    step *= design.weight
    square = np.einsum("mk,mk->m", residual, residual).astype(np.float64)
    misfit = 0.0 if prior is None else prior.misfit(levels)
    return FittedLevels(
        residual=residual,
        slopes=design.edge_spread.derivatives * step[:, None],
        linear=design.weighted,
        gram=gram,
        levels=levels,
        model=model,
        square=square,
        cost=square + np.sum(prior_precision * levels**2, axis=1) + misfit,
    )


def _regularized(gram: FloatArray, prior_precision: FloatArray | float = 0.0) -> FloatArray:
    """Return the information (m, l, l) on levels with the `prior_precision` (m, l) and a ridge."""
    ridge = _RIDGE * np.trace(gram, axis1=1, axis2=2) / gram.shape[1] + 1e-30
    return np.asarray(gram + (prior_precision + ridge[:, None])[:, :, None] * np.eye(gram.shape[1]))
