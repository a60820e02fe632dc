"""One pose for all circles of a ring target, from all their rims together. Pure NumPy.

Each rim gives the coefficients of its cone's modes, with an information matrix (`rings.evidence`). The pose of all
circles (center and two tilts; of coaxial circles also the height between their planes) minimizes the sum of squared
misfits, by damped Gauss-Newton.

Radii and heights are not known exactly, nor are rings exactly concentric. The largest circle is the yardstick: the
radii and places of the others have a tolerance relative to it, which is a part of the covariance of their rims. Where
the misfit is larger than all this explains, the covariance is inflated by as much. The two candidates of a target are
compared by Student's t, whose tails allow for errors that are larger than estimated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from circlepose._numerics import STUDENT_FREEDOM, logistic, student_log_likelihood
from circlepose._typing import FloatArray
from circlepose.geometry.cone import plane_basis
from circlepose.geometry.cone_perturbation import MODES, pose_coefficients, pose_derivatives
from circlepose.results import Failure, Status
from circlepose.rings.evidence import RimEvidence
from circlepose.rings.options import DEFAULT, RingOptions

_STEPS = 40
_LEAST_GAIN = 1e-3
"""Chi-square; a step that would gain less is the last; numerical."""
_WORST_CONDITION = 1e14
"""Condition number of an information matrix, above which its inverse has no digits; numerical."""
_MOST_DAMPING = 1e8
_LONGEST_STEP = 0.2
"""Longest step: of the center in shares of the distance, of the normal in rad; numerical."""


@dataclass(frozen=True, slots=True, eq=False)
class AxisPose:
    """Pose of a target's circles: that of the largest, and the height of the others in front of it."""

    center: FloatArray
    """(3,)"""
    normal: FloatArray
    """(3,) unit, towards the camera"""
    height: float = 0.0
    """along the normal"""

    def circle(self, number: int) -> tuple[FloatArray, FloatArray]:
        """Return center and normal of the largest circle, number 0, or another."""
        return (self.center if number == 0 else self.center + self.height * self.normal), self.normal

    def offset(self, number: int, other: AxisPose) -> FloatArray:
        """Return center (3) and tilts (2) from a circle's pose to that in `other`, which is close."""
        (center, normal), (other_center, other_normal) = self.circle(number), other.circle(number)
        return np.concatenate([other_center - center, np.stack(plane_basis(normal)) @ other_normal])

    def circle_derivatives(self, number: int) -> FloatArray:
        """Return d circle's pose (center, two tilts) / d center, tilts and height: (5, 6)."""
        derivatives = np.eye(5, 6)
        if number > 0:
            first, second = plane_basis(self.normal)
            derivatives[:3, 3:] = np.stack([self.height * first, self.height * second, self.normal], axis=-1)
        return derivatives


@dataclass(frozen=True, slots=True, eq=False)
class JointPose:
    """A pose of all circles, as a rule a local minimum of the misfit."""

    pose: AxisPose
    misfit: float
    """chi-square"""
    freedom: int
    """its degrees of freedom, if the errors are as estimated"""
    covariance: FloatArray
    """(6, 6) of the largest circle's center, two tilts and the height, if the errors are as estimated"""

    @property
    def excess(self) -> float:
        """The ratio, at least 1, by which the misfit inflates variances."""
        return max(1.0, (STUDENT_FREEDOM + self.misfit) / (STUDENT_FREEDOM + self.freedom))

    def covariance_of(self, number: int) -> FloatArray:
        """Return the covariance (5, 5) of a circle's center and two tilts, basis `cone.plane_basis(normal)`."""
        derivatives = self.pose.circle_derivatives(number)
        return np.asarray(self.excess * (derivatives @ self.covariance @ derivatives.T))

    @property
    def height_sigma(self) -> float:
        """Standard deviation of the height; 0 where it is fixed."""
        return float(np.sqrt(self.excess * self.covariance[5, 5]))

    @property
    def log_weight(self) -> float:
        """Logarithm of the probability of all poses around this one, up to a constant."""
        free = self.covariance[:5, :5] if self.covariance[5, 5] == 0.0 else self.covariance
        return float(student_log_likelihood(self.misfit, self.freedom) + 0.5 * np.linalg.slogdet(free)[1])


@dataclass(frozen=True, slots=True, eq=False)
class RingProblem:
    """The rims of a target's circles, the largest first, and what is known of the height between their planes."""

    rims: tuple[RimEvidence, ...]
    height: float = 0.0
    """that is known or assumed"""
    height_sigma: float = 0.0
    """its standard deviation: 0 where it is fixed, infinite where nothing is known"""
    options: RingOptions = DEFAULT

    def solve(self, start: AxisPose) -> JointPose | Failure:
        """Return the local minimum of the misfit near `start`; fails where the camera could not see it."""
        informations = self._with_tolerances(start)
        size = self._size(start)
        pose, cost, damping = start, self._cost(start, informations), 1e-4
        for _ in range(_STEPS):
            matrix, gradient = self._equations(pose, informations, size)
            if not 0.0 < np.trace(matrix) < np.inf:
                return Failure(Status.NO_POSE, "the rims do not determine a joint pose")
            ridge = 1e-14 * np.trace(matrix) * np.eye(len(size))
            gain = float(gradient @ np.linalg.solve(matrix + ridge, gradient))
            while damping < _MOST_DAMPING:
                step = -np.linalg.solve(matrix + ridge + damping * np.diag(np.diag(matrix)), gradient)
                step = step * min(1.0, _LONGEST_STEP / max(float(np.max(np.abs(step[:5]))), 1e-300))
                trial = _moved(pose, step * size)
                trial_cost = self._cost(trial, informations)
                if trial_cost <= cost:
                    break
                damping = max(damping * 10.0, 1e-6)
            else:
                break
            pose, cost, damping = trial, trial_cost, damping * 0.1
            # However short the damping made this step, the whole one would not gain more.
            if gain < _LEAST_GAIN:
                break
        return self.at(pose)

    def at(self, pose: AxisPose) -> JointPose | Failure:
        """Return the misfit at `pose` and its covariance, were it a minimum; fails where it is not determined."""
        if not pose.center[2] > 0.0 or pose.center @ pose.normal >= 0.0:
            return Failure(Status.NO_POSE, "the joint pose is behind the camera, or faces away from it")
        informations = self._with_tolerances(pose)
        size = self._size(pose)
        matrix, _ = self._equations(pose, informations, size)
        if not np.all(np.isfinite(matrix)) or np.linalg.cond(matrix) > _WORST_CONDITION:
            return Failure(Status.NO_POSE, "the rims do not determine a joint pose")
        free = len(size)
        covariance = np.zeros((6, 6))
        covariance[:free, :free] = np.linalg.inv(matrix) * np.outer(size, size)
        freedom = MODES * len(self.rims) - free + (1 if self._height_information > 0.0 else 0)
        return JointPose(pose, self._cost(pose, informations), freedom, covariance)

    def rim_covariance(self, number: int, pose: AxisPose) -> FloatArray | Failure:
        """Return the covariance (5, 5) of a rim's modes at `pose`, with the tolerances of its circle and its height.

        It fails where a part of the rim does not determine some of them.
        """
        information = self._with_tolerances(pose)[number]
        if np.linalg.cond(information) > _WORST_CONDITION:
            return Failure(Status.NO_POSE, "too little of a rim is seen")
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
        informations = [self.rims[0].information]
        place_sigma = self.options.place_share * self.rims[0].radius
        for rim in self.rims[1:]:
            slopes = pose_derivatives(rim.factor, *pose.circle(1), rim.radius)[:, [0, 1, 2, 5]]
            slopes = slopes * np.array([place_sigma] * 3 + [self.options.radius_share * rim.radius])
            informed = rim.information @ slopes
            less = informed @ np.linalg.solve(np.eye(4) + slopes.T @ informed, informed.T)
            informations.append(np.asarray(rim.information - less))
        return informations

    def _away(self, pose: AxisPose, number: int) -> FloatArray:
        rim = self.rims[number]
        return pose_coefficients(rim.factor, *pose.circle(number), rim.radius) - rim.coefficients

    def _cost(self, pose: AxisPose, informations: Sequence[FloatArray]) -> float:
        cost = self._height_information * (pose.height - self.height) ** 2
        for number, information in enumerate(informations):
            away = self._away(pose, number)
            cost += float(away @ information @ away)
        return cost if np.isfinite(cost) else np.inf

    def _equations(
        self, pose: AxisPose, informations: Sequence[FloatArray], size: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the matrix and the right side of the normal equations, in the units of `size`."""
        matrix, gradient = np.zeros((6, 6)), np.zeros(6)
        matrix[5, 5] = self._height_information
        gradient[5] = self._height_information * (pose.height - self.height)
        for number, (rim, information) in enumerate(zip(self.rims, informations, strict=True)):
            own = pose_derivatives(rim.factor, *pose.circle(number), rim.radius)[:, :5]
            slopes = own @ pose.circle_derivatives(number)
            matrix += slopes.T @ information @ slopes
            gradient += slopes.T @ information @ self._away(pose, number)
        free = len(size)
        return matrix[:free, :free] * np.outer(size, size), gradient[:free] * size


def are_one(first: JointPose, second: JointPose, *, options: RingOptions = DEFAULT) -> bool:
    """Whether two starts led to one minimum."""
    apart = first.pose.offset(0, second.pose)
    return bool(apart @ np.linalg.solve(first.covariance_of(0), apart) < options.same_sigmas**2)


def chance_of_second(first: float, second: float) -> float:
    """Return the probability of the second of two hypotheses, from the log weights of both."""
    return float(logistic(second - first))


def _moved(pose: AxisPose, step: FloatArray) -> AxisPose:
    first, second = plane_basis(pose.normal)
    normal = pose.normal + step[3] * first + step[4] * second
    height = pose.height + (step[5] if len(step) > 5 else 0.0)
    return AxisPose(pose.center + step[:3], normal / np.linalg.norm(normal), float(height))
