"""What a target means for the views that it is measured in: doubts that hold for any image of it."""

from __future__ import annotations

import math
from collections.abc import Iterator

from circlepose.solvers.fu_zhou_coaxial import height_from_generatrix
from circlepose.solvers.mirror_view import farthest_mirror_distance, mirror_tilt
from circlepose.targets.target import Target

_NEAREST = 2.0
"""distance, in radii of the big circle, nearer than which no set-up is expected"""


def describe_target(target: Target) -> str:
    """Return kind and sizes of the target in words."""
    radii = ", ".join(f"{radius:g}" for radius in target.radii_mm)
    words = f"{target.kind}, {'radius' if len(target.radii_mm) == 1 else 'radii'} {radii} mm"
    return words if target.generatrix_mm is None else f"{words}, generatrix {target.generatrix_mm:g} mm"


def target_warnings(target: Target) -> Iterator[str]:
    """Yield what is doubtful in all images of the target: a recess of which two poses fit equally in some views."""
    if target.kind != "coaxial" or target.generatrix_mm is None:
        return
    big, small = target.radii_mm
    depth = float(height_from_generatrix(target.generatrix_mm, big, small))
    farthest = farthest_mirror_distance(big, small, depth)
    near, far = target.depth_range_mm or (0.0, None)
    if farthest is None or max(near, _NEAREST * big) >= farthest:
        return
    first = max(near or 0.5 * farthest, 0.75 * _NEAREST * big)
    last = min(far or 0.9 * farthest, 0.9 * farthest)
    distances = (first, last) if first < last else (first,)
    views = " and ".join(
        f"{math.degrees(float(mirror_tilt(big, small, -depth, distance))):.0f} deg from {distance:.0f} mm"
        for distance in distances
    )
    yield (
        f"as a recess {depth:.3g} mm deep (small circle behind the big one) the target has views in which two poses "
        f"fit equally: tilts of about {views}, none beyond {farthest:.0f} mm; avoid these views, or take a deeper "
        "recess or a boss"
    )
