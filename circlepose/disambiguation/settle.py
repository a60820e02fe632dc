"""Lone circles: each takes the candidate that a shared plane and the hints make likelier.

Planes are found, or one is declared. Hints are a rough normal, the vertical of horizontal surfaces and the side that
a surface faces. The log likelihoods of all are added.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from circlepose._typing import BoolArray, FloatArray, IntArray
from circlepose.camera.camera import Camera
from circlepose.disambiguation.common_plane import common_plane
from circlepose.disambiguation.found_planes import FoundPlanes, find_planes
from circlepose.disambiguation.hint_likelihoods import Decision, decide, facing, rough_normal, up_direction
from circlepose.disambiguation.joint_plane import on_joint_plane
from circlepose.disambiguation.observed import observed, standard_errors
from circlepose.disambiguation.options import DEFAULT, DisambiguationOptions
from circlepose.results import CircleResult, Flag, Plane, SettledBy
from circlepose.targets.hints import facing_direction
from circlepose.targets.target import Target


@dataclass(frozen=True, slots=True, eq=False)
class Settled:
    """The circles of one image with their candidates in order, and the planes that they share."""

    circles: list[CircleResult]
    planes: tuple[Plane, ...] = ()


def settled(
    circles: list[CircleResult], target: Target, camera: Camera, *, options: DisambiguationOptions = DEFAULT
) -> Settled:
    """Order the candidates of lone circles by the planes that they share and by all hints on their target.

    The circles of each method are settled among themselves.

    Parameters
    ----------
    circles
        The circles of one image.
    target
        The target, with its hints.
    camera
        The calibration for this image size.
    options
        The numbers of the hints and planes.

    Returns
    -------
    The circles in their order, the likelier candidate of each first, with the probability that it is the wrong one.
    Circles with one candidate are unchanged, unless a plane is declared: then all that lie in it get its normal.
    """
    result, planes = list(circles), list[Plane]()
    for method in dict.fromkeys(circle.method for circle in circles):
        index = [i for i, c in enumerate(circles) if c.method == method and len(c.candidates) == 2]
        if index and _is_known(target, len(index), options):
            ordered, found = _by_cues([circles[i] for i in index], target, len(planes), options)
            planes.extend(found)
            for i, circle in zip(index, ordered, strict=True):
                result[i] = circle
        if target.same_plane == "yes":
            index = [i for i, c in enumerate(circles) if c.method == method and c.candidates]
            joint = on_joint_plane([result[i] for i in index], camera, len(planes), options=options)
            planes.extend([] if joint.plane is None else [joint.plane])
            for i, circle in zip(index, joint.circles, strict=True):
                result[i] = circle
    return Settled(result, tuple(planes))


def _is_known(target: Target, number: int, options: DisambiguationOptions) -> bool:
    """Whether anything may settle `number` circles with two candidates."""
    own = (target.normal_hint, target.up_hint, target.facing)
    least = {"auto": options.least_members, "yes": 2}.get(str(target.same_plane), number + 1)
    return any(hint is not None for hint in own) or number >= least


def _by_cues(
    circles: list[CircleResult], target: Target, first_plane: int, options: DisambiguationOptions
) -> tuple[list[CircleResult], list[Plane]]:
    """Return circles of one method with the likelier candidate first, and the planes found, from `first_plane` on."""
    by_plane, found = _by_planes(circles, target, options)
    by_hints = _by_hints(circles, target, options)
    decision = decide(by_plane + by_hints)
    is_settled = decision.ambiguity < options.undecided
    numbers, planes = _listed(found, is_settled, circles[0].method, first_plane)
    if target.same_plane != "auto":
        # The plane that is declared is fitted to all circles.
        numbers, planes = np.full(len(circles), -1), []
    ordered = [
        replace(
            circle,
            candidates=circle.candidates if chosen == 0 else circle.candidates[::-1],
            ambiguity=float(wrong),
            settled_by=cue,
            plane=int(number) if number >= 0 else None,
            flags=tuple(f for f in circle.flags if f is not Flag.AMBIGUOUS or wrong >= options.undecided),
        )
        for circle, chosen, wrong, cue, number in zip(
            circles,
            decision.chosen,
            decision.ambiguity,
            _settled_by(decision, by_plane, by_hints, options),
            numbers,
            strict=True,
        )
    ]
    return ordered, planes


def _settled_by(
    decision: Decision, by_plane: FloatArray, by_hints: FloatArray, options: DisambiguationOptions
) -> list[SettledBy]:
    """Return what settled the choice of each circle: the stronger one of the plane and the other hints."""
    plane, hints = (np.abs(scores[:, 0] - scores[:, 1]) for scores in (by_plane, by_hints))
    return [
        SettledBy.NONE if wrong >= options.undecided else SettledBy.COMMON_PLANE if more else SettledBy.HINT
        for wrong, more in zip(decision.ambiguity, plane > hints, strict=True)
    ]


def _listed(found: FoundPlanes, is_settled: BoolArray, method: str, first: int) -> tuple[IntArray, list[Plane]]:
    """Return the plane of each circle, -1 for none, and the planes in which circles are settled."""
    inside = np.where(is_settled, found.planes, -1)
    numbers, planes = np.full(len(inside), -1), list[Plane]()
    for plane, (normal, offset) in enumerate(zip(found.normals, found.offsets, strict=True)):
        if np.any(inside == plane):
            numbers[inside == plane] = first + len(planes)
            planes.append(Plane(method, normal, float(offset), int(np.count_nonzero(inside == plane))))
    return numbers, planes


def _by_planes(
    circles: list[CircleResult], target: Target, options: DisambiguationOptions
) -> tuple[FloatArray, FoundPlanes]:
    """Return the log likelihoods (m, 2) of the candidates by the planes that circles share, and those found."""
    number = len(circles)
    none = FoundPlanes(np.zeros((number, 2)), np.full(number, -1), np.zeros((0, 3)), np.zeros(0))
    if target.same_plane == "no" or number < 2:
        return none.log_probabilities, none
    candidates = observed(circles, options)
    if number >= options.least_members:
        found = find_planes(candidates, options=options)
        if target.same_plane == "auto":
            return found.log_probabilities, found
        if len(found.normals):
            largest = np.bincount(found.planes[found.planes >= 0]).argmax()
            is_in = found.planes == largest
            return np.where(is_in[:, None], found.log_probabilities, np.log(0.5)), found
    if target.same_plane == "auto":
        return none.log_probabilities, none
    sigma_rad, sigma_mm = _sigmas(circles, options)
    by_plane = common_plane(candidates.centers, candidates.normals, sigma_rad, sigma_mm, options=options)
    return by_plane, none


def _by_hints(circles: list[CircleResult], target: Target, options: DisambiguationOptions) -> FloatArray:
    """Return the log likelihoods (m, 2) of the candidates by the hints."""
    scores = np.zeros((len(circles), 2))
    if target.normal_hint is None and target.up_hint is None and target.facing is None:
        return scores
    normals = np.stack([[c.normal for c in circle.candidates] for circle in circles])
    sigma_rad, _ = _sigmas(circles, options)
    # Both candidates are equally likely before, so they get the same spread.
    own_deg = np.degrees(sigma_rad.mean(axis=-1, keepdims=True))
    if target.normal_hint is not None:
        spread = np.hypot(target.normal_hint.spread_deg, own_deg)
        likelihoods = rough_normal(normals, np.array(target.normal_hint.direction), spread)
        scores = scores + np.logaddexp(likelihoods, options.least_log_likelihood)
    if target.up_hint is not None:
        spread = np.hypot(target.up_hint.spread_deg, own_deg)
        likelihoods = up_direction(normals, np.array(target.up_hint.direction), spread)
        scores = scores + np.logaddexp(likelihoods, options.least_log_likelihood)
    if target.facing is not None:
        scores = scores + facing(normals, np.array(facing_direction(target.facing)), sigma_rad)
    return scores


def _sigmas(circles: list[CircleResult], options: DisambiguationOptions) -> tuple[FloatArray, FloatArray]:
    """Return standard errors (m, 2) of the normals (rad, per axis) and of the centers across the plane (mm)."""
    errors = np.array([[standard_errors(circle, each, options) for each in circle.candidates] for circle in circles])
    return np.hypot(errors[..., 0], np.radians(options.flatness_deg)), np.hypot(errors[..., 1], options.flatness_mm)
