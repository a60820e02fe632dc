"""Ring targets by the route of Fu & Zhou alone, as `--method fu-zhou`: no joint fit, no candidate chosen by one.

Coplanar circles have one pose, by eq. 7 to 10, where the vanishing line settles the choice between the candidates of
their cones. Where it does not, and for coaxial circles, the candidates of each circle's own cone are returned, in the
order of their likelihood by the vanishing line, or by the generatrices of their pairs (GCC).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from circlepose._numerics import logistic
from circlepose.camera.camera import Camera
from circlepose.results import Candidate, CircleResult, Failure, Flag, SettledBy, Status
from circlepose.rings.evidence import RimEvidence
from circlepose.rings.generatrix import generatrix_odds, generatrix_pairs, partner_of, with_pair
from circlepose.rings.options import DEFAULT, RingOptions
from circlepose.rings.vanishing_line import VanishingCheck
from circlepose.solvers import FU_ZHOU
from circlepose.targets.target import Target

NEEDS_RINGS = Failure(
    Status.NO_POSE, f"the method {FU_ZHOU} needs two circles of a ring target, and only one was found"
)


def by_vanishing_line(
    own: Sequence[CircleResult],
    check: VanishingCheck | Failure,
    camera: Camera,
    *,
    with_covariance: bool,
    options: RingOptions = DEFAULT,
) -> list[CircleResult]:
    """Return the results of a coplanar target's circles by eq. 7 to 10.

    Parameters
    ----------
    own
        The results of each circle by its own rim, the largest first.
    check
        The candidates by the vanishing line, or why there is none.
    camera
        The calibration for this image size.
    with_covariance
        Whether the covariance is known.
    options
        The numbers of ring targets.

    Returns
    -------
    A result of each circle; mm, camera frame. `ambiguity` is the probability of the candidate that the vanishing line
    does not choose. Where that is not small, both candidates of each circle's own rim are returned, the nearer to the
    line's normal first, flagged `ambiguous`. Source: Fu & Zhou (2019), section 3.2.
    """
    if isinstance(check, Failure):
        return [without_pose(result, check) for result in own]
    flags = (Flag.VANISHING_LINE_DISAGREES,) if _contradicts_all(check, options) else ()
    pose = Candidate(
        check.pose.center,
        check.pose.normal,
        camera.project(check.pose.center),
        covariance=check.pose.covariance if with_covariance else None,
    )
    cue = SettledBy.VANISHING_LINE if len(check.chi_squares) == 2 else SettledBy.NONE
    results = []
    for result in own:
        chance = _chance_of_other(check, result.flags, options)
        candidates: tuple[Candidate, ...] = (pose,)
        if chance >= options.fu_zhou_ambiguity:
            candidates = tuple(sorted(result.candidates, key=lambda c: -float(c.normal @ check.nearest)))
        found = replace(
            result,
            vanishing_normal=check.pose.normal,
            vanishing_sigma_deg=float(np.degrees(check.pose.sigma_rad)),
            flags=(*result.flags, *flags),
        )
        results.append(_decided(found, candidates, chance, cue, options))
    return results


def by_generatrix(
    own: Sequence[CircleResult],
    rims: Sequence[RimEvidence],
    target: Target,
    *,
    options: RingOptions = DEFAULT,
) -> list[CircleResult]:
    """Return the results of the two circles of a coaxial target, their candidates ordered by the generatrices.

    Parameters
    ----------
    own
        The results of each circle by its own rim, the big one's first.
    rims
        What is known of both rims; empty where nothing is.
    target
        The coaxial target. Where its generatrix is not known, both ends of the right pair have one length.
    options
        The numbers of ring targets.

    Returns
    -------
    A result of each circle; mm, camera frame. Source: Fu & Zhou (2019), section 3.3.
    """
    results = []
    for result in own:
        pairs = generatrix_pairs(result, partner_of(result, own), rims, options)
        odds = generatrix_odds(pairs, target, options)
        log_odds = 0.0 if isinstance(odds, Failure) else odds.log_odds
        candidates = result.candidates
        if pairs:
            candidates = tuple(with_pair(candidate, pair) for candidate, pair in zip(candidates, pairs, strict=True))
        found = replace(result, generatrix_expected_mm=target.generatrix_mm if pairs else None)
        ranked = candidates[::-1] if log_odds > 0.0 else candidates
        chance = float(logistic(-abs(log_odds)))
        results.append(_decided(found, ranked, chance, SettledBy.GENERATRIX, options))
    return results


def without_pose(result: CircleResult, failure: Failure) -> CircleResult:
    """Return the result of a circle for which this method has no pose."""
    return replace(
        result, method=FU_ZHOU, candidates=(), status=failure.status, reason=failure.reason, cone=None, flags=()
    )


def _contradicts_all(check: VanishingCheck, options: RingOptions) -> bool:
    """Whether the vanishing line contradicts every candidate."""
    return min(check.chi_squares) > options.contradicted_cue


def _chance_of_other(check: VanishingCheck, flags: Sequence[Flag], options: RingOptions) -> float:
    """Return the probability of the candidate that is farther from the vanishing line's normal."""
    if Flag.NOT_FLAT in flags or _contradicts_all(check, options):
        # The line distinguishes the candidates only by the flatness of the target. A step may make either look flat,
        # and what remains, the tilt of each cone, is for the joint fit: it is no part of this method.
        return 0.5
    if len(check.chi_squares) < 2:
        return 0.0
    likelihoods = np.logaddexp(-0.5 * np.sort(check.chi_squares), np.log(options.step_weight))
    return float(logistic(likelihoods[1] - likelihoods[0]))


def _decided(
    result: CircleResult, candidates: tuple[Candidate, ...], chance: float, cue: SettledBy, options: RingOptions
) -> CircleResult:
    """Return the result with the probability `chance` of the other candidate: settled by the `cue`, or ambiguous."""
    flags: tuple[Flag, ...] = tuple(flag for flag in result.flags if flag is not Flag.AMBIGUOUS)
    if chance >= options.fu_zhou_ambiguity:
        cue = SettledBy.NONE
        if len(candidates) < 2:
            chance = 0.0
        else:
            flags = (Flag.AMBIGUOUS, *flags)
    return replace(result, method=FU_ZHOU, candidates=candidates, ambiguity=chance, settled_by=cue, flags=flags)
