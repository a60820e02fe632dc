"""Grey levels -> viewing cones, by a blurred edge fitted to the pixels around each rim. Many rims at once.

Damped Gauss-Newton over the five `rim_modes` and the blur of each rim, the levels eliminated (see `blurred_edge`).
Stretches of the rim whose residuals are unlike the others' (something hides or touches the rim there) are left out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from circlepose._typing import BoolArray, FloatArray, IntArray, RealArray
from circlepose.fitting.band import Bands
from circlepose.fitting.blurred_edge import LINEAR, Levels, fit_levels, stiffness
from circlepose.fitting.blurred_share import BLUR, Places, Share, curved, places, straight
from circlepose.fitting.unlike import AT_RIM, QUANTIZATION, ZONES, cells_of, unlike_others
from circlepose.rim_modes import MODES, grown

_SIGMA_PX = (0.25, 8.0)
_MOST_UNEQUAL = 0.6
_STEPS = 12
_CONVERGED = 1e-3
"""A step that would lower the cost by so many noise variances is worth nothing: 3 % of a standard error."""
_MOST_DAMPING = 1e5
_ROUNDS = 3
_THINNED = 3
_MANY_PIXELS = 1500
"""A longer band is fitted to every third pixel first."""
_STRETCH_PX = 8.0
_STRETCHES = (12, 72)
_LEAST_PIXELS = 40
_WORST_CONDITION = 1e14
_START_DAMPING = 1e-5
_LONGEST_STEP = 0.5
_JOINED = ((1, 1.0), (2, 1.5), (4, 2.0))
"""Neighbouring stretches taken together, and the correlation from which these count."""

Shares = Callable[[Places, FloatArray], Share]


@dataclass(frozen=True, slots=True, eq=False)
class Expected:
    """What is known of the blurs of m rims before their pixels are seen."""

    mean: FloatArray
    """(m, 3)"""
    information: FloatArray
    """(m, 3) inverse variances; 0 where nothing is known"""


@dataclass(frozen=True, slots=True, eq=False)
class LevelsFit:
    """Blurred edges fitted to the levels around m rims."""

    factors: FloatArray
    """(m, 3, 3) of the viewing cones"""
    covariance: FloatArray
    """(m, 5, 5) of the `rim_modes` of these factors, with blur and levels unknown"""
    blur: FloatArray
    """(m, 3), see `blurred_share`; the pixel's box included"""
    blur_variance: FloatArray
    """(m, 3)"""
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
    weight: RealArray
    """(m, k) of the pixels, in the end"""


def fit_to_levels(
    bands: Bands,
    factors: FloatArray,
    blur: FloatArray,
    expected: Expected,
    perimeter_px: FloatArray,
    limits: tuple[float, float] = (-np.inf, np.inf),
    *,
    beside: FloatArray | None = None,
    is_curved: bool = False,
) -> LevelsFit:
    """Fit the cones of m rims, starting at `factors` (m, 3, 3) and `blur` (m, 3), of which something is `expected`.

    `perimeter_px` (m,) of the rims; levels at the `limits` are clipped, and say only that the light was beyond.
    `beside` (m, k) is what other rims close by add to the levels. With `is_curved` the curvature of the rims is met
    exactly, which takes longer.
    """
    shares = curved if is_curved else straight
    given = bands.weight > 0.0
    stretches = np.clip(perimeter_px / _STRETCH_PX, *_STRETCHES).astype(np.int64)
    left_out = np.zeros((len(factors), int(stretches.max()), ZONES), dtype=np.bool_)
    dark, light = bands.levels <= limits[0], bands.levels >= limits[1]
    added = 0.0 if beside is None else beside
    if beside is not None:
        bands = bands.less(beside)
    # First the plain edge, as what departs from it could be taken for blur, on as many pixels as that needs.
    few = bands.thinned(_THINNED) if bands.levels.shape[1] > _MANY_PIXELS else bands
    seen = _Seen.of(few, factors, blur, shares)
    state = fit_levels(few, seen.at, seen.share, np.zeros((len(factors), LINEAR)))
    variance = _variance(state, few)
    stiff = stiffness(variance, state.contrast, plain=True)
    seen, state, converged = _gauss_newton(
        few, seen, shares, stiff, variance[:, None] * expected.information, expected.mean
    )
    if few is not bands:
        seen = _Seen.of(bands, seen.factors, seen.blur, shares)
        state = fit_levels(bands, seen.at, seen.share, stiff)
    for number in range(_ROUNDS):
        cells = cells_of(seen.at, np.exp(seen.blur[:, 0]), stretches, left_out.shape)
        # A clipped level tells only where the model would have it on this side of the clip.
        model = state.model + added
        tells = given & ~((light & (model >= limits[1])) | (dark & (model <= limits[0])))
        misfit = state.model - bands.levels
        left_out = unlike_others(misfit, tells, bands.weight, cells, state.contrast, left_out.shape)
        weight = (tells & ~left_out.ravel()[cells]).astype(bands.weight.dtype)
        if number > 0 and np.array_equal(weight, bands.weight):
            break
        bands = bands.weighted(weight)
        variance = _variance(state, bands)
        stiff = stiffness(variance, state.contrast)
        seen, state, converged = _gauss_newton(
            bands, seen, shares, stiff, variance[:, None] * expected.information, expected.mean
        )
    counted = np.sum(bands.weight, axis=1)
    variance = _variance(state, bands)
    matrix, _ = state.normal_equations()
    matrix = _with_prior(matrix, variance[:, None] * expected.information)
    told = (counted >= _LEAST_PIXELS) & (np.linalg.cond(matrix) < _WORST_CONDITION)
    matrix = np.where(told[:, None, None], matrix, np.eye(MODES + BLUR))
    correlation = _correlation(state, cells // ZONES, stretches, matrix, variance)
    covariance = np.linalg.inv(matrix) * variance[:, None, None]
    return LevelsFit(
        factors=seen.factors,
        covariance=covariance[:, :MODES, :MODES] * correlation[:, None, None],
        blur=seen.blur,
        blur_variance=np.einsum("mii->mi", covariance)[:, MODES:],
        noise_levels=np.sqrt(variance),
        correlation=correlation,
        contrast_levels=state.contrast,
        rim_used=1.0 - np.array([row[:n, AT_RIM].mean() for row, n in zip(left_out, stretches, strict=True)]),
        converged=converged & told,
        weight=bands.weight,
    )


def _variance(state: Levels, bands: Bands) -> FloatArray:
    """Return the variance (m,) of the levels about the model."""
    counted = np.sum(bands.weight, axis=1)
    return np.maximum(state.square / np.maximum(counted - LINEAR - MODES - BLUR, 1.0), QUANTIZATION)


def _with_prior(matrix: FloatArray, prior: FloatArray) -> FloatArray:
    matrix = matrix.copy()
    matrix[:, range(MODES, MODES + BLUR), range(MODES, MODES + BLUR)] += prior
    return matrix


@dataclass(frozen=True, slots=True, eq=False)
class _Seen:
    """The rims at some factors and blurs, as their pixels see them."""

    factors: FloatArray
    blur: FloatArray
    at: Places
    share: Share

    @classmethod
    def of(cls, bands: Bands, factors: FloatArray, blur: FloatArray, shares: Shares) -> _Seen:
        at = places(bands, factors)
        return cls(factors, blur, at, shares(at, blur))


def _gauss_newton(
    bands: Bands, seen: _Seen, shares: Shares, stiff: FloatArray, prior: FloatArray, mean: FloatArray
) -> tuple[_Seen, Levels, BoolArray]:
    """Return the rims fitted from where they are `seen`, and whether they converged.

    `prior` (m, 3) pulls the blurs to `mean` (m, 3).
    """
    factors, blur = seen.factors.copy(), seen.blur.copy()
    every = np.arange(len(factors))

    def evaluate(some: Bands, now: _Seen, which: IntArray) -> tuple[Levels, FloatArray, FloatArray, FloatArray]:
        state = fit_levels(some, now.at, now.share, stiff[which])
        matrix, gradient = state.normal_equations()
        off = now.blur - mean[which]
        gradient[:, MODES:] += prior[which] * off
        return state, state.cost + np.sum(prior[which] * off**2, axis=1), _with_prior(matrix, prior[which]), gradient

    current, (state, cost, matrix, gradient) = seen, evaluate(bands, seen, every)
    damping = np.full(len(factors), _START_DAMPING)
    counted = np.maximum(np.sum(bands.weight, axis=1), 1.0)
    running = np.ones(len(factors), dtype=np.bool_)
    for _ in range(_STEPS):
        diagonal = np.einsum("mii->mi", matrix) + 1e-12
        damped = matrix + (diagonal * damping[:, None])[:, :, None] * np.eye(MODES + BLUR)
        step = -np.linalg.solve(damped, gradient[..., None])[..., 0]
        gain = -np.sum(step * gradient, axis=1)
        running &= (gain > _CONVERGED * (cost / counted + QUANTIZATION)) & (damping < _MOST_DAMPING)
        which = np.flatnonzero(running)
        if len(which) == 0:
            break
        some = bands if len(which) == len(every) else bands[which]
        trial = _Seen.of(some, *_after(factors[which], blur[which], step[which]), shares)
        new_state, new_cost, new_matrix, new_gradient = evaluate(some, trial, which)
        better = new_cost <= cost[which]
        damping[which] = np.where(better, damping[which] * 0.1, np.maximum(damping[which] * 30.0, 1e-3))
        taken = which[better]
        factors[taken], blur[taken], cost[taken] = trial.factors[better], trial.blur[better], new_cost[better]
        matrix[taken], gradient[taken] = new_matrix[better], new_gradient[better]
        if len(taken) == len(every):
            current, state = trial, new_state
    converged = ~running & (damping < _MOST_DAMPING)
    if not (np.array_equal(current.factors, factors) and np.array_equal(current.blur, blur)):
        current = _Seen.of(bands, factors, blur, shares)
        state = fit_levels(bands, current.at, current.share, stiff)
    return current, state, converged


def _after(factors: FloatArray, blur: FloatArray, step: FloatArray) -> tuple[FloatArray, FloatArray]:
    limited = np.clip(step, -_LONGEST_STEP, _LONGEST_STEP)
    changed = blur + limited[:, MODES:]
    low, high = np.log(_SIGMA_PX[0]), np.log(_SIGMA_PX[1])
    changed[:, 0] = np.clip(changed[:, 0], low, high)
    changed[:, 1:] = np.clip(changed[:, 1:], -_MOST_UNEQUAL, _MOST_UNEQUAL)
    return grown(factors, limited[:, :MODES]), changed


def _correlation(
    state: Levels, stretch: IntArray, numbers: IntArray, matrix: FloatArray, variance: FloatArray
) -> FloatArray:
    """Return (m,) how much more the residuals of a stretch add up to than independent ones would; at least 1.

    The scores of independent residuals, summed by stretch, scatter as the information says. Where neighbours err
    alike (texture, a model that does not hold), they scatter more, and so does the estimate. `stretch` (m, k) of each
    pixel, of `numbers` (m,) in all for each rim, counted on from rim to rim by the most that any has. Coarse texture
    shows in joined stretches only, of which there are few: there more is asked of it.
    """
    projected = state.projected_slopes()
    rims, most = len(matrix), int(numbers.max())
    scores = np.stack(
        [
            np.bincount(stretch.ravel(), (projected[:, i] * state.residual).ravel(), rims * most)
            for i in range(MODES + BLUR)
        ],
        axis=-1,
    ).reshape(rims, most, MODES + BLUR)
    largest = np.ones(rims)
    for joined, least in _JOINED:
        sums = sum(np.roll(scores, -shift, axis=1) for shift in range(joined)) if joined > 1 else scores
        total = np.einsum("msi,msj->mij", sums, sums) / joined
        ratio = np.einsum("mii->m", np.linalg.solve(matrix, total)) / ((MODES + BLUR) * variance)
        largest = np.maximum(largest, np.where(ratio > least, ratio, 1.0))
    return largest
