"""Ring targets by the route of Fu & Zhou alone, as `--method fu-zhou`: no joint fit, no candidate chosen by one.

Coplanar circles have one pose, by eq. 7 to 10. Coaxial circles have the candidates of their own cones, in the order
that the generatrix GCC of their pairs gives.
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
    UNTOLD,
    VanishingCheck,
    chance_by_generatrix,
    partner_of,
    with_generatrix,
)
from circlepose.rings.flatness import STEP_WEIGHT
from circlepose.rings.joint_pose import RimEvidence
from circlepose.solvers import FU_ZHOU
from circlepose.targets.target import Target

NEEDS_RINGS = f"the method {FU_ZHOU} needs two circles of a ring target, and only one was found"
_NO_LINE = "the rims are not those of concentric circles in one plane, so there is no vanishing line"


def by_vanishing_line(
    own: Sequence[CircleResult], check: VanishingCheck | None, camera: Camera, *, with_covariance: bool
) -> list[CircleResult]:
    """Return the results of a coplanar target's circles by eq. 7 to 10, from those of each by its own rim.

    `ambiguity` is the probability that the largest circle has its other candidate after all, as a step in the target
    may make it. It is 0 where the line contradicts none of the two.
    """
    if check is None:
        return [without_pose(result, _NO_LINE) for result in own]
    pose = Candidate(
        check.pose.center,
        check.pose.normal,
        camera.project(check.pose.center),
        covariance=check.pose.covariance if with_covariance else None,
    )
    flags = (Flag.VANISHING_LINE_DISAGREES,) if min(check.chi_squares) > CONTRADICTED else ()
    results = []
    for result in own:
        kept = tuple(flag for flag in result.flags if flag is not Flag.AMBIGUOUS)
        results.append(
            replace(
                result,
                method=FU_ZHOU,
                candidates=(pose,),
                ambiguity=_chance_of_other(check),
                settled_by=SettledBy.VANISHING_LINE,
                vanishing_normal=check.pose.normal,
                vanishing_sigma_deg=float(np.degrees(check.pose.sigma_rad)),
                flags=(*kept, *flags),
            )
        )
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
        said = chance_by_generatrix(result, partner_of(result, own), rims, target)
        results.append(_ordered(result, said))
    return results


def _chance_of_other(check: VanishingCheck) -> float:
    """Return the probability of the candidate that is farther from the vanishing line's normal."""
    if len(check.chi_squares) < 2 or max(check.chi_squares) <= CONTRADICTED:
        return 0.0
    likelihoods = np.logaddexp(-0.5 * np.sort(check.chi_squares), np.log(STEP_WEIGHT))
    return float(logistic(likelihoods[1] - likelihoods[0]))


def _ordered(result: CircleResult, said: tuple[float, float] | None) -> CircleResult:
    """Return the result with the candidate first that `said`, of `chance_by_generatrix`, speaks for."""
    result = replace(result, method=FU_ZHOU)
    if len(result.candidates) < 2:
        return replace(result, ambiguity=0.0, settled_by=SettledBy.NONE)
    wrong = 0.5 if said is None else said[1]
    first, second = result.candidates
    is_told = abs(wrong - 0.5) > 0.5 - UNTOLD
    return replace(
        result,
        candidates=(first, second) if wrong <= 0.5 else (second, first),
        ambiguity=min(wrong, 1.0 - wrong),
        settled_by=SettledBy.GENERATRIX if is_told else SettledBy.NONE,
        flags=tuple(flag for flag in result.flags if flag is not Flag.AMBIGUOUS or not is_told),
    )


def without_pose(result: CircleResult, reason: str) -> CircleResult:
    """Return the result of a circle for which this method has no pose, and why."""
    return replace(result, method=FU_ZHOU, candidates=(), status=Status.NO_POSE, reason=reason, cone=None, flags=())
