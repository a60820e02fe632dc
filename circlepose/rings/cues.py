"""Fu & Zhou's own cues on a measured ring target, beside the joint fit: vanishing line and generatrix. Pure NumPy.

Coplanar circles: the normal from the vanishing line (eq. 7 and 10) rests on the imaged centre, which no single
circle shows. It is compared with both candidates. Coaxial circles: the generatrices of both pairs of candidates, of
the poses that each circle has on its own, are compared with the part's. Either may settle the choice alone; a
vanishing line that contradicts the chosen candidate is an alarm.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from circlepose._numerics import logistic
from circlepose._typing import FloatArray
from circlepose.geometry.cone import plane_basis
from circlepose.geometry.cone_perturbation import grown
from circlepose.results import Candidate, CircleResult, Flag, SettledBy
from circlepose.rings.joint_pose import RADIUS_SHARE, AxisPose, RimEvidence, RingProblem
from circlepose.rings.poses import TargetPoses
from circlepose.solvers.fu_zhou_coaxial import (
    MeasuredCircle,
    ends_covariance,
    generatrix_ends,
    pair_candidates,
    pair_misfit,
)
from circlepose.solvers.fu_zhou_coplanar import log_odds, pose_with_covariance
from circlepose.targets.target import Target
from circlepose.uncertainty.pose_covariance import pose_covariance

UNTOLD = 0.45
"""From this chance of being wrong on nothing has told the candidates apart."""
CONFIDENT = 0.01
"""A cue settles the choice alone where by it the chance of being wrong is less."""
CONTRADICTED = 20.0
"""Chi-square of two degrees of freedom from which a cue contradicts a candidate: 1 of 22,000 right ones."""
DISTRUST = 0.05
"""Least ambiguity of a choice that the vanishing line contradicts: the target is not what it was declared to be."""


@dataclass(frozen=True, slots=True, eq=False)
class VanishingPose:
    """The one pose of two coplanar circles by eq. 7 to 10."""

    center: FloatArray
    """(3,)"""
    normal: FloatArray
    """(3,) unit, towards the camera"""
    covariance: FloatArray
    """(5, 5) of the centre and two tilts towards the vectors of `cone.plane_basis(normal)`"""

    @property
    def sigma_rad(self) -> float:
        """Root of the sum of both tilts' variances."""
        return float(np.sqrt(np.trace(self.covariance[3:, 3:])))

    def chi_square(self, normal: FloatArray, tilts: FloatArray) -> float:
        """Return the squared distance of a `normal` (3,), in standard errors: of two degrees of freedom.

        `tilts` (2, 2) is the covariance of that normal's tilts towards the vectors of its own plane basis.
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
    """What the vanishing line says of the candidate poses of a coplanar target, the chosen one first."""

    pose: VanishingPose
    chi_squares: tuple[float, ...]
    """of the candidates' normals"""
    nearest: FloatArray
    """(3,) the candidate's normal with the least chi-square"""
    chance_of_second: float
    """probability that the second candidate is right, by the vanishing line of a flat target alone"""

    @property
    def disagrees(self) -> bool:
        """Whether the chosen candidate is contradicted."""
        return self.chi_squares[0] > CONTRADICTED

    @property
    def settles(self) -> bool:
        """Whether the vanishing line alone settles that the first candidate is right."""
        return not self.disagrees and len(self.chi_squares) == 2 and self.chance_of_second < CONFIDENT


def vanishing_check(poses: TargetPoses, flatness_mm: float) -> VanishingCheck | None:
    """Compare the joint fit's `poses` of a coplanar target with its vanishing line; None where it has none."""
    pose = vanishing_pose(poses.rims, flatness_mm, poses.excess)
    if pose is None:
        return None
    normals = np.stack([each.normal for each in poses.poses])
    chi_squares = tuple(pose.chi_square(normal, tilts) for normal, tilts in zip(normals, poses.tilts, strict=True))
    chance = 0.0
    if len(normals) == 2:
        sigma = float(np.sqrt(np.mean([np.trace(tilts) / 2.0 for tilts in poses.tilts])))
        chance = float(logistic(-log_odds(normals, sigma, pose.normal, pose.covariance[3:, 3:])))
    return VanishingCheck(pose, chi_squares, normals[int(np.argmin(chi_squares))], chance)


def vanishing_pose(rims: Sequence[RimEvidence], flatness_mm: float, excess: float = 1.0) -> VanishingPose | None:
    """Return the pose by the vanishing line of the largest and the smallest of coplanar circles, the largest first.

    Its covariance is from those of the `rims`, times `excess`, and from the `flatness_mm` of the target. None where
    no two concentric circles have such rims, or part of one is not determined.
    """
    problem = RingProblem((rims[0], rims[-1]), 0.0, flatness_mm)
    factors = np.stack([grown(rim.factor, rim.amounts) for rim in problem.rims])
    center, normal, _ = pose_with_covariance(factors, np.zeros((2, 5, 5)), rims[0].radius)
    if not (np.all(np.isfinite(center)) and np.all(np.isfinite(normal))):
        return None
    covariances = [problem.rim_covariance(number, AxisPose(center, normal)) for number in range(2)]
    known = [covariance for covariance in covariances if covariance is not None]
    if len(known) < len(covariances):
        return None
    *_, covariance = pose_with_covariance(factors, excess * np.stack(known), rims[0].radius)
    is_known = np.all(np.isfinite(covariance)) and np.linalg.eigvalsh(covariance[3:, 3:])[0] > 0.0
    return VanishingPose(center, normal, covariance) if is_known else None


def checked_by_vanishing_line(result: CircleResult, check: VanishingCheck | None) -> CircleResult:
    """Return the result of a coplanar target's circle with the vanishing line's normal, and what settled the choice.

    A contradiction of the chosen candidate is flagged, and `DISTRUST` is its least ambiguity.
    """
    if check is None or not result.candidates:
        return settled(result, None)
    result = with_vanishing_normal(result, check.pose)
    if check.disagrees:
        wrong = result.ambiguity if len(result.candidates) == 1 else max(result.ambiguity, DISTRUST)
        flagged = replace(result, ambiguity=wrong, flags=(*result.flags, Flag.VANISHING_LINE_DISAGREES))
        return settled(flagged, None)
    return settled(result, SettledBy.VANISHING_LINE if check.settles else None)


def with_vanishing_normal(result: CircleResult, pose: VanishingPose) -> CircleResult:
    """Return the result with the vanishing line's normal and its distance from each candidate's."""
    candidates = tuple(
        replace(
            candidate,
            vanishing_distance_deg=_angle_deg(candidate.normal, pose.normal),
            vanishing_distance_sigmas=None
            if candidate.covariance is None
            else float(np.sqrt(pose.chi_square(candidate.normal, candidate.covariance[3:, 3:]))),
        )
        for candidate in result.candidates
    )
    sigma_deg = float(np.degrees(pose.sigma_rad))
    return replace(result, candidates=candidates, vanishing_normal=pose.normal, vanishing_sigma_deg=sigma_deg)


def settled(result: CircleResult, alone: SettledBy | None) -> CircleResult:
    """Return a ring target's result with what settled it: the cue that did it `alone`, the joint fit, or nothing."""
    if len(result.candidates) < 2 or result.ambiguity >= UNTOLD:
        return replace(result, settled_by=SettledBy.NONE)
    return replace(result, settled_by=alone or SettledBy.JOINT_FIT)


def with_generatrix(
    results: Sequence[CircleResult], rims: Sequence[RimEvidence] | None, target: Target
) -> list[CircleResult]:
    """Add to each candidate of coaxial circles, measured each by its own rim, the generatrix of its pair.

    The pair is with the other circle's candidate of nearest normal. `rims` are what is known of the big and of the
    small circle's rim; None where nothing is.
    """
    done = []
    for result in results:
        partner = partner_of(result, results)
        if result.candidates and partner.candidates:
            pairs = _pairs(result, partner, rims)
            candidates = tuple(
                replace(
                    candidate,
                    generatrix_mm=float(pair.ends[0]),
                    generatrix_ends_mm=pair.ends,
                    generatrix_ends_sigma_mm=None
                    if pair.covariance is None
                    else np.sqrt(np.diagonal(pair.covariance)),
                )
                for candidate, pair in zip(result.candidates, pairs, strict=True)
            )
            done.append(replace(result, candidates=candidates, generatrix_expected_mm=target.generatrix_mm))
        else:
            done.append(result)
    return done


def partner_of(result: CircleResult, results: Sequence[CircleResult]) -> CircleResult:
    """Return the result of the other circle of a coaxial target, by the same method."""
    return next(other for other in results if other.method == result.method and other.circle != result.circle)


def odds_by_generatrix(
    result: CircleResult, partner: CircleResult, rims: Sequence[RimEvidence] | None, target: Target
) -> tuple[float, float] | None:
    """Return what the generatrices alone say of the two candidates of a coaxial circle, each with its pair.

    They are the chi-square of the first candidate's pair, and the log odds of the second over the first. Both
    circles' candidates are those of their own rims. None where there is nothing to choose, or a covariance is not
    known.
    """
    if len(result.candidates) < 2 or not partner.candidates:
        return None
    misfits = [
        pair_misfit(pair.ends, pair.covariance, target.generatrix_mm, RADIUS_SHARE * target.radii_mm[0])
        for pair in _pairs(result, partner, rims)
        if pair.covariance is not None
    ]
    if len(misfits) < len(result.candidates):
        return None
    return misfits[0][0], misfits[1][1] - misfits[0][1]


def is_settled_by_generatrix(
    result: CircleResult, partner: CircleResult, rims: Sequence[RimEvidence] | None, target: Target
) -> bool:
    """Tell whether the generatrices alone settle that the first candidate is right; see `odds_by_generatrix`."""
    said = odds_by_generatrix(result, partner, rims, target)
    return said is not None and said[0] <= CONTRADICTED and float(logistic(said[1])) < CONFIDENT


class _Pair(NamedTuple):
    ends: FloatArray
    """(2,) the generatrices at the nearer and at the farther end"""
    covariance: FloatArray | None
    """(2, 2)"""


def _pairs(result: CircleResult, partner: CircleResult, rims: Sequence[RimEvidence] | None) -> list[_Pair]:
    """Return each candidate's pair with the other circle's candidate of nearest normal."""
    is_big = result.radius_mm > partner.radius_mm
    own_rim, other_rim = (None, None) if rims is None else rims if is_big else rims[::-1]
    pairs = []
    for candidate, number in zip(
        result.candidates, pair_candidates(_normals(result), _normals(partner)), strict=True
    ):
        own = _measured(result, candidate, own_rim)
        other = _measured(partner, partner.candidates[int(number)], other_rim)
        big, small = (own, other) if is_big else (other, own)
        ends = generatrix_ends(big.center, big.normal, big.radius, small.center, small.normal, small.radius)
        is_known = np.all(np.isfinite(big.covariance)) and np.all(np.isfinite(small.covariance))
        pairs.append(_Pair(ends, ends_covariance(big, small, RADIUS_SHARE) if is_known else None))
    return pairs


def _measured(result: CircleResult, candidate: Candidate, rim: RimEvidence | None) -> MeasuredCircle:
    """Return a candidate with its covariance: by the edges of its own rim where levels say nothing, or else NaN."""
    covariance = candidate.covariance
    if covariance is None and rim is not None and np.linalg.matrix_rank(rim.information) == len(rim.information):
        modes = np.asarray(np.linalg.inv(rim.information))
        covariance = pose_covariance(rim.factor, modes, candidate.center, candidate.normal, result.radius_mm)
    known = np.full((5, 5), np.nan) if covariance is None else covariance
    return MeasuredCircle(candidate.center, candidate.normal, result.radius_mm, known)


def _normals(result: CircleResult) -> FloatArray:
    return np.stack([candidate.normal for candidate in result.candidates])


def _angle_deg(first: FloatArray, second: FloatArray) -> float:
    return float(np.degrees(2.0 * np.arcsin(min(1.0, float(np.linalg.norm(first - second)) / 2.0))))
