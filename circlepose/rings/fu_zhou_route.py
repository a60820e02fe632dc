"""Ring targets by the route of Fu & Zhou alone, as `--method fu-zhou`: no joint fit, no candidate chosen by one.

Coplanar circles have one pose, by eq. 7 to 10, where the vanishing line settles the choice between the candidates of
their cones. Where it does not, and for coaxial circles, the candidates of each circle's own cone are returned, in the
order that the vanishing line, or the generatrix GCC of their pairs, gives.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from circlepose._numerics import logistic
from circlepose.camera.camera import Camera
from circlepose.results import Candidate, CircleResult, Flag, SettledBy, Status
from circlepose.rings.cues import (
    CONTRADICTED,
    VanishingCheck,
    odds_by_generatrix,
    partner_of,
    with_generatrix,
)
from circlepose.rings.flatness import STEP_WEIGHT
from circlepose.rings.joint_pose import RimEvidence
from circlepose.solvers import FU_ZHOU
from circlepose.targets.target import Target

NEEDS_RINGS = f"the method {FU_ZHOU} needs two circles of a ring target, and only one was found"
_SETTLES = 0.05
"""A cue settles the choice where the probability of the other candidate is less. A flat target's is `STEP_WEIGHT` at
least, since some targets that are declared coplanar are not flat."""
_NO_LINE = "the rims are not those of concentric circles in one plane, so there is no vanishing line"


def by_vanishing_line(
    own: Sequence[CircleResult], check: VanishingCheck | None, camera: Camera, *, with_covariance: bool
) -> list[CircleResult]:
    """Return the results of a coplanar target's circles by eq. 7 to 10, from those of each by its own rim.

    `ambiguity` is the probability of the candidate that the vanishing line does not choose. Where that is not small,
    both candidates of each circle's own rim are returned, the nearer to the line's normal first, flagged `ambiguous`.
    """
    if check is None:
        return [without_pose(result, _NO_LINE) for result in own]
    flags = (Flag.VANISHING_LINE_DISAGREES,) if min(check.chi_squares) > CONTRADICTED else ()
    pose = Candidate(
        check.pose.center,
        check.pose.normal,
        camera.project(check.pose.center),
        covariance=check.pose.covariance if with_covariance else None,
    )
    results = []
    for result in own:
        chance = _chance_of_other(check, result.flags)
        found = replace(
            result,
            method=FU_ZHOU,
            vanishing_normal=check.pose.normal,
            vanishing_sigma_deg=float(np.degrees(check.pose.sigma_rad)),
            flags=(*result.flags, *flags),
        )
        if chance < _SETTLES:
            found = replace(found, candidates=(pose,))
        else:
            ranked = sorted(result.candidates, key=lambda c: -float(c.normal @ check.nearest))
            found = replace(found, candidates=tuple(ranked))
        is_chosen = len(check.chi_squares) == 2
        results.append(_settled(found, chance, SettledBy.VANISHING_LINE if is_chosen else SettledBy.NONE))
    return results


def by_generatrix(
    own: Sequence[CircleResult], rims: Sequence[RimEvidence] | None, target: Target
) -> list[CircleResult]:
    """Return the results of the two circles of a coaxial target, ordered by GCC, from those of each by its own rim.

    Where `generatrix_mm` is not known, both ends of the right pair have one length. `rims` are what is known of them,
    None where nothing is.
    """
    results = []
    for result in with_generatrix(own, rims, target):
        said = odds_by_generatrix(result, partner_of(result, own), rims, target)
        results.append(_ordered(result, 0.0 if said is None else said[1]))
    return results


def _chance_of_other(check: VanishingCheck, flags: Sequence[Flag]) -> float:
    """Return the probability of the candidate that is farther from the vanishing line's normal."""
    if Flag.NOT_FLAT in flags or min(check.chi_squares) > CONTRADICTED:
        # The line distinguishes the candidates only by the flatness of the target. A step may make either look flat,
        # and what remains, the tilt of each cone, is for the joint fit: it is no part of this method.
        return 0.5
    if len(check.chi_squares) < 2:
        return 0.0
    likelihoods = np.logaddexp(-0.5 * np.sort(check.chi_squares), np.log(STEP_WEIGHT))
    return float(logistic(likelihoods[1] - likelihoods[0]))


def _ordered(result: CircleResult, odds: float) -> CircleResult:
    """Return the result with the likelier candidate first; `odds` are the log odds of the second over the first."""
    first, *others = result.candidates
    ranked = (*others, first) if odds > 0.0 else result.candidates
    found = replace(result, method=FU_ZHOU, candidates=tuple(ranked))
    return _settled(found, float(logistic(-abs(odds))), SettledBy.GENERATRIX)


def _settled(result: CircleResult, chance: float, cue: SettledBy) -> CircleResult:
    """Return the result with the probability `chance` of the other candidate: settled by the `cue`, or ambiguous."""
    kept = tuple(flag for flag in result.flags if flag is not Flag.AMBIGUOUS)
    if chance < _SETTLES:
        return replace(result, ambiguity=chance, settled_by=cue, flags=kept)
    if len(result.candidates) < 2:
        return replace(result, ambiguity=0.0, settled_by=SettledBy.NONE, flags=kept)
    return replace(result, ambiguity=chance, settled_by=SettledBy.NONE, flags=(Flag.AMBIGUOUS, *kept))


def without_pose(result: CircleResult, reason: str) -> CircleResult:
    """Return the result of a circle for which this method has no pose, and why."""
    return replace(result, method=FU_ZHOU, candidates=(), status=Status.NO_POSE, reason=reason, cone=None, flags=())
