"""Rims of a ring target of which too little is seen for the extraction, sought where another rim says they must be.

The candidate poses of a rim that is found, taken for one circle of the target, predict the images of the others: a
curve with little free but which candidate, and in front or behind. So a fifth of that rim is evidence, where a curve
with five free parameters needs half. What is found keeps the normal of its prediction, only its centre is fitted.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from circlepose._typing import BoolArray, FloatArray, Image
from circlepose.camera.camera import Camera
from circlepose.fitting.cone_fit import ConeFit, SeenPoints, rim_distance_px
from circlepose.fitting.cone_projection import rim_pixels
from circlepose.geometry.cone import factor_from_circle
from circlepose.imaging.subpixel_edges import contour_normals, locate_edges
from circlepose.measurement.rim import Rim, rim_from_fit
from circlepose.results import Failure
from circlepose.rings.matching import as_circle, find_families, other_heights
from circlepose.targets.target import Target

_SPACING_PX = 1.5
_PLACES = (60, 360)
_REACH_PX = 2.0
_REACH_SHARE = 0.03
"""How far the edge may be from its prediction, beside _REACH_PX: a share of the predicted semi-major axis."""
_APART_PX = 4.0
"""Nearer than this to the rim that predicts, or to one of a complete target, an edge is that rim's."""
_MOST_RIMS = 12
"""So many rims without a family, the most evident ones, predict others."""
_SAME_PX = 1.0
_LEAST_RIM = 0.2
_LEAST_PLACES = 14
_NEAR_PX = 0.5
"""Distance from the fitted rim within which an edge agrees with it."""
_SMOOTH_PX = 0.18
"""Largest rms distance of the edges on less than _LEAST_ROUGH of the rim: those of texture have 0.2 and more."""
_LEAST_ROUGH = 0.5
_STRETCH = 7
"""Edges count in stretches of so many neighbouring places that agree; texture and noise do not make them."""
_ROUNDS = 5
_EDGE_PX = 0.1
_LOOSE_SHARE = 0.02
"""Standard error of a predicted centre, a share of the radius: radii and heights are not known better."""
_FARTHEST = 3.0
"""Standard errors by which a centre may be off its prediction."""


@dataclass(frozen=True, slots=True, eq=False)
class _Prediction:
    """A circle of the target where a candidate pose of another puts it."""

    center: FloatArray
    normal: FloatArray
    radius: float


def with_second_rims(levels: Image, camera: Camera, rims: Sequence[Rim], target: Target) -> list[Rim]:
    """Return `rims`, the most evident first, and those found by prediction in the grey image `levels` (h, w).

    Nothing is sought when there are as many complete targets as asked for, nor where the other circle's place is
    not known (a coaxial target without its generatrix).
    """
    known = list(rims)
    families = find_families(known, camera, target)
    if (target.count is not None and len(families) >= target.count) or other_heights(1, target) is None:
        return known
    taken = {number for family in families for number in family.members}
    complete = [rims[number] for number in taken]
    single = [rim for number, rim in enumerate(rims) if number not in taken]
    for rim in single[:_MOST_RIMS]:
        for predictions in _predictions(rim, camera, target):
            found = [_found(levels, camera, prediction, [rim, *complete]) for prediction in predictions]
            seen = [each for each in found if each is not None]
            best = max(seen, key=lambda each: each.rim_used, default=None)
            if best is not None and not any(_same(best, other) for other in known):
                known.append(best)
    return known


def _same(first: Rim, second: Rim) -> bool:
    a, b = first.ellipse, second.ellipse
    apart = [*(a.center - b.center), a.semi_major - b.semi_major, a.semi_minor - b.semi_minor]
    return bool(np.max(np.abs(apart)) < _SAME_PX)


def _predictions(rim: Rim, camera: Camera, target: Target) -> Iterator[list[_Prediction]]:
    """Yield, for each circle that `rim` may be and each other one of the target, where that may be."""
    seen = SeenPoints.of(camera, rim.points)
    for own in range(len(target.radii_mm)):
        solutions = as_circle(rim, seen, target, own)
        if solutions is None:
            continue
        for which, radius in enumerate(target.radii_mm):
            heights = other_heights(max(own, which), target)
            if which != own and heights is not None:
                yield [
                    _Prediction(center + height * normal, normal, radius)
                    for center, normal in zip(solutions.centers, solutions.normals, strict=True)
                    for height in heights
                ]


def _found(levels: Image, camera: Camera, prediction: _Prediction, others: Sequence[Rim]) -> Rim | None:
    """Return the rim seen where `prediction` puts it, apart from those of `others`; None where too little is."""
    radius = prediction.radius
    if prediction.center[2] <= radius or prediction.center @ prediction.normal >= 0.0:
        return None
    factor = factor_from_circle(prediction.center, prediction.normal, radius)
    rough = rim_pixels(camera, factor, _PLACES[0])
    if not np.all(np.isfinite(rough)):
        return None
    perimeter = float(np.sum(np.linalg.norm(np.roll(rough, -1, axis=0) - rough, axis=1)))
    places = int(np.clip(perimeter / _SPACING_PX, *_PLACES))
    predicted = rim_pixels(camera, factor, places)[None]
    reach = max(_REACH_PX, _REACH_SHARE * perimeter / (2.0 * np.pi))
    edges = locate_edges(levels, predicted, contour_normals(predicted), np.array([reach]))
    seen = SeenPoints.of(camera, edges.points[0])
    # However far the rim is from its prediction, along it that changes little from place to place.
    steady = np.abs(np.diff(edges.offset_px[0], append=edges.offset_px[0, :1])) <= _NEAR_PX
    usable = _in_stretches(edges.valid[0] & np.all(np.isfinite(seen.rays), axis=-1) & steady)
    for rim in others:
        usable &= np.abs(rim_distance_px(rim.cone.factor, seen.rays, seen.jacobians)) > _APART_PX
    least = max(_LEAST_RIM * places, _LEAST_PLACES)
    if usable.sum() < least:
        return None
    center, agreeing = _centred(factor, radius, seen, usable, reach)
    moved = float(np.linalg.norm(center - prediction.center))
    if agreeing.sum() < least or moved > _FARTHEST * _LOOSE_SHARE * radius:
        return None
    factor = _moved(factor, center)
    used = seen[agreeing]
    fit = ConeFit(factor, rim_distance_px(factor, used.rays, used.jacobians))
    share = float(agreeing.mean())
    if fit.rms_px > _SMOOTH_PX and share < _LEAST_ROUGH:
        return None
    found = rim_from_fit(camera, fit, used.pixels, share, int(edges.polarity[0]))
    # Of an arc the errors of the axes grow faster than with the number of its edges.
    return None if isinstance(found, Failure) else replace(found, axis_error_px=found.axis_error_px / share)


def _centred(
    predicted: FloatArray, radius: float, seen: SeenPoints, usable: BoolArray, reach_px: float
) -> tuple[FloatArray, BoolArray]:
    """Return the centre (3,) that brings the predicted rim to the edges, and which edges then agree with it (n,).

    `predicted` (3, 3) is the factor of a circle of `radius`, whose third column is its centre.
    """
    start = predicted[:, 2]
    loose, step = _LOOSE_SHARE * radius, 1e-3 * radius

    def distances(center: FloatArray) -> FloatArray:
        return rim_distance_px(_moved(predicted, center), seen.rays, seen.jacobians)

    center = start
    for tolerance in np.geomspace(max(reach_px, _NEAR_PX), _NEAR_PX, _ROUNDS):
        distance = distances(center)
        slopes = np.stack([(distances(center + step * axis) - distance) / step for axis in np.eye(3)], axis=-1)
        weights = _in_stretches(usable & (np.abs(distance) <= tolerance)) / _EDGE_PX**2
        information = slopes.T @ (weights[:, None] * slopes) + np.eye(3) / loose**2
        pull = -slopes.T @ (weights * distance) - (center - start) / loose**2
        center = center + np.linalg.solve(information, pull)
    return center, _in_stretches(usable & (np.abs(distances(center)) <= _NEAR_PX))


def _moved(factor: FloatArray, center: FloatArray) -> FloatArray:
    """Return the factor (3, 3) of the same circle at another centre (3,)."""
    return np.concatenate([factor[:, :2], center[:, None]], axis=1)


def _in_stretches(which: BoolArray) -> BoolArray:
    """Keep of `which` (n,), around a closed contour, the stretches of _STRETCH and more."""
    shifted = np.stack([np.roll(which, -shift) for shift in range(_STRETCH)])
    whole = shifted.all(axis=0)
    return np.asarray(np.any([np.roll(whole, shift) for shift in range(_STRETCH)], axis=0))
