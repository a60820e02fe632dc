"""The result of a fit to gray levels: cones with the covariance of their modes, noise, and what was left out.

With H the information of modes and blur, the levels eliminated, and v the variance of the residuals (squared levels),
the covariance of the modes' coefficients is v (H + prior)^-1, times the correlation of neighboring residuals.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from circlepose._numerics import ROUNDING_VARIANCE
from circlepose._typing import BoolArray, FloatArray, IntArray, RealArray
from circlepose.geometry.cone_perturbation import MODES
from circlepose.photometry.edge_spread import BLUR
from circlepose.photometry.gauss_newton import GaussNewtonResult, add_blur_prior
from circlepose.photometry.options import PhotometryOptions
from circlepose.photometry.pixel_band import Bands
from circlepose.photometry.residual_correlation import residual_correlation
from circlepose.photometry.rim_coordinates import LEVELS

_WORST_CONDITION = 1e14
"""Condition number of the information from which it is singular in float64."""


@dataclass(frozen=True, slots=True, eq=False)
class BlurPrior:
    """The prior of the blurs of m rims; parameters as in `edge_spread`."""

    mean: FloatArray
    """(m, 3)"""
    information: FloatArray
    """(m, 3) inverse variances; 0 for no prior"""


@dataclass(frozen=True, slots=True, eq=False)
class LevelsFit:
    """Blurred edges fitted to the levels around m rims."""

    factors: FloatArray
    """(m, 3, 3) of the viewing cones, camera frame"""
    covariance: FloatArray
    """(m, 5, 5) of the coefficients of the modes of these factors, with blur and levels unknown"""
    blur: FloatArray
    """(m, 3) see `edge_spread`; the pixel's box included"""
    blur_variance: FloatArray
    """(m, 3)"""
    noise_levels: FloatArray
    """(m,) standard deviation of the residuals"""
    correlation: FloatArray
    """(m,) of neighboring residuals, see `residual_correlation`; the covariance includes it"""
    contrast_levels: FloatArray
    """(m,) inside minus outside"""
    rim_used: FloatArray
    """(m,) share of the rim that is in use"""
    converged: BoolArray
    """(m,)"""
    weight: RealArray
    """(m, k) final weights of the pixels"""
    prior_precision: FloatArray
    """(m, 11) of the levels, see `level_prior_precision`"""


def levels_fit(
    result: GaussNewtonResult,
    bands: Bands,
    blur_prior: BlurPrior,
    segments: tuple[IntArray, IntArray],
    rim_used: FloatArray,
    prior_precision: FloatArray,
    options: PhotometryOptions,
) -> LevelsFit:
    """Return a result with its statistics; `segments` are that (m, k) of each pixel, and their number (m,)."""
    levels = result.levels
    slopes = levels.projected_slopes(result.equations)
    residual = levels.residual + (result.last_step.astype(slopes.dtype)[:, None] @ slopes)[:, 0]
    variance = residual_variance(np.einsum("mk,mk->m", residual, residual), bands)
    matrix = add_blur_prior(result.equations.matrix, variance[:, None] * blur_prior.information)
    eigenvalues = np.linalg.eigvalsh(matrix)
    is_determined = (np.sum(bands.weight, axis=1) >= options.least_pixels) & (
        eigenvalues[:, -1] < _WORST_CONDITION * eigenvalues[:, 0]
    )
    matrix = np.where(is_determined[:, None, None], matrix, np.eye(MODES + BLUR))
    inverse = np.asarray(np.linalg.inv(matrix), dtype=np.float64)
    correlation = residual_correlation(slopes, residual, *segments, inverse, variance, options=options)
    covariance = inverse * variance[:, None, None]
    return LevelsFit(
        factors=result.factors,
        covariance=covariance[:, :MODES, :MODES] * correlation[:, None, None],
        blur=result.blur,
        blur_variance=np.einsum("mii->mi", covariance)[:, MODES:],
        noise_levels=np.sqrt(variance),
        correlation=correlation,
        contrast_levels=levels.contrast,
        rim_used=rim_used,
        converged=result.converged & is_determined,
        weight=bands.weight,
        prior_precision=prior_precision,
    )


def residual_variance(square: FloatArray, bands: Bands, levels: int = LEVELS) -> FloatArray:
    """Return the variance (m,) about a model with that number of `levels`, from the sum of squares (m,)."""
    counted = np.sum(bands.weight, axis=1)
    return np.maximum(square / np.maximum(counted - levels - MODES - BLUR, 1.0), ROUNDING_VARIANCE)
