"""Fu & Zhou's cue for coaxial circles: the generatrix of both pairs of candidates against the part's. Pure NumPy.

The candidates are those that each circle has by its own rim. The generatrices may settle the choice alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from circlepose._numerics import logistic
from circlepose._typing import FloatArray
from circlepose.results import Candidate, CircleResult, Failure, Status
from circlepose.rings.evidence import RimEvidence
from circlepose.rings.options import RingOptions
from circlepose.solvers.fu_zhou_coaxial import (
    MeasuredCircle,
    ends_covariance,
    generatrix_ends,
    pair_candidates,
    pair_misfit,
)
from circlepose.targets.target import Target
from circlepose.uncertainty.pose_covariance import pose_covariance


@dataclass(frozen=True, slots=True, eq=False)
class GeneratrixPair:
    """The generatrix of a candidate with the other circle's candidate of nearest normal."""

    ends_mm: FloatArray
    """(2,) rim to rim distance at the nearer and at the farther end"""
    covariance: FloatArray | None
    """(2, 2) of both; None where that of a candidate is not known"""

    @property
    def sigmas_mm(self) -> FloatArray | None:
        """(2,) standard deviations of both ends."""
        return None if self.covariance is None else np.sqrt(np.diagonal(self.covariance))


@dataclass(frozen=True, slots=True)
class GeneratrixOdds:
    """The two candidates of a circle by the generatrices alone."""

    chi_square: float
    """of the first candidate's pair"""
    log_odds: float
    """of the second candidate over the first"""


def with_pair(candidate: Candidate, pair: GeneratrixPair) -> Candidate:
    """Return the candidate with the generatrix of its pair."""
    return replace(
        candidate,
        generatrix_mm=float(pair.ends_mm[0]),
        generatrix_ends_mm=pair.ends_mm,
        generatrix_ends_sigma_mm=pair.sigmas_mm,
    )


def partner_of(result: CircleResult, results: Sequence[CircleResult]) -> CircleResult:
    """Return the result of the other circle of a coaxial target, by the same method."""
    return next(other for other in results if other.method == result.method and other.circle != result.circle)


def generatrix_pairs(
    result: CircleResult, partner: CircleResult, rims: Sequence[RimEvidence], options: RingOptions
) -> tuple[GeneratrixPair, ...]:
    """Return the generatrix of each candidate of a circle; none where one of the circles has no candidates.

    Parameters
    ----------
    result, partner
        Both circles, each by its own rim.
    rims
        What is known of the big and of the small circle's rim; empty where nothing is.
    options
        The numbers of ring targets.
    """
    if not result.candidates or not partner.candidates:
        return ()
    is_big = result.radius_mm > partner.radius_mm
    own_rim, other_rim = (None, None) if not rims else rims if is_big else rims[::-1]
    pairs = []
    partners = pair_candidates(_normals(result), _normals(partner))
    for candidate, number in zip(result.candidates, partners, strict=True):
        own = _measured(result, candidate, own_rim)
        other = _measured(partner, partner.candidates[int(number)], other_rim)
        big, small = (own, other) if is_big else (other, own)
        ends = generatrix_ends(big.center, big.normal, big.radius, small.center, small.normal, small.radius)
        is_known = np.all(np.isfinite(big.covariance)) and np.all(np.isfinite(small.covariance))
        pairs.append(GeneratrixPair(ends, ends_covariance(big, small, options.radius_share) if is_known else None))
    return tuple(pairs)


def generatrix_odds(
    pairs: Sequence[GeneratrixPair], target: Target, options: RingOptions
) -> GeneratrixOdds | Failure:
    """Compare the generatrices of a circle's two candidates with that of the target.

    Parameters
    ----------
    pairs
        The generatrix of each candidate.
    target
        The coaxial target. Where its generatrix is not known, both ends of the right pair have one length.
    options
        The numbers of ring targets.

    Returns
    -------
    The odds. It fails where there is nothing to choose, or a covariance is not known. Source: Fu & Zhou (2019),
    section 3.3, and `solvers.fu_zhou_coaxial`.
    """
    if len(pairs) < 2:
        return Failure(Status.NO_POSE, "there are no two candidates to choose from")
    sigma = options.radius_share * target.radii_mm[0]
    misfits = [
        pair_misfit(pair.ends_mm, pair.covariance, target.generatrix_mm, sigma)
        for pair in pairs
        if pair.covariance is not None
    ]
    if len(misfits) < len(pairs):
        return Failure(Status.NO_POSE, "the covariance of a generatrix is not known")
    return GeneratrixOdds(misfits[0][0], misfits[1][1] - misfits[0][1])


def settles(pairs: Sequence[GeneratrixPair], target: Target, options: RingOptions) -> bool:
    """Whether the generatrices alone settle that the first candidate is right."""
    odds = generatrix_odds(pairs, target, options)
    if isinstance(odds, Failure) or odds.chi_square > options.contradicted_cue:
        return False
    return float(logistic(odds.log_odds)) < options.alone_ambiguity


def _measured(result: CircleResult, candidate: Candidate, rim: RimEvidence | None) -> MeasuredCircle:
    """Return a candidate with its covariance, or that of its rim's edges where it has none; NaN where neither is."""
    covariance = candidate.covariance
    if covariance is None and rim is not None and np.linalg.matrix_rank(rim.information) == len(rim.information):
        modes = np.asarray(np.linalg.inv(rim.information))
        covariance = pose_covariance(rim.factor, modes, candidate.center, candidate.normal, result.radius_mm)
    known = np.full((5, 5), np.nan) if covariance is None else covariance
    return MeasuredCircle(candidate.center, candidate.normal, result.radius_mm, known)


def _normals(result: CircleResult) -> FloatArray:
    return np.stack([candidate.normal for candidate in result.candidates])
