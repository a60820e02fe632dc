"""One rigid pose of a board from the rims of its circles. Pure NumPy.

Each rim gives the coefficients of its cone's modes, with an information matrix. The pose minimizes the sum of
squared misfits, by damped Gauss-Newton: a rotation about the board's origin, in camera axes, and a translation. A
rim that fits none but itself does not count. Where the discs are not as large as stated beside their distances, one
factor of all radii is found, too: printers and blur change small radii by percents, but hardly the distances.

A planar board seen from afar has two poses, nearly mirror images; both are fitted and compared by Student's t.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from circlepose._numerics import STUDENT_FREEDOM, logistic, student_log_likelihood
from circlepose._typing import BoolArray, FloatArray
from circlepose.boards.options import DEFAULT, BoardOptions
from circlepose.boards.pose import FREE, BoardRims, RigidPose, circle_derivatives, circles_at
from circlepose.geometry.cone_perturbation import MODES, pose_coefficients, pose_derivatives

_MEDIAN_CHI_SQUARE = 4.35
"""Of five degrees of freedom; exact."""
_ROUNDS, _STEPS = 8, 30
_SOFT_STEPS = 3
"""Steps of each round whose weights are not yet the last; cost."""
_LEAST_GAIN = 1e-4
"""Chi-square; a step that would gain less is the last; numerical."""
_LONGEST_STEP = 0.3
"""Longest step: of the place in shares of the distance, of the rotation in rad; numerical."""
_WORST_CONDITION = 1e14


@dataclass(frozen=True, slots=True, eq=False)
class BoardFit:
    """A pose of a board, a local minimum of the misfit."""

    pose: RigidPose
    growth: float
    """share by which all radii are larger than stated; 0 where they are taken as stated"""
    chi_square: FloatArray
    """(k,) misfit of each rim"""
    used: BoolArray
    """(k,) the rims that count"""
    covariance: FloatArray
    """(6, 6) of the translation (mm) and of the rotation vector in camera axes (rad), as the rims' noise brings it"""
    freedom: int
    """degrees of freedom of the misfit"""

    @property
    def misfit(self) -> float:
        """Chi-square of the rims that count."""
        return float(self.chi_square[self.used].sum())

    @property
    def excess(self) -> float:
        """The ratio, at least 1, by which the misfit inflates variances."""
        return max(1.0, (STUDENT_FREEDOM + self.misfit) / (STUDENT_FREEDOM + max(self.freedom, 0)))

    @property
    def log_weight(self) -> float:
        """Logarithm of the probability of all poses around this one, up to a constant."""
        spread = 0.5 * float(np.linalg.slogdet(self.covariance)[1])
        return float(student_log_likelihood(self.misfit, max(self.freedom, 1))) + spread


def fit_board(
    rims: BoardRims, start: RigidPose, options: BoardOptions = DEFAULT, *, may_grow: bool = True
) -> BoardFit | None:
    """Return the pose near `start` that fits most of the rims; None where they determine none.

    `may_grow`: all radii may be larger, or smaller, than stated, where the rims show it beyond doubt.
    """
    fit = _robust(rims, _near_centers(rims, start, options), None, options)
    if fit is None or not may_grow or np.count_nonzero(fit.used) < options.least_growing:
        return fit
    grown = _robust(rims, fit.pose, fit, options)
    if grown is None:
        return fit
    # Both judged on the same rims, in units of the better misfit.
    both = fit.used & grown.used
    scale = max(1.0, float(np.median(grown.chi_square[both])) / _MEDIAN_CHI_SQUARE) if both.any() else 1.0
    gain = float(fit.chi_square[both].sum() - grown.chi_square[both].sum()) / scale
    more = np.count_nonzero(grown.used) > np.count_nonzero(fit.used)
    return grown if gain > options.growth_chi_square or (more and gain > 0.0) else fit


def minimum_near(rims: BoardRims, start: RigidPose) -> BoardFit | None:
    """Return the minimum of the misfit of all rims near a pose; None where they determine none."""
    every = np.ones(len(rims))
    found = _solved(rims, start, 0.0, every, grows=False)
    return None if found is None else fit_at(rims, found[0], 0.0, every > 0.0, grows=False)


def chance_of_second(first: BoardFit, second: BoardFit) -> float:
    """Return the probability of the second of two fits to the same rims."""
    return float(logistic(second.log_weight - first.log_weight))


def _near_centers(rims: BoardRims, start: RigidPose, options: BoardOptions) -> RigidPose:
    """Return a pose that brings the circles to where their rims are, by their centers, where `start` is far off.

    The modes hold for small changes alone.
    """
    seen = rims.factor[:, :2, 2] / rims.factor[:, 2:, 2]
    pose, damping = start, 1e-3
    offset, slopes, far = _center_offsets(rims, pose, seen)
    if len(rims) < options.least_on_lattice or far < options.far_radii:
        return start
    for _ in range(_STEPS):
        weight = 1.0 / (1.0 + np.sum(offset**2, axis=1) / max(float(np.median(np.sum(offset**2, axis=1))), 1e-18))
        size = _size(pose, grows=False)
        scaled = slopes * size
        matrix = np.einsum("k,kai,kaj->ij", weight, scaled, scaled)
        gradient = np.einsum("k,kai,ka->i", weight, scaled, offset)
        step = -np.linalg.solve(matrix + damping * np.trace(matrix) * np.eye(FREE), gradient)
        step = step * min(1.0, _LONGEST_STEP / max(float(np.max(np.abs(step))), 1e-300)) * size
        trial = pose.moved(step)
        moved, its_slopes, _ = _center_offsets(rims, trial, seen)
        if float(np.median(np.abs(moved))) <= float(np.median(np.abs(offset))):
            pose, offset, slopes, damping = trial, moved, its_slopes, damping * 0.1
        else:
            damping *= 10.0
        if damping > 1e6:
            break
    return pose


def _center_offsets(rims: BoardRims, pose: RigidPose, seen: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Return (k, 2) by how much the circles' centers are off `seen` (k, 2), x/z and y/z, with slopes (k, 2, 6).

    And the median of their distances in radii.
    """
    center, _, radius = circles_at(rims, pose)
    depth = np.maximum(center[:, 2:], 1e-6 * np.linalg.norm(center, axis=1, keepdims=True))
    plane = center[:, :2] / depth
    by_center = np.zeros((len(rims), 2, 3))
    by_center[:, 0, 0] = by_center[:, 1, 1] = 1.0 / depth[:, 0]
    by_center[:, :, 2] = -plane / depth
    slopes = by_center @ circle_derivatives(rims, pose)[:, :3]
    offset = plane - seen
    far = float(np.median(np.linalg.norm(offset, axis=1) * depth[:, 0] / radius))
    return offset, slopes, far


def _robust(rims: BoardRims, start: RigidPose, before: BoardFit | None, options: BoardOptions) -> BoardFit | None:
    """Fit with weights that fall with the misfit, then without the rims that misfit; with `before` the radii grow."""
    pose, growth = start, 0.0
    grows = before is not None
    chi_square = chi_squares(rims, pose, growth)
    for _ in range(_ROUNDS):
        scale = max(1.0, float(np.median(chi_square)) / _MEDIAN_CHI_SQUARE)
        weight = 1.0 / (1.0 + chi_square / (scale * 2.0 * MODES))
        step = _solved(rims, pose, growth, weight, grows=grows, steps=_SOFT_STEPS)
        if step is None:
            return None
        pose, growth = step
        former, chi_square = chi_square, chi_squares(rims, pose, growth)
        if np.abs(chi_square - former).max(initial=0.0) < 0.01 * scale:
            break
    used = np.ones(len(rims), np.bool_)
    for _ in range(_ROUNDS):
        scale = max(1.0, float(np.median(chi_square)) / _MEDIAN_CHI_SQUARE)
        kept = chi_square <= options.most_chi_square * scale
        if np.count_nonzero(kept) < 2:
            kept = chi_square <= np.sort(chi_square)[1]
        step = _solved(rims, pose, growth, kept.astype(np.float64), grows=grows)
        if step is None:
            return None
        pose, growth = step
        chi_square = chi_squares(rims, pose, growth)
        if np.array_equal(kept, used):
            break
        used = kept
    return fit_at(rims, pose, growth, kept, grows=grows)


def fit_at(rims: BoardRims, pose: RigidPose, growth: float, used: BoolArray, *, grows: bool) -> BoardFit | None:
    """Return the fit whose minimum is at `pose`; None where the rims `used` (k,) do not determine it."""
    matrix, _ = _equations(rims, pose, growth, used.astype(np.float64), grows=grows)
    size = _size(pose, grows=grows)
    scaled = matrix * np.outer(size, size)
    if not np.all(np.isfinite(scaled)) or np.linalg.cond(scaled) > _WORST_CONDITION:
        return None
    covariance = (np.linalg.inv(scaled) * np.outer(size, size))[:FREE, :FREE]
    freedom = MODES * int(np.count_nonzero(used)) - len(size)
    return BoardFit(pose, growth, chi_squares(rims, pose, growth), used, covariance, freedom)


def _solved(
    rims: BoardRims, pose: RigidPose, growth: float, weight: FloatArray, *, grows: bool, steps: int = _STEPS
) -> tuple[RigidPose, float] | None:
    """Return the minimum of the weighted misfit near a pose, by damped Gauss-Newton."""
    cost, damping = float(weight @ chi_squares(rims, pose, growth)), 1e-6
    for _ in range(steps):
        matrix, gradient = _equations(rims, pose, growth, weight, grows=grows)
        size = _size(pose, grows=grows)
        matrix, gradient = matrix * np.outer(size, size), gradient * size
        if not 0.0 < np.trace(matrix) < np.inf:
            return None
        ridge = 1e-14 * np.trace(matrix) * np.eye(len(size))
        gain = float(gradient @ np.linalg.solve(matrix + ridge, gradient))
        while damping < 1e8:
            step = -np.linalg.solve(matrix + ridge + damping * np.diag(np.diag(matrix)), gradient)
            step = step * min(1.0, _LONGEST_STEP / max(float(np.max(np.abs(step))), 1e-300)) * size
            trial, trial_growth = pose.moved(step[:FREE]), growth + (float(step[FREE]) if grows else 0.0)
            trial_cost = float(weight @ chi_squares(rims, trial, trial_growth))
            if trial_cost <= cost:
                break
            damping = max(damping * 10.0, 1e-6)
        else:
            break
        pose, growth, cost, damping = trial, trial_growth, trial_cost, damping * 0.1
        if gain < _LEAST_GAIN * max(1.0, cost):
            break
    return pose, growth


def _size(pose: RigidPose, *, grows: bool) -> FloatArray:
    """Return the units in which all parameters are of one kind."""
    distance = max(float(np.linalg.norm(pose.translation)), 1e-9)
    return np.array([distance] * 3 + [1.0] * (4 if grows else 3))


def _away(rims: BoardRims, pose: RigidPose, growth: float) -> FloatArray:
    return pose_coefficients(rims.factor, *_placed(rims, pose, growth)) - rims.coefficients


def _placed(rims: BoardRims, pose: RigidPose, growth: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    center, normal, radius = circles_at(rims, pose, growth)
    return center, normal, radius[:, None, None]


def chi_squares(rims: BoardRims, pose: RigidPose, growth: float = 0.0) -> FloatArray:
    """Return the misfit (k,) of each rim at a pose."""
    away = _away(rims, pose, growth)
    misfit = np.einsum("ki,kij,kj->k", away, rims.information, away)
    return np.where(np.isfinite(misfit), misfit, 1e30)


def _equations(
    rims: BoardRims, pose: RigidPose, growth: float, weight: FloatArray, *, grows: bool
) -> tuple[FloatArray, FloatArray]:
    """Return the matrix and the right side of the normal equations."""
    center, normal, radius = circles_at(rims, pose, growth)
    own = pose_derivatives(rims.factor, center, normal, radius[:, None, None])
    slopes = own[..., :5] @ circle_derivatives(rims, pose)
    if grows:
        slopes = np.concatenate([slopes, own[..., 5:] * rims.radius_mm[:, None, None]], axis=-1)
    weighted = np.swapaxes(slopes, -1, -2) @ (rims.information * weight[:, None, None])
    away = _away(rims, pose, growth)
    usable = np.all(np.isfinite(slopes), axis=(1, 2)) & np.all(np.isfinite(away), axis=1)
    weighted, slopes, away = weighted[usable], slopes[usable], away[usable]
    return (weighted @ slopes).sum(axis=0), np.einsum("kij,kj->i", weighted, away)
