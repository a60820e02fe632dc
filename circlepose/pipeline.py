"""One image through all stages: detection, measurement, poses, disambiguation, uncertainty."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, replace

from circlepose import _arguments
from circlepose._typing import Image
from circlepose.camera.camera import Camera
from circlepose.camera.image_size import size_mismatch
from circlepose.camera.plausibility import misfit
from circlepose.detection import EXTRACTIONS
from circlepose.detection.axis_intervals import axis_intervals
from circlepose.detection.contour import Contour, Rejection
from circlepose.disambiguation.options import DisambiguationOptions
from circlepose.disambiguation.settle import settled_by_hints
from circlepose.imaging.float_levels import without_gaps
from circlepose.imaging.gray import to_grey
from circlepose.measurement.intensity_fit import LevelFit, LevelFits, fit_levels
from circlepose.measurement.options import MeasurementOptions
from circlepose.measurement.poses import results_of_rims
from circlepose.measurement.rim import Rim
from circlepose.measurement.selection import measure_lone_circles, measure_rings
from circlepose.results import CircleResult, Failure, Flag, ImageResult, Status
from circlepose.rings.guided_search import with_hidden_rims
from circlepose.rings.matching import match_rings
from circlepose.rings.options import RingOptions
from circlepose.rings.results import find_ring_targets
from circlepose.solvers import METHODS, methods_for
from circlepose.targets.target import AxisIntervals, Target
from circlepose.uncertainty.systematic import with_all_terms


@dataclass(frozen=True, slots=True)
class EstimateOptions:
    """The tunable numbers of each stage: `options=` of `estimate`. The defaults suit all but odd images."""

    measurement: MeasurementOptions = field(default_factory=MeasurementOptions)
    """in it also those of the detection and of the fits to gray levels"""
    rings: RingOptions = field(default_factory=RingOptions)
    disambiguation: DisambiguationOptions = field(default_factory=DisambiguationOptions)

    def __post_init__(self) -> None:
        _arguments.instance_of(MeasurementOptions, "measurement", self.measurement, "MeasurementOptions(...)")
        _arguments.instance_of(RingOptions, "rings", self.rings, "RingOptions(...)")
        _arguments.instance_of(
            DisambiguationOptions, "disambiguation", self.disambiguation, "DisambiguationOptions(...)"
        )


ESTIMATE_OPTIONS = EstimateOptions()


@dataclass(frozen=True, slots=True, eq=False)
class Trace:
    """What the stages of one estimate handed on."""

    camera: Camera
    """the calibration for the size of the image"""
    levels: Image
    """(h, w) gray levels that were measured; NaN where a pixel has none"""
    contours: tuple[Contour, ...] = ()
    """those that detection kept, most evidence first"""
    starts: tuple[Rim, ...] = ()
    """the rims before their fit to the gray levels"""
    rims: tuple[Rim, ...] = ()
    """the same rims, from which the poses follow"""
    fits: tuple[LevelFit | None, ...] = ()
    """of each rim; None where its levels were not fitted, or it was fitted as a thin ellipse"""

    def number_of(self, circle: CircleResult) -> int | None:
        """Return the index of the rim that a result was solved from."""
        numbers = (number for number, rim in enumerate(self.rims) if rim.ellipse is circle.ellipse)
        return next(numbers, None)


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
    options: EstimateOptions = ESTIMATE_OPTIONS,
) -> ImageResult:
    """Find the targets in one image and estimate their poses.

    Parameters
    ----------
    image
        (h, w), (h, w, 3) BGR or (h, w, 4) BGRA pixels, 8 or 16 bit or floating, as decoded: not undistorted, not
        turned by EXIF. The gain and offset of floating levels do not count, and none of them is clipped. Pixels that
        are not finite (dead pixels) are left out.
    camera
        The calibration.
    target
        What to look for, and how many.
    method
        A name of `circlepose.solvers.METHODS`, or `all`. `fu-zhou` is for ring targets only; `all` leaves it out for
        lone circles.
    refine
        Measure the rim on the edges and gray levels along its prediction by the lens model. Without it the pose is
        that of the detected contour.
    extraction
        A name of `circlepose.detection.EXTRACTIONS`: connected edges, or region borders that coincide with edges.
    scale_calibration
        Accept an image of another size than the calibration's as resized, if its proportions are the same. Without
        it such an image gets the status `size_mismatch`, as does an image that no camera of these numbers can have
        taken (`circlepose.camera.plausibility`).
    force_calibration
        Measure although the calibration looks wrong. Then only a different size is refused, unless
        `scale_calibration` scales each axis to it.
    name
        The name under which the image is reported.
    options
        The tunable numbers of the stages.

    Returns
    -------
    The circles with both candidate poses each, centers in mm, camera frame; or the reason why there are none. An
    image that cannot be measured is a status, not an exception.

    Raises
    ------
    ArgumentError
        On misuse, naming the parameter: an array that is no image, a camera or target of another type, an unknown
        method, `fu-zhou` for a target of kind circle.
    """
    return estimate_with_trace(
        image,
        camera,
        target,
        method=method,
        refine=refine,
        extraction=extraction,
        scale_calibration=scale_calibration,
        force_calibration=force_calibration,
        name=name,
        options=options,
        keep_fits=False,
    )[0]


def estimate_with_trace(
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
    options: EstimateOptions = ESTIMATE_OPTIONS,
    keep_fits: bool = True,
) -> tuple[ImageResult, Trace]:
    """As `estimate`, with what the stages handed on.

    `keep_fits` keeps the pixels of each fit to the gray levels, some 100 kB a circle.
    """
    _arguments.instance_of(Camera, "camera", camera, _arguments.HOW_CAMERA)
    _arguments.instance_of(Target, "target", target, _arguments.HOW_TARGET)
    _arguments.one_of(("all", *METHODS), "method", method)
    _arguments.one_of(EXTRACTIONS, "extraction", extraction)
    _arguments.instance_of(EstimateOptions, "options", options, "circlepose.pipeline.EstimateOptions(...)")
    refine = _arguments.truth("refine", refine)
    force_calibration = _arguments.truth("force_calibration", force_calibration)
    scale_calibration = _arguments.truth("scale_calibration", scale_calibration)
    _arguments.text("name", name)
    methods = methods_for(target.kind, method)
    levels = to_grey(image)
    # Only the fit to the gray levels can do without pixels that have none.
    gray = without_gaps(levels)
    size = (int(gray.shape[1]), int(gray.shape[0]))
    unfit = _unfit(camera, size, scaled=scale_calibration, forced=force_calibration)
    if unfit is not None:
        return ImageResult(name, unfit.status, unfit.reason, image_size=size), Trace(camera, levels)
    if camera.image_size not in (None, size):
        camera = camera.scaled_to(size)
    intervals = axis_intervals(target, camera, size, options.measurement.detection)
    numbers = options.measurement
    of_rings = replace(options.rings, measurement=numbers)
    incomplete = ""
    if target.kind == "circle":
        measured = measure_lone_circles(
            gray,
            camera,
            target,
            intervals,
            extraction=extraction,
            refine=refine,
            # The other methods, and rings, use the edges themselves.
            are_starts=methods == ("chen-huang",),
            options=numbers,
        )
        starts, rejected = measured.rims, measured.rejected
        after = _fitted(levels, camera, starts, refine=refine, keep_fits=keep_fits, options=numbers)
        circles = results_of_rims(
            after.rims, camera, methods, target.radii_mm[0], range(len(starts)), "disc", options=numbers
        )
        circles = settled_by_hints(circles, target, options=options.disambiguation)
    else:
        # The polarity of a ring target is that of its largest circle.
        measured = measure_rings(gray, camera, intervals, extraction=extraction, refine=refine, options=numbers)
        matched = match_rings(measured.rims, camera, target, options=of_rings)
        starts = measured.rims
        if refine:
            matched = with_hidden_rims(gray, camera, matched, target, options=of_rings)
            starts = tuple(each.rim for each in matched.rims)
        after = _fitted(levels, camera, starts, refine=refine, keep_fits=keep_fits, options=numbers)
        found = find_ring_targets(after.rims, matched, camera, target, methods, placed=refine, options=of_rings)
        circles, incomplete = list(found.circles), found.incomplete
        rejected = measured.rejected + found.rejected
    circles = with_all_terms(circles, camera, target)
    result = _image_result(name, size, target, circles, rejected, incomplete, intervals)
    return result, Trace(camera, levels, measured.contours, starts, tuple(after.rims), tuple(after.fits))


def _fitted(
    levels: Image,
    camera: Camera,
    rims: tuple[Rim, ...],
    *,
    refine: bool,
    keep_fits: bool,
    options: MeasurementOptions,
) -> LevelFits:
    """Fit the rims to the gray levels where they are to be refined."""
    if not refine:
        return LevelFits(list(rims), [None] * len(rims))
    return fit_levels(levels, camera, rims, keep_fits=keep_fits, options=options)


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
    """Return which sizes were searched, where they follow from the depth range: a reason that is overlooked."""
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


def _unfit(camera: Camera, size: tuple[int, int], *, scaled: bool, forced: bool) -> Failure | None:
    """Return why `camera` cannot be used for an image of `size` (width, height) px; None where it can."""
    insist = "; to measure it all the same, set force_calibration"
    if camera.image_size is not None and not (scaled and forced):
        mismatch = size_mismatch(size, camera.image_size, scaled=scaled)
        if mismatch is not None:
            return Failure(Status.SIZE_MISMATCH, mismatch + (insist if scaled else ""))
    reason = None if forced else misfit(camera, size)
    return None if reason is None else Failure(Status.SIZE_MISMATCH, reason + insist)
