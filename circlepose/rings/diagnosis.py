"""What the rims in an image say against a ring target: radii, generatrix or places that are not the target's."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from circlepose.camera.camera import Camera
from circlepose.fitting.cone_fit import SeenPoints
from circlepose.geometry.cone import cone_from_factor
from circlepose.measurement.rim import Rim
from circlepose.rings.matching import allowed_px, free_height, largest_circle, may_belong
from circlepose.solvers.fu_zhou_coplanar import concentricity, radius_ratio
from circlepose.targets.target import Target

_CONCENTRIC = 0.02
"""Split of the double eigenvalue: with radii of ratio 0.6, centres a tenth of the outer radius apart."""
_SHOWN = 3
_MOST_RIMS = 12
"""The most evident rims, which are looked at."""


def contradiction(rims: Sequence[Rim], camera: Camera, target: Target) -> str:
    """Say why no rims make a complete `target`, as far as they tell, beginning with a semicolon; or nothing."""
    ordered = sorted(rims[:_MOST_RIMS], key=lambda rim: -float(rim.ellipse.semi_major))
    pairs = [(a, b) for a, b in itertools.combinations(ordered, 2) if may_belong(a, b, target) and _within(b, a)]
    if not pairs:
        return "; nothing else in the image can be another circle of it"
    return _of_coplanar(pairs, target) if target.kind == "coplanar" else _of_coaxial(pairs, camera, target)


def _of_coplanar(pairs: list[tuple[Rim, Rim]], target: Target) -> str:
    largest = pairs[0][0]
    nested = [b for a, b in pairs if a is largest]
    concentric = [_radius_ratio(largest, rim) for rim in nested if _concentric(largest, rim)]
    if not concentric:
        apart = min(float(np.linalg.norm(rim.ellipse.center - largest.ellipse.center)) for rim in nested)
        return f"; the nested circles seen are not concentric, their centres are {apart:.1f} px apart"
    seen = ", ".join(f"{ratio:.2f}" for ratio in sorted(concentric, reverse=True)[:_SHOWN])
    asked = ", ".join(f"{radius / target.radii_mm[0]:.2f}" for radius in target.radii_mm[1:])
    return f"; nested circles seen are {seen} of the largest, radii_mm asks for {asked}"


def _of_coaxial(pairs: list[tuple[Rim, Rim]], camera: Camera, target: Target) -> str:
    big, small = target.radii_mm
    lengths = []
    for first, second in pairs:
        seen = SeenPoints.of(camera, second.points)
        solutions = largest_circle(first, SeenPoints.of(camera, first.points), target)
        if solutions is None:
            continue
        for center, normal in zip(solutions.centers, solutions.normals, strict=True):
            misfit, height = free_height(center, normal, small, seen, 3.0 * big)
            if misfit <= allowed_px(second):
                lengths.append((misfit, float(np.hypot(height, big - small))))
    if not lengths:
        return "; no two circles seen have radii of the ratio of radii_mm and one axis"
    length = min(lengths)[1]
    if target.generatrix_mm is None:
        return ""
    return (
        f"; circles seen would have a generatrix of {length:.3g} mm, generatrix_mm asks for {target.generatrix_mm:g}"
    )


def _within(inner: Rim, outer: Rim) -> bool:
    apart = float(np.linalg.norm(inner.ellipse.center - outer.ellipse.center))
    return apart < float(outer.ellipse.semi_major)


def _radius_ratio(outer: Rim, inner: Rim) -> float:
    return float(radius_ratio(cone_from_factor(outer.cone.factor), cone_from_factor(inner.cone.factor)))


def _concentric(outer: Rim, inner: Rim) -> bool:
    conics = cone_from_factor(outer.cone.factor), cone_from_factor(inner.cone.factor)
    return bool(concentricity(*conics) < _CONCENTRIC)
