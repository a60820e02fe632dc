"""Grey levels -> the ellipse of a thin rim (a circle seen nearly edge-on), whose sides the blur runs together.

Where the minor axis is a few times the blur, or less, there is no edge to place: the levels of both sides
overlap. So the whole blurred ellipse is fitted. With x along the major axis, y across, and x' = a sin u,

    c(x, y) = integral G(x - a sin u) [Phi((y + b cos u)/sigma) - Phi((y - b cos u)/sigma)] a cos u du

is the share of the ellipse in the level at (x, y), blur and pixel box taken together as a Gaussian of sigma;
the level is out (1 - c) + in c, with a linear gradient in `out`. Exact for any axes, down to a segment; the
cost per pixel does not depend on the size, but the quadrature is made for b up to about 10 sigma.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtr

from circlepose._typing import BoolArray, FloatArray, Image, IntArray
from circlepose.conic import Ellipse

_NODES, _NODE_WEIGHTS = np.polynomial.legendre.leggauss(20)
_REACH_SIGMA = 4.5
_START_SIGMA_PX = 0.85
_SIGMA_PRIOR_PX = 0.3
_SIGMA_PX = (0.35, 4.0)
_MARGIN_PX = 4.0
_FADE = 0.15
_GROWING_ROUNDS = ((10, 1.4), (10, 1.4), (10, 1.4))
_ROUNDS = ((12, 1.0), (6, 1.0))
"""Steps of each round, and how far it looks along the axes, in their lengths."""
_DEEP_PX = 4.0
"""Pixels farther inside than this see no edge."""
_STRETCHES = 24
_CLEANINGS = 4
_COVERED = 2.5
_COVERED_SHARE = 0.04
"""A stretch is covered when its residual is so many times the typical one, and such a share of the peak."""
_LEAST_KEPT = 0.5
_MOST_PIXELS = 14000
_GROWTH = 3.0
"""Longest semi-major axis, in units of the start's, before the fit has lost its object."""
_QUANTIZATION = 1.0 / 12.0
"""Variance of rounding to whole levels: the noise of an image without noise."""


THIN_PX = 14.0
"""Semi-minor axis below which the tips of an ellipse are a matter of blur."""
_THIN_RATIO = 0.15


def are_thin(ellipse: Ellipse) -> BoolArray:
    """Tell (...) which image ellipses (px) are so thin that blur joins their sides, at the tips at least."""
    return np.asarray(ellipse.semi_minor < np.minimum(THIN_PX, _THIN_RATIO * ellipse.semi_major))


@dataclass(frozen=True, slots=True, eq=False)
class ThinEllipse:
    """A blurred ellipse fitted to grey levels."""

    ellipse: Ellipse
    sigma_px: float
    """blur and pixel box"""
    contrast: float
    """grey levels, inside minus outside"""
    peak_levels: float
    """highest level that the ellipse adds or takes: the contrast, less where blur is wider than the ellipse"""
    rms_levels: float
    """rms residual"""
    rim_used: float
    """share of its length that is not covered or touched by something else"""
    covariance: FloatArray
    """(5, 5) of centre x, y, semi-major, semi-minor (px) and angle (rad), with the blur unknown"""

    @property
    def error_px(self) -> float:
        """What the noise of the levels makes of an edge's place: noise over the steepest slope."""
        return self.rms_levels * self.sigma_px * float(np.sqrt(2.0 * np.pi)) / abs(self.contrast)


def fit_thin_ellipse(grey: Image, start: Ellipse, *, grow: bool = False) -> ThinEllipse | None:
    """Fit the blurred ellipse to the levels of `grey` (h, w) around `start`; None when it does not converge there.

    With `grow` the start may be a fragment, and the first rounds look beyond its tips.
    """
    center = np.asarray(start.center, dtype=np.float64)
    theta = np.array([*center, float(start.semi_major), max(float(start.semi_minor), 0.3), float(start.angle)])
    theta = np.append(theta, _START_SIGMA_PX)
    # Which pixels count is settled before each round, so that no step can gain by dropping some.
    for steps, stretch in (*_GROWING_ROUNDS, *_ROUNDS) if grow else _ROUNDS:
        pixels = _pixels(grey, theta, stretch)
        if pixels is None:
            return None
        problem = _Problem(*pixels, center, float(start.semi_major))
        fitted = _levenberg_marquardt(problem, theta, steps)
        if fitted is None:
            return None
        theta, state = fitted
    kept = np.ones(2 * _STRETCHES, dtype=np.bool_)
    for _ in range(_CLEANINGS):
        stretch_of = _stretches(problem.points, theta)
        covered = _not_covered(state, stretch_of) & kept
        if np.array_equal(covered, kept):
            break
        kept = covered
        if kept.mean() < _LEAST_KEPT:
            return None
        problem = replace(problem, root_weight=problem.root_weight * kept[stretch_of])
        fitted = _levenberg_marquardt(problem, theta, _ROUNDS[0][0])
        if fitted is None:
            return None
        theta, state = fitted
    ellipse = Ellipse.from_axes(theta[:2], theta[2:4], theta[4])
    information = state.jacobian.T @ state.jacobian / state.variance + _prior(1.0)
    return ThinEllipse(
        ellipse=ellipse,
        sigma_px=float(theta[5]),
        contrast=state.contrast,
        peak_levels=abs(state.contrast) * state.highest_share,
        rms_levels=float(np.sqrt(np.sum(state.residual**2) / max(float(np.sum(problem.root_weight**2)), 1.0))),
        rim_used=float(kept.mean()),
        covariance=np.asarray(np.linalg.pinv(information)[:5, :5], dtype=np.float64),
    )


def _stretches(points: FloatArray, theta: FloatArray) -> IntArray:
    """Return the stretch along the major axis, of either side, that each point (n, 2) belongs to."""
    cos, sin = np.cos(theta[4]), np.sin(theta[4])
    offset = points - theta[:2]
    along, across = offset @ np.array([cos, sin]), offset @ np.array([-sin, cos])
    share = (along / (theta[2] + _MARGIN_PX) + 1.0) / 2.0
    return np.clip((share * _STRETCHES).astype(np.int64), 0, _STRETCHES - 1) + _STRETCHES * (across > 0.0)


def _not_covered(state: _State, stretch_of: IntArray) -> BoolArray:
    """Tell which stretches have residuals like the best of them: something covers the rest, or touches them."""
    count = np.maximum(np.bincount(stretch_of, minlength=2 * _STRETCHES), 1)
    rms = np.sqrt(np.bincount(stretch_of, state.residual**2, 2 * _STRETCHES) / count)
    limit = max(_COVERED * float(np.quantile(rms, 0.25)), _COVERED_SHARE * abs(state.contrast) * state.highest_share)
    bad = np.pad((rms > limit).reshape(2, _STRETCHES), ((0, 0), (1, 1)))
    # What covers a stretch reaches a little into its neighbours.
    return ~(bad[:, 1:-1] | bad[:, :-2] | bad[:, 2:]).ravel()


@dataclass(frozen=True, slots=True, eq=False)
class _Problem:
    points: FloatArray
    levels: FloatArray
    root_weight: FloatArray
    origin: FloatArray
    semi_major: float


@dataclass(frozen=True, slots=True, eq=False)
class _State:
    cost: float
    jacobian: FloatArray
    residual: FloatArray
    contrast: float
    highest_share: float
    variance: float


def _levenberg_marquardt(problem: _Problem, theta: FloatArray, steps: int) -> tuple[FloatArray, _State] | None:
    damping = 1e-3
    state = _evaluate(theta, problem)
    for _ in range(steps):
        prior = _prior(state.variance)
        normal_matrix = state.jacobian.T @ state.jacobian + prior
        gradient = state.jacobian.T @ state.residual + prior @ (theta - _prior_mean(theta))
        scale = np.diag(np.maximum(np.diag(normal_matrix), 1e-12))
        step = -np.linalg.solve(normal_matrix + damping * scale, gradient)
        trial = theta + step
        trial[3], trial[5] = max(abs(trial[3]), 1e-3), np.clip(trial[5], *_SIGMA_PX)
        if not 0.0 < trial[2] < _GROWTH * problem.semi_major or np.any(np.abs(trial[:2] - problem.origin) > trial[2]):
            return None
        after = _evaluate(trial, problem)
        if after.cost <= state.cost:
            done = bool(np.all(np.abs(step[:4]) < 1e-4)) or state.cost - after.cost < 1e-7 * state.cost
            theta, state, damping = trial, after, damping * 0.2
            if done:
                break
        else:
            damping *= 8.0
            if damping > 1e6:
                break
    return theta, state


def _prior_mean(theta: FloatArray) -> FloatArray:
    """Return `theta` with the expected blur, which in a segment's image cannot be told from the width."""
    mean = theta.copy()
    mean[5] = _START_SIGMA_PX
    return mean


def _prior(variance: float) -> FloatArray:
    return np.diag([0.0, 0.0, 0.0, 0.0, 0.0, variance / _SIGMA_PRIOR_PX**2])


def _pixels(grey: Image, theta: FloatArray, stretch: float) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """Return the pixels (n, 2) within the margin of the ellipse, their levels (n,) and root weights (n,)."""
    a, b, angle = theta[2] * stretch, theta[3], theta[4]
    cos, sin = np.cos(angle), np.sin(angle)
    half = np.array([np.hypot(a * cos, b * sin), np.hypot(a * sin, b * cos)]) + _MARGIN_PX
    low = np.maximum(np.floor(theta[:2] - half), 0).astype(int)
    high = np.minimum(np.ceil(theta[:2] + half) + 1, [grey.shape[1], grey.shape[0]]).astype(int)
    if np.any(high - low < 3):
        return None
    x, y = np.meshgrid(np.arange(low[0], high[0]), np.arange(low[1], high[1]))
    u, v = x - theta[0], y - theta[1]
    radius = np.hypot((cos * u + sin * v) / (a + _MARGIN_PX), (cos * v - sin * u) / (b + _MARGIN_PX))
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


def _evaluate(theta: FloatArray, problem: _Problem) -> _State:
    """Residuals and their derivatives at `theta`, the levels eliminated."""
    share, derivatives = _share(theta, problem.points)
    offset = problem.points - problem.origin
    outside = 1.0 - share
    linear = np.stack([share, outside, outside * offset[:, 0], outside * offset[:, 1]], axis=-1)
    root = problem.root_weight
    basis, triangle = np.linalg.qr(linear * root[:, None])
    coefficients = np.linalg.lstsq(triangle, basis.T @ (problem.levels * root), rcond=1e-10)[0]
    residual = (linear @ coefficients - problem.levels) * root
    out = coefficients[1] + offset @ coefficients[2:]
    slopes = derivatives * ((coefficients[0] - out) * root)[:, None]
    # Variable projection: what a change of the levels would make up for is no information.
    slopes = slopes - basis @ (basis.T @ slopes)
    freedom = max(float(np.sum(root**2)) - 10.0, 1.0)
    variance = max(float(residual @ residual) / freedom, _QUANTIZATION)
    prior = variance * (theta[5] - _START_SIGMA_PX) ** 2 / _SIGMA_PRIOR_PX**2
    contrast = float(coefficients[0] - coefficients[1])
    return _State(float(residual @ residual) + prior, slopes, residual, contrast, float(share.max()), variance)


def _share(theta: FloatArray, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the share c (n,) and its derivatives to centre x, y, a, b, angle, sigma (n, 6)."""
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
    between = ndtr(upper) - ndtr(lower)
    upper_pdf = np.exp(-0.5 * upper**2) / np.sqrt(2.0 * np.pi)
    lower_pdf = np.exp(-0.5 * lower**2) / np.sqrt(2.0 * np.pi)
    mass = a * density
    share = np.sum(mass * between, axis=1)
    by_x = np.sum(-gap / sigma * mass * between, axis=1)
    by_y = np.sum(mass * (upper_pdf - lower_pdf), axis=1) / sigma
    by_a = np.sum(density * between * (1.0 + a * along * gap / sigma), axis=1)
    by_b = np.sum(mass * (upper_pdf + lower_pdf) * np.cos(u), axis=1) / sigma
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
        ],
        axis=-1,
    )
    return share, derivatives
