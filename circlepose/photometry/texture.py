"""The fit of rims between textured surfaces: levels for texture, with the most likely strength. Many rims at once.

Texture near a rim would otherwise be taken for a displaced edge. With e the estimated coefficients of texture
(levels) and C their covariance, the strength t maximizes the likelihood of e ~ N(0, C + t^2 I); texture is accepted
if the likelihood is far above that of t = 0. The selection of pixels is kept: with texture, an object that hides the
rim would fit.
"""

from __future__ import annotations

import numpy as np

from circlepose._batching import rows
from circlepose._typing import FloatArray, IntArray
from circlepose.photometry.edge_spread import EdgeSpreadFunction, curved_edge_spread
from circlepose.photometry.gauss_newton import Linearization, add_blur_prior, gauss_newton
from circlepose.photometry.intensity_model import Equations, FittedLevels, fit_levels
from circlepose.photometry.levels_fit import BlurPrior, LevelsFit, levels_fit, residual_variance
from circlepose.photometry.options import PhotometryOptions
from circlepose.photometry.pixel_band import Bands
from circlepose.photometry.texture_basis import texture_functions

_RIDGE = 1e-12
"""Relative to the trace of the information: keeps it invertible for a rim without pixels."""


def fit_texture(
    fit: LevelsFit,
    bands: Bands,
    blur_prior: BlurPrior,
    segments: tuple[IntArray, IntArray],
    edge_spread: EdgeSpreadFunction,
    options: PhotometryOptions,
) -> tuple[LevelsFit, IntArray]:
    """Return the fits with texture, and the indices (n,) of those of the m rims that have texture and converged.

    `segments` are that (m, k) of each pixel, and their number (m,).
    """
    order = options.curved_texture_order if edge_spread is curved_edge_spread else options.texture_order
    linearization = Linearization.of(bands, fit.factors, fit.blur, edge_spread, texture_order=order)
    kept = fit.prior_precision.shape[1] // 2
    unknown = (fit.noise_levels / (options.texture_start * np.abs(fit.contrast_levels))) ** 2
    loose = np.tile(unknown[:, None], texture_functions(order))
    inside, outside, halo = np.split(fit.prior_precision, [kept, 2 * kept], axis=1)
    prior_precision = np.concatenate([inside, loose, outside, loose, halo], axis=1)
    fitted = fit_levels(linearization.design, prior_precision)
    variance = residual_variance(fitted.square, bands, prior_precision.shape[1])
    blur_precision = variance[:, None] * blur_prior.information
    levels, covariance = predicted_levels(fitted, fitted.normal_equations(), blur_precision, variance)
    side = prior_precision.shape[1] // 2
    extra = np.r_[kept:side, side + kept : prior_precision.shape[1] - 1]
    trials = np.geomspace(options.least_texture, options.most_texture, options.texture_trials)
    strengths = np.abs(fit.contrast_levels)[:, None] * trials
    strength, gain = _most_likely(levels[:, extra], covariance[:, extra[:, None], extra], strengths)
    prior_precision[:, kept:side] = prior_precision[:, side + kept : -1] = (variance / strength**2)[:, None]
    is_textured = np.flatnonzero(gain > options.texture_log_likelihood)
    if len(is_textured) == 0:
        return rows(fit, is_textured), is_textured
    if len(is_textured) < len(gain):
        fit, bands, blur_prior = rows((fit, bands, blur_prior), is_textured)
        segments, prior_precision, blur_precision = rows((segments, prior_precision, blur_precision), is_textured)
        linearization = Linearization.of(bands, fit.factors, fit.blur, edge_spread, texture_order=order)
    result = gauss_newton(
        bands, linearization, edge_spread, prior_precision, blur_precision, blur_prior.mean, options=options
    )
    again = levels_fit(result, bands, blur_prior, segments, fit.rim_used, fit.prior_precision, options)
    converged = np.flatnonzero(again.converged)
    return rows(again, converged), is_textured[converged]


def predicted_levels(
    fitted: FittedLevels, equations: Equations, blur_precision: FloatArray, variance: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the levels (m, l) after the next step, and their covariance (m, l, l) with the rim unknown."""
    matrix = add_blur_prior(equations.matrix, blur_precision)
    ridge = _RIDGE * np.trace(matrix, axis1=1, axis2=2) + _RIDGE
    inverse = np.linalg.inv(matrix + ridge[:, None, None] * np.eye(matrix.shape[1]))
    response = equations.level_response
    change = response @ (inverse @ equations.gradient[..., None])
    covariance = np.linalg.inv(fitted.gram) + response @ inverse @ response.transpose(0, 2, 1)
    return fitted.levels + change[..., 0], covariance * variance[:, None, None]


def _most_likely(levels: FloatArray, covariance: FloatArray, strengths: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (m,) the most likely of the `strengths` (m, n), and its gain in log likelihood over no texture.

    `levels` (m, l) are the estimated coefficients of texture with `covariance` (m, l, l).
    """
    spread, turn = np.linalg.eigh(covariance)
    square = (np.swapaxes(turn, -1, -2) @ levels[..., None])[..., 0] ** 2
    added = np.column_stack([np.zeros(len(strengths)), strengths])[..., None] ** 2
    variances = np.maximum(spread, 1e-12)[:, None] + added
    likelihood = -0.5 * np.sum(np.log(variances) + square[:, None] / variances, axis=-1)
    best = np.argmax(likelihood[:, 1:], axis=1)
    rim = np.arange(len(strengths))
    return strengths[rim, best], likelihood[rim, 1 + best] - likelihood[:, 0]
