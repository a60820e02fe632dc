"""Why the rims in an image make no complete ring target: radii, generatrix or places that are not the target's."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from circlepose.geometry.cone import cone_from_factor
from circlepose.measurement.rim import Rim
from circlepose.results import Failure
from circlepose.rings.hypotheses import SolvedRim, as_largest_circle, free_height
from circlepose.rings.matching import allowed_px, may_belong
from circlepose.rings.options import RingOptions
from circlepose.solvers.fu_zhou_coplanar import concentricity, radius_ratio
from circlepose.targets.target import Target


def contradiction(rims: Sequence[SolvedRim], target: Target, options: RingOptions) -> str:
    """Return why no rims make a complete target, as far as they show it.

    Parameters
    ----------
    rims
        (m) the rims of the image, the most evident first.
    target
        The ring target.
    options
        The numbers of ring targets.

    Returns
    -------
    A clause that begins with a semicolon; empty where nothing shows why.
    """
    evident = rims[: options.most_diagnosed_rims]
    ordered = sorted(evident, key=lambda each: -float(each.rim.ellipse.semi_major))
    pairs = [
        (a, b)
        for a, b in itertools.combinations(ordered, 2)
        if may_belong(a.rim, b.rim, target, options) and _within(b.rim, a.rim)
    ]
    if not pairs:
        return "; nothing else in the image can be another circle of it"
    if target.kind == "coplanar":
        largest = pairs[0][0]
        nested = [b.rim for a, b in pairs if a is largest]
        return _of_coplanar(largest.rim, nested, target, options)
    return _of_coaxial(pairs, target, options)


def _of_coplanar(largest: Rim, nested: Sequence[Rim], target: Target, options: RingOptions) -> str:
    concentric = [_radius_ratio(largest, rim) for rim in nested if _are_concentric(largest, rim, options)]
    if not concentric:
        apart = min(float(np.linalg.norm(rim.ellipse.center - largest.ellipse.center)) for rim in nested)
        return f"; the nested circles seen are not concentric, their centers are {apart:.1f} px apart"
    seen = ", ".join(f"{ratio:.2f}" for ratio in sorted(concentric, reverse=True)[: options.most_ratios])
    asked = ", ".join(f"{radius / target.radii_mm[0]:.2f}" for radius in target.radii_mm[1:])
    return f"; nested circles seen are {seen} of the largest, radii_mm asks for {asked}"


def _of_coaxial(pairs: Sequence[tuple[SolvedRim, SolvedRim]], target: Target, options: RingOptions) -> str:
    big, small = target.radii_mm
    lengths = []
    for first, second in pairs:
        solutions = as_largest_circle(first, target)
        if isinstance(solutions, Failure):
            continue
        for center, normal in zip(solutions.centers, solutions.normals, strict=True):
            misfit = free_height(center, normal, small, second.seen, options.highest_radii * big, options)
            if misfit.rms_px <= allowed_px(second.rim, options):
                lengths.append((misfit.rms_px, float(np.hypot(misfit.height_mm, big - small))))
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


def _are_concentric(outer: Rim, inner: Rim, options: RingOptions) -> bool:
    conics = cone_from_factor(outer.cone.factor), cone_from_factor(inner.cone.factor)
    return bool(concentricity(*conics) < options.concentric_split)
