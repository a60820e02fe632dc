"""Ring targets: the results of the rims that belong together, with the candidate that all of them agree on."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from circlepose._typing import FloatArray
from circlepose.camera import Camera
from circlepose.cone import ConeKind
from circlepose.disambiguation.generatrix import generatrix_length, pair_candidates
from circlepose.disambiguation.second_circle import ambiguity
from circlepose.extraction.contour import WANTED_SIGN, Rejection
from circlepose.fitting.viewing_cone import SeenPoints
from circlepose.measure import Rim
from circlepose.pose import CircleResult, Flag
from circlepose.ring_families import Family, as_circle, find_families
from circlepose.ring_poses import TargetPoses, target_poses
from circlepose.solutions import circle_results
from circlepose.target import Target

_STRAINED_SHARE = 0.02
"""Rims that are off their places by more than this share of their semi-major axis, or _STRAINED_PX, are told."""
_STRAINED_PX = 1.0
_UNTOLD = 0.45
"""From this chance of being wrong on nothing has told the candidates apart."""


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
    for rim in rims:
        seen = SeenPoints.of(camera, rim.points)
        for which, (radius, name) in enumerate(zip(target.radii_mm, target.circle_names, strict=True)):
            # The polarity is the largest circle's; of the others it is not known.
            if which == 0 and WANTED_SIGN[target.polarity] * rim.polarity < 0:
                continue
            solutions = as_circle(rim, seen, target, which)
            if solutions is not None:
                lone = circle_results(rim, camera, methods, radius, 0, name, chen_huang=solutions)
                return [replace(result, flags=(*result.flags, Flag.LONE_CIRCLE)) for result in lone]
    return []


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
    chance, wanted = _by_misfits(family, members) if poses is None else (poses.ambiguity, poses.poses[0].normal)
    is_strained = _is_strained(family, rims)
    strained = (Flag.RING_MISFIT,) if is_strained else ()
    results = []
    for number, (rim, radius, name) in enumerate(zip(members, target.radii_mm, target.circle_names, strict=True)):
        known = family.solutions if number == 0 else None
        for result in circle_results(rim, camera, methods, radius, instance, name, chen_huang=known):
            ranked = sorted(result.candidates, key=lambda c: -float(c.normal @ wanted))
            flags = tuple(f for f in result.flags if f is not Flag.AMBIGUOUS or chance >= _UNTOLD)
            one = len(ranked) == 1
            results.append(
                replace(
                    result,
                    candidates=tuple(ranked),
                    ambiguity=0.0 if one else chance,
                    flags=(*flags, *strained),
                )
            )
    if target.kind == "coaxial":
        results = _with_generatrix(results)
    # Where several methods are compared, or lengths contradict each other, each circle is told by its own rim.
    if poses is None or is_strained or methods != ("chen-huang",):
        return results
    return [_in_one_pose(result, number, poses, camera) for number, result in enumerate(results)]


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
                own,
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


def _with_generatrix(results: list[CircleResult]) -> list[CircleResult]:
    """Add to each candidate the generatrix of its pair with the other circle's candidate of nearest normal."""
    done = []
    for result in results:
        partner = next(r for r in results if r.method == result.method and r.circle != result.circle)
        if not (result.candidates and partner.candidates):
            done.append(result)
            continue
        own, others = _poses(result), _poses(partner)
        paired = pair_candidates(own[1], others[1])
        other = (others[0][paired], others[1][paired], partner.radius_mm)
        is_big = result.radius_mm > partner.radius_mm
        lengths = generatrix_length(*own, *other) if is_big else generatrix_length(*other, *own)
        candidates = [
            replace(candidate, generatrix_mm=float(length))
            for candidate, length in zip(result.candidates, lengths, strict=True)
        ]
        done.append(replace(result, candidates=tuple(candidates)))
    return done


def _poses(result: CircleResult) -> tuple[FloatArray, FloatArray, float]:
    """Return centres (k, 3) and normals (k, 3) of the candidates, and the radius."""
    centers = np.stack([candidate.center for candidate in result.candidates])
    return centers, np.stack([candidate.normal for candidate in result.candidates]), result.radius_mm
