"""The candidate poses of a ring target, each fitted to all of its rims together, and which of them is right."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from circlepose._typing import FloatArray
from circlepose.geometry.cone import ConeKind
from circlepose.results import Failure, Status
from circlepose.rings.evidence import RimEvidence, evidence_of_rims
from circlepose.rings.flatness import free_heights, is_stepped, log_flatness
from circlepose.rings.hypotheses import least_misfit, other_heights
from circlepose.rings.joint_pose import AxisPose, JointPose, RingProblem, are_one, chance_of_second
from circlepose.rings.matching import RingMatch
from circlepose.rings.options import DEFAULT, RingOptions
from circlepose.solvers.chen_huang import poses_from_frame
from circlepose.targets.target import Target

_FLATTEST = 1e-9
"""Relative determinant of a cone's factor, below which its circle is seen edge-on; numerical."""


@dataclass(frozen=True, slots=True, eq=False)
class TargetPoses:
    """The poses of a target that its rims allow, the likelier first."""

    poses: tuple[AxisPose, ...]
    """one or two; mm, camera frame"""
    covariances: tuple[tuple[FloatArray, ...] | None, ...]
    """of each pose, for each circle (5, 5); None where it is not known"""
    tilts: tuple[FloatArray, ...]
    """(2, 2) of each pose, the covariance of the normal's tilts, also where the other is not known"""
    ambiguity: float
    """probability that the first is wrong"""
    rims: tuple[RimEvidence, ...]
    """what was fitted, the largest circle's first"""
    heights: tuple[tuple[float, float], ...]
    """of each pose, the height (mm) of the other circles in front of the largest and its standard deviation; of
    coplanar circles as measured without the assumption that they are flat"""
    excess: float = 1.0
    """the ratio by which the misfit of the first pose, with a free height, inflates variances"""
    not_flat: bool = False
    """the circles of a coplanar target are not in one plane, with the first pose"""


@dataclass(frozen=True, slots=True, eq=False)
class _Hypothesis:
    """A pose with its log weight; of coplanar circles also the pose with a free height, where there is one."""

    joint: JointPose
    log_weight: float
    free: JointPose | None = None
    is_stepped: bool = False

    @property
    def freest(self) -> JointPose:
        return self.joint if self.free is None else self.free


def target_poses(
    match: RingMatch, target: Target, *, placed: bool = True, options: RingOptions = DEFAULT
) -> TargetPoses | Failure:
    """Fit one pose to all rims of a target, from each candidate of its largest circle.

    Parameters
    ----------
    match
        The rims of the target.
    target
        The ring target.
    placed
        Whether edges were located along the rims. The common error of a contour's own points is not known, so there
        is no covariance.
    options
        The numbers of ring targets.

    Returns
    -------
    One pose where the largest circle's cone is right, else one or two; mm, camera frame. It fails where a rim is seen
    edge-on, or no pose agrees with the rims. Source: least squares over the modes of all cones, `rings.joint_pose`.
    """
    if any(_is_flat(each.rim.cone.factor) for each in match.rims):
        return Failure(Status.NO_POSE, "a circle of the target is seen edge-on")
    evidence = evidence_of_rims(match.rims, target, options)
    starts = _starts(match, target, options)
    problems = [RingProblem(evidence, start.height, _height_sigma(target, options), options) for start in starts]
    found = _minima(problems, starts, options)
    if target.kind == "coplanar":
        hypotheses = _hypotheses_of_coplanar(evidence, starts, found, target.flatness_mm, options)
    else:
        hypotheses = [_Hypothesis(joint, joint.log_weight) for joint in found if isinstance(joint, JointPose)]
    if not hypotheses:
        return Failure(Status.NO_POSE, "no pose agrees with all circles of the target")
    return _ranked(hypotheses, evidence, placed, match.solutions.cone)


def _starts(match: RingMatch, target: Target, options: RingOptions) -> list[AxisPose]:
    """Return both candidate poses of the largest circle, by its measured cone, with the height of the others."""
    largest = match.rims[0]
    are_known = not largest.is_settled and len(match.solutions.centers) == 2
    centers, normals = match.solutions.centers, match.solutions.normals
    if not are_known:
        centers, normals = poses_from_frame(largest.frame, target.radii_mm[0])
    if target.kind == "coplanar":
        heights = [0.0, 0.0]
    elif not are_known:
        seen = match.rims[1].seen
        heights = [
            least_misfit(center, normal, 1, seen, target, options).height_mm
            for center, normal in zip(centers, normals, strict=True)
        ]
    else:
        heights = match.heights_mm[0].tolist()
    return [AxisPose(*pose) for pose in zip(centers, normals, heights, strict=True)]


def _minima(
    problems: Sequence[RingProblem], starts: Sequence[AxisPose], options: RingOptions
) -> list[JointPose | Failure]:
    """Return the joint pose of each of two candidates."""
    solved = [problem.solve(start) for problem, start in zip(problems, starts, strict=True)]
    first, second = solved
    if isinstance(first, JointPose) and isinstance(second, JointPose) and are_one(first, second, options=options):
        # All rims together leave one minimum; the other candidate is then the largest circle's own.
        other = int(np.argmin([start.normal @ first.pose.normal for start in starts]))
        solved[other] = Failure(Status.NO_POSE, "both candidates lead to one joint pose")
    return [
        each if isinstance(each, JointPose) else problem.at(start)
        for each, problem, start in zip(solved, problems, starts, strict=True)
    ]


def _hypotheses_of_coplanar(
    rims: tuple[RimEvidence, ...],
    starts: Sequence[AxisPose],
    tolerant: Sequence[JointPose | Failure],
    flatness_mm: float,
    options: RingOptions,
) -> list[_Hypothesis]:
    """Return the hypotheses of a coplanar target from its candidates' `starts` and fits `tolerant` of its flatness.

    Fits with a free height compete, each weighted by how flat it is; where they are not two, near the axis, the
    tolerant ones do. A candidate under which the target has a step is fitted flat: it stands for a flat target.
    """
    free = [_pose_or_none(each) for each in free_heights(rims, starts, options)]
    known = [each for each in free if each is not None]
    are_two = len(known) == len(free) and not are_one(known[0], known[1], options=options)
    stepped = [each is not None and is_stepped(each, flatness_mm, options) for each in free]
    flat = _minima([RingProblem(rims, options=options)] * 2, starts, options) if any(stepped) else tolerant
    hypotheses = []
    for usual, unconstrained, has_step, exact in zip(tolerant, free, stepped, flat, strict=True):
        joint = (_pose_or_none(exact) if has_step else None) or _pose_or_none(usual) or unconstrained
        if joint is None:
            continue
        weight = joint.log_weight
        if are_two and unconstrained is not None:
            weight = unconstrained.log_weight + log_flatness(unconstrained, flatness_mm, options)
        hypotheses.append(_Hypothesis(joint, weight, unconstrained, has_step))
    return hypotheses


def _pose_or_none(found: JointPose | Failure) -> JointPose | None:
    return found if isinstance(found, JointPose) else None


def _ranked(found: Sequence[_Hypothesis], rims: tuple[RimEvidence, ...], placed: bool, cone: str) -> TargetPoses:
    """Return the hypotheses as poses, the likelier first; of a right `cone` one."""
    found = sorted(found, key=lambda hypothesis: -hypothesis.log_weight)
    not_flat = found[0].is_stepped
    joints = [hypothesis.freest if not_flat else hypothesis.joint for hypothesis in found]
    chance = 0.0 if len(found) == 1 else chance_of_second(found[0].log_weight, found[1].log_weight)
    numbers = range(len(rims))
    covariances = [[joint.covariance_of(i) for i in numbers] for joint in joints]
    if cone == ConeKind.RIGHT and len(joints) == 2:
        # One pose is reported. That it may be the other one, close by, is a part of its error.
        offsets = [joints[0].pose.offset(i, joints[1].pose) for i in numbers]
        covariances[0] = [own + chance * np.outer(o, o) for own, o in zip(covariances[0], offsets, strict=True)]
        joints, chance = joints[:1], 0.0
    return TargetPoses(
        poses=tuple(joint.pose for joint in joints),
        covariances=tuple(tuple(each) if placed else None for each in covariances[: len(joints)]),
        tilts=tuple(each[0][3:, 3:] for each in covariances[: len(joints)]),
        ambiguity=chance,
        rims=rims,
        heights=tuple((h.freest.pose.height, h.freest.height_sigma) for h in found[: len(joints)]),
        excess=found[0].freest.excess,
        not_flat=not_flat,
    )


def _height_sigma(target: Target, options: RingOptions) -> float:
    """Return the standard deviation of the height, mm; infinite where nothing is known."""
    if target.kind == "coplanar":
        return target.flatness_mm
    heights = other_heights(1, target)
    return np.inf if heights is None else options.radius_share * max(float(heights[0]), target.radii_mm[0])


def _is_flat(factor: FloatArray) -> bool:
    columns = factor / np.linalg.norm(factor, axis=0)
    return abs(float(np.linalg.det(columns))) < _FLATTEST
