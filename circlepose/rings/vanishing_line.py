"""Fu & Zhou's cue for coplanar circles: the normal from the vanishing line (eq. 7 and 10). Pure NumPy.

It rests on the imaged center, which no single circle shows, and is independent of the joint fit. It is compared with
the normals of the candidates: it may settle the choice between them alone, or contradict the chosen one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from circlepose._numerics import logistic
from circlepose._typing import FloatArray
from circlepose.geometry.cone import plane_basis
from circlepose.geometry.cone_perturbation import grown
from circlepose.results import Failure, Status
from circlepose.rings.evidence import RimEvidence
from circlepose.rings.joint_pose import AxisPose, RingProblem
from circlepose.rings.options import DEFAULT, RingOptions
from circlepose.rings.poses import TargetPoses
from circlepose.solvers.fu_zhou_coplanar import log_odds, pose_with_covariance

_NO_LINE = Failure(
    Status.NO_POSE, "the rims are not those of concentric circles in one plane, so there is no vanishing line"
)


@dataclass(frozen=True, slots=True, eq=False)
class VanishingPose:
    """The one pose of two coplanar circles by eq. 7 to 10."""

    center: FloatArray
    """(3,) mm, camera frame"""
    normal: FloatArray
    """(3,) unit, towards the camera"""
    covariance: FloatArray
    """(5, 5) of the center and two tilts towards the vectors of `cone.plane_basis(normal)`"""

    @property
    def sigma_rad(self) -> float:
        """Root of the sum of both tilts' variances."""
        return float(np.sqrt(np.trace(self.covariance[3:, 3:])))

    def chi_square(self, normal: FloatArray, tilts: FloatArray) -> float:
        """Return the squared distance of a normal in standard errors: chi-square of two degrees of freedom.

        Parameters
        ----------
        normal
            (3,) unit vector, camera frame.
        tilts
            (2, 2) covariance, rad^2, of its tilts towards the vectors of `cone.plane_basis(normal)`.
        """
        basis = np.stack(plane_basis(self.normal))
        away = basis @ normal
        if normal @ self.normal <= 0.0:
            away = away / max(float(np.linalg.norm(away)), np.finfo(np.float64).tiny)
        turn = basis @ np.stack(plane_basis(normal), axis=-1)
        spread = self.covariance[3:, 3:] + turn @ tilts @ turn.T
        return float(away @ np.linalg.solve(spread, away))


@dataclass(frozen=True, slots=True, eq=False)
class VanishingCheck:
    """The candidate poses of a coplanar target by its vanishing line, the chosen one first."""

    pose: VanishingPose
    chi_squares: tuple[float, ...]
    """of the candidates' normals"""
    nearest: FloatArray
    """(3,) the candidate's normal with the least chi-square"""
    chance_of_second: float
    """probability that the second candidate is right, by the vanishing line of a flat target alone"""
    disagrees: bool
    """whether the chosen candidate is contradicted"""
    settles: bool
    """whether the vanishing line alone settles that the first candidate is right"""


def vanishing_check(
    poses: TargetPoses | Failure, flatness_mm: float, *, options: RingOptions = DEFAULT
) -> VanishingCheck | Failure:
    """Compare the joint poses of a coplanar target with its vanishing line.

    Parameters
    ----------
    poses
        The joint poses, or why there are none.
    flatness_mm
        Standard deviation of the height of the inner circles over the plane, mm.
    options
        The numbers of ring targets.

    Returns
    -------
    The comparison. It fails where there are no joint poses, or the rims have no vanishing line. Source: Fu & Zhou
    (2019), eq. 7 and 10.
    """
    if isinstance(poses, Failure):
        return poses
    pose = vanishing_pose(poses.rims, flatness_mm, poses.excess, options=options)
    if isinstance(pose, Failure):
        return pose
    normals = np.stack([each.normal for each in poses.poses])
    chi_squares = tuple(pose.chi_square(normal, tilts) for normal, tilts in zip(normals, poses.tilts, strict=True))
    are_two = len(normals) == 2
    chance = 0.0
    if are_two:
        sigma = float(np.sqrt(np.mean([np.trace(tilts) / 2.0 for tilts in poses.tilts])))
        chance = float(logistic(-log_odds(normals, sigma, pose.normal, pose.covariance[3:, 3:])))
    disagrees = chi_squares[0] > options.contradicted_cue
    settles = not disagrees and are_two and chance < options.alone_ambiguity
    return VanishingCheck(pose, chi_squares, normals[int(np.argmin(chi_squares))], chance, disagrees, settles)


def vanishing_pose(
    rims: Sequence[RimEvidence], flatness_mm: float, excess: float = 1.0, *, options: RingOptions = DEFAULT
) -> VanishingPose | Failure:
    """Return the pose by the vanishing line of the largest and the smallest of coplanar circles.

    Parameters
    ----------
    rims
        The rims' evidence, the largest circle's first.
    flatness_mm
        Standard deviation of the height of the smallest circle over the plane, mm.
    excess
        Ratio by which the covariances of the rims are inflated.
    options
        The numbers of ring targets.

    Returns
    -------
    The pose, mm, camera frame. It fails where the rims are not those of concentric circles, or too little of one is
    seen. Source: Fu & Zhou (2019), eq. 7 to 10.
    """
    problem = RingProblem((rims[0], rims[-1]), 0.0, flatness_mm, options)
    factors = np.stack([grown(rim.factor, rim.coefficients) for rim in problem.rims])
    center, normal, _ = pose_with_covariance(factors, np.zeros((2, 5, 5)), rims[0].radius)
    if not (np.all(np.isfinite(center)) and np.all(np.isfinite(normal))):
        return _NO_LINE
    covariances = []
    for number in range(2):
        own = problem.rim_covariance(number, AxisPose(center, normal))
        if isinstance(own, Failure):
            return own
        covariances.append(own)
    *_, covariance = pose_with_covariance(factors, excess * np.stack(covariances), rims[0].radius)
    if not np.all(np.isfinite(covariance)) or np.linalg.eigvalsh(covariance[3:, 3:])[0] <= 0.0:
        return _NO_LINE
    return VanishingPose(center, normal, covariance)
