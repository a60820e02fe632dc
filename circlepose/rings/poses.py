"""The candidate poses of a ring target, each of all its rims together, and which is right."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from circlepose._typing import FloatArray
from circlepose.camera.camera import Camera
from circlepose.fitting.cone_fit import SeenPoints
from circlepose.geometry.cone import ConeKind, principal_frame
from circlepose.geometry.cone_perturbation import MODES
from circlepose.geometry.conic import signed_distance
from circlepose.measurement.rim import Rim, modes_covariance
from circlepose.rings.flatness import free_heights, is_stepped, log_flatness
from circlepose.rings.joint_pose import (
    RADIUS_SHARE,
    AxisPose,
    JointPose,
    RimEvidence,
    RingProblem,
    are_one,
    chance_of_second,
    from_edges,
    from_levels,
)
from circlepose.rings.matching import least_misfit, other_heights
from circlepose.solvers.chen_huang import poses_from_frame
from circlepose.targets.target import Target

_PLACES = 90
_LEAST_SCATTER_PX = 0.02
_EDGES_PX2 = 10.0
"""Edges are off all together, by blur, the curvature of the rim and its neighbours: by this over the squared
semi-minor axis, in rendered views."""
_MOST_COMMON_PX = 0.5
_CONTRADICTED = 0.5
"""Mean squared standard errors, of edges, by which these contradict a fit to the levels."""
_BESIDE_PX = 6.0
_BESIDE_EDGES = 2.0
_BESIDE_LEVELS_PX = 0.02
_BESIDE_APART_PX = 0.08
"""Where coaxial rims come so close, or one hides part of the other: edges are off by so much more all together, each
mode of a fit to levels by that much, and such a fit is contradicted by edges that far away."""
_FLATTEST = 1e-9
"""Relative determinant of a cone's factor below which its circle is seen edge-on."""


@dataclass(frozen=True, slots=True, eq=False)
class TargetPoses:
    """The poses of a target that its rims allow, the likelier first."""

    poses: tuple[AxisPose, ...]
    """one or two"""
    covariances: tuple[tuple[FloatArray, ...] | None, ...]
    """of each pose, for each circle (5, 5); None where none can be vouched for"""
    tilts: tuple[FloatArray, ...]
    """(2, 2) of each pose, the covariance of the normal's tilts, also where none can be vouched for"""
    ambiguity: float
    """probability that the first is wrong"""
    rims: tuple[RimEvidence, ...]
    """what was fitted, the largest circle's first"""
    heights: tuple[tuple[float, float], ...]
    """of each pose, how far the other circles are in front of the largest, and its standard deviation; of coplanar
    circles with nothing known of it"""
    excess: float = 1.0
    """by how much the misfit of the first pose makes variances larger than told, with a free height"""
    not_flat: bool = False
    """the circles of a coplanar target are not in one plane, with the first pose"""


class _Hypothesis(NamedTuple):
    """A pose with its log weight; of coplanar circles also the pose with a free height, where there is one."""

    joint: JointPose
    log_weight: float
    free: JointPose | None = None
    is_stepped: bool = False

    @property
    def freest(self) -> JointPose:
        return self.joint if self.free is None else self.free


def target_poses(
    rims: Sequence[Rim], camera: Camera, target: Target, cone: str, *, placed: bool = True
) -> TargetPoses | None:
    """Return the poses of the target whose circles have these `rims`, the largest first.

    `cone` is the kind of the largest circle's; of a right one a single pose comes back. `placed` tells whether edges
    were placed along the rims: of a contour's own points nobody knows how far they are off in common, and there is
    no covariance. None where a rim is seen edge-on, or no pose agrees with them.
    """
    if any(_is_flat(rim.cone.factor) for rim in rims):
        return None
    seen = [_within_model(SeenPoints.of(camera, rim.points)) for rim in rims]
    beside = target.kind == "coaxial" and _gap_px(rims[0], rims[1]) < _BESIDE_PX
    evidence = tuple(
        _evidence(rim, radius, points, beside=beside)
        for rim, radius, points in zip(rims, target.radii_mm, seen, strict=True)
    )
    centers, normals = poses_from_frame(principal_frame(rims[0].cone.factor), target.radii_mm[0])
    starts, problems = [], []
    for center, normal in zip(centers, normals, strict=True):
        height = 0.0 if target.kind == "coplanar" else least_misfit(center, normal, 1, seen[1], target)[1]
        starts.append(AxisPose(center, normal, height))
        problems.append(RingProblem(evidence, height, _height_sigma(target)))
    found = _optima(problems, starts)
    if target.kind == "coplanar":
        hypotheses = _hypotheses_of_coplanar(evidence, starts, found, target.flatness_mm)
    else:
        hypotheses = [_Hypothesis(joint, joint.log_weight) for joint in found if joint is not None]
    return _ranked(hypotheses, evidence, placed, cone)


def _optima(problems: Sequence[RingProblem], starts: Sequence[AxisPose]) -> list[JointPose | None]:
    """Return the optimum of each of two candidates; None of one with which no pose agrees."""
    solved = [problem.solve(start) for problem, start in zip(problems, starts, strict=True)]
    first, second = solved
    if first is not None and second is not None and are_one(first, second):
        # All rims together leave one optimum; the other candidate is then the largest circle's own.
        other = int(np.argmin([start.normal @ first.pose.normal for start in starts]))
        solved[other] = None
    return [
        problem.at(start) if each is None else each
        for each, problem, start in zip(solved, problems, starts, strict=True)
    ]


def _hypotheses_of_coplanar(
    rims: tuple[RimEvidence, ...], starts: list[AxisPose], tolerant: Sequence[JointPose | None], flatness_mm: float
) -> list[_Hypothesis]:
    """Return the hypotheses of a coplanar target from its candidates' `starts` and fits `tolerant` of its flatness.

    Fits with a free height compete, each weighted by how flat it is; where they are not two, near the axis, the
    tolerant ones do. A candidate under which the target has a step is fitted flat: it stands for a flat target.
    """
    free = free_heights(rims, starts)
    are_two = None not in free and not are_one(*(each for each in free if each is not None))
    stepped = [known is not None and is_stepped(known, flatness_mm) for known in free]
    flat = _optima([RingProblem(rims)] * 2, starts) if any(stepped) else tolerant
    hypotheses = []
    for usual, known, has_step, exact in zip(tolerant, free, stepped, flat, strict=True):
        joint = (exact if has_step else usual) or usual or known
        if joint is None:
            continue
        weight = joint.log_weight
        if are_two and known is not None:
            weight = known.log_weight + log_flatness(known, flatness_mm)
        hypotheses.append(_Hypothesis(joint, weight, known, has_step))
    return hypotheses


def _ranked(found: list[_Hypothesis], rims: tuple[RimEvidence, ...], placed: bool, cone: str) -> TargetPoses | None:
    if not found:
        return None
    found = sorted(found, key=lambda hypothesis: -hypothesis.log_weight)
    not_flat = found[0].is_stepped
    joints = [hypothesis.freest if not_flat else hypothesis.joint for hypothesis in found]
    chance = 0.0 if len(found) == 1 else chance_of_second(found[0].log_weight, found[1].log_weight)
    numbers = range(len(rims))
    covariances = [[joint.covariance_of(i) for i in numbers] for joint in joints]
    if cone == ConeKind.RIGHT and len(joints) == 2:
        # One pose is told; that it may be the other, close by, is a part of its error.
        offsets = [joints[0].pose.offset(i, joints[1].pose) for i in numbers]
        covariances[0] = [told + chance * np.outer(o, o) for told, o in zip(covariances[0], offsets, strict=True)]
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


def _evidence(rim: Rim, radius: float, seen: SeenPoints, *, beside: bool) -> RimEvidence:
    """Return what a rim tells: its levels, unless its edges contradict them, or else the edges.

    `beside`: one circle hides part of another, or nearly does, so that the surroundings change along the rim.
    """
    semi_major, semi_minor = float(rim.ellipse.semi_major), float(rim.ellipse.semi_minor)
    common = min(_EDGES_PX2 / semi_minor**2, _MOST_COMMON_PX) * (_BESIDE_EDGES if beside else 1.0)
    scatter = max(rim.cone.rms_px, _LEAST_SCATTER_PX)
    edges = from_edges(rim.cone.factor, radius, seen.rays, seen.jacobians, scatter, common)
    modes = modes_covariance(rim)
    if modes is None or not np.all(np.linalg.eigvalsh(modes) > 0.0):
        return edges
    apart = edges.amounts
    if beside:
        is_contradicted = float(np.linalg.norm(apart)) * semi_major > _BESIDE_APART_PX
        uneven = (_BESIDE_LEVELS_PX / semi_major) ** 2 * np.eye(MODES)
    else:
        is_contradicted = bool(apart @ edges.information @ apart > _CONTRADICTED * MODES)
        uneven = np.zeros((MODES, MODES))
    return edges if is_contradicted else from_levels(rim.cone.factor, radius, modes + uneven)


def _within_model(seen: SeenPoints) -> SeenPoints:
    return seen[np.all(np.isfinite(seen.rays), axis=-1)]


def _gap_px(first: Rim, second: Rim) -> float:
    """Return the least distance, px, between two rims in the image."""
    return float(np.min(np.abs(signed_distance(first.ellipse, second.ellipse.points(_PLACES)))))


def _height_sigma(target: Target) -> float:
    if target.kind == "coplanar":
        return target.flatness_mm
    heights = other_heights(1, target)
    return np.inf if heights is None else RADIUS_SHARE * max(float(heights[0]), target.radii_mm[0])


def _is_flat(factor: FloatArray) -> bool:
    columns = factor / np.linalg.norm(factor, axis=0)
    return abs(float(np.linalg.det(columns))) < _FLATTEST
