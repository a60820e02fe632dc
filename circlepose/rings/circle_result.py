"""The result of one circle of a ring target: its candidates with their cues, in the order of the decision."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from circlepose._numerics import angle_between
from circlepose.camera.camera import Camera
from circlepose.geometry.cone import ConeKind
from circlepose.measurement.poses import measured_cone
from circlepose.results import Candidate, CircleResult, Flag, SettledBy
from circlepose.rings.decision import Decision
from circlepose.rings.generatrix import GeneratrixPair, settles, with_pair
from circlepose.rings.matching import RingMatch
from circlepose.rings.options import RingOptions
from circlepose.rings.poses import TargetPoses
from circlepose.rings.vanishing_line import VanishingCheck
from circlepose.targets.target import Target


def in_order(result: CircleResult, decision: Decision) -> CircleResult:
    """Return the result with the candidate first whose normal is nearest to the chosen one."""
    ranked = sorted(result.candidates, key=lambda candidate: -float(candidate.normal @ decision.normal))
    return replace(result, candidates=tuple(ranked))


def own_result(
    result: CircleResult,
    pairs: Sequence[GeneratrixPair],
    decision: Decision,
    target: Target,
    options: RingOptions,
) -> CircleResult:
    """Return the result of a circle with the poses of its own rim.

    Parameters
    ----------
    result
        The circle by its own rim, its candidates in the order of the decision.
    pairs
        The generatrix of each candidate; empty for coplanar circles.
    decision
        What all rims of the target say.
    target
        The ring target.
    options
        The numbers of ring targets.
    """
    candidates = []
    for number, candidate in enumerate(result.candidates):
        nearest = 0
        if isinstance(decision.joint, TargetPoses):
            normals = np.stack([pose.normal for pose in decision.joint.poses])
            nearest = int(np.argmax(normals @ candidate.normal))
        candidates.append(_with_cues(candidate, nearest, pairs[number] if pairs else None, decision))
    chance = 0.0 if len(candidates) == 1 else decision.ambiguity
    is_ambiguous = Flag.AMBIGUOUS in result.flags and decision.ambiguity >= options.undecided
    return _decided(result, candidates, chance, is_ambiguous, pairs, decision, target, options)


def joint_result(
    base: CircleResult,
    number: int,
    pairs: Sequence[GeneratrixPair],
    decision: Decision,
    match: RingMatch,
    camera: Camera,
    target: Target,
    options: RingOptions,
) -> CircleResult:
    """Return the result of one circle with the joint poses.

    Parameters
    ----------
    base
        What its rim says; of coaxial circles with the candidates of its own rim.
    number
        Of the circle in the target, 0 for the largest.
    pairs
        The generatrix of each candidate of `base`; empty for coplanar circles.
    decision
        What all rims of the target say. Its joint poses are known.
    match
        The rims of the target.
    camera
        The calibration for this image size.
    target
        The ring target.
    options
        The numbers of ring targets.
    """
    joint = decision.joint
    assert isinstance(joint, TargetPoses)
    candidates = []
    for which, pose in enumerate(joint.poses):
        center, normal = pose.circle(number)
        covariances = joint.covariances[which]
        pair = None
        if pairs:
            pair = pairs[int(np.argmax([candidate.normal @ normal for candidate in base.candidates]))]
        covariance = None if covariances is None else covariances[number]
        candidate = Candidate(center, normal, camera.project(center), covariance=covariance)
        candidates.append(_with_cues(candidate, which, pair, decision))
    own = match.rims[number].unit
    are_two = len(candidates) == 2
    kind = ConeKind(own.cone)
    if kind is ConeKind.RIGHT and are_two:
        kind = ConeKind.ELLIPTICAL
    cone = measured_cone(match.rims[number].rim, kind)
    is_ambiguous = are_two and len(own.centers) == 2 and joint.ambiguity >= options.undecided
    return _decided(
        replace(base, cone=cone), candidates, joint.ambiguity, is_ambiguous, pairs, decision, target, options
    )


def _with_cues(candidate: Candidate, which: int, pair: GeneratrixPair | None, decision: Decision) -> Candidate:
    """Return the candidate with the cues of Fu & Zhou and the height; `which` is that of the joint pose."""
    joint, line = decision.joint, decision.line
    height, height_sigma = joint.heights[which] if isinstance(joint, TargetPoses) else (None, None)
    distance_deg, distance_sigmas = None, None
    if isinstance(line, VanishingCheck):
        distance_deg = float(np.degrees(angle_between(candidate.normal, line.pose.normal)))
        if candidate.covariance is not None:
            chi_square = line.pose.chi_square(candidate.normal, candidate.covariance[3:, 3:])
            distance_sigmas = float(np.sqrt(chi_square))
    return replace(
        candidate if pair is None else with_pair(candidate, pair),
        height_mm=height,
        height_sigma_mm=height_sigma,
        vanishing_distance_deg=distance_deg,
        vanishing_distance_sigmas=distance_sigmas,
    )


def _decided(
    base: CircleResult,
    candidates: Sequence[Candidate],
    chance: float,
    is_ambiguous: bool,
    pairs: Sequence[GeneratrixPair],
    decision: Decision,
    target: Target,
    options: RingOptions,
) -> CircleResult:
    """Return the result with its candidates, the likelier first, and what settled the choice between them."""
    kept = (flag for flag in base.flags if flag is not Flag.AMBIGUOUS)
    flags = [*([Flag.AMBIGUOUS] if is_ambiguous else []), *kept, *decision.flags]
    line = decision.line if candidates else None
    cue = SettledBy.JOINT_FIT
    if isinstance(line, VanishingCheck) and line.disagrees:
        flags.append(Flag.VANISHING_LINE_DISAGREES)
        if len(candidates) == 2:
            chance = max(chance, options.least_contradicted_ambiguity)
    elif isinstance(line, VanishingCheck) and line.settles:
        cue = SettledBy.VANISHING_LINE
    elif settles(pairs, target, options):
        cue = SettledBy.GENERATRIX
    if len(candidates) < 2 or chance >= options.undecided:
        cue = SettledBy.NONE
    return replace(
        base,
        candidates=tuple(candidates),
        ambiguity=chance,
        settled_by=cue,
        vanishing_normal=line.pose.normal if isinstance(line, VanishingCheck) else None,
        vanishing_sigma_deg=float(np.degrees(line.pose.sigma_rad)) if isinstance(line, VanishingCheck) else None,
        generatrix_expected_mm=target.generatrix_mm if pairs else None,
        flags=tuple(flags),
    )
