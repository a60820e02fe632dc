"""One pose for all circles of a ring target: what their rims tell together. Pure NumPy.

Of each rim is known by how much its `rim_modes` depart from those of its measured cone, with an information matrix:
from the fit to the grey levels, or from placed edges. The pose of all circles (centre and two tilts; with coaxial
circles also the height between their planes) is where the sum of squared misfits is least, by damped Gauss-Newton.

Radii and heights are not known exactly, nor are rings concentric to every digit. The largest circle is the
yardstick: the others' radii and places have a tolerance relative to it, which is a part of the covariance of their
rims. Where the misfit is more than all this explains, the covariance is larger by so much; and the two candidates
of a target are compared by Student's t, whose tails allow for the errors being larger than told.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from circlepose._numerics import STUDENT_FREEDOM, logistic, student_log_likelihood
from circlepose._typing import FloatArray
from circlepose.geometry.cone import plane_basis
from circlepose.geometry.cone_perturbation import MODES, mode_shapes, pose_amounts, pose_derivatives

RADIUS_SHARE = 2e-3
"""Standard deviation of another circle's radius, and of a height, relative to the largest circle."""
PLACE_SHARE = 1e-4
"""Standard deviation of another circle's centre, in each direction, in radii of the largest."""
INDEPENDENT_EDGES = 12.0
"""The errors of edges go together along a rim: so many of them at most are worth as much as all."""
_STEPS = 40
_WORTH = 1e-3
"""After a step that would lower chi-square by less there is nothing to gain."""
_WORST_CONDITION = 1e14
_MOST_DAMPING = 1e8
_LONGEST = 0.2
"""Longest step: of the centre in shares of the distance, of the normal in rad."""
_SAME_SIGMAS = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class RimEvidence:
    """What a rim tells of the cone of its circle."""

    factor: FloatArray
    """(3, 3) of the measured cone"""
    radius: float
    amounts: FloatArray
    """(5,) of the `rim_modes`, most likely"""
    information: FloatArray
    """(5, 5) inverse of their covariance; singular where part of the rim says nothing of some"""


@dataclass(frozen=True, slots=True, eq=False)
class AxisPose:
    """Pose of a target's circles: the largest's, and how far in front of it, along the normal, the others are."""

    center: FloatArray
    """(3,)"""
    normal: FloatArray
    """(3,) unit"""
    height: float = 0.0

    def circle(self, number: int) -> tuple[FloatArray, FloatArray]:
        """Return centre and normal of the largest circle, number 0, or another."""
        return (self.center if number == 0 else self.center + self.height * self.normal), self.normal

    def offset(self, number: int, other: AxisPose) -> FloatArray:
        """Return centre (3) and tilts (2) from a circle's pose to that in `other`, which is close."""
        (center, normal), (other_center, other_normal) = self.circle(number), other.circle(number)
        return np.concatenate([other_center - center, np.stack(plane_basis(normal)) @ other_normal])

    def circle_derivatives(self, number: int) -> FloatArray:
        """Return d circle's pose (centre, two tilts) / d centre, tilts and height: (5, 6)."""
        derivatives = np.eye(5, 6)
        if number > 0:
            first, second = plane_basis(self.normal)
            derivatives[:3, 3:] = np.stack([self.height * first, self.height * second, self.normal], axis=-1)
        return derivatives


@dataclass(frozen=True, slots=True, eq=False)
class JointPose:
    """A pose of all circles, as a rule one with the least misfit around."""

    pose: AxisPose
    misfit: float
    """chi-square, with the degrees of freedom below where the errors are as told"""
    freedom: int
    covariance: FloatArray
    """(6, 6) of the largest circle's centre, two tilts and the height, were the errors as told"""

    @property
    def excess(self) -> float:
        """By how much the misfit makes variances larger than told, at least 1."""
        return max(1.0, (STUDENT_FREEDOM + self.misfit) / (STUDENT_FREEDOM + self.freedom))

    def covariance_of(self, number: int) -> FloatArray:
        """Return the covariance (5, 5) of a circle's centre and two tilts, basis `cone.plane_basis(normal)`."""
        derivatives = self.pose.circle_derivatives(number)
        return np.asarray(self.excess * (derivatives @ self.covariance @ derivatives.T))

    @property
    def height_sigma(self) -> float:
        """Standard deviation of the height; 0 where it is fixed."""
        return float(np.sqrt(self.excess * self.covariance[5, 5]))

    @property
    def log_weight(self) -> float:
        """Logarithm of the probability of all poses around this one, up to a constant."""
        told = self.covariance[:5, :5] if self.covariance[5, 5] == 0.0 else self.covariance
        return float(student_log_likelihood(self.misfit, self.freedom) + 0.5 * np.linalg.slogdet(told)[1])


def from_levels(factor: FloatArray, radius: float, modes_covariance: FloatArray) -> RimEvidence:
    """Return the evidence of a rim fitted to grey levels, with the covariance (5, 5) of its modes."""
    return RimEvidence(factor, radius, np.zeros(MODES), np.asarray(np.linalg.inv(modes_covariance)))


def from_edges(
    factor: FloatArray, radius: float, rays: FloatArray, jacobians: FloatArray, scatter_px: float, common_px: float
) -> RimEvidence:
    """Return the evidence of edges near the rim of the cone with `factor`, also along a part of it alone.

    `rays` (n, 3) of the edges and `jacobians` (n, 3, 2) = d ray / d pixel. Their errors are `scatter_px` from place
    to place, and `common_px` of all together.
    """
    inverse = np.linalg.inv(factor)
    local = rays @ inverse.T
    across = np.hypot(local[:, 0], local[:, 1])
    ratio = across / local[:, 2]
    by_ray = np.stack([local[:, 0] / across, local[:, 1] / across, -ratio], axis=-1) / local[:, 2:] @ inverse
    per_px = np.linalg.norm(np.einsum("ni,nij->nj", by_ray, jacobians), axis=-1)
    slopes = mode_shapes(np.arctan2(local[:, 1], local[:, 0])) / per_px[:, None]
    distance = (ratio - 1.0) / per_px
    variance = scatter_px**2 * max(len(rays) / INDEPENDENT_EDGES, 1.0) + common_px**2 * len(rays)
    amounts: FloatArray = np.linalg.lstsq(slopes, distance, rcond=1e-6)[0]
    return RimEvidence(factor, radius, amounts, slopes.T @ slopes / variance)


@dataclass(frozen=True, slots=True, eq=False)
class RingProblem:
    """The rims of a target's circles, the largest first, and what is known of the height between their planes."""

    rims: tuple[RimEvidence, ...]
    height: float = 0.0
    """that is known or assumed"""
    height_sigma: float = 0.0
    """its standard deviation: 0 where it is fixed, infinite where nothing is known"""

    def solve(self, start: AxisPose) -> JointPose | None:
        """Return the optimum nearest to `start`; None where there is none that the camera could see."""
        told = self._with_tolerances(start)
        size = self._size(start)
        pose, cost, damping = start, self._cost(start, told), 1e-4
        for _ in range(_STEPS):
            matrix, gradient = self._equations(pose, told, size)
            if not 0.0 < np.trace(matrix) < np.inf:
                return None
            ridge = 1e-14 * np.trace(matrix) * np.eye(len(size))
            gain = float(gradient @ np.linalg.solve(matrix + ridge, gradient))
            while damping < _MOST_DAMPING:
                step = -np.linalg.solve(matrix + ridge + damping * np.diag(np.diag(matrix)), gradient)
                step = step * min(1.0, _LONGEST / max(float(np.max(np.abs(step[:5]))), 1e-300))
                trial = _moved(pose, step * size)
                trial_cost = self._cost(trial, told)
                if trial_cost <= cost:
                    break
                damping = max(damping * 10.0, 1e-6)
            else:
                break
            pose, cost, damping = trial, trial_cost, damping * 0.1
            # However short the damping made this step, the whole one would not be worth more.
            if gain < _WORTH:
                break
        return self.at(pose)

    def at(self, pose: AxisPose) -> JointPose | None:
        """Return the misfit at `pose` and its covariance, were it an optimum; None where it is not determined."""
        if not pose.center[2] > 0.0 or pose.center @ pose.normal >= 0.0:
            return None
        told = self._with_tolerances(pose)
        size = self._size(pose)
        matrix, _ = self._equations(pose, told, size)
        if not np.all(np.isfinite(matrix)) or np.linalg.cond(matrix) > _WORST_CONDITION:
            return None
        free = len(size)
        covariance = np.zeros((6, 6))
        covariance[:free, :free] = np.linalg.inv(matrix) * np.outer(size, size)
        freedom = MODES * len(self.rims) - free + (1 if self._height_information > 0.0 else 0)
        return JointPose(pose, self._cost(pose, told), freedom, covariance)

    def rim_covariance(self, number: int, pose: AxisPose) -> FloatArray | None:
        """Return the covariance (5, 5) of a rim's modes at `pose`, with the tolerances of its circle and its height.

        None where part of the rim determines nothing of some of them.
        """
        information = self._with_tolerances(pose)[number]
        if np.linalg.cond(information) > _WORST_CONDITION:
            return None
        covariance = np.linalg.inv(information)
        if number > 0:
            rim = self.rims[number]
            slope = pose_derivatives(rim.factor, *pose.circle(number), rim.radius)[:, :3] @ pose.normal
            covariance = covariance + self.height_sigma**2 * np.outer(slope, slope)
        return np.asarray(covariance)

    @property
    def _height_information(self) -> float:
        return 0.0 if self.height_sigma in (0.0, np.inf) else self.height_sigma**-2

    def _size(self, pose: AxisPose) -> FloatArray:
        """Return the units (5,) or (6,) in which all free parameters are of one kind."""
        distance = float(np.linalg.norm(pose.center))
        return np.array([distance, distance, distance, 1.0, 1.0, self.rims[0].radius])[
            : 5 if self.height_sigma == 0.0 else 6
        ]

    def _with_tolerances(self, pose: AxisPose) -> list[FloatArray]:
        """Return the information (5, 5) of each rim, its circle known relative to the largest to a tolerance."""
        told = [self.rims[0].information]
        for rim in self.rims[1:]:
            slopes = pose_derivatives(rim.factor, *pose.circle(1), rim.radius)[:, [0, 1, 2, 5]]
            slopes = slopes * np.array([PLACE_SHARE * self.rims[0].radius] * 3 + [RADIUS_SHARE * rim.radius])
            informed = rim.information @ slopes
            less = informed @ np.linalg.solve(np.eye(4) + slopes.T @ informed, informed.T)
            told.append(np.asarray(rim.information - less))
        return told

    def _away(self, pose: AxisPose, number: int) -> FloatArray:
        rim = self.rims[number]
        return pose_amounts(rim.factor, *pose.circle(number), rim.radius) - rim.amounts

    def _cost(self, pose: AxisPose, told: Sequence[FloatArray]) -> float:
        cost = self._height_information * (pose.height - self.height) ** 2
        for number, information in enumerate(told):
            away = self._away(pose, number)
            cost += float(away @ information @ away)
        return cost if np.isfinite(cost) else np.inf

    def _equations(
        self, pose: AxisPose, told: Sequence[FloatArray], size: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the matrix and the right side of the normal equations, in the units of `size`."""
        matrix, gradient = np.zeros((6, 6)), np.zeros(6)
        matrix[5, 5] = self._height_information
        gradient[5] = self._height_information * (pose.height - self.height)
        for number, (rim, information) in enumerate(zip(self.rims, told, strict=True)):
            own = pose_derivatives(rim.factor, *pose.circle(number), rim.radius)[:, :5]
            slopes = own @ pose.circle_derivatives(number)
            matrix += slopes.T @ information @ slopes
            gradient += slopes.T @ information @ self._away(pose, number)
        free = len(size)
        return matrix[:free, :free] * np.outer(size, size), gradient[:free] * size


def are_one(first: JointPose, second: JointPose) -> bool:
    """Tell whether two starts led to one optimum."""
    apart = first.pose.offset(0, second.pose)
    return bool(apart @ np.linalg.solve(first.covariance_of(0), apart) < _SAME_SIGMAS**2)


def chance_of_second(first: float, second: float) -> float:
    """Return the probability of the second of two hypotheses, of which the log weights are given."""
    return float(logistic(second - first))


def _moved(pose: AxisPose, step: FloatArray) -> AxisPose:
    first, second = plane_basis(pose.normal)
    normal = pose.normal + step[3] * first + step[4] * second
    height = pose.height + (step[5] if len(step) > 5 else 0.0)
    return AxisPose(pose.center + step[:3], normal / np.linalg.norm(normal), float(height))
