"""Concentric rims of which one is the circle's: which is taken, by what the target says.

A disc with a ring around it, a washer or a countersunk hole has several rims of one center, each a circle that could
be the target's. Detection has left out those that the axis intervals and the polarity of the target exclude. Those
outside the depth range are excluded here. Of the others the outermost is taken, and the circle is flagged.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from circlepose.camera.camera import Camera
from circlepose.detection.contour import Contour, Rejection
from circlepose.detection.duplicates import are_confusable
from circlepose.detection.options import DetectionOptions
from circlepose.flags import in_order
from circlepose.measurement.rim import Rim
from circlepose.results import CircleResult, Failure, Flag, NestedRim
from circlepose.solvers.registry import solve

OUTSIDE = frozenset({Rejection.DEPTH, Rejection.RESIDUAL})
"""Why a rim cannot be the target's by what the caller declared."""


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredRim:
    """One of the concentric rims of a circle."""

    contour: Contour
    fit: Rim | Failure
    why_not: Rejection | None
    """why it is not used; None where it may be"""


def chosen(rims: Sequence[MeasuredRim]) -> MeasuredRim:
    """Return the outermost rim that is not outside of what is declared; the outermost where all are.

    It may have no pose. Then none of the others is taken in its place: it would be a circle of another size.
    """
    return next((rim for rim in rims if rim.why_not not in OUTSIDE), rims[0])


def listed(
    rims: Sequence[MeasuredRim], taken: MeasuredRim, camera: Camera, radius_mm: float
) -> tuple[NestedRim, ...]:
    """Return the rims for the result of the one that was `taken`."""
    return tuple(
        NestedRim(
            rim.contour.ellipse,
            rim.contour.polarity,
            _distance_mm(rim.fit, camera, radius_mm),
            is_admitted=rim.why_not not in OUTSIDE,
            is_taken=rim is taken,
        )
        for rim in rims
    )


def with_nested_rims(
    results: Sequence[CircleResult], nested: Sequence[tuple[NestedRim, ...]], options: DetectionOptions
) -> list[CircleResult]:
    """Add the concentric rims `nested` of each instance to its results, flagged where another may be the target's."""
    return [_with_nested(each, nested[each.instance], options) if nested[each.instance] else each for each in results]


def _with_nested(result: CircleResult, rims: tuple[NestedRim, ...], options: DetectionOptions) -> CircleResult:
    taken = next(rim for rim in rims if rim.is_taken)
    others = [rim for rim in rims if rim.is_admitted and not rim.is_taken]
    is_open = any(
        are_confusable(
            float(other.ellipse.semi_major), other.polarity, float(taken.ellipse.semi_major), taken.polarity, options
        )
        for other in others
    )
    flags = {*result.flags, Flag.NESTED_RIMS} if is_open else set(result.flags)
    return replace(result, nested_rims=rims, flags=in_order(flags))


def _distance_mm(fit: Rim | Failure, camera: Camera, radius_mm: float) -> float | None:
    if isinstance(fit, Failure):
        return None
    solutions = solve("chen-huang", fit.cone.factor, camera.rays(fit.points), radius_mm)
    return None if isinstance(solutions, Failure) else float(np.linalg.norm(solutions.centers, axis=1).mean())
