"""Ring targets: which rims belong together, and the candidate that both agree on."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, replace

import numpy as np

from circlepose._typing import FloatArray
from circlepose.camera import Camera
from circlepose.disambiguation.second_circle import ambiguity, generatrix_mm, misfit_px
from circlepose.extraction.contour import WANTED_SIGN, Rejection
from circlepose.measure import Rim
from circlepose.pose import CircleResult, Flag
from circlepose.solutions import circle_results
from circlepose.solvers.solve import Solutions, solve
from circlepose.target import Target

_MISFIT_SHARE = 0.08
"""Rims belong together when one predicts the other to this share of its semi-major axis, or _MISFIT_PX."""
_MISFIT_PX = 1.5


@dataclass(frozen=True, slots=True)
class _Pair:
    """A rim taken for the largest circle of a target, and one taken for another of its circles."""

    first: int
    second: int
    misfits_px: tuple[float, ...]
    """of the second rim, for each candidate pose of the first"""


def find_ring_targets(
    rims: list[Rim], camera: Camera, target: Target, methods: tuple[str, ...], rejected: Counter[Rejection]
) -> list[CircleResult]:
    """Return the results of all circles of up to `target.count` ring targets among `rims`, best agreement first.

    The first rim's candidates are solved with the largest radius; each predicts where the other circles must
    be seen, and the candidate with the smaller misfit is chosen. Without a complete target the most evident
    rim alone is reported as the largest circle, flagged `lone_circle`.
    """
    solved = [solve("chen-huang", rim.cone.factor, camera.rays(rim.points), target.radii_mm[0]) for rim in rims]
    families = []
    for first, solutions in enumerate(solved):
        if isinstance(solutions, str) or WANTED_SIGN[target.polarity] * rims[first].polarity < 0:
            continue
        pairs = [_best_second(first, solutions, k, rims, camera, target) for k in range(1, len(target.radii_mm))]
        if all(pair is not None for pair in pairs):
            families.append([pair for pair in pairs if pair is not None])
    families.sort(key=lambda family: max(min(pair.misfits_px) / _allowed(rims[pair.second]) for pair in family))
    results: list[CircleResult] = []
    used: set[int] = set()
    instance = 0
    for family in families:
        members = {family[0].first, *(pair.second for pair in family)}
        if used & members or (target.count is not None and instance >= target.count):
            continue
        used |= members
        results.extend(_target_results(family, rims, camera, target, methods, instance))
        instance += 1
    rejected[Rejection.NOT_IN_TARGET] += len(rims) - len(used)
    if not results and rims:
        lone = circle_results(rims[0], camera, methods, target.radii_mm[0], 0, target.circle_names[0])
        return [replace(r, flags=(*r.flags, Flag.LONE_CIRCLE)) for r in lone]
    return results


def contradiction(rims: list[Rim], target: Target) -> str:
    """Say which ratio of radii the nested rims in the image have, where it is not that of a coplanar `target`."""
    if target.kind != "coplanar" or len(rims) < 2:
        return ""
    largest = rims[0].ellipse
    nested = [
        float(rim.ellipse.semi_major / largest.semi_major)
        for rim in rims[1:]
        if np.linalg.norm(rim.ellipse.center - largest.center) < 0.2 * largest.semi_minor
    ]
    if not nested:
        return ""
    seen = ", ".join(f"{ratio:.2f}" for ratio in sorted(nested, reverse=True)[:3])
    asked = ", ".join(f"{radius / target.radii_mm[0]:.2f}" for radius in target.radii_mm[1:])
    return f"; nested circles seen are {seen} of the largest, radii_mm asks for {asked}"


def _best_second(
    first: int, solutions: Solutions, which: int, rims: list[Rim], camera: Camera, target: Target
) -> _Pair | None:
    """Find the rim that circle number `which` of the target would have if `first` were the largest one."""
    best: _Pair | None = None
    for second, rim in enumerate(rims):
        if second == first or rim.ellipse.semi_major >= 1.3 * rims[first].ellipse.semi_major:
            continue
        rays, jacobians = camera.rays_with_jacobian(rim.points)
        misfits = tuple(
            min(
                misfit_px(place, normal, target.radii_mm[which], rays, jacobians)
                for place in _second_centers(center, normal, which, target)
            )
            for center, normal in zip(solutions.centers, solutions.normals, strict=True)
        )
        if min(misfits) <= _allowed(rim) and (best is None or min(misfits) < min(best.misfits_px)):
            best = _Pair(first, second, misfits)
    return best


def _second_centers(center: FloatArray, normal: FloatArray, which: int, target: Target) -> list[FloatArray]:
    """Where the second circle's centre can be: the same, or the part's height in front or behind."""
    if target.kind == "coplanar":
        return [center]
    difference = target.radii_mm[0] - target.radii_mm[which]
    if target.generatrix_mm is not None:
        height = math.sqrt(target.generatrix_mm**2 - difference**2)
        return [center + sign * height * normal for sign in (1.0, -1.0)]
    return [center + height * normal for height in np.linspace(-3.0, 3.0, 121) * target.radii_mm[0]]


def _allowed(rim: Rim) -> float:
    return max(_MISFIT_PX, _MISFIT_SHARE * float(rim.ellipse.semi_major))


def _target_results(
    family: list[_Pair], rims: list[Rim], camera: Camera, target: Target, methods: tuple[str, ...], instance: int
) -> list[CircleResult]:
    """Results of one target's circles, each with its candidates in the order that the others' rims tell."""
    first = rims[family[0].first]
    noise = math.hypot(first.cone.rms_px, *(rims[pair.second].cone.rms_px for pair in family))
    total = np.sqrt(np.sum(np.square([pair.misfits_px for pair in family]), axis=0))
    order = np.argsort(total, kind="stable")
    chance = 0.0 if len(order) == 1 else ambiguity(float(total[order[0]]), float(total[order[1]]), noise)
    members = [first, *(rims[pair.second] for pair in family)]
    reference = solve("chen-huang", first.cone.factor, camera.rays(first.points), target.radii_mm[0])
    assert not isinstance(reference, str)
    wanted = reference.normals[order[0]]
    results = []
    for rim, radius, name in zip(members, target.radii_mm, target.circle_names, strict=True):
        for result in circle_results(rim, camera, methods, radius, instance, name):
            ranked = sorted(result.candidates, key=lambda c: -float(c.normal @ wanted))
            flags = tuple(f for f in result.flags if f is not Flag.AMBIGUOUS or chance >= 0.5)
            one = len(ranked) == 1
            results.append(replace(result, candidates=tuple(ranked), ambiguity=0.0 if one else chance, flags=flags))
    return _with_generatrix(results) if target.kind == "coaxial" else results


def _with_generatrix(results: list[CircleResult]) -> list[CircleResult]:
    """Add to each candidate the rim to rim distance to the like candidate of the other circle."""
    done = []
    for result in results:
        partner = next(r for r in results if r.method == result.method and r.circle != result.circle)
        candidates = []
        for candidate in result.candidates:
            other = max(partner.candidates, key=lambda c: float(c.normal @ candidate.normal), default=None)
            length = None
            if other is not None:
                length = generatrix_mm(
                    (candidate.center, candidate.normal, result.radius_mm),
                    (other.center, other.normal, partner.radius_mm),
                )
            candidates.append(replace(candidate, generatrix_mm=length))
        done.append(replace(result, candidates=tuple(candidates)))
    return done
