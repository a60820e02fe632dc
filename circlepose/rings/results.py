"""Ring targets: the results of the rims that belong together, with the candidate that all of them agree on."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from circlepose._typing import FloatArray
from circlepose.camera.camera import Camera
from circlepose.detection.contour import WANTED_SIGN, Rejection
from circlepose.fitting.cone_fit import SeenPoints
from circlepose.geometry.cone import ConeKind
from circlepose.measurement.poses import circle_results, compared
from circlepose.measurement.rim import Rim
from circlepose.results import Candidate, CircleResult, Flag, SettledBy
from circlepose.rings.cues import (
    UNTOLD,
    VanishingCheck,
    checked_by_vanishing_line,
    is_settled_by_generatrix,
    partner_of,
    settled,
    vanishing_check,
    with_generatrix,
)
from circlepose.rings.fu_zhou_route import NEEDS_RINGS, by_generatrix, by_vanishing_line, without_pose
from circlepose.rings.matching import Family, as_circle, find_families
from circlepose.rings.poses import TargetPoses, target_poses
from circlepose.rings.reprojection import ambiguity
from circlepose.solvers import CIRCLE_METHODS, FU_ZHOU
from circlepose.targets.target import Target

_STRAINED_SHARE = 0.02
"""Rims that are off their places by more than this share of their semi-major axis, or _STRAINED_PX, are told."""
_STRAINED_PX = 1.0


def find_ring_targets(
    rims: Sequence[Rim],
    camera: Camera,
    target: Target,
    methods: tuple[str, ...],
    rejected: Counter[Rejection],
    *,
    placed: bool = True,
) -> list[CircleResult]:
    """Return the results of all circles of up to `target.count` ring targets among `rims`, best agreement first.

    The first rim's candidates are solved with the largest radius; each predicts where the other circles must be
    seen, and is then fitted to all rims together (`ring_poses`), where it is one method's poses that are asked for.
    Without a complete target the most evident rim is reported alone, as the largest circle that what is known of the
    target allows, flagged `lone_circle`. `placed` tells whether edges were placed along the rims.
    """
    families = find_families(rims, camera, target)
    used = sum(len(family.members) for family in families)
    rejected[Rejection.NOT_IN_TARGET] += len(rims) - used
    results = [
        result
        for instance, family in enumerate(families)
        for result in _target_results(family, rims, camera, target, methods, instance, placed)
    ]
    return results or _lone_circle(rims, camera, target, methods)


def _lone_circle(rims: Sequence[Rim], camera: Camera, target: Target, methods: tuple[str, ...]) -> list[CircleResult]:
    """Return the results of the most evident rim that can be a circle of `target`, as the largest that it can be."""
    own = _own_methods(methods)
    for rim in rims:
        seen = SeenPoints.of(camera, rim.points)
        for which, (radius, name) in enumerate(zip(target.radii_mm, target.circle_names, strict=True)):
            # The polarity is the largest circle's; of the others it is not known.
            if which == 0 and WANTED_SIGN[target.polarity] * rim.polarity < 0:
                continue
            solutions = as_circle(rim, seen, target, which)
            if solutions is not None:
                lone = circle_results(rim, camera, own, radius, 0, name, chen_huang=solutions)
                if methods == (FU_ZHOU,):
                    lone = [without_pose(result, NEEDS_RINGS) for result in lone]
                return [replace(result, flags=(*result.flags, Flag.LONE_CIRCLE)) for result in lone]
    return []


def _own_methods(methods: tuple[str, ...]) -> tuple[str, ...]:
    """Return the methods that solve each circle by its own rim; the first of all where none is asked for."""
    return tuple(method for method in methods if method != FU_ZHOU) or (CIRCLE_METHODS[0],)


def _target_results(
    family: Family,
    rims: Sequence[Rim],
    camera: Camera,
    target: Target,
    methods: tuple[str, ...],
    instance: int,
    placed: bool,
) -> list[CircleResult]:
    """Results of one target's circles: by one pose of them all, each method's own ones in the order that it tells."""
    members = [rims[number] for number in family.members]
    poses = target_poses(members, camera, target, family.solutions.cone, placed=placed)
    is_strained = _is_strained(family, rims)
    own = [
        result
        for number, (rim, radius, name) in enumerate(zip(members, target.radii_mm, target.circle_names, strict=True))
        for result in circle_results(
            rim,
            camera,
            _own_methods(methods),
            radius,
            instance,
            name,
            chen_huang=family.solutions if number == 0 else None,
        )
    ]
    own = [replace(result, flags=(*result.flags, *_flags(poses, is_strained=is_strained))) for result in own]
    check = None
    if poses is not None and target.kind == "coplanar":
        check = vanishing_check(poses, target.flatness_mm)
    results: list[CircleResult] = []
    if methods != (FU_ZHOU,):
        chance, wanted = _by_misfits(family, members) if poses is None else (poses.ambiguity, poses.poses[0].normal)
        results = [_in_order(result, chance, wanted) for result in own]
        cues: list[SettledBy | None] = [None] * len(results)
        if target.kind == "coaxial":
            evidence = None if poses is None else poses.rims
            results = with_generatrix(results, evidence, target)
            cues = [
                SettledBy.GENERATRIX
                if is_settled_by_generatrix(result, partner_of(result, results), evidence, target)
                else None
                for result in results
            ]
        if poses is not None:
            # Where several methods are compared, or lengths contradict each other, each circle keeps its own poses.
            is_joint = methods == (CIRCLE_METHODS[0],) and (poses.not_flat or not is_strained)
            results = [
                _in_poses(result, number, poses, camera, is_joint=is_joint) for number, result in enumerate(results)
            ]
        if target.kind == "coplanar":
            results = [checked_by_vanishing_line(result, check) for result in results]
        else:
            results = [settled(result, cue) for result, cue in zip(results, cues, strict=True)]
    if FU_ZHOU in methods:
        results = _with_fu_zhou(results, own, poses, check, camera, target, placed=placed)
    return results


def _with_fu_zhou(
    results: Sequence[CircleResult],
    own: Sequence[CircleResult],
    poses: TargetPoses | None,
    check: VanishingCheck | None,
    camera: Camera,
    target: Target,
    *,
    placed: bool,
) -> list[CircleResult]:
    """Return `results` with those of Fu & Zhou's route, each after the others of its circle."""
    by_rim = [result for result in own if result.method == CIRCLE_METHODS[0]]
    if target.kind == "coplanar":
        found = by_vanishing_line(by_rim, check, camera, with_covariance=placed)
    else:
        found = by_generatrix(by_rim, None if poses is None else poses.rims, target)
    if not results:
        return found
    done: list[CircleResult] = []
    for reference, result in zip(by_rim, found, strict=True):
        candidates = tuple(compared(candidate, reference.candidates) for candidate in result.candidates)
        done += [each for each in results if each.circle == result.circle]
        done.append(replace(result, candidates=candidates))
    return done


def _flags(poses: TargetPoses | None, *, is_strained: bool) -> tuple[Flag, ...]:
    """Return what is to be said of a target as a whole."""
    flags = [Flag.RING_MISFIT] if is_strained else []
    if poses is not None and poses.not_flat:
        flags.append(Flag.NOT_FLAT)
    return tuple(flags)


def _in_order(result: CircleResult, chance: float, wanted: FloatArray) -> CircleResult:
    """Return the result with the candidate first whose normal is nearest to the one `wanted`, wrong by `chance`."""
    ranked = sorted(result.candidates, key=lambda c: -float(c.normal @ wanted))
    flags = tuple(f for f in result.flags if f is not Flag.AMBIGUOUS or chance >= UNTOLD)
    return replace(result, candidates=tuple(ranked), ambiguity=0.0 if len(ranked) == 1 else chance, flags=flags)


def _in_poses(
    result: CircleResult, number: int, poses: TargetPoses, camera: Camera, *, is_joint: bool
) -> CircleResult:
    """Return the result of circle `number` with the target's poses, or their heights alone."""
    if is_joint:
        return _in_one_pose(result, number, poses, camera)
    normals = np.stack([pose.normal for pose in poses.poses])
    nearest = [int(np.argmax(normals @ candidate.normal)) for candidate in result.candidates]
    candidates = [
        _with_height(candidate, poses, which) for candidate, which in zip(result.candidates, nearest, strict=True)
    ]
    return replace(result, candidates=tuple(candidates))


def _with_height(candidate: Candidate, poses: TargetPoses, which: int) -> Candidate:
    height, sigma = poses.heights[which]
    return replace(candidate, height_mm=height, height_sigma_mm=sigma)


def _by_misfits(family: Family, members: Sequence[Rim]) -> tuple[float, FloatArray]:
    """Return the ambiguity and the chosen normal by how far edges are from where the first circle puts them."""
    noise = math.hypot(*(rim.cone.rms_px for rim in members))
    total = np.sqrt(np.sum(np.square(family.misfits_px), axis=0))
    order = np.argsort(total, kind="stable")
    chance = 0.0 if len(order) == 1 else ambiguity(float(total[order[0]]), float(total[order[1]]), noise)
    return chance, family.solutions.normals[order[0]]


def _in_one_pose(result: CircleResult, number: int, poses: TargetPoses, camera: Camera) -> CircleResult:
    """Return the result of circle `number` with the target's poses in place of its own."""
    candidates = []
    for which, pose in enumerate(poses.poses):
        center, normal = pose.circle(number)
        own = max(result.candidates, key=lambda c: float(c.normal @ normal))
        covariances = poses.covariances[which]
        candidates.append(
            replace(
                _with_height(own, poses, which),
                center=center,
                normal=normal,
                imaged_center=camera.project(center),
                covariance=None if covariances is None else covariances[number],
            )
        )
    one = len(candidates) == 1
    flags = tuple(flag for flag in result.flags if flag is not Flag.AMBIGUOUS or not one)
    cone = ConeKind.ELLIPTICAL if result.cone is ConeKind.RIGHT and not one else result.cone
    return replace(result, candidates=tuple(candidates), ambiguity=poses.ambiguity, cone=cone, flags=flags)


def _is_strained(family: Family, rims: Sequence[Rim]) -> bool:
    misfits = family.misfits_px.min(axis=1)
    size = np.array([float(rims[number].ellipse.semi_major) for number in family.members[1:]])
    return bool(np.any(misfits > np.maximum(_STRAINED_PX, _STRAINED_SHARE * size)))
