"""The image of a blurred ellipse, fitted to grey levels: the model, its derivatives and its least squares.

With x along the major axis, y across, and x' = a sin u,

    c(x, y) = integral G(x - a sin u) [Phi((y + b cos u)/sigma) - Phi((y - b cos u)/sigma)] a cos u du

is the share of the ellipse in the level at (x, y), blur and pixel box taken together as a Gaussian of sigma;
the level is out (1 - c) + in c, with a linear gradient in `out`, and one along the major axis in `in`: across it, a
gradient would pass for a shift of a segment. Exact for any axes, down to a segment; the
cost per pixel does not depend on the size, but the quadrature is made for b up to about 10 sigma.

Parameters are theta (6,): centre x, y, semi-major, semi-minor (px), angle (rad) and sigma (px).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from circlepose._typing import BoolArray, FloatArray, Image
from circlepose.photometry.gaussian import normal_share

_NODES, _NODE_WEIGHTS = np.polynomial.legendre.leggauss(20)
_REACH_SIGMA = 4.5
START_SIGMA_PX = 0.85
_SIGMA_PRIOR_PX = 0.3
_SIGMA_PX = (0.35, 4.0)
MARGIN_PX = 4.0
_FADE = 0.15
_DEEP_PX = 4.0
"""Pixels farther inside than this see no edge."""
_MOST_PIXELS = 14000
_STEEP_PX = 5.0
"""The level outside changes little over so many px; what changes more is something else."""
_GROWTH = 3.0
"""Longest semi-major axis, in units of the start's, before the fit has lost its object."""
_LEAST_SQUARE = 1e-12
QUANTIZATION = 1.0 / 12.0
"""Variance of rounding to whole levels: the noise of an image without noise."""


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """Levels around an ellipse, and which of them are fitted."""

    points: FloatArray
    levels: FloatArray
    fade: FloatArray
    """root weight of each pixel"""
    chosen: BoolArray
    """the pixels that are fitted"""
    origin: FloatArray
    semi_major: float


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """A fit at some parameters: its residuals (levels) and what follows from them."""

    theta: FloatArray
    cost: float
    jacobian: FloatArray
    residual: FloatArray
    """0 where a pixel is not fitted; the last three keep the gradients of the levels small"""
    misfit: FloatArray
    """of all pixels"""
    taper_slope: FloatArray
    """as a column of the jacobian, of the exponent p with which the width falls off as (1 - (x/a)^2)^p: 1/2 here"""
    contrast: float
    highest_share: float
    variance: float
    rms: float


def levenberg_marquardt(problem: Problem, theta: FloatArray, steps: int) -> State | None:
    """Fit from `theta` (6,) in at most so many steps; None when the fit loses its object."""
    damping = 1e-3
    state = evaluate(theta, problem)
    for _ in range(steps):
        prior = prior_information(state.variance)
        normal_matrix = state.jacobian.T @ state.jacobian + prior
        gradient = state.jacobian.T @ state.residual + prior @ (state.theta - _prior_mean(state.theta))
        scale = np.diag(np.maximum(np.diag(normal_matrix), 1e-12))
        step = -np.linalg.solve(normal_matrix + damping * scale, gradient)
        trial = state.theta + step
        trial[3], trial[5] = max(abs(trial[3]), 1e-3), np.clip(trial[5], *_SIGMA_PX)
        if not 0.0 < trial[2] < _GROWTH * problem.semi_major or np.any(np.abs(trial[:2] - problem.origin) > trial[2]):
            return None
        after = evaluate(trial, problem)
        if after.cost <= state.cost:
            done = bool(np.all(np.abs(step[:4]) < 1e-4)) or state.cost - after.cost < 1e-7 * state.cost
            state, damping = after, damping * 0.2
            if done:
                break
        else:
            damping *= 8.0
            if damping > 1e6:
                break
    return state


def _prior_mean(theta: FloatArray) -> FloatArray:
    """Return `theta` with the expected blur, which in a segment's image cannot be told from the width."""
    mean = theta.copy()
    mean[5] = START_SIGMA_PX
    return mean


def prior_information(variance: float) -> FloatArray:
    """Return the information (6, 6), times `variance` of the levels, that is had before any image is seen."""
    return np.diag([0.0, 0.0, 0.0, 0.0, 0.0, variance / _SIGMA_PRIOR_PX**2])


def taper(state: State) -> tuple[float, float]:
    """Return the exponent p with which the width falls off as (1 - (x/a)^2)^p, and its standard deviation.

    To first order from the ellipse's 1/2, all else fitted as well: about 0 for a bar, 1 between two arcs.
    """
    prior = prior_information(state.variance)
    information = state.jacobian.T @ state.jacobian + prior
    shared = state.jacobian.T @ state.taper_slope
    # What the other parameters would make up for is no information.
    own = state.taper_slope - state.jacobian @ np.linalg.pinv(information, hermitian=True) @ shared
    square = float(own @ state.taper_slope)
    if square <= 0.0:
        return 0.5, np.inf
    return 0.5 - float(own @ state.residual) / square, float(np.sqrt(state.variance / square))


def pixels_around(grey: Image, theta: FloatArray, stretch: float) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """Return the pixels (n, 2) within the margin of the ellipse, their levels (n,) and root weights (n,)."""
    a, b, angle = theta[2] * stretch, theta[3], theta[4]
    cos, sin = np.cos(angle), np.sin(angle)
    half = np.array([np.hypot(a * cos, b * sin), np.hypot(a * sin, b * cos)]) + MARGIN_PX
    low = np.maximum(np.floor(theta[:2] - half), 0).astype(int)
    high = np.minimum(np.ceil(theta[:2] + half) + 1, [grey.shape[1], grey.shape[0]]).astype(int)
    if np.any(high - low < 3):
        return None
    x, y = np.meshgrid(np.arange(low[0], high[0]), np.arange(low[1], high[1]))
    u, v = x - theta[0], y - theta[1]
    radius = np.hypot((cos * u + sin * v) / (a + MARGIN_PX), (cos * v - sin * u) / (b + MARGIN_PX))
    near = radius < 1.0
    if b > _DEEP_PX + 1.0:
        deep = np.hypot((cos * u + sin * v) / (a - _DEEP_PX), (cos * v - sin * u) / (b - _DEEP_PX)) < 1.0
        near &= ~deep
    if not 12 <= int(np.count_nonzero(near)) <= _MOST_PIXELS:
        return None
    points = np.stack([x[near], y[near]], axis=-1).astype(np.float64)
    # Fading out, what stands close by has no border to pull at.
    fade = np.clip((1.0 - radius[near]) / _FADE, 0.0, 1.0)
    return points, grey[y[near], x[near]].astype(np.float64), np.sqrt(fade)


def evaluate(theta: FloatArray, problem: Problem) -> State:
    """Return residuals and their derivatives at `theta` (6,), the levels eliminated."""
    share, derivatives = _share(theta, problem.points)
    offset = problem.points - problem.origin
    outside = 1.0 - share
    along = offset @ np.array([np.cos(theta[4]), np.sin(theta[4])])
    linear = np.stack([share, outside, outside * offset[:, 0], outside * offset[:, 1], share * along], axis=-1)
    root = problem.fade * problem.chosen
    weight = float(np.sum(root**2))
    stiffness = np.zeros((3, 5))
    stiffness[:, 2:] = np.sqrt(weight) * _STEEP_PX * np.eye(3)
    basis, triangle = np.linalg.qr(np.concatenate([linear * root[:, None], stiffness]))
    number = len(root)
    coefficients = np.linalg.lstsq(triangle, basis[:number].T @ (problem.levels * root), rcond=1e-10)[0]
    misfit = (linear @ coefficients - problem.levels) * problem.fade
    residual = np.append(misfit * problem.chosen, stiffness @ coefficients)
    out = coefficients[1] + offset @ coefficients[2:4]
    slopes = np.zeros((number + len(stiffness), derivatives.shape[1]))
    slopes[:number] = derivatives * ((coefficients[0] + along * coefficients[4] - out) * root)[:, None]
    # Variable projection: what a change of the levels would make up for is no information.
    slopes = slopes - basis @ (basis.T @ slopes)
    square = float(np.sum(residual[:number] ** 2))
    variance = max(square / max(weight - 10.0, 1.0), QUANTIZATION)
    prior = variance * (theta[5] - START_SIGMA_PX) ** 2 / _SIGMA_PRIOR_PX**2
    contrast = float(coefficients[0] - coefficients[1])
    return State(
        theta=theta,
        cost=float(residual @ residual) + prior,
        jacobian=slopes[:, :-1],
        taper_slope=slopes[:, -1],
        residual=residual,
        misfit=misfit,
        contrast=contrast,
        highest_share=float(share.max()),
        variance=variance,
        rms=float(np.sqrt(square / max(weight, 1.0))),
    )


def _share(theta: FloatArray, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the share c (n,) and its derivatives to centre x, y, a, b, angle, sigma and the taper (n, 7)."""
    a, b, angle, sigma = theta[2:]
    cos, sin = np.cos(angle), np.sin(angle)
    offset = points - theta[:2]
    x = cos * offset[:, 0] + sin * offset[:, 1]
    y = cos * offset[:, 1] - sin * offset[:, 0]
    reach = _REACH_SIGMA * sigma
    low = np.arcsin(np.clip((x - reach) / a, -1.0, 1.0))
    high = np.arcsin(np.clip((x + reach) / a, -1.0, 1.0))
    half = (high - low)[:, None] / 2.0
    u = (high + low)[:, None] / 2.0 + half * _NODES
    along, width = np.sin(u), b * np.cos(u)
    gap = (x[:, None] - a * along) / sigma
    density = np.exp(-0.5 * gap**2) / (np.sqrt(2.0 * np.pi) * sigma) * np.cos(u) * half * _NODE_WEIGHTS
    upper, lower = (y[:, None] + width) / sigma, (y[:, None] - width) / sigma
    upper_pdf, below_upper = normal_share(upper)
    lower_pdf, below_lower = normal_share(lower)
    between = below_upper - below_lower
    mass = a * density
    share = np.sum(mass * between, axis=1)
    by_x = np.sum(-gap / sigma * mass * between, axis=1)
    by_y = np.sum(mass * (upper_pdf - lower_pdf), axis=1) / sigma
    by_a = np.sum(density * between * (1.0 + a * along * gap / sigma), axis=1)
    by_width = mass * (upper_pdf + lower_pdf) * np.cos(u) / sigma
    by_b = np.sum(by_width, axis=1)
    by_taper = b * np.sum(by_width * np.log(np.maximum(np.cos(u) ** 2, _LEAST_SQUARE)), axis=1)
    # The heat equation: dc/dsigma = sigma (c_xx + c_yy).
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
    return share, derivatives
