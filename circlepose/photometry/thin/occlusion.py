"""Which stretches of a thin rim nothing covers: the residuals of a fit, stretch by stretch on either side of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from circlepose._typing import BoolArray, FloatArray, IntArray
from circlepose.photometry.thin.model import MARGIN_PX, QUANTIZATION, Problem, State, evaluate

_ALONG = 24
STRETCHES = 2 * _ALONG
_CLEAN_SHARE = 0.2
"""Share of the stretches that are taken to be clean."""
_COVERED = 2.5
_TOUCHED = 1.6
_COVERED_SHARE = 0.015
"""A stretch is covered when its residual is so many times the typical one, and such a share of the peak; touched by
what covers another when it is the second number of times as large."""
_LEAST_KEPT = 0.35
_CONCENTRATIONS = 4


def with_points(points: FloatArray, theta: FloatArray) -> BoolArray:
    """Tell which stretches have points, or lie between two that have."""
    has = np.bincount(stretches_of(points, theta), minlength=STRETCHES).reshape(2, _ALONG) > 0
    padded = np.pad(has, ((0, 0), (1, 1)))
    return np.asarray((has | (padded[:, :-2] & padded[:, 2:])).ravel())


def agreeing(problem: Problem, theta: FloatArray) -> BoolArray:
    """Tell which stretches agree on levels with the better half of them (concentration steps)."""
    stretch_of = stretches_of(problem.points, theta)
    kept = np.ones(STRETCHES, dtype=np.bool_)
    for _ in range(_CONCENTRATIONS):
        state = evaluate(theta, replace(problem, chosen=kept[stretch_of]))
        rms = rms_of_stretches(state, problem, stretch_of)
        kept = rms <= np.median(rms)
    return uncovered(state, problem, stretch_of)


def stretches_of(points: FloatArray, theta: FloatArray) -> IntArray:
    """Return the stretch along the major axis, of either side, that each point (n, 2) belongs to."""
    cos, sin = np.cos(theta[4]), np.sin(theta[4])
    offset = points - theta[:2]
    along, across = offset @ np.array([cos, sin]), offset @ np.array([-sin, cos])
    share = (along / (theta[2] + MARGIN_PX) + 1.0) / 2.0
    return np.clip((share * _ALONG).astype(np.int64), 0, _ALONG - 1) + _ALONG * (across > 0.0)


def rms_of_stretches(state: State, problem: Problem, stretch_of: IntArray) -> FloatArray:
    """Return the rms residual (s,) of each stretch."""
    weight = np.maximum(np.bincount(stretch_of, problem.fade**2, STRETCHES), 1.0)
    return np.sqrt(np.bincount(stretch_of, state.misfit**2, STRETCHES) / weight)


def uncovered(state: State, problem: Problem, stretch_of: IntArray, *, closely: bool = False) -> BoolArray:
    """Tell which stretches have residuals like the best of them: something covers the rest, or touches them.

    With `closely`, for a fit that nothing pulls at any more, those that the edge of it touches are told too. The
    best are kept in any case, as a fit that is still off has residuals everywhere.
    """
    rms = rms_of_stretches(state, problem, stretch_of)
    limit = covered_from(state, problem, stretch_of)
    bad = np.pad((rms > limit).reshape(2, _ALONG), ((0, 0), (1, 1)))
    # What covers a stretch reaches a little into its neighbours.
    clean = ~(bad[:, 1:-1] | bad[:, :-2] | bad[:, 2:]).ravel()
    if closely and not clean.all():
        clean &= rms <= _TOUCHED * np.quantile(rms, _CLEAN_SHARE)
    return clean if clean.mean() >= _LEAST_KEPT else rms <= np.quantile(rms, _LEAST_KEPT)


def covered_from(state: State, problem: Problem, stretch_of: IntArray) -> float:
    """Return the rms residual from which a stretch is covered."""
    typical = float(np.quantile(rms_of_stretches(state, problem, stretch_of), _CLEAN_SHARE))
    return max(_COVERED * typical, _COVERED_SHARE * abs(state.contrast) * state.highest_share)


def structure(state: State, problem: Problem, kept: BoolArray) -> float:
    """Return the rms residual over that which neighbouring pixels do not share: 1 where noise is all that is left."""
    chosen = problem.fade * kept[stretches_of(problem.points, state.theta)]
    # Pixels stand in rows; of the same row are those that follow with the next x.
    same_row = np.all(np.diff(problem.points, axis=0) == [1.0, 0.0], axis=1)
    weight = same_row * np.minimum(chosen[1:], chosen[:-1]) ** 2
    plain = state.misfit / np.maximum(problem.fade, 1e-9)
    unshared = float(np.sum(weight * np.diff(plain) ** 2)) / 2.0 / max(float(np.sum(weight)), 1e-9)
    return state.rms / float(np.sqrt(max(unshared, QUANTIZATION)))
