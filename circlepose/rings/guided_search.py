"""The search for circles of a ring target that detection missed, where a rim that was found predicts them.

The candidate poses of a rim, taken for one circle of the target, predict the images of the others: curves that depend
on little more than the candidate, and the side. So a fifth of such a rim is evidence, where a curve with five free
parameters needs half. A rim that is found keeps the normal of its prediction; only its center is fitted.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from circlepose._typing import BoolArray, FloatArray, Image
from circlepose.camera.camera import Camera
from circlepose.fitting.cone_fit import ConeFit
from circlepose.fitting.cone_projection import rim_pixels
from circlepose.fitting.observations import Observations, rim_distance_px
from circlepose.geometry.cone import factor_from_circle
from circlepose.imaging.subpixel_edges import contour_normals, locate_edges
from circlepose.measurement.rim import Rim, rim_from_fit
from circlepose.results import Failure, Status
from circlepose.rings.hypotheses import SolvedRim, as_circle, other_heights, solve_rims
from circlepose.rings.matching import MatchedRims, match_solved
from circlepose.rings.options import DEFAULT, RingOptions
from circlepose.targets.target import Target


@dataclass(frozen=True, slots=True, eq=False)
class _Prediction:
    """A circle of the target where a candidate pose of another puts it."""

    center: FloatArray
    normal: FloatArray
    radius: float


def with_hidden_rims(
    levels: Image, camera: Camera, matched: MatchedRims, target: Target, *, options: RingOptions = DEFAULT
) -> MatchedRims:
    """Add the rims that are found by prediction, and match again where there are any.

    Nothing is searched where as many targets are complete as are asked for, nor where the place of the other circle
    is not known (a coaxial target without its generatrix).

    Parameters
    ----------
    levels
        (h, w) gray image.
    camera
        The calibration for this image size.
    matched
        The rims that were detected, and their matches.
    target
        The ring target.
    options
        The numbers of ring targets.

    Returns
    -------
    The detected rims in their order, then those found; with their matches. The same value where none is found.
    """
    complete = matched.wanted(target)
    if len(complete) == target.count or other_heights(1, target) is None:
        return matched
    taken = {number for match in complete for number in match.members}
    rims = [each.rim for each in matched.rims]
    of_complete = [rims[number] for number in taken]
    single = [each for number, each in enumerate(matched.rims) if number not in taken]
    added: list[Rim] = []
    for each in single[: options.most_searching_rims]:
        for predictions in _predictions(each, target):
            searched = [
                _found(levels, camera, prediction, [each.rim, *of_complete], options) for prediction in predictions
            ]
            found = [rim for rim in searched if not isinstance(rim, Failure)]
            best = max(found, key=lambda rim: rim.rim_used, default=None)
            if best is not None and not any(_are_one(best, other, options) for other in (*rims, *added)):
                added.append(best)
    if not added:
        return matched
    return match_solved((*matched.rims, *solve_rims(added, camera, options)), target, options)


def _are_one(first: Rim, second: Rim, options: RingOptions) -> bool:
    a, b = first.ellipse, second.ellipse
    apart = [*(a.center - b.center), a.semi_major - b.semi_major, a.semi_minor - b.semi_minor]
    return bool(np.max(np.abs(apart)) < options.same_rim_px)


def _predictions(solved: SolvedRim, target: Target) -> Iterator[list[_Prediction]]:
    """Yield the predictions of each other circle of the target, for each circle that the rim may be."""
    for own in range(len(target.radii_mm)):
        solutions = as_circle(solved, target, own)
        if isinstance(solutions, Failure):
            continue
        for which, radius in enumerate(target.radii_mm):
            heights = other_heights(max(own, which), target)
            if which != own and heights is not None:
                yield [
                    _Prediction(center + height * normal, normal, radius)
                    for center, normal in zip(solutions.centers, solutions.normals, strict=True)
                    for height in heights
                ]


def _found(
    levels: Image, camera: Camera, prediction: _Prediction, others: Sequence[Rim], options: RingOptions
) -> Rim | Failure:
    """Return the rim seen where `prediction` puts it, apart from the rims `others`."""
    radius = prediction.radius
    if prediction.center[2] <= radius or prediction.center @ prediction.normal >= 0.0:
        return Failure(Status.NO_POSE, "the predicted circle does not face the camera")
    factor = factor_from_circle(prediction.center, prediction.normal, radius)
    rough = rim_pixels(camera, factor, options.search_samples[0])
    if not np.all(np.isfinite(rough)):
        return Failure(Status.NO_POSE, "the predicted rim lies outside the valid field of the lens model")
    perimeter = float(np.sum(np.linalg.norm(np.roll(rough, -1, axis=0) - rough, axis=1)))
    samples = int(np.clip(perimeter / options.search_spacing_px, *options.search_samples))
    predicted = rim_pixels(camera, factor, samples)[None]
    half_width = max(options.search_half_width_px, options.search_half_width_share * perimeter / (2.0 * np.pi))
    edges = locate_edges(levels, predicted, contour_normals(predicted), np.array([half_width]))
    seen = Observations.of(camera, edges.points[0])
    # However far the rim is from its prediction, along it that changes little from place to place.
    steady = np.abs(np.diff(edges.offset_px[0], append=edges.offset_px[0, :1])) <= options.agreeing_px
    usable = _in_runs(edges.valid[0] & np.all(np.isfinite(seen.rays), axis=-1) & steady, options)
    for rim in others:
        usable &= np.abs(rim_distance_px(rim.cone.factor, seen.rays, seen.jacobians)) > options.other_rim_px
    least = max(options.least_found_share * samples, options.least_found_samples)
    if usable.sum() < least:
        return Failure(Status.NO_POSE, "too few edges are near the predicted rim")
    center, agreeing = _centered(factor, radius, seen, usable, half_width, options)
    moved = float(np.linalg.norm(center - prediction.center))
    if agreeing.sum() < least or moved > options.farthest_sigmas * options.center_share * radius:
        return Failure(Status.NO_POSE, "the edges near the predicted rim do not agree on a circle")
    factor = _moved(factor, center)
    used = seen[agreeing]
    fit = ConeFit(factor, rim_distance_px(factor, used.rays, used.jacobians))
    share = float(agreeing.mean())
    if fit.rms_px > options.smooth_px and share < options.rough_share:
        return Failure(Status.NO_POSE, "the edges near the predicted rim are those of texture")
    found = rim_from_fit(camera, fit, used.pixels, share, int(edges.polarity[0]), options=options.measurement)
    if isinstance(found, Failure):
        return found
    # On an arc the errors of the axes grow faster than the number of edges falls.
    return replace(found, axis_error_px=found.axis_error_px / share)


def _centered(
    predicted: FloatArray,
    radius: float,
    seen: Observations,
    usable: BoolArray,
    half_width_px: float,
    options: RingOptions,
) -> tuple[FloatArray, BoolArray]:
    """Return the center (3,) that brings the predicted rim to the edges, and which edges then agree with it (n,).

    `predicted` (3, 3) is the factor of a circle of `radius`, whose third column is its center.
    """
    start, near = predicted[:, 2], options.agreeing_px
    sigma, step = options.center_share * radius, 1e-3 * radius

    def distances(center: FloatArray) -> FloatArray:
        return rim_distance_px(_moved(predicted, center), seen.rays, seen.jacobians)

    center = start
    for tolerance in np.geomspace(max(half_width_px, near), near, options.search_rounds):
        distance = distances(center)
        slopes = np.stack([(distances(center + step * axis) - distance) / step for axis in np.eye(3)], axis=-1)
        weights = _in_runs(usable & (np.abs(distance) <= tolerance), options) / options.search_edge_px**2
        information = slopes.T @ (weights[:, None] * slopes) + np.eye(3) / sigma**2
        pull = -slopes.T @ (weights * distance) - (center - start) / sigma**2
        center = center + np.linalg.solve(information, pull)
    return center, _in_runs(usable & (np.abs(distances(center)) <= near), options)


def _moved(factor: FloatArray, center: FloatArray) -> FloatArray:
    """Return the factor (3, 3) of the same circle at another center (3,)."""
    return np.concatenate([factor[:, :2], center[:, None]], axis=1)


def _in_runs(which: BoolArray, options: RingOptions) -> BoolArray:
    """Keep of `which` (n,), around a closed contour, the runs of at least `options.least_run`."""
    shifts = range(options.least_run)
    shifted = np.stack([np.roll(which, -shift) for shift in shifts])
    whole = shifted.all(axis=0)
    return np.asarray(np.any([np.roll(whole, shift) for shift in shifts], axis=0))
