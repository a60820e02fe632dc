"""Damped Gauss-Newton over the five `rim_modes` and the blurs of many rims at once, the levels eliminated."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from circlepose._batching import put_rows, rows
from circlepose._typing import BoolArray, FloatArray, IntArray
from circlepose.geometry.cone_perturbation import MODES, grown
from circlepose.photometry.edge_spread import BLUR, Places, Share, places
from circlepose.photometry.intensity_model import Columns, Equations, Levels, fit_levels
from circlepose.photometry.intensity_prior import FarLevels
from circlepose.photometry.occlusion import QUANTIZATION
from circlepose.photometry.pixel_band import Bands

_LEAST_BLUR = np.array([np.log(0.25), -0.6, -0.6])
_MOST_BLUR = np.array([np.log(8.0), 0.6, 0.6])
_STEPS = 12
_CONVERGED = 1e-3
"""A step that would lower the cost by so many noise variances is worth nothing: 3 % of a standard error."""
_MOST_DAMPING = 1e5
_START_DAMPING = 1e-5
_LONGEST_STEP = 0.5
SHORT, SHORT_FIRST = 0.25, 1.0
"""Standard errors that the second order of a last step may make, so that it is taken unseen; where more follows."""

Shares = Callable[[Places, FloatArray], Share]


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """The rims at some factors and blurs, as their pixels see them."""

    factors: FloatArray
    blur: FloatArray
    at: Places
    columns: Columns
    finest: int = 0
    """order of the finest harmonic of the levels for texture; 0 where there are none"""

    @classmethod
    def of(cls, bands: Bands, factors: FloatArray, blur: FloatArray, shares: Shares, *, finest: int = 0) -> Seen:
        """Return the rims of cones with `factors` (m, 3, 3) and `blur` (m, 3), as the pixels of `bands` see them."""
        at = places(bands, factors)
        return cls(factors, blur, at, Columns.of(bands, at, shares(at, blur), finest=finest), finest)

    def weighted(self, bands: Bands) -> Seen:
        """Return the same with the weight that the pixels have in `bands`."""
        return replace(self, columns=Columns.of(bands, self.at, self.columns.share, finest=self.finest))


@dataclass(frozen=True, slots=True, eq=False)
class Descent:
    """Where a descent ended: `ahead` (m, 8) of where the rims were last `seen`, by steps too short to look again."""

    factors: FloatArray
    blur: FloatArray
    converged: BoolArray
    seen: Seen
    state: Levels
    equations: Equations
    ahead: FloatArray

    @property
    def is_seen(self) -> bool:
        """Whether the rims were seen where they are."""
        return not self.ahead.any()

    @property
    def square(self) -> FloatArray:
        """(m,) sum of squares of the residuals where the rims are."""
        return self.state.square + np.sum(self.ahead * self.equations.gradient, axis=1)


def descend(
    bands: Bands,
    seen: Seen,
    shares: Shares,
    stiff: FloatArray,
    prior: FloatArray,
    mean: FloatArray,
    far: FarLevels | None = None,
    *,
    start: tuple[Levels, Equations] | None = None,
    short: float = SHORT,
) -> Descent:
    """Fit the rims from where they are `seen`; `prior` (m, 3) pulls the blurs to `mean` (m, 3).

    `start` is what fits there, of pixels and `far` levels, if that is known already.

    A step whose second order is below `short` standard errors is the last, and taken unseen. What is in `seen` is
    written over where rims move: no copy is made of that much.
    """
    factors, blur = seen.factors.copy(), seen.blur.copy()
    every = np.arange(len(factors))

    def evaluate(
        now: Seen, which: IntArray, known: tuple[Levels, Equations] | None = None
    ) -> tuple[Levels, Equations, FloatArray]:
        if known is None:
            state = fit_levels(now.columns, stiff[which], None if far is None else rows(far, which))
            known = state, state.normal_equations()
        state, found = known
        off = now.blur - mean[which]
        found.gradient[:, MODES:] += prior[which] * off
        return state, found, state.cost + np.sum(prior[which] * off**2, axis=1)

    current, (state, equations, cost) = seen, evaluate(seen, every, start)
    matrix, gradient = with_prior(equations.matrix, prior), equations.gradient.copy()
    damping = np.full(len(factors), _START_DAMPING)
    counted = np.maximum(np.sum(bands.weight, axis=1), 1.0)
    running = np.ones(len(factors), dtype=np.bool_)
    ahead = np.zeros((len(factors), MODES + BLUR))
    for _ in range(_STEPS):
        diagonal = np.einsum("mii->mi", matrix) + 1e-12
        damped = matrix + (diagonal * damping[:, None])[:, :, None] * np.eye(MODES + BLUR)
        inverse = np.linalg.inv(damped)
        step = -(inverse @ gradient[..., None])[..., 0]
        gain = -np.sum(step * gradient, axis=1)
        variance = np.maximum(cost, 0.0) / counted + QUANTIZATION
        running &= (gain > _CONVERGED * variance) & (damping < _MOST_DAMPING)
        last = running & (_second_order(step, inverse, variance) < short)
        if last.any():
            factors[last], blur[last] = _after(factors[last], blur[last], step[last])
            ahead[last] = step[last]
            running &= ~last
        which = np.flatnonzero(running)
        if len(which) == 0:
            break
        some = bands if len(which) == len(every) else rows(bands, which)
        moved_to = _after(factors[which], blur[which], step[which])
        trial = Seen.of(some, *moved_to, shares, finest=seen.finest)
        new_state, new_equations, new_cost = evaluate(trial, which)
        better = new_cost <= cost[which]
        damping[which] = np.where(better, damping[which] * 0.1, np.maximum(damping[which] * 30.0, 1e-3))
        taken = which[better]
        factors[taken], blur[taken], cost[taken] = trial.factors[better], trial.blur[better], new_cost[better]
        matrix[taken] = with_prior(new_equations.matrix, prior[which])[better]
        gradient[taken] = new_equations.gradient[better]
        if len(taken) == len(every):
            current, state, equations = trial, new_state, new_equations
        elif len(taken):
            those = None if better.all() else np.flatnonzero(better)
            put_rows((current, state, equations), taken, (trial, new_state, new_equations), those)
    converged = ~running & (damping < _MOST_DAMPING)
    return Descent(factors, blur, converged, current, state, equations, ahead)


def _second_order(step: FloatArray, inverse: FloatArray, variance: FloatArray) -> FloatArray:
    """Return (m,) how far the second order of a `step` (m, 8) may move a rim, in standard errors of the rim."""
    error = np.sqrt(np.maximum(np.min(np.einsum("mii->mi", inverse)[:, :MODES], axis=1), 0.0) * variance)
    moved = np.abs(step[:, :MODES]).sum(axis=1)
    return moved * (moved + np.abs(step[:, MODES:]).sum(axis=1)) / np.maximum(error, 1e-30)


def _after(factors: FloatArray, blur: FloatArray, step: FloatArray) -> tuple[FloatArray, FloatArray]:
    limited = np.minimum(np.maximum(step, -_LONGEST_STEP), _LONGEST_STEP)
    changed = blur + limited[:, MODES:]
    return grown(factors, limited[:, :MODES]), np.minimum(np.maximum(changed, _LEAST_BLUR), _MOST_BLUR)


def with_prior(matrix: FloatArray, prior: FloatArray) -> FloatArray:
    """Return the information (m, 8, 8) on modes and blurs with the `prior` (m, 3) on the blurs added."""
    matrix = matrix.copy()
    matrix[:, MODES:, MODES:] += prior[:, :, None] * np.eye(BLUR)
    return matrix
