"""The model of the image of a blurred ellipse, its derivatives and its least squares.

With x along the major axis, y across, and x' = a sin u,

    c(x, y) = integral G(x - a sin u) [Phi((y + b cos u)/sigma) - Phi((y - b cos u)/sigma)] a cos u du

is the coverage of the pixel at (x, y) by the ellipse, where the Gaussian of sigma (px) stands for blur and pixel box.
The level is out (1 - c) + in c, with a linear gradient in `out`, and one along the major axis in `in`; a gradient
across it would look like a shift of a segment. The model is exact for any axes, down to a segment. The time per pixel
does not depend on the size, but the quadrature is made for b up to about 10 sigma.

The parameters theta (6,) are center x, y, semi-major, semi-minor axis (px), angle (rad) and sigma (px).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from circlepose._numerics import ROUNDING_VARIANCE, normal_pdf_cdf
from circlepose._typing import BoolArray, FloatArray, Image
from circlepose.photometry.thin.options import ThinOptions

_NODES, _NODE_WEIGHTS = np.polynomial.legendre.leggauss(20)
_HALF_WIDTH_SIGMAS = 4.5
"""Half-width of the integral, in blurs: what is outside is below 1e-5."""
_LEAST_SQUARE = 1e-12
"""Lower bound of cos^2 u in a logarithm."""
_LEVELS = 5
"""Levels: in, out, two gradients of `out`, one of `in`."""
_PARAMETERS_AND_LEVELS = 10.0
"""Subtracted from the number of pixels for the variance."""
_LEAST_PIXELS = 12


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """The pixels around an ellipse, and which of them are fitted."""

    points: FloatArray
    """(n, 2) px"""
    levels: FloatArray
    """(n,)"""
    fade: FloatArray
    """(n,) square root of the weight of each pixel"""
    chosen: BoolArray
    """(n,) pixels that are fitted"""
    origin: FloatArray
    """(2,) center of the ellipse at the start, px"""
    semi_major: float
    """of the ellipse at the start, px"""
    options: ThinOptions


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """The fit at given parameters: its residuals (levels) and their derivatives."""

    theta: FloatArray
    """(6,)"""
    cost: float
    """squared levels, with the blur's prior"""
    jacobian: FloatArray
    """(n + 3, 6) the levels eliminated"""
    residual: FloatArray
    """(n + 3,) 0 for a pixel that is not fitted; the last three are the prior of the gradients"""
    misfit: FloatArray
    """(n,) weighted residuals of all pixels"""
    taper_slope: FloatArray
    """(n + 3,) derivative to the exponent p of the width (1 - (x/a)^2)^p, at the 1/2 of an ellipse"""
    contrast: float
    """levels inside minus outside"""
    highest_coverage: float
    variance: float
    """of the residuals, squared levels"""
    rms: float
    """of the residuals, levels"""


def levenberg_marquardt(problem: Problem, theta: FloatArray, steps: int) -> State | None:
    """Fit from `theta` (6,) in at most that number of steps; None if the ellipse leaves its object.

    Source: Levenberg (1944), Marquardt (1963).
    """
    options = problem.options
    damping = options.start_damping
    state = evaluate(theta, problem)
    for _ in range(steps):
        prior = prior_information(state.variance, options)
        normal_matrix = state.jacobian.T @ state.jacobian + prior
        gradient = state.jacobian.T @ state.residual + prior @ (state.theta - _prior_mean(state.theta, options))
        scale = np.diag(np.maximum(np.diag(normal_matrix), 1e-12))
        step = -np.linalg.solve(normal_matrix + damping * scale, gradient)
        trial = state.theta + step
        trial[3] = max(abs(trial[3]), options.least_semi_minor_px)
        trial[5] = np.clip(trial[5], options.least_sigma_px, options.most_sigma_px)
        has_left = np.any(np.abs(trial[:2] - problem.origin) > trial[2])
        if not 0.0 < trial[2] < options.most_growth * problem.semi_major or has_left:
            return None
        after = evaluate(trial, problem)
        if after.cost <= state.cost:
            is_short = bool(np.all(np.abs(step[:4]) < options.converged_step))
            done = is_short or state.cost - after.cost < options.converged_gain * state.cost
            state, damping = after, damping * options.damping_decrease
            if done:
                break
        else:
            damping *= options.damping_increase
            if damping > options.most_damping:
                break
    return state


def _prior_mean(theta: FloatArray, options: ThinOptions) -> FloatArray:
    """Return `theta` with the prior mean of the blur, which cannot be separated from the width of a segment."""
    mean = theta.copy()
    mean[5] = options.start_sigma_px
    return mean


def prior_information(variance: float, options: ThinOptions) -> FloatArray:
    """Return the prior information (6, 6) on theta, times the `variance` of the levels."""
    return np.diag([0.0, 0.0, 0.0, 0.0, 0.0, variance / options.sigma_prior_px**2])


def taper(state: State, options: ThinOptions) -> tuple[float, float]:
    """Return the exponent p of the width (1 - (x/a)^2)^p, and its standard deviation.

    To first order from the 1/2 of an ellipse, with all other parameters free: about 0 for a bar, 1 between two arcs.
    """
    prior = prior_information(state.variance, options)
    information = state.jacobian.T @ state.jacobian + prior
    shared = state.jacobian.T @ state.taper_slope
    # Project out what the other parameters can compensate.
    own = state.taper_slope - state.jacobian @ np.linalg.pinv(information, hermitian=True) @ shared
    square = float(own @ state.taper_slope)
    if square <= 0.0:
        return 0.5, np.inf
    return 0.5 - float(own @ state.residual) / square, float(np.sqrt(state.variance / square))


def pixels_around(
    grey: Image, theta: FloatArray, length_factor: float, options: ThinOptions
) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """Return the pixels (n, 2) within the margin of the ellipse, their levels (n,) and square roots of weights (n,).

    The semi-major axis is multiplied by `length_factor`. None if there are too few pixels, or too many.
    """
    margin, deep_px = options.margin_px, options.deep_px
    a, b, angle = theta[2] * length_factor, theta[3], theta[4]
    cos, sin = np.cos(angle), np.sin(angle)
    half = np.array([np.hypot(a * cos, b * sin), np.hypot(a * sin, b * cos)]) + margin
    low = np.maximum(np.floor(theta[:2] - half), 0).astype(int)
    high = np.minimum(np.ceil(theta[:2] + half) + 1, [grey.shape[1], grey.shape[0]]).astype(int)
    if np.any(high - low < 3):
        return None
    x, y = np.meshgrid(np.arange(low[0], high[0]), np.arange(low[1], high[1]))
    u, v = x - theta[0], y - theta[1]
    radius = np.hypot((cos * u + sin * v) / (a + margin), (cos * v - sin * u) / (b + margin))
    near = radius < 1.0
    if b > deep_px + 1.0:
        deep = np.hypot((cos * u + sin * v) / (a - deep_px), (cos * v - sin * u) / (b - deep_px)) < 1.0
        near &= ~deep
    if not _LEAST_PIXELS <= int(np.count_nonzero(near)) <= options.most_pixels:
        return None
    points = np.stack([x[near], y[near]], axis=-1).astype(np.float64)
    # Smooth weights: a step of the weight near another object would bias the fit.
    fade = np.clip((1.0 - radius[near]) / options.fade, 0.0, 1.0)
    return points, grey[y[near], x[near]].astype(np.float64), np.sqrt(fade)


def evaluate(theta: FloatArray, problem: Problem) -> State:
    """Return residuals and their derivatives at `theta` (6,), the levels eliminated.

    Source: variable projection, Golub & Pereyra (1973).
    """
    options = problem.options
    coverage, derivatives = _coverage(theta, problem.points)
    offset = problem.points - problem.origin
    outside = 1.0 - coverage
    along = offset @ np.array([np.cos(theta[4]), np.sin(theta[4])])
    columns = (coverage, outside, outside * offset[:, 0], outside * offset[:, 1], coverage * along)
    linear = np.stack(columns, axis=-1)
    root = problem.fade * problem.chosen
    weight = float(np.sum(root**2))
    gradient_prior = np.zeros((3, _LEVELS))
    gradient_prior[:, 2:] = np.sqrt(weight) * options.gradient_px * np.eye(3)
    basis, triangle = np.linalg.qr(np.concatenate([linear * root[:, None], gradient_prior]))
    number = len(root)
    coefficients = np.linalg.lstsq(triangle, basis[:number].T @ (problem.levels * root), rcond=1e-10)[0]
    misfit = (linear @ coefficients - problem.levels) * problem.fade
    residual = np.append(misfit * problem.chosen, gradient_prior @ coefficients)
    out = coefficients[1] + offset @ coefficients[2:4]
    slopes = np.zeros((number + len(gradient_prior), derivatives.shape[1]))
    slopes[:number] = derivatives * ((coefficients[0] + along * coefficients[4] - out) * root)[:, None]
    # Project out what a change of the levels can compensate.
    slopes = slopes - basis @ (basis.T @ slopes)
    square = float(np.sum(residual[:number] ** 2))
    variance = max(square / max(weight - _PARAMETERS_AND_LEVELS, 1.0), ROUNDING_VARIANCE)
    prior = variance * (theta[5] - options.start_sigma_px) ** 2 / options.sigma_prior_px**2
    contrast = float(coefficients[0] - coefficients[1])
    return State(
        theta=theta,
        cost=float(residual @ residual) + prior,
        jacobian=slopes[:, :-1],
        taper_slope=slopes[:, -1],
        residual=residual,
        misfit=misfit,
        contrast=contrast,
        highest_coverage=float(coverage.max()),
        variance=variance,
        rms=float(np.sqrt(square / max(weight, 1.0))),
    )


def _coverage(theta: FloatArray, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the coverage c (n,) and its derivatives (n, 7) to center x, y, a, b, angle, sigma and the taper."""
    a, b, angle, sigma = theta[2:]
    cos, sin = np.cos(angle), np.sin(angle)
    offset = points - theta[:2]
    x = cos * offset[:, 0] + sin * offset[:, 1]
    y = cos * offset[:, 1] - sin * offset[:, 0]
    half_width = _HALF_WIDTH_SIGMAS * sigma
    low = np.arcsin(np.clip((x - half_width) / a, -1.0, 1.0))
    high = np.arcsin(np.clip((x + half_width) / a, -1.0, 1.0))
    half = (high - low)[:, None] / 2.0
    u = (high + low)[:, None] / 2.0 + half * _NODES
    along, width = np.sin(u), b * np.cos(u)
    gap = (x[:, None] - a * along) / sigma
    density = np.exp(-0.5 * gap**2) / (np.sqrt(2.0 * np.pi) * sigma) * np.cos(u) * half * _NODE_WEIGHTS
    upper, lower = (y[:, None] + width) / sigma, (y[:, None] - width) / sigma
    upper_pdf, below_upper = normal_pdf_cdf(upper)
    lower_pdf, below_lower = normal_pdf_cdf(lower)
    between = below_upper - below_lower
    mass = a * density
    coverage = np.sum(mass * between, axis=1)
    by_x = np.sum(-gap / sigma * mass * between, axis=1)
    by_y = np.sum(mass * (upper_pdf - lower_pdf), axis=1) / sigma
    by_a = np.sum(density * between * (1.0 + a * along * gap / sigma), axis=1)
    by_width = mass * (upper_pdf + lower_pdf) * np.cos(u) / sigma
    by_b = np.sum(by_width, axis=1)
    by_taper = b * np.sum(by_width * np.log(np.maximum(np.cos(u) ** 2, _LEAST_SQUARE)), axis=1)
    # Heat equation: dc/dsigma = sigma (c_xx + c_yy).
    by_xx = np.sum((gap**2 - 1.0) / sigma**2 * mass * between, axis=1)
    by_yy = np.sum(mass * (lower * lower_pdf - upper * upper_pdf), axis=1) / sigma**2
    derivatives = np.stack(
        [
            -cos * by_x + sin * by_y,
            -sin * by_x - cos * by_y,
            by_a,
            by_b,
            by_x * y - by_y * x,
            sigma * (by_xx + by_yy),
            by_taper,
        ],
        axis=-1,
    )
    return coverage, derivatives
