"""One image through all stages: extraction, fitting, solving, disambiguation."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import replace

from circlepose import _arguments
from circlepose._typing import Image
from circlepose.camera.camera import Camera
from circlepose.camera.image_size import size_mismatch
from circlepose.camera.plausibility import misfit
from circlepose.detection import EXTRACTIONS
from circlepose.detection.axis_intervals import axis_intervals
from circlepose.detection.contour import Contour, Rejection
from circlepose.detection.detect import find_contours
from circlepose.disambiguation.settle import settled_by_hints
from circlepose.imaging.float_levels import without_gaps
from circlepose.imaging.gray import to_grey
from circlepose.measurement.edge_fit import Rim, fit_rims
from circlepose.measurement.intensity_fit import refined
from circlepose.measurement.poses import results_of_rims
from circlepose.results import CircleResult, Failure, Flag, ImageResult, Status
from circlepose.rings.guided_search import with_hidden_rims
from circlepose.rings.matching import match_rings
from circlepose.rings.results import find_ring_targets
from circlepose.solvers import METHODS, methods_for
from circlepose.solvers.registry import solve
from circlepose.targets.target import AxisIntervals, Target
from circlepose.uncertainty.systematic import with_all_terms

_EVERY_ONE = 1_000_000


def estimate(
    image: Image,
    camera: Camera,
    target: Target,
    *,
    method: str = "chen-huang",
    refine: bool = True,
    extraction: str = EXTRACTIONS[0],
    scale_calibration: bool = False,
    force_calibration: bool = False,
    name: str = "",
) -> ImageResult:
    """Find the targets in one image and estimate their poses.

    Parameters
    ----------
    image
        (h, w), (h, w, 3) BGR or (h, w, 4) BGRA pixels, 8 or 16 bit or floating, as decoded: not undistorted,
        not turned by EXIF. Of floating levels neither gain nor offset counts, and none is clipped; pixels that are
        not finite, dead ones, are left out.
    camera
        Its calibration. An image of another size than the calibration's gets the status `size_mismatch`
        unless `scale_calibration` says that it was resized, which has to show in its proportions. The same status
        has an image that no camera of these numbers can have taken; see `circlepose.camera.plausibility`.
    scale_calibration
        Scale the calibration to an image of another size, which must have the same proportions.
    force_calibration
        Measure with the calibration although it looks wrong: only a size that differs is refused then, unless
        `scale_calibration` scales each axis to it.
    target
        What to look for, and how many.
    method
        A name of `circlepose.solvers.METHODS`, or `all`. `fu-zhou` is for ring targets only: `all` leaves it out for
        lone circles.
    refine
        Place the edges anew along the rim that the lens model predicts. Without it the pose is that of the
        extracted contour.
    extraction
        A name of `circlepose.detection.EXTRACTIONS`: connected edges, or region borders that coincide with edges.
    name
        Under which the image is reported.

    Returns
    -------
    The circles with both candidate poses each, in mm, in the camera frame; or the reason why there are none. An
    image that cannot be measured is a status, not an exception.

    Raises
    ------
    ArgumentError
        On misuse, naming the parameter: an array that is no image, a camera or target of another type, an unknown
        method, `fu-zhou` for a target of kind circle.
    """
    _arguments.instance_of(Camera, "camera", camera, _arguments.HOW_CAMERA)
    _arguments.instance_of(Target, "target", target, _arguments.HOW_TARGET)
    _arguments.one_of(("all", *METHODS), "method", method)
    _arguments.one_of(EXTRACTIONS, "extraction", extraction)
    refine = _arguments.truth("refine", refine)
    scale_calibration = _arguments.truth("scale_calibration", scale_calibration)
    _arguments.text("name", name)
    methods = methods_for(target.kind, method)
    measured = to_grey(image)
    # Only the fit to the levels can do without pixels that have none.
    grey = without_gaps(measured)
    size = (int(grey.shape[1]), int(grey.shape[0]))
    unfit = _unfit(camera, size, scaled=scale_calibration, forced=force_calibration)
    if unfit is not None:
        return ImageResult(name, Status.SIZE_MISMATCH, unfit, image_size=size)
    if camera.image_size not in (None, size):
        camera = camera.scaled_to(size)
    intervals = axis_intervals(target, camera, size)
    lone = target.kind == "circle"
    incomplete = ""
    if lone:
        chosen, rejected = _sought_rims(
            # The other methods, and rings, go by the edges themselves.
            grey,
            camera,
            target,
            intervals,
            refine,
            extraction,
            are_starts=methods == ("chen-huang",),
        )
        if refine:
            chosen = refined(measured, camera, chosen)
        circles = results_of_rims(chosen, camera, methods, target.radii_mm[0], range(len(chosen)), "disc")
        circles = settled_by_hints(circles, target)
    else:
        # Of a ring target the polarity is the largest circle's.
        found = find_contours(grey, intervals, "any", keep_concentric=True, extraction=extraction)
        rejected = Counter(found.rejected)
        fits = fit_rims(grey, camera, found.contours, refine=refine)
        all_rims = list(_measured(zip(found.contours, fits, strict=True), rejected))
        matched = match_rings(all_rims, camera, target)
        if refine:
            matched = with_hidden_rims(grey, camera, matched, target)
            all_rims = refined(measured, camera, [each.rim for each in matched.rims])
        found_targets = find_ring_targets(all_rims, matched, camera, target, methods, placed=refine)
        circles, incomplete = list(found_targets.circles), found_targets.incomplete
        rejected = rejected + found_targets.rejected
    circles = with_all_terms(circles, camera, target)
    return _image_result(name, size, target, circles, rejected, incomplete, intervals)


def _sought_rims(
    grey: Image,
    camera: Camera,
    target: Target,
    intervals: AxisIntervals,
    refine: bool,
    extraction: str,
    *,
    are_starts: bool,
) -> tuple[list[Rim], Counter[Rejection]]:
    """Find the rims of the circles asked for, and why other contours are none of them.

    The search ends with as many contours as are asked for. Where some of these turn out not to be the target's, it
    goes on to all there are.
    """
    enough = target.count
    while True:
        found = find_contours(grey, intervals, target.polarity, enough=enough, extraction=extraction)
        rejected = Counter(found.rejected)
        remaining = iter(found.contours)
        fits = fit_rims(grey, camera, found.contours, refine=refine, are_starts=are_starts)
        taken = _lone_rims(_measured(zip(remaining, fits, strict=True), rejected), camera, target, rejected)
        if found.is_complete or target.count is None or len(taken) >= target.count:
            rejected[Rejection.BEYOND_COUNT] += sum(1 for _ in remaining)
            return taken, rejected
        enough = _EVERY_ONE


def _measured(fits: Iterable[tuple[Contour, Rim | None]], rejected: Counter[Rejection]) -> Iterator[Rim]:
    """Return the rims of contours that have one, as they are asked for, the most evident first."""
    for contour, rim in fits:
        if rim is None:
            rejected[Rejection.NO_POSE] += 1
        else:
            yield replace(rim, score=contour.score)


def _lone_rims(rims: Iterator[Rim], camera: Camera, target: Target, rejected: Counter[Rejection]) -> list[Rim]:
    """Take the rims of as many circles as the target asks for, within its depth range."""
    taken: list[Rim] = []
    while target.count is None or len(taken) < target.count:
        rim = next(rims, None)
        if rim is None:
            break
        if _in_depth_range(rim, camera, target):
            taken.append(rim)
        else:
            rejected[Rejection.DEPTH] += 1
    return taken


def _in_depth_range(rim: Rim, camera: Camera, target: Target) -> bool:
    if target.depth_range_mm is None:
        return True
    nearest, farthest = target.depth_range_mm
    solutions = solve("chen-huang", rim.cone.factor, camera.rays(rim.points), target.radii_mm[0])
    return not isinstance(solutions, Failure) and any(nearest <= z <= farthest for z in solutions.centers[:, 2])


def _image_result(
    name: str,
    size: tuple[int, int],
    target: Target,
    circles: list[CircleResult],
    rejected: Counter[Rejection],
    incomplete: str,
    intervals: AxisIntervals,
) -> ImageResult:
    complete = {c.instance for c in circles if Flag.LONE_CIRCLE not in c.flags}
    counts = {str(reason): number for reason, number in sorted(rejected.items()) if number}
    status, reason = Status.OK, ""
    if not circles:
        status = Status.NO_CIRCLE
        reason = _why_none(rejected) + _sizes_of_depths(target, intervals)
    elif not complete:
        status = Status.TOO_FEW_CIRCLES
        reason = f"no complete target: one circle alone was measured, as the {circles[0].circle} one{incomplete}"
    elif target.count is not None and len(complete) < target.count:
        status = Status.TOO_FEW_CIRCLES
        reason = f"{len(complete)} of {target.count} found"
    return ImageResult(name, status, reason, tuple(circles), size, counts)


def _sizes_of_depths(target: Target, intervals: AxisIntervals) -> str:
    """Return which sizes were looked for, where they follow from the depth range: a reason that is overlooked."""
    given = target.axis_intervals is not None and target.axis_intervals.major_px is not None
    if target.depth_range_mm is None or given or intervals.major_px is None:
        return ""
    near, far = target.depth_range_mm
    low, high = intervals.major_px
    return (
        f"; depth_range_mm {near:g} to {far:g} means major axes of {low:.0f} to {high:.0f} px, no others were taken"
    )


def _why_none(rejected: Counter[Rejection]) -> str:
    """Name the reason that stopped the most promising contours: the later stages first."""
    late = [Rejection.DEPTH, Rejection.NO_POSE, Rejection.POLARITY, Rejection.NOT_IN_TARGET, Rejection.MAJOR_AXIS]
    for reason in (*late, Rejection.MINOR_AXIS, Rejection.TOO_LITTLE_RIM, Rejection.NOT_ELLIPTICAL):
        if rejected[reason]:
            return f"no contour is the target's image; {rejected[reason]} came close: {reason}"
    return "no contour is the target's image"


def _unfit(camera: Camera, size: tuple[int, int], *, scaled: bool, forced: bool) -> str | None:
    """Return why `camera` is not to be used for an image of `size`, or None."""
    insist = "; to measure it all the same, set force_calibration"
    if camera.image_size is not None and not (scaled and forced):
        mismatch = size_mismatch(size, camera.image_size, scaled=scaled)
        if mismatch is not None:
            return mismatch + (insist if scaled else "")
    reason = None if forced else misfit(camera, size)
    return None if reason is None else reason + insist
