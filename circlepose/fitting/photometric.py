"""Grey levels -> viewing cones, by a blurred edge fitted to the pixels around each rim. Many rims at once.

Damped Gauss-Newton over the five `rim_modes` and the blur of each rim, the levels eliminated (see `blurred_edge`).
Stretches of the rim whose residuals are unlike the others' (something hides or touches the rim there) are left out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from circlepose._typing import BoolArray, FloatArray, IntArray
from circlepose.fitting.band import Bands
from circlepose.fitting.blurred_edge import LINEAR, Levels, Places, fit_levels, places
from circlepose.rim_modes import MODES, grown

START_SIGMA_PX = 0.8
_SIGMA_PX = (0.25, 8.0)
_STEPS = 12
_CONVERGED = 1e-4
"""A step that would lower the cost by so many noise variances is worth nothing: 1 % of a standard error."""
_MOST_DAMPING = 1e5
_QUANTIZATION = 1.0 / 12.0
"""Variance of rounding to whole levels: the noise of an image without noise."""
_ROUNDS = 4
_STRETCH_PX = 8.0
_STRETCHES = (12, 72)
_ZONE_SIGMA = 2.0
_UNLIKELY = 6.0
_COVERED_SHARE = 0.03
_LEAST_PIXELS = 40
_LEAST_IN_CELL = 4
_ZONES, _AT_RIM = 3, 1
_WORST_CONDITION = 1e14
_START_DAMPING = 1e-5
_LONGEST_STEP = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class LevelsFit:
    """Blurred edges fitted to the levels around m rims."""

    factors: FloatArray
    """(m, 3, 3) of the viewing cones"""
    covariance: FloatArray
    """(m, 5, 5) of the `rim_modes` of these factors, with blur and levels unknown"""
    sigma_px: FloatArray
    """(m,) blur, the pixel's box included"""
    noise_levels: FloatArray
    """(m,) standard deviation of the residuals"""
    correlation: FloatArray
    """(m,) variance of what neighbouring residuals add up to, relative to independent ones; in the covariance"""
    contrast_levels: FloatArray
    """(m,) inside minus outside"""
    rim_used: FloatArray
    """(m,) share of the rim that is not left out"""
    converged: BoolArray
    """(m,)"""
    weight: FloatArray
    """(m, k) of the pixels, in the end"""


def fit_to_levels(
    bands: Bands,
    factors: FloatArray,
    sigma_px: FloatArray,
    perimeter_px: FloatArray,
    limits: tuple[float, float] = (-np.inf, np.inf),
) -> LevelsFit:
    """Fit the cones of m rims, starting at `factors` (m, 3, 3) and blurs `sigma_px` (m,).

    `perimeter_px` (m,) of the rims; levels at the `limits` are clipped, and say only that the light was beyond.
    """
    given = bands.weight > 0.0
    stretches = np.clip(perimeter_px / _STRETCH_PX, *_STRETCHES).astype(np.int64)
    left_out = np.zeros((len(factors), int(stretches.max()), _ZONES), dtype=np.bool_)
    dark, light = bands.levels <= limits[0], bands.levels >= limits[1]
    for last in (*(False,) * (_ROUNDS - 1), True):
        factors, sigma_px, converged = _gauss_newton(bands, factors, sigma_px)
        at = places(bands, factors)
        state = fit_levels(bands, at, sigma_px)
        cells = _cells(at, sigma_px, stretches, left_out.shape)
        if last:
            break
        # A clipped level tells only where the model would have it on this side of the clip.
        tells = given & ~((light & (state.model >= limits[1])) | (dark & (state.model <= limits[0])))
        left_out = _unlike_others(
            state.model - bands.levels, tells, bands.weight, cells, state.contrast, left_out.shape
        )
        weight = np.where(tells & ~left_out.ravel()[cells], 1.0, 0.0)
        if np.array_equal(weight, bands.weight):
            break
        bands = bands.weighted(weight)
    counted = np.sum(bands.weight, axis=1)
    matrix, _ = state.normal_equations()
    told = (counted >= _LEAST_PIXELS) & (np.linalg.cond(matrix) < _WORST_CONDITION)
    matrix = np.where(told[:, None, None], matrix, np.eye(MODES + 1))
    variance = np.maximum(state.cost / np.maximum(counted - LINEAR - MODES - 1.0, 1.0), _QUANTIZATION)
    correlation = _correlation(state, cells // _ZONES, matrix, variance)
    return LevelsFit(
        factors=factors,
        covariance=np.linalg.inv(matrix)[:, :MODES, :MODES] * (variance * correlation)[:, None, None],
        sigma_px=sigma_px,
        noise_levels=np.sqrt(variance),
        correlation=correlation,
        contrast_levels=state.contrast,
        rim_used=1.0 - np.array([row[:n, _AT_RIM].mean() for row, n in zip(left_out, stretches, strict=True)]),
        converged=converged & told,
        weight=bands.weight,
    )


def _gauss_newton(
    bands: Bands, factors: FloatArray, sigma_px: FloatArray
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Return the factors, blurs and whether they converged."""
    factors, sigma_px = factors.copy(), sigma_px.copy()
    state = fit_levels(bands, places(bands, factors), sigma_px)
    matrix, gradient = state.normal_equations()
    cost = state.cost
    damping = np.full(len(factors), _START_DAMPING)
    counted = np.maximum(np.sum(bands.weight, axis=1), 1.0)
    running = np.ones(len(factors), dtype=np.bool_)
    for _ in range(_STEPS):
        diagonal = np.einsum("mii->mi", matrix) + 1e-12
        damped = matrix + (diagonal * damping[:, None])[:, :, None] * np.eye(MODES + 1)
        step = -np.linalg.solve(damped, gradient[..., None])[..., 0]
        gain = -np.sum(step * gradient, axis=1)
        worth = gain > _CONVERGED * (cost / counted + _QUANTIZATION)
        # Nowhere to go from here: what is not converged stays as it is.
        running = running & np.isfinite(gain)
        trial, trial_sigma = _after(factors, sigma_px, np.where(np.isfinite(step), step, 0.0))
        # The last step costs nothing, and helps.
        ends = running & ~worth
        factors[ends], sigma_px[ends] = trial[ends], trial_sigma[ends]
        running = running & worth & (damping < _MOST_DAMPING)
        which = np.flatnonzero(running)
        if len(which) == 0:
            break
        some = bands if len(which) == len(factors) else bands[which]
        state = fit_levels(some, places(some, trial[which]), trial_sigma[which])
        better = state.cost <= cost[which]
        damping[which] = np.where(better, damping[which] * 0.1, np.maximum(damping[which] * 30.0, 1e-3))
        taken = which[better]
        factors[taken], sigma_px[taken], cost[taken] = trial[taken], trial_sigma[taken], state.cost[better]
        new_matrix, new_gradient = state.normal_equations()
        matrix[taken], gradient[taken] = new_matrix[better], new_gradient[better]
    return factors, sigma_px, ~running & (damping < _MOST_DAMPING) & np.isfinite(cost)


def _after(factors: FloatArray, sigma_px: FloatArray, step: FloatArray) -> tuple[FloatArray, FloatArray]:
    limited = np.clip(step, -_LONGEST_STEP, _LONGEST_STEP)
    sigma = np.clip(sigma_px * np.exp(limited[:, MODES]), *_SIGMA_PX)
    return grown(factors, limited[:, :MODES]), sigma


def _cells(at: Places, sigma_px: FloatArray, stretches: IntArray, shape: tuple[int, int, int]) -> IntArray:
    """Return (m, k) the cell that each pixel lies in, as an index into (m, stretches, zones) laid flat."""
    turn = np.arctan2(at.plane[1], at.plane[0]) / (2.0 * np.pi) + 0.5
    stretch = np.minimum((turn * stretches[:, None]).astype(np.int64), stretches[:, None] - 1)
    far = np.abs(at.distance_px) > _ZONE_SIGMA * sigma_px[:, None]
    zone = np.where(far, np.where(at.distance_px < 0.0, 0, 2), _AT_RIM)
    rim = np.arange(shape[0])[:, None]
    return np.asarray((rim * shape[1] + stretch) * _ZONES + zone)


def _unlike_others(
    residual: FloatArray,
    tells: BoolArray,
    weight: FloatArray,
    cells: IntArray,
    contrast: FloatArray,
    shape: tuple[int, int, int],
) -> BoolArray:
    """Tell (m, stretches, zones) where residuals are unlike those of most of the rim in use, by `weight`.

    Something beside the rim (far zones) is left out alone; what crosses the rim takes the whole stretch with it,
    and a little of the stretches beside.
    """
    size = shape[0] * shape[1] * shape[2]
    count = np.bincount(cells.ravel(), tells.ravel(), size).reshape(shape)
    in_use = np.bincount(cells.ravel(), weight.ravel(), size).reshape(shape)
    mean = np.bincount(cells.ravel(), (residual**2 * tells).ravel(), size).reshape(shape) / np.maximum(count, 1.0)
    counted = (in_use > 0.5 * count) & (count >= _LEAST_IN_CELL)
    usual = np.array(
        [np.median(row[there]) if there.any() else 0.0 for row, there in zip(mean, counted, strict=True)]
    )
    usual = np.maximum(usual, _QUANTIZATION)[:, None, None]
    unlikely = (mean / usual - 1.0) * np.sqrt(count / 2.0) > _UNLIKELY
    bad = unlikely & (mean > (_COVERED_SHARE * contrast[:, None, None]) ** 2)
    crossed = bad[:, :, _AT_RIM]
    return bad | crossed[:, :, None]


def _correlation(state: Levels, stretch: IntArray, matrix: FloatArray, variance: FloatArray) -> FloatArray:
    """Return (m,) how much more the residuals of a stretch add up to than independent ones would; at least 1.

    The scores of independent residuals, summed by stretch, scatter as the information says. Where neighbours err
    alike (texture, a model that does not hold), they scatter more, and so does the estimate.
    """
    projected = state.projected_slopes()
    number = int(stretch.max()) + 1
    total = np.zeros((len(matrix), MODES + 1, MODES + 1))
    scores = np.stack(
        [np.bincount(stretch.ravel(), (projected[:, i] * state.residual).ravel(), number) for i in range(MODES + 1)]
    )
    owner = np.zeros(number, dtype=np.int64)
    owner[stretch.ravel()] = np.repeat(np.arange(len(matrix)), stretch.shape[1])
    np.add.at(total, owner, np.einsum("is,js->sij", scores, scores))
    ratio = np.einsum("mii->m", np.linalg.solve(matrix, total)) / ((MODES + 1.0) * variance)
    return np.maximum(ratio, 1.0)
