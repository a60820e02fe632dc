"""Damped Gauss-Newton over the modes and blurs of many rims at once, the levels eliminated.

The cost is the sum of squared residuals (squared levels) plus the priors of the levels and of the blur. With the
gradient g and the information H of the eight parameters (coefficients of the five modes, log sigma, alpha, beta),
each step is -(H + lambda diag H)^-1 g (Levenberg 1944, Marquardt 1963). Each rim has its own damping lambda.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from circlepose._batching import put_rows, rows
from circlepose._numerics import ROUNDING_VARIANCE
from circlepose._typing import BoolArray, FloatArray, IntArray
from circlepose.geometry.cone_perturbation import MODES, grown
from circlepose.photometry.edge_spread import BLUR, EdgeSpreadFunction
from circlepose.photometry.intensity_model import DesignMatrix, Equations, FittedLevels, fit_levels
from circlepose.photometry.intensity_prior import IntensityPrior
from circlepose.photometry.options import DEFAULT, PhotometryOptions
from circlepose.photometry.pixel_band import Bands
from circlepose.photometry.rim_coordinates import RimCoordinates, rim_coordinates


@dataclass(frozen=True, slots=True, eq=False)
class Linearization:
    """The model of m rims, linearized at their cones and blurs."""

    factors: FloatArray
    """(m, 3, 3) of the viewing cones, camera frame"""
    blur: FloatArray
    """(m, 3) logarithm of the blur (px), and its inequality by direction, see `edge_spread`"""
    coordinates: RimCoordinates
    design: DesignMatrix
    texture_order: int = 0
    """order of the finest harmonic of texture; 0 for no texture"""

    @classmethod
    def of(
        cls,
        bands: Bands,
        factors: FloatArray,
        blur: FloatArray,
        edge_spread: EdgeSpreadFunction,
        *,
        texture_order: int = 0,
    ) -> Linearization:
        """Linearize at the cones with `factors` (m, 3, 3) and `blur` (m, 3), for the pixels of `bands`."""
        coordinates = rim_coordinates(bands, factors)
        spread = edge_spread(coordinates, blur)
        design = DesignMatrix.of(bands, coordinates, spread, texture_order=texture_order)
        return cls(factors, blur, coordinates, design, texture_order)

    def weighted(self, bands: Bands) -> Linearization:
        """Return the same with the weights of `bands`."""
        design = DesignMatrix.of(bands, self.coordinates, self.design.edge_spread, texture_order=self.texture_order)
        return replace(self, design=design)


@dataclass(frozen=True, slots=True, eq=False)
class GaussNewtonResult:
    """Where the iteration ended, for each of m rims."""

    factors: FloatArray
    """(m, 3, 3)"""
    blur: FloatArray
    """(m, 3)"""
    converged: BoolArray
    """(m,)"""
    linearization: Linearization
    """at the last parameters that were evaluated"""
    levels: FittedLevels
    """there"""
    equations: Equations
    """there"""
    last_step: FloatArray
    """(m, 8) from there to the result, without evaluation; 0 where the result was evaluated"""

    @property
    def is_evaluated(self) -> bool:
        """Whether all rims were evaluated at the result."""
        return not self.last_step.any()

    @property
    def square(self) -> FloatArray:
        """(m,) sum of squared residuals at the result."""
        return self.levels.square + np.sum(self.last_step * self.equations.gradient, axis=1)


def gauss_newton(
    bands: Bands,
    start: Linearization,
    edge_spread: EdgeSpreadFunction,
    prior_precision: FloatArray,
    blur_precision: FloatArray,
    blur_mean: FloatArray,
    outer_prior: IntensityPrior | None = None,
    *,
    fitted: tuple[FittedLevels, Equations] | None = None,
    last_step_errors: float | None = None,
    options: PhotometryOptions = DEFAULT,
) -> GaussNewtonResult:
    """Fit cones and blurs of m rims. The arrays of `start` are overwritten where rims move, to save memory.

    Parameters
    ----------
    bands
        The pixels and their weights.
    start
        The model at the start.
    edge_spread
        `straight_edge_spread` or `curved_edge_spread`.
    prior_precision
        (m, l) of the levels, see `level_prior_precision`.
    blur_precision, blur_mean
        (m, 3) prior of the blur's parameters; the precision is times the noise variance.
    outer_prior
        Prior of the levels from pixels outside the bands.
    fitted
        Levels and equations at the start, if they are known.
    last_step_errors
        Standard errors; a step with a smaller second-order effect is the last, and is not evaluated.
    options
        Tunable numbers.
    """
    if last_step_errors is None:
        last_step_errors = options.last_step_errors
    factors, blur = start.factors.copy(), start.blur.copy()
    every = np.arange(len(factors))

    def evaluate(
        now: Linearization, which: IntArray, known: tuple[FittedLevels, Equations] | None = None
    ) -> tuple[FittedLevels, Equations, FloatArray]:
        if known is None:
            prior = None if outer_prior is None else rows(outer_prior, which)
            levels = fit_levels(now.design, prior_precision[which], prior)
            known = levels, levels.normal_equations()
        levels, found = known
        offset = now.blur - blur_mean[which]
        found.gradient[:, MODES:] += blur_precision[which] * offset
        return levels, found, levels.cost + np.sum(blur_precision[which] * offset**2, axis=1)

    current, (levels, equations, cost) = start, evaluate(start, every, fitted)
    matrix, gradient = add_blur_prior(equations.matrix, blur_precision), equations.gradient.copy()
    damping = np.full(len(factors), options.start_damping)
    counted = np.maximum(np.sum(bands.weight, axis=1), 1.0)
    running = np.ones(len(factors), dtype=np.bool_)
    last_step = np.zeros((len(factors), MODES + BLUR))
    for _ in range(options.steps):
        inverse = np.asarray(np.linalg.inv(_damped(matrix, damping)), dtype=np.float64)
        step = -(inverse @ gradient[..., None])[..., 0]
        gain = -np.sum(step * gradient, axis=1)
        variance = np.maximum(cost, 0.0) / counted + ROUNDING_VARIANCE
        running &= (gain > options.converged_gain * variance) & (damping < options.most_damping)
        last = running & (_second_order(step, inverse, variance) < last_step_errors)
        if last.any():
            factors[last], blur[last] = _moved(factors[last], blur[last], step[last], options)
            last_step[last] = step[last]
            running &= ~last
        which = np.flatnonzero(running)
        if len(which) == 0:
            break
        some = bands if len(which) == len(every) else rows(bands, which)
        moved_to = _moved(factors[which], blur[which], step[which], options)
        # A step too far may overflow: it has no cost, and is not taken.
        with np.errstate(over="ignore", invalid="ignore"):
            trial = Linearization.of(some, *moved_to, edge_spread, texture_order=start.texture_order)
            new_levels, new_equations, new_cost = evaluate(trial, which)
        better = new_cost <= cost[which]
        raised = np.maximum(damping[which] * options.damping_increase, options.least_raised_damping)
        damping[which] = np.where(better, damping[which] * options.damping_decrease, raised)
        taken = which[better]
        factors[taken], blur[taken], cost[taken] = trial.factors[better], trial.blur[better], new_cost[better]
        matrix[taken] = add_blur_prior(new_equations.matrix, blur_precision[which])[better]
        gradient[taken] = new_equations.gradient[better]
        if len(taken) == len(every):
            current, levels, equations = trial, new_levels, new_equations
        elif len(taken):
            those = None if better.all() else np.flatnonzero(better)
            put_rows((current, levels, equations), taken, (trial, new_levels, new_equations), those)
    converged = ~running & (damping < options.most_damping)
    return GaussNewtonResult(factors, blur, converged, current, levels, equations, last_step)


def add_blur_prior(matrix: FloatArray, blur_precision: FloatArray) -> FloatArray:
    """Return the information (m, 8, 8) on modes and blurs with the precision (m, 3) of the blurs' prior added."""
    matrix = matrix.copy()
    matrix[:, MODES:, MODES:] += blur_precision[:, :, None] * np.eye(BLUR)
    return matrix


def _damped(matrix: FloatArray, damping: FloatArray) -> FloatArray:
    """Return the information (m, 8, 8) with `damping` (m,) times its diagonal added."""
    diagonal = np.einsum("mii->mi", matrix) + 1e-12
    return np.asarray(matrix + (diagonal * damping[:, None])[:, :, None] * np.eye(MODES + BLUR))


def _second_order(step: FloatArray, inverse: FloatArray, variance: FloatArray) -> FloatArray:
    """Return (m,) the second-order effect of a `step` (m, 8) on a rim, in standard errors of the rim."""
    error = np.sqrt(np.maximum(np.min(np.einsum("mii->mi", inverse)[:, :MODES], axis=1), 0.0) * variance)
    moved = np.abs(step[:, :MODES]).sum(axis=1)
    return moved * (moved + np.abs(step[:, MODES:]).sum(axis=1)) / np.maximum(error, 1e-30)


def _moved(
    factors: FloatArray, blur: FloatArray, step: FloatArray, options: PhotometryOptions
) -> tuple[FloatArray, FloatArray]:
    """Return the factors (m, 3, 3) and blurs (m, 3) after a `step` (m, 8), both within their bounds."""
    bound = options.most_anisotropy
    least = np.array([np.log(options.least_sigma_px), -bound, -bound])
    most = np.array([np.log(options.most_sigma_px), bound, bound])
    limited = np.minimum(np.maximum(step, -options.longest_step), options.longest_step)
    changed = blur + limited[:, MODES:]
    return grown(factors, limited[:, :MODES]), np.minimum(np.maximum(changed, least), most)
