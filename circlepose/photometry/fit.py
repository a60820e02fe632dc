"""Gray levels -> viewing cones: blurred edges fitted to the pixels around rims. Many rims at once.

The cost is the sum over pixels of w (I - measured)^2 (squared levels), with the model I of `intensity_model`, plus
the priors of levels and blur. It is minimized by `gauss_newton`, in turn with the selection of pixels: first a plain
edge on a part of the pixels, then all pixels with shading, then, where residuals are correlated, with texture.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from circlepose._batching import put_rows, rows
from circlepose._typing import BoolArray, FloatArray, IntArray
from circlepose.photometry.edge_spread import EdgeSpreadFunction, curved_edge_spread, straight_edge_spread
from circlepose.photometry.gauss_newton import GaussNewtonResult, Linearization, gauss_newton
from circlepose.photometry.intensity_model import fit_levels, level_prior_precision
from circlepose.photometry.intensity_prior import IntensityPrior
from circlepose.photometry.levels_fit import BlurPrior, LevelsFit, levels_fit, residual_variance
from circlepose.photometry.options import DEFAULT, PhotometryOptions
from circlepose.photometry.pixel_band import Bands, OuterSamples
from circlepose.photometry.pixel_selection import Pixels
from circlepose.photometry.segments import AT_RIM
from circlepose.photometry.texture import fit_texture, predicted_levels


@dataclass(frozen=True, slots=True, eq=False)
class _Problem:
    """What all rounds of a fit share."""

    pixels: Pixels
    blur_prior: BlurPrior
    radius_px: FloatArray
    """(m,) for the prior of quadratic shading"""
    edge_spread: EdgeSpreadFunction
    options: PhotometryOptions

    def prior_precision(
        self, variance: FloatArray, contrast: FloatArray, which: IntArray | slice, *, plain: bool = False
    ) -> FloatArray:
        """Return the precision (n, 11) of the levels' prior of the rims `which`."""
        radius_px = self.radius_px[which]
        return level_prior_precision(variance, contrast, radius_px, plain=plain, options=self.options)


def fit_to_levels(
    bands: Bands,
    factors: FloatArray,
    blur: FloatArray,
    blur_prior: BlurPrior,
    perimeter_px: FloatArray,
    limits: tuple[float, float] = (-np.inf, np.inf),
    *,
    neighbors: FloatArray | None = None,
    outer: OuterSamples | None = None,
    is_curved: bool = False,
    options: PhotometryOptions = DEFAULT,
) -> LevelsFit:
    """Fit the cones of m rims to the levels around them.

    Parameters
    ----------
    bands
        Pixels around the rims, k each, with their levels and rays.
    factors
        (m, 3, 3) of the cones at the start, camera frame.
    blur
        (m, 3) at the start, see `edge_spread`.
    blur_prior
        Prior of the blurs.
    perimeter_px
        (m,) of the rims, px.
    limits
        Levels at which the image is clipped. Pixels at a limit are inequality constraints.
    neighbors
        (m, k) levels that other rims close by add.
    outer
        Samples inside and outside the bands, a prior of the levels.
    is_curved
        Use the curved edge spread, which takes longer.
    options
        Tunable numbers.

    Returns
    -------
    LevelsFit
        Cones, covariances and statistics; `converged` is False for a rim whose levels do not determine its cone.
    """
    pixels = Pixels.of(bands, perimeter_px, limits, neighbors, options=options)
    bands = Bands(pixels.levels, bands.weight.copy(), bands.rays, bands.pixels)
    radius_px = perimeter_px / (2.0 * np.pi)
    if neighbors is not None:
        # The neighbors' levels are only approximate, so shading may be as uneven as on a large disc.
        radius_px = np.where(np.any(neighbors != 0.0, axis=1), np.inf, radius_px)
    edge_spread = curved_edge_spread if is_curved else straight_edge_spread
    problem = _Problem(pixels, blur_prior, radius_px, edge_spread, options)
    fit, bands, segment, may_have_texture = _fit_shaded(problem, bands, factors, blur, outer)
    which = np.flatnonzero(fit.converged & may_have_texture & (perimeter_px > options.texture_perimeter_px))
    if len(which):
        own = rows((fit, bands, blur_prior, (segment, pixels.segments)), which)
        textured, those = fit_texture(*own, edge_spread, options)
        put_rows(fit, which[those], textured)
    return fit


def _fit_shaded(
    problem: _Problem, bands: Bands, factors: FloatArray, blur: FloatArray, outer: OuterSamples | None
) -> tuple[LevelsFit, Bands, IntArray, BoolArray]:
    """Fit the rims with shading but no texture, in turn with the selection of pixels.

    Also returns the bands with their final weights, the segment (m, k) of each pixel, and where texture is likely.
    """
    pixels, blur_prior, options = problem.pixels, problem.blur_prior, problem.options
    linearization, precision = _fit_plain_edge(problem, bands, factors, blur)
    fitted = fit_levels(linearization.design, precision)
    weight = bands.weight.copy()
    every = slice(None)
    selected, outliers, segment = pixels.select(every, linearization, fitted, weight, options=options)
    which = np.flatnonzero(np.any(selected != weight, axis=1))
    weight[which] = selected[which]
    bands = bands.weighted(weight)
    variance = residual_variance(fitted.square, bands)
    if len(which):
        some = rows(bands, which)
        fewer = rows(linearization, which).weighted(some)
        levels = fit_levels(fewer.design, precision[which])
        variance[which] = residual_variance(levels.square, some)
        precision[which] = problem.prior_precision(variance[which], levels.contrast, which)
        put_rows((linearization, fitted), which, (fewer, fit_levels(fewer.design, precision[which])))
    blur_precision = variance[:, None] * blur_prior.information
    start = fitted, fitted.normal_equations()
    prior = None
    if outer is not None:
        near = predicted_levels(*start, blur_precision, variance)
        prior = IntensityPrior.of(outer, linearization.factors, near, variance, options=options)
        start = fitted.updated(prior, start[1])
    result = gauss_newton(
        bands,
        linearization,
        problem.edge_spread,
        precision,
        blur_precision,
        blur_prior.mean,
        prior,
        fitted=start,
        options=options,
    )
    # The arrays of a linearization take most of the memory: keep one at a time.
    del fitted, start
    # Rims without outliers keep their pixels. (`weight` is the array in `bands`.)
    for _ in range(options.fit_rounds - 1 if len(which) else 0):
        selected, outliers[which], segment[which] = pixels.select(
            which, result.linearization, result.levels, weight, options=options
        )
        changed = np.flatnonzero(np.any(selected != weight[which], axis=1))
        if len(changed) == 0:
            break
        which = which[changed]
        weight[which] = selected[changed]
        some = rows(bands, which)
        square = np.sum((result.levels.residual[which] * some.weight) ** 2, axis=1)
        variance[which] = residual_variance(square, some)
        precision[which] = problem.prior_precision(variance[which], result.levels.contrast[which], which)
        blur_precision[which] = variance[which, None] * blur_prior.information[which]
        put_rows(result, which, _refit(problem, some, which, result, (precision, blur_precision), prior))
    at_rim = zip(outliers, pixels.segments, strict=True)
    rim_used = 1.0 - np.array([cells[:number, AT_RIM].mean() for cells, number in at_rim])
    fit = levels_fit(result, bands, blur_prior, (segment, pixels.segments), rim_used, precision, options)
    is_correlated = fit.correlation > 1.0
    return fit, bands, segment, is_correlated if prior is None else is_correlated | ~prior.is_continued


def _refit(
    problem: _Problem,
    bands: Bands,
    which: IntArray,
    before: GaussNewtonResult,
    precisions: tuple[FloatArray, FloatArray],
    prior: IntensityPrior | None,
) -> GaussNewtonResult:
    """Fit the rims `which` again with the weights of their `bands`; `precisions` of levels and blurs are of all."""
    start = rows(before.linearization, which).weighted(bands)
    setting = rows((*precisions, problem.blur_prior.mean, prior), which)
    return gauss_newton(bands, start, problem.edge_spread, *setting, options=problem.options)


def _fit_plain_edge(
    problem: _Problem, bands: Bands, factors: FloatArray, blur: FloatArray
) -> tuple[Linearization, FloatArray]:
    """Fit edges with a Gaussian blur and no halo, which could be taken for blur, to a part of the pixels.

    Returns the model of all pixels at the result, and the precision (m, 11) of the levels' prior from then on.
    """
    blur_prior, edge_spread, options = problem.blur_prior, problem.edge_spread, problem.options
    step = bands.levels.shape[1] // options.first_pixels
    few = bands.thinned(step) if step > 1 else bands
    linearization = Linearization.of(few, factors, blur, edge_spread)
    square, contrast = linearization.design.noise_and_contrast()
    variance = residual_variance(square, few)
    every = slice(None)
    result = gauss_newton(
        few,
        linearization,
        edge_spread,
        problem.prior_precision(variance, contrast, every, plain=True),
        variance[:, None] * blur_prior.information,
        blur_prior.mean,
        last_step_errors=options.first_last_step_errors,
        options=options,
    )
    precision = problem.prior_precision(residual_variance(result.square, few), result.levels.contrast, every)
    if few is bands and result.is_evaluated:
        return result.linearization, precision
    factors, blur = result.factors, result.blur
    # The arrays of a linearization take most of the memory: keep one at a time.
    del result, linearization
    return Linearization.of(bands, factors, blur, edge_spread), precision
