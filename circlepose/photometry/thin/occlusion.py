"""The segments of a thin rim that nothing covers, from the residuals of its fit.

The rim is divided along the major axis, on either side of it. With e the rms residual (levels) of a segment and e0 a
low quantile over all segments, a segment is covered if e > max(2.5 e0, 0.015 peak level), with the numbers of
`ThinOptions`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from circlepose._numerics import ROUNDING_VARIANCE
from circlepose._typing import BoolArray, FloatArray, IntArray
from circlepose.photometry.segments import mean_squares, segment_sums
from circlepose.photometry.thin.model import Problem, State, evaluate
from circlepose.photometry.thin.options import ThinOptions


def segments_of(points: FloatArray, theta: FloatArray, options: ThinOptions) -> IntArray:
    """Return the segment (n,) of each point (n, 2): its index along the major axis, on either side of it."""
    along_count = options.segments_per_side
    cos, sin = np.cos(theta[4]), np.sin(theta[4])
    offset = points - theta[:2]
    along, across = offset @ np.array([cos, sin]), offset @ np.array([-sin, cos])
    share = (along / (theta[2] + options.margin_px) + 1.0) / 2.0
    return np.clip((share * along_count).astype(np.int64), 0, along_count - 1) + along_count * (across > 0.0)


def segments_with_points(points: FloatArray, theta: FloatArray, options: ThinOptions) -> BoolArray:
    """Return (s,) which segments have points, or lie between two that have."""
    sides = (2, options.segments_per_side)
    segment = segments_of(points, theta, options)
    has = segment_sums(np.ones(len(segment)), segment, sides) > 0
    padded = np.pad(has, ((0, 0), (1, 1)))
    return np.asarray((has | (padded[:, :-2] & padded[:, 2:])).ravel())


def consensus_segments(problem: Problem, theta: FloatArray) -> BoolArray:
    """Return (s,) which segments agree on levels with the better half of them.

    Source: concentration steps of least trimmed squares, Rousseeuw & Van Driessen (2006).
    """
    segment = segments_of(problem.points, theta, problem.options)
    kept = np.ones(2 * problem.options.segments_per_side, dtype=np.bool_)
    for _ in range(problem.options.concentrations):
        state = evaluate(theta, replace(problem, chosen=kept[segment]))
        rms = segment_rms(state, problem, segment)
        kept = rms <= np.median(rms)
    return uncovered_segments(state, problem, segment)


def segment_rms(state: State, problem: Problem, segment: IntArray) -> FloatArray:
    """Return the rms residual (s,) of each segment, levels."""
    shape = (2 * problem.options.segments_per_side,)
    return np.sqrt(mean_squares(state.misfit**2, problem.fade**2, segment, shape)[0])


def uncovered_segments(state: State, problem: Problem, segment: IntArray, *, strict: bool = False) -> BoolArray:
    """Return (s,) which segments have residuals like the best ones; the rest is covered or touched by something.

    With `strict`, for a fit without covered segments, also the segments that are touched are left out. The best
    segments are always kept, because a fit that has not converged has residuals everywhere.
    """
    options = problem.options
    rms = segment_rms(state, problem, segment)
    limit = covered_rms(state, problem, segment)
    covered = np.pad((rms > limit).reshape(2, options.segments_per_side), ((0, 0), (1, 1)))
    # What covers a segment extends a little into its neighbors.
    clean = ~(covered[:, 1:-1] | covered[:, :-2] | covered[:, 2:]).ravel()
    if strict and not clean.all():
        clean &= rms <= options.touched_ratio * np.quantile(rms, options.clean_share)
    return clean if clean.mean() >= options.least_kept else rms <= np.quantile(rms, options.least_kept)


def covered_rms(state: State, problem: Problem, segment: IntArray) -> float:
    """Return the rms residual (levels) above which a segment is covered."""
    options = problem.options
    typical = float(np.quantile(segment_rms(state, problem, segment), options.clean_share))
    peak_levels = options.covered_share * abs(state.contrast) * state.highest_coverage
    return max(options.covered_ratio * typical, peak_levels)


def structure(state: State, problem: Problem, kept: BoolArray) -> float:
    """Return the rms residual over that of its differences between neighboring pixels: 1 for independent noise."""
    chosen = problem.fade * kept[segments_of(problem.points, state.theta, problem.options)]
    # Pixels are in row order; two of the same row follow each other with x increased by 1.
    same_row = np.all(np.diff(problem.points, axis=0) == [1.0, 0.0], axis=1)
    weight = same_row * np.minimum(chosen[1:], chosen[:-1]) ** 2
    plain = state.misfit / np.maximum(problem.fade, 1e-9)
    independent = float(np.sum(weight * np.diff(plain) ** 2)) / 2.0 / max(float(np.sum(weight)), 1e-9)
    return state.rms / float(np.sqrt(max(independent, ROUNDING_VARIANCE)))
