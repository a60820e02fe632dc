"""Grey levels -> viewing cones, by a blurred edge fitted to the pixels around each rim. Many rims at once.

Damped Gauss-Newton over the five `rim_modes` and the blur of each rim, the levels eliminated (see `blurred_edge`).
Stretches of the rim whose residuals are unlike the others' (something hides or touches the rim there) are left out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from circlepose._typing import BoolArray, FloatArray, IntArray, RealArray
from circlepose.fitting.band import Bands, Beyond
from circlepose.fitting.blurred_edge import LINEAR, Columns, Equations, Levels, fit_levels, stiffness
from circlepose.fitting.blurred_share import BLUR, Places, Share, curved, places, straight
from circlepose.fitting.far_levels import FarLevels
from circlepose.fitting.unlike import AT_RIM, QUANTIZATION, ZONES, cells_of, unlike_others
from circlepose.rim_modes import MODES, grown

_SIGMA_PX = (0.25, 8.0)
_MOST_UNEQUAL = 0.6
_STEPS = 12
_CONVERGED = 1e-3
"""A step that would lower the cost by so many noise variances is worth nothing: 3 % of a standard error."""
_MOST_DAMPING = 1e5
_ROUNDS = 3
_FEW_PIXELS = 1200
"""A band several times longer is fitted to about so many of its pixels first."""
_STRETCH_PX = 8.0
_STRETCHES = (12, 72)
_LEAST_PIXELS = 40
_WORST_CONDITION = 1e14
_START_DAMPING = 1e-5
_LONGEST_STEP = 0.5
_SHORT, _SHORT_FIRST = 0.25, 1.0
"""Standard errors that the second order of a last step may make, so that it is taken unseen."""
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
    beyond: Beyond | None = None,
    is_curved: bool = False,
) -> LevelsFit:
    """Fit the cones of m rims, starting at `factors` (m, 3, 3) and `blur` (m, 3), of which something is `expected`.

    `perimeter_px` (m,) of the rims; levels at the `limits` are clipped, and say only that the light was beyond.
    `beside` (m, k) is what other rims close by add to the levels; pixels `beyond` the bands, inside and outside, pin
    the levels. With `is_curved` the curvature of the rims is met exactly, which takes longer.
    """
    shares = curved if is_curved else straight
    radius_px = perimeter_px / (2.0 * np.pi)
    given = bands.weight > 0.0
    stretches = np.clip(perimeter_px / _STRETCH_PX, *_STRETCHES).astype(np.int64)
    left_out = np.zeros((len(factors), int(stretches.max()), ZONES), dtype=np.bool_)
    dark, light = bands.levels <= limits[0], bands.levels >= limits[1]
    added = 0.0 if beside is None else beside
    if beside is not None:
        bands = bands.less(beside)
    # First the plain edge, as what departs from it could be taken for blur, on as many pixels as that needs.
    step = bands.levels.shape[1] // _FEW_PIXELS
    few = bands.thinned(step) if step > 1 else bands
    seen = _Seen.of(few, factors, blur, shares)
    state = fit_levels(seen.columns, np.zeros((len(factors), LINEAR)))
    variance = _variance(state.square, few)
    stiff = stiffness(variance, state.contrast, radius_px, plain=True)
    prior = variance[:, None] * expected.information
    fit = _gauss_newton(few, seen, shares, stiff, prior, expected.mean, short=_SHORT_FIRST)
    seen = fit.seen if few is bands and fit.is_seen else _Seen.of(bands, fit.factors, fit.blur, shares)
    state = fit_levels(seen.columns, stiff)
    far = None
    for number in range(_ROUNDS):
        cells = cells_of(seen.at, np.exp(seen.blur[:, 0]), stretches, left_out.shape)
        # A clipped level tells only where the model would have it on this side of the clip.
        model = state.model + added
        tells = given & ~((light & (model >= limits[1])) | (dark & (model <= limits[0])))
        misfit = state.model - bands.levels
        left_out = unlike_others(misfit, tells, bands.weight, cells, state.contrast, left_out.shape)
        weight = (tells & ~left_out.ravel()[cells]).astype(bands.weight.dtype)
        same = np.array_equal(weight, bands.weight)
        if number > 0 and same:
            break
        if not same:
            bands = bands.weighted(weight)
            seen = seen.weighted(bands)
        variance = _variance(state.square, bands)
        stiff = stiffness(variance, state.contrast, radius_px)
        prior = variance[:, None] * expected.information
        if beyond is not None and far is None:
            far = FarLevels.of(beyond, seen.factors, _levels_ahead(state, prior, variance), variance)
        fit = _gauss_newton(bands, seen, shares, stiff, prior, expected.mean, far)
        seen, state = fit.seen, fit.state
        if same:
            break
    counted = np.sum(bands.weight, axis=1)
    projected = state.projected_slopes(fit.equations)
    residual = state.residual + (fit.ahead.astype(projected.dtype)[:, None] @ projected)[:, 0]
    variance = _variance(np.einsum("mk,mk->m", residual, residual), bands)
    matrix = _with_prior(fit.equations.matrix, variance[:, None] * expected.information)
    told = (counted >= _LEAST_PIXELS) & (np.linalg.cond(matrix) < _WORST_CONDITION)
    matrix = np.where(told[:, None, None], matrix, np.eye(MODES + BLUR))
    correlation = _correlation(projected * residual[:, None], cells // ZONES, stretches, matrix, variance)
    covariance = np.linalg.inv(matrix) * variance[:, None, None]
    return LevelsFit(
        factors=fit.factors,
        covariance=covariance[:, :MODES, :MODES] * correlation[:, None, None],
        blur=fit.blur,
        blur_variance=np.einsum("mii->mi", covariance)[:, MODES:],
        noise_levels=np.sqrt(variance),
        correlation=correlation,
        contrast_levels=state.contrast,
        rim_used=1.0 - np.array([row[:n, AT_RIM].mean() for row, n in zip(left_out, stretches, strict=True)]),
        converged=fit.converged & told,
        weight=bands.weight,
    )


def _levels_ahead(state: Levels, prior: FloatArray, variance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the levels (m, 11) where the next step leads, and their covariance (m, 11, 11), the rim unknown."""
    equations = state.normal_equations()
    inverse = np.linalg.pinv(_with_prior(equations.matrix, prior), hermitian=True)
    change = equations.made_up @ (inverse @ equations.gradient[..., None])
    covariance = np.linalg.inv(state.gram) + equations.made_up @ inverse @ equations.made_up.transpose(0, 2, 1)
    return state.levels + change[..., 0], covariance * variance[:, None, None]


def _variance(square: FloatArray, bands: Bands) -> FloatArray:
    """Return the variance (m,) of the levels about the model, from the sum of squares (m,)."""
    counted = np.sum(bands.weight, axis=1)
    return np.maximum(square / np.maximum(counted - LINEAR - MODES - BLUR, 1.0), QUANTIZATION)


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
    columns: Columns

    @classmethod
    def of(cls, bands: Bands, factors: FloatArray, blur: FloatArray, shares: Shares) -> _Seen:
        at = places(bands, factors)
        return cls(factors, blur, at, Columns.of(bands, at, shares(at, blur)))

    def weighted(self, bands: Bands) -> _Seen:
        """Return the same with the weight that the pixels have in `bands`."""
        return replace(self, columns=Columns.of(bands, self.at, self.columns.share))


@dataclass(frozen=True, slots=True, eq=False)
class _Fit:
    """Where a descent ended: `ahead` (m, 8) of where the rims were last `seen`, by steps too short to look again."""

    factors: FloatArray
    blur: FloatArray
    converged: BoolArray
    seen: _Seen
    state: Levels
    equations: Equations
    ahead: FloatArray

    @property
    def is_seen(self) -> bool:
        """Whether the rims were seen where they are."""
        return not self.ahead.any()


def _gauss_newton(
    bands: Bands,
    seen: _Seen,
    shares: Shares,
    stiff: FloatArray,
    prior: FloatArray,
    mean: FloatArray,
    far: FarLevels | None = None,
    *,
    short: float = _SHORT,
) -> _Fit:
    """Fit the rims from where they are `seen`; `prior` (m, 3) pulls the blurs to `mean` (m, 3).

    A step whose second order is below `short` standard errors is the last, and taken unseen.
    """
    factors, blur = seen.factors.copy(), seen.blur.copy()
    every = np.arange(len(factors))

    def evaluate(now: _Seen, which: IntArray) -> tuple[Levels, Equations, FloatArray]:
        state = fit_levels(now.columns, stiff[which], None if far is None else far[which])
        found = state.normal_equations()
        off = now.blur - mean[which]
        found.gradient[:, MODES:] += prior[which] * off
        return state, found, state.cost + np.sum(prior[which] * off**2, axis=1)

    current, (state, equations, cost) = seen, evaluate(seen, every)
    matrix, gradient = _with_prior(equations.matrix, prior), equations.gradient.copy()
    damping = np.full(len(factors), _START_DAMPING)
    counted = np.maximum(np.sum(bands.weight, axis=1), 1.0)
    running = np.ones(len(factors), dtype=np.bool_)
    ahead = np.zeros((len(factors), MODES + BLUR))
    is_current = True
    for _ in range(_STEPS):
        diagonal = np.einsum("mii->mi", matrix) + 1e-12
        damped = matrix + (diagonal * damping[:, None])[:, :, None] * np.eye(MODES + BLUR)
        inverse = np.linalg.inv(damped)
        step = -(inverse @ gradient[..., None])[..., 0]
        gain = -np.sum(step * gradient, axis=1)
        variance = cost / counted + QUANTIZATION
        running &= (gain > _CONVERGED * variance) & (damping < _MOST_DAMPING)
        # How far the second order may move a rim, beside its own error.
        error = np.sqrt(np.maximum(np.min(np.einsum("mii->mi", inverse)[:, :MODES], axis=1), 0.0) * variance)
        moved = np.abs(step[:, :MODES]).sum(axis=1)
        last = running & (moved * (moved + np.abs(step[:, MODES:]).sum(axis=1)) < short * error)
        if last.any():
            factors[last], blur[last] = _after(factors[last], blur[last], step[last])
            ahead[last] = step[last]
            running &= ~last
        which = np.flatnonzero(running)
        if len(which) == 0:
            break
        some = bands if len(which) == len(every) else bands[which]
        trial = _Seen.of(some, *_after(factors[which], blur[which], step[which]), shares)
        new_state, new_equations, new_cost = evaluate(trial, which)
        better = new_cost <= cost[which]
        damping[which] = np.where(better, damping[which] * 0.1, np.maximum(damping[which] * 30.0, 1e-3))
        taken = which[better]
        factors[taken], blur[taken], cost[taken] = trial.factors[better], trial.blur[better], new_cost[better]
        matrix[taken] = _with_prior(new_equations.matrix, prior[which])[better]
        gradient[taken] = new_equations.gradient[better]
        if len(taken) == len(every):
            current, state, equations = trial, new_state, new_equations
        elif len(taken):
            is_current = False
    converged = ~running & (damping < _MOST_DAMPING)
    if not is_current:
        current = _Seen.of(bands, factors, blur, shares)
        state, equations, _ = evaluate(current, every)
        ahead[:] = 0.0
    return _Fit(factors, blur, converged, current, state, equations, ahead)


def _after(factors: FloatArray, blur: FloatArray, step: FloatArray) -> tuple[FloatArray, FloatArray]:
    limited = np.clip(step, -_LONGEST_STEP, _LONGEST_STEP)
    changed = blur + limited[:, MODES:]
    low, high = np.log(_SIGMA_PX[0]), np.log(_SIGMA_PX[1])
    changed[:, 0] = np.clip(changed[:, 0], low, high)
    changed[:, 1:] = np.clip(changed[:, 1:], -_MOST_UNEQUAL, _MOST_UNEQUAL)
    return grown(factors, limited[:, :MODES]), changed


def _correlation(
    scores: RealArray, stretch: IntArray, numbers: IntArray, matrix: FloatArray, variance: FloatArray
) -> FloatArray:
    """Return (m,) how much more the residuals of a stretch add up to than independent ones would; at least 1.

    The scores (m, 8, k) of independent residuals, summed by stretch, scatter as the information says. Where
    neighbours err alike (texture, a model that does not hold), they scatter more, and so does the estimate.
    `stretch` (m, k) of each pixel, of `numbers` (m,) in all for each rim, counted on from rim to rim by the most that
    any has. Coarse texture shows in joined stretches only, of which there are few: there more is asked of it.
    """
    rims, most = len(matrix), int(numbers.max())
    flat = stretch.ravel()
    by_stretch = np.stack(
        [np.bincount(flat, scores[:, i].ravel(), rims * most) for i in range(MODES + BLUR)], axis=-1
    ).reshape(rims, most, MODES + BLUR)
    inverse = np.linalg.inv(matrix)
    largest = np.ones(rims)
    for joined, least in _JOINED:
        sums = sum(np.roll(by_stretch, -shift, axis=1) for shift in range(joined)) if joined > 1 else by_stretch
        total = np.sum((sums @ inverse) * sums, axis=(1, 2)) / joined
        ratio = total / ((MODES + BLUR) * variance)
        largest = np.maximum(largest, np.where(ratio > least, ratio, 1.0))
    return largest
