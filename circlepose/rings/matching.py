"""Which rims in an image belong together, as the circles of one ring target.

A rim is taken for the target's largest circle; each of its candidate poses says where the other circles must be
seen: at the same centre (coplanar), or along the normal at the part's height, in front or behind (coaxial). Where
each is seen there, within a tolerance, these rims are a family.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from circlepose._typing import FloatArray
from circlepose.camera.camera import Camera
from circlepose.detection.contour import WANTED_SIGN
from circlepose.fitting.cone_fit import SeenPoints
from circlepose.measurement.poses import settled_factor
from circlepose.measurement.rim import Rim
from circlepose.results import Failure
from circlepose.rings.reprojection import misfits_px
from circlepose.solvers.fu_zhou_coaxial import height_from_generatrix
from circlepose.solvers.registry import Solutions, solve
from circlepose.targets.target import Target

_MISFIT_SHARE = 0.08
"""Rims belong together when one predicts the other to this share of its semi-major axis, or _MISFIT_PX."""
_MISFIT_PX = 1.5
_LARGER = 1.3
"""Farther away or not, a smaller circle's image is not larger than this times the largest circle's."""
_HIGHEST = 3.0
"""Largest height of a coaxial target without a generatrix, in its big radii."""
_HEIGHTS = 61
_FINER = 11
_FEW = 24
"""Edges that tell roughly at which height a circle is."""


@dataclass(frozen=True, slots=True, eq=False)
class Family:
    """The rims of one target."""

    members: tuple[int, ...]
    """of each circle of the target, the largest first: the number of its rim"""
    solutions: Solutions
    """of the first rim by chen-huang: (c) candidates"""
    misfits_px: FloatArray
    """(k - 1, c) rms distance of each other rim from where a candidate pose of the first predicts it"""
    allowed_px: FloatArray
    """(k - 1,) misfit with which a rim is accepted"""

    @property
    def strain(self) -> float:
        """The largest misfit of the better candidate, as a share of what is allowed."""
        return float(np.max(self.misfits_px.min(axis=1) / self.allowed_px))


def find_families(rims: Sequence[Rim], camera: Camera, target: Target) -> list[Family]:
    """Return up to `target.count` families among `rims`, no rim in two of them, best agreement first."""
    seen = [SeenPoints.of(camera, rim.points) for rim in rims]
    families = []
    for first, rim in enumerate(rims):
        solutions = largest_circle(rim, seen[first], target)
        if solutions is None:
            continue
        others = [
            _best_other(first, solutions, which, rims, seen, target) for which in range(1, len(target.radii_mm))
        ]
        found = [other for other in others if other is not None]
        members = (first, *(number for number, _ in found))
        if len(found) == len(others) and len(set(members)) == len(members):
            misfits = np.stack([misfits for _, misfits in found])
            allowed = np.array([allowed_px(rims[number]) for number, _ in found])
            families.append(Family(members, solutions, misfits, allowed))
    families.sort(key=lambda family: family.strain)
    kept: list[Family] = []
    used: set[int] = set()
    for family in families:
        if not used & set(family.members) and (target.count is None or len(kept) < target.count):
            used |= set(family.members)
            kept.append(family)
    return kept


def largest_circle(rim: Rim, seen: SeenPoints, target: Target) -> Solutions | None:
    """Return the poses of `rim` as the target's largest circle; None where what is known of it rules that out."""
    if WANTED_SIGN[target.polarity] * rim.polarity < 0:
        return None
    return as_circle(rim, seen, target, 0)


def as_circle(rim: Rim, seen: SeenPoints, target: Target, which: int) -> Solutions | None:
    """Return the poses of `rim` as the target's circle number `which`.

    None where it has none in the depth range, or its axes would put the largest circle's outside their intervals.
    """
    share = target.radii_mm[which] / target.radii_mm[0]
    axes = target.axis_intervals
    if axes is not None and not (
        axes.holds_major(2.0 * float(rim.ellipse.semi_major) / share)
        and axes.holds_minor(2.0 * float(rim.ellipse.semi_minor) / share)
    ):
        return None
    solutions = solve("chen-huang", settled_factor(rim), seen.rays, target.radii_mm[which])
    if isinstance(solutions, Failure):
        return None
    if target.depth_range_mm is not None:
        nearest, farthest = target.depth_range_mm
        if not np.any((solutions.centers[:, 2] >= nearest) & (solutions.centers[:, 2] <= farthest)):
            return None
    return solutions


def other_heights(which: int, target: Target) -> FloatArray | None:
    """Return where the target's circle number `which` can be along the normal, mm in front; None where anywhere."""
    if target.kind == "coplanar":
        return np.zeros(1)
    if target.generatrix_mm is None:
        return None
    height = height_from_generatrix(target.generatrix_mm, target.radii_mm[0], target.radii_mm[which])
    return np.array([float(height), -float(height)])


def least_misfit(
    center: FloatArray, normal: FloatArray, which: int, seen: SeenPoints, target: Target
) -> tuple[float, float]:
    """Return how near, px, edges `seen` are to circle number `which` of a target at a pose, and at which height."""
    radius = target.radii_mm[which]
    heights = other_heights(which, target)
    if heights is None:
        return free_height(center, normal, radius, seen, _HIGHEST * target.radii_mm[0])
    misfits = misfits_px(center + heights[:, None] * normal, normal, radius, seen.rays, seen.jacobians)
    best = int(np.argmin(misfits))
    return float(misfits[best]), float(heights[best])


def free_height(
    center: FloatArray, normal: FloatArray, radius: float, seen: SeenPoints, highest: float
) -> tuple[float, float]:
    """Return the least misfit, px, of a circle anywhere on the axis up to `highest`, and its height there."""
    step = 2.0 * highest / (_HEIGHTS - 1)
    few = slice(None, None, max(1, len(seen) // _FEW))
    best, least = 0.0, np.inf
    for reach, number, edges in (
        (highest, _HEIGHTS, few),
        (step, _FINER, slice(None)),
        (2.0 * step / (_FINER - 1), _FINER, slice(None)),
    ):
        heights = best + np.linspace(-reach, reach, number)
        centers = center + heights[:, None] * normal
        misfits = misfits_px(centers, normal, radius, seen.rays[edges], seen.jacobians[edges])
        best, least = float(heights[int(np.argmin(misfits))]), float(misfits.min())
    return least, best


def allowed_px(rim: Rim) -> float:
    """Return the misfit with which `rim` is still taken for a circle of a family."""
    return max(_MISFIT_PX, _MISFIT_SHARE * float(rim.ellipse.semi_major))


def may_belong(first: Rim, second: Rim, target: Target) -> bool:
    """Tell whether `second` can be another circle of the target whose largest is `first`, by place and size alone."""
    largest = float(first.ellipse.semi_major)
    if float(second.ellipse.semi_major) >= _LARGER * largest:
        return False
    heights = None if target.kind == "coplanar" else other_heights(1, target)
    reach = (
        0.5 if target.kind == "coplanar" else 1.5 * (_HIGHEST if heights is None else heights[0] / target.radii_mm[0])
    )
    return float(np.linalg.norm(second.ellipse.center - first.ellipse.center)) <= (0.5 + reach) * largest


def _best_other(
    first: int, solutions: Solutions, which: int, rims: Sequence[Rim], seen: Sequence[SeenPoints], target: Target
) -> tuple[int, FloatArray] | None:
    """Return the number of the rim that is circle number `which`, were `first` the largest, and its misfits (c,)."""
    best: tuple[int, FloatArray] | None = None
    for number, rim in enumerate(rims):
        if number == first or not may_belong(rims[first], rim, target):
            continue
        misfits = np.array(
            [
                least_misfit(center, normal, which, seen[number], target)[0]
                for center, normal in zip(solutions.centers, solutions.normals, strict=True)
            ]
        )
        if misfits.min() <= allowed_px(rim) and (best is None or misfits.min() < best[1].min()):
            best = number, misfits
    return best
