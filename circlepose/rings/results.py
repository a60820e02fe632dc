"""Ring targets: the results of the circles that belong together, with the candidate that all of them agree on."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

from circlepose.camera.camera import Camera
from circlepose.detection.contour import WANTED_SIGN, Rejection
from circlepose.measurement.poses import circle_results, compared, result_without_pose, rim_flags
from circlepose.measurement.rim import Rim
from circlepose.results import CircleResult, Failure, Flag
from circlepose.rings.circle_result import in_order, joint_result, own_result
from circlepose.rings.decision import decide
from circlepose.rings.diagnosis import contradiction
from circlepose.rings.fu_zhou_route import NEEDS_RINGS, by_generatrix, by_vanishing_line, without_pose
from circlepose.rings.generatrix import generatrix_pairs, partner_of
from circlepose.rings.hypotheses import SolvedRim, as_circle, solve_rims
from circlepose.rings.matching import MatchedRims, RingMatch, matched_again
from circlepose.rings.options import DEFAULT, RingOptions
from circlepose.rings.poses import TargetPoses
from circlepose.solvers import CIRCLE_METHODS, FU_ZHOU
from circlepose.targets.target import Target


@dataclass(frozen=True, slots=True, eq=False)
class RingTargets:
    """The ring targets of one image."""

    circles: tuple[CircleResult, ...]
    """of all targets, best agreement first; or of one circle alone, flagged `lone_circle`"""
    rejected: Counter[Rejection]
    """how many rims are not used, by reason"""
    incomplete: str = ""
    """why no rims make a complete target, beginning with a semicolon; empty where they do"""


def find_ring_targets(
    rims: Sequence[Rim],
    matched: MatchedRims,
    camera: Camera,
    target: Target,
    methods: tuple[str, ...],
    *,
    placed: bool = True,
    options: RingOptions = DEFAULT,
) -> RingTargets:
    """Solve the poses of all circles of the ring targets in one image.

    One pose is fitted to all rims of a target (`rings.poses`). It is the result where the first method alone is asked
    for. Other methods solve each circle by its own rim, and the joint pose chooses the candidate.

    Parameters
    ----------
    rims
        (m) the rims of the matching in their order, as they were measured last.
    matched
        Which of them belong together.
    camera
        The calibration for this image size.
    target
        A target of kind `coplanar` or `coaxial`.
    methods
        Names of `circlepose.solvers.METHODS`.
    placed
        Whether edges were located along the rims; else joint poses have no covariance.
    options
        The numbers of ring targets.

    Returns
    -------
    The circles of up to `target.count` targets, mm, camera frame. Without a complete target the most evident rim is
    the only one, as the largest circle that the depth range and the axis intervals allow.
    """
    again = matched_again(matched, rims, camera, target, options)
    matches = again.wanted(target)
    used = sum(len(match.members) for match in matches)
    rejected = Counter({Rejection.NOT_IN_TARGET: len(rims) - used})
    circles = [
        result
        for instance, match in enumerate(matches)
        for result in _target_results(match, instance, camera, target, methods, placed, options)
    ]
    if circles:
        return RingTargets(tuple(circles), rejected)
    solved = matched.rims if _are_same(rims, matched) else solve_rims(rims, camera, options)
    lone = _lone_circle(solved, camera, target, methods, options)
    return RingTargets(tuple(lone), rejected, contradiction(solved, target, options) if lone else "")


def _are_same(rims: Sequence[Rim], matched: MatchedRims) -> bool:
    return all(rim is solved.rim for rim, solved in zip(rims, matched.rims, strict=True))


def _lone_circle(
    rims: Sequence[SolvedRim], camera: Camera, target: Target, methods: tuple[str, ...], options: RingOptions
) -> list[CircleResult]:
    """Return the results of the most evident rim that can be a circle of `target`, as the largest that it can be."""
    for solved in rims:
        for which, (radius, name) in enumerate(zip(target.radii_mm, target.circle_names, strict=True)):
            # The polarity is the largest circle's. That of the others is not known.
            if which == 0 and WANTED_SIGN[target.polarity] * solved.rim.polarity < 0:
                continue
            if isinstance(as_circle(solved, target, which), Failure):
                continue
            own = _own_methods(methods)
            lone = circle_results(
                solved.rim, camera, own, radius, 0, name, frame=solved.frame, options=options.measurement
            )
            if methods == (FU_ZHOU,):
                lone = [without_pose(result, NEEDS_RINGS) for result in lone]
            return [replace(result, flags=(*result.flags, Flag.LONE_CIRCLE)) for result in lone]
    return []


def _own_methods(methods: tuple[str, ...]) -> tuple[str, ...]:
    """Return the methods that solve each circle by its own rim; the first of all where none is asked for."""
    return tuple(method for method in methods if method != FU_ZHOU) or (CIRCLE_METHODS[0],)


def _target_results(
    match: RingMatch,
    instance: int,
    camera: Camera,
    target: Target,
    methods: tuple[str, ...],
    placed: bool,
    options: RingOptions,
) -> list[CircleResult]:
    """Return the results of one target's circles, those of one circle together."""
    decision = decide(match, target, placed, options)
    joint = decision.joint
    is_joint = False
    if methods == (CIRCLE_METHODS[0],) and isinstance(joint, TargetPoses):
        # Where methods are compared, or lengths contradict each other, each circle keeps its own poses.
        is_joint = joint.not_flat or not decision.is_strained
    if is_joint and target.kind == "coplanar":
        bases = _without_candidates(match, instance, target, options)
        return [joint_result(base, n, (), decision, match, camera, target, options) for n, base in enumerate(bases)]
    own = _own_results(match, instance, camera, target, methods, options)
    evidence = joint.rims if isinstance(joint, TargetPoses) else ()
    results: list[CircleResult] = []
    if methods != (FU_ZHOU,):
        ordered = [in_order(result, decision) for result in own]
        pairs = [
            generatrix_pairs(result, partner_of(result, ordered), evidence, options)
            if target.kind == "coaxial"
            else ()
            for result in ordered
        ]
        results = [
            joint_result(result, number, own_pairs, decision, match, camera, target, options)
            if is_joint
            else own_result(result, own_pairs, decision, target, options)
            for number, (result, own_pairs) in enumerate(zip(ordered, pairs, strict=True))
        ]
    if FU_ZHOU not in methods:
        return results
    by_rim = [
        replace(result, flags=(*result.flags, *decision.flags))
        for result in own
        if result.method == CIRCLE_METHODS[0]
    ]
    if target.kind == "coplanar":
        found = by_vanishing_line(by_rim, decision.line, camera, with_covariance=placed, options=options)
    else:
        found = by_generatrix(by_rim, evidence, target, options=options)
    return _interleaved(results, found, by_rim) if results else found


def _own_results(
    match: RingMatch,
    instance: int,
    camera: Camera,
    target: Target,
    methods: tuple[str, ...],
    options: RingOptions,
) -> list[CircleResult]:
    """Return the results of each circle by its own rim, by each method."""
    return [
        result
        for each, radius, name in zip(match.rims, target.radii_mm, target.circle_names, strict=True)
        for result in circle_results(
            each.rim,
            camera,
            _own_methods(methods),
            radius,
            instance,
            name,
            frame=each.frame,
            options=options.measurement,
        )
    ]


def _without_candidates(match: RingMatch, instance: int, target: Target, options: RingOptions) -> list[CircleResult]:
    """Return what the result of each circle says of its rim."""
    method = CIRCLE_METHODS[0]
    return [
        replace(
            result_without_pose(each.rim, method, radius, instance, name),
            flags=rim_flags(each.rim, each.frame, options.measurement),
        )
        for each, radius, name in zip(match.rims, target.radii_mm, target.circle_names, strict=True)
    ]


def _interleaved(
    results: Sequence[CircleResult], found: Sequence[CircleResult], by_rim: Sequence[CircleResult]
) -> list[CircleResult]:
    """Return `results` with those `found` by Fu & Zhou's route, each after the others of its circle."""
    done: list[CircleResult] = []
    for reference, result in zip(by_rim, found, strict=True):
        candidates = tuple(compared(candidate, reference.candidates) for candidate in result.candidates)
        done += [each for each in results if each.circle == result.circle]
        done.append(replace(result, candidates=candidates))
    return done
