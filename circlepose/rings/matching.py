"""Which rims in an image belong together, as the circles of one ring target.

A rim is taken for the largest circle of the target. Each of its candidate poses predicts the images of the other
circles: at the same center (coplanar), or along the normal at the part's height, in front or behind (coaxial). Where
every circle has a rim there, within a tolerance, these rims are a match.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from circlepose._typing import FloatArray
from circlepose.camera.camera import Camera
from circlepose.measurement.rim import Rim
from circlepose.results import Failure, Status
from circlepose.rings.hypotheses import (
    Misfit,
    SolvedRim,
    as_largest_circle,
    least_misfit,
    other_heights,
    solve_rims,
)
from circlepose.rings.options import DEFAULT, RingOptions
from circlepose.solvers.registry import Solutions
from circlepose.targets.target import Target


@dataclass(frozen=True, slots=True, eq=False)
class RingMatch:
    """The rims of one target, the largest circle's first."""

    members: tuple[int, ...]
    """(k) index of each circle's rim among all rims"""
    rims: tuple[SolvedRim, ...]
    """(k) these rims"""
    solutions: Solutions
    """of the largest circle by Chen & Huang: c candidates"""
    misfits_px: FloatArray
    """(k - 1, c) rms distance of each other rim from where a candidate pose of the largest circle predicts it"""
    heights_mm: FloatArray
    """(k - 1, c) its height in front of the largest circle in that prediction"""
    allowed_px: FloatArray
    """(k - 1,) misfit up to which a rim is accepted"""

    @property
    def strain(self) -> float:
        """The largest misfit of the better candidate, as a share of what is allowed."""
        return float(np.max(self.misfits_px.min(axis=1) / self.allowed_px))


@dataclass(frozen=True, slots=True, eq=False)
class MatchedRims:
    """All rims of an image, and which of them belong together."""

    rims: tuple[SolvedRim, ...]
    """the most evident first"""
    matches: tuple[RingMatch, ...]
    """best agreement first; no rim is in two of them"""

    def wanted(self, target: Target) -> tuple[RingMatch, ...]:
        """Return as many matches as the target asks for."""
        return self.matches[: target.count]


def match_rings(
    rims: Sequence[Rim], camera: Camera, target: Target, *, options: RingOptions = DEFAULT
) -> MatchedRims:
    """Find the rims that belong together as the circles of one ring target.

    Parameters
    ----------
    rims
        (m) measured rims, the most evident first.
    camera
        The calibration for this image size.
    target
        A target of kind `coplanar` or `coaxial`.
    options
        The numbers of ring targets.

    Returns
    -------
    The rims, solved, and all matches. Source: the target's geometry; see `rings.reprojection`.
    """
    return match_solved(solve_rims(rims, camera, options), target, options)


def match_solved(rims: tuple[SolvedRim, ...], target: Target, options: RingOptions) -> MatchedRims:
    """As `match_rings`, of rims that are solved."""
    found = [
        match for first in range(len(rims)) if isinstance(match := _match(first, rims, target, options), RingMatch)
    ]
    return MatchedRims(rims, tuple(_without_conflicts(found)))


def matched_again(
    matched: MatchedRims, rims: Sequence[Rim], camera: Camera, target: Target, options: RingOptions
) -> MatchedRims:
    """Return the same matches of rims that were measured again, without those that do not hold any more.

    Parameters
    ----------
    matched
        The matches of the rims before.
    rims
        (m) the same rims in the same order, measured again.
    camera, target, options
        See `match_rings`.
    """
    numbers = [number for match in matched.matches for number in match.members]
    if all(rims[number] is matched.rims[number].rim for number in numbers):
        return matched
    solved = dict(zip(numbers, solve_rims([rims[number] for number in numbers], camera, options), strict=True))
    again = [_measured_again(match, solved, target, options) for match in matched.matches]
    kept = sorted((each for each in again if isinstance(each, RingMatch)), key=lambda match: match.strain)
    return MatchedRims(tuple(solved.get(n, rim) for n, rim in enumerate(matched.rims)), tuple(kept))


def allowed_px(rim: Rim, options: RingOptions) -> float:
    """Return the misfit, px, up to which a rim is accepted as a circle of a target."""
    return max(options.match_px, options.match_share * float(rim.ellipse.semi_major))


def may_belong(first: Rim, second: Rim, target: Target, options: RingOptions) -> bool:
    """Whether `second` can be another circle of the target whose largest is `first`, by place and size alone."""
    largest = float(first.ellipse.semi_major)
    if float(second.ellipse.semi_major) >= options.largest_ratio * largest:
        return False
    farthest = 1.0
    if target.kind == "coaxial":
        heights = other_heights(1, target)
        highest = options.highest_radii if heights is None else float(heights[0]) / target.radii_mm[0]
        farthest = 0.5 + 1.5 * highest
    return float(np.linalg.norm(second.ellipse.center - first.ellipse.center)) <= farthest * largest


def _match(first: int, rims: Sequence[SolvedRim], target: Target, options: RingOptions) -> RingMatch | Failure:
    """Return the match whose largest circle is rim number `first`."""
    solutions = as_largest_circle(rims[first], target)
    if isinstance(solutions, Failure):
        return solutions
    members, predictions = [first], []
    for which in range(1, len(target.radii_mm)):
        best = _best_other(first, solutions, which, rims, target, options)
        if isinstance(best, Failure):
            return best
        members.append(best[0])
        predictions.append(best[1])
    if len(set(members)) < len(members):
        return Failure(Status.TOO_FEW_CIRCLES, "one rim would be two circles of the target")
    return _with_predictions(tuple(members), tuple(rims[n] for n in members), solutions, predictions, options)


def _best_other(
    first: int, solutions: Solutions, which: int, rims: Sequence[SolvedRim], target: Target, options: RingOptions
) -> tuple[int, list[Misfit]] | Failure:
    """Return the number of the rim that is circle `which`, were `first` the largest, and its misfits (c)."""
    best: tuple[int, list[Misfit]] | None = None
    for number, other in enumerate(rims):
        if number == first or not may_belong(rims[first].rim, other.rim, target, options):
            continue
        misfits = _misfits(solutions, which, other, target, options)
        least = _least_px(misfits)
        if least <= allowed_px(other.rim, options) and (best is None or least < _least_px(best[1])):
            best = number, misfits
    return Failure(Status.TOO_FEW_CIRCLES, "a circle of the target is not seen") if best is None else best


def _measured_again(
    match: RingMatch, solved: Mapping[int, SolvedRim], target: Target, options: RingOptions
) -> RingMatch | Failure:
    """Return the match of the same rims, measured again."""
    rims = tuple(solved[number] for number in match.members)
    solutions = as_largest_circle(rims[0], target)
    if isinstance(solutions, Failure):
        return solutions
    predictions = [_misfits(solutions, which, rim, target, options) for which, rim in enumerate(rims[1:], start=1)]
    again = _with_predictions(match.members, rims, solutions, predictions, options)
    return again if again.strain <= 1.0 else Failure(Status.TOO_FEW_CIRCLES, "the rims do not fit the target")


def _misfits(
    solutions: Solutions, which: int, other: SolvedRim, target: Target, options: RingOptions
) -> list[Misfit]:
    """Return the misfit of a rim as circle number `which` by each candidate pose of the largest circle."""
    return [
        least_misfit(center, normal, which, other.seen, target, options)
        for center, normal in zip(solutions.centers, solutions.normals, strict=True)
    ]


def _least_px(misfits: Sequence[Misfit]) -> float:
    return min(misfit.rms_px for misfit in misfits)


def _with_predictions(
    members: tuple[int, ...],
    rims: tuple[SolvedRim, ...],
    solutions: Solutions,
    predictions: Sequence[Sequence[Misfit]],
    options: RingOptions,
) -> RingMatch:
    return RingMatch(
        members,
        rims,
        solutions,
        misfits_px=np.array([[misfit.rms_px for misfit in misfits] for misfits in predictions]),
        heights_mm=np.array([[misfit.height_mm for misfit in misfits] for misfits in predictions]),
        allowed_px=np.array([allowed_px(other.rim, options) for other in rims[1:]]),
    )


def _without_conflicts(found: Sequence[RingMatch]) -> list[RingMatch]:
    """Return the matches in the order of their strain, no rim in two of them."""
    kept: list[RingMatch] = []
    used: set[int] = set()
    for match in sorted(found, key=lambda match: match.strain):
        if used.isdisjoint(match.members):
            used.update(match.members)
            kept.append(match)
    return kept
