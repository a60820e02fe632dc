"""`estimate`: one image through all stages."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

from circlepose import _arguments
from circlepose._typing import Image
from circlepose.boards.results import MeasuredBoards
from circlepose.camera.camera import Camera
from circlepose.camera.image_size import size_mismatch
from circlepose.camera.plausibility import misfit
from circlepose.detection import EXTRACTIONS
from circlepose.detection.axis_intervals import axis_intervals
from circlepose.detection.contour import Rejection
from circlepose.detection.reasons import why_none
from circlepose.imaging.color_mixes import color_mixes
from circlepose.imaging.gray import to_channels
from circlepose.measurement.poses import with_doubt
from circlepose.measurement.trace import Trace
from circlepose.pipeline.lone_circles import lone_circles
from circlepose.pipeline.options import ESTIMATE_OPTIONS, EstimateOptions
from circlepose.pipeline.world import check_world_board, circles_of_boards, with_world
from circlepose.results import CircleResult, Failure, Flag, ImageResult, Plane, Status
from circlepose.rings.views import ring_targets_in_views
from circlepose.solvers import METHODS, methods_for
from circlepose.targets.target import AxisIntervals, Target
from circlepose.uncertainty.systematic import with_all_terms


def estimate(
    image: Image,
    camera: Camera,
    target: Target,
    *,
    world_board: Target | None = None,
    method: str = "chen-huang",
    refine: bool = True,
    extraction: str = EXTRACTIONS[0],
    scale_calibration: bool = False,
    force_calibration: bool = False,
    min_score: float | None = None,
    max_residual_px: float | None = None,
    name: str = "",
    options: EstimateOptions = ESTIMATE_OPTIONS,
) -> ImageResult:
    """Find the targets in one image and estimate their poses.

    Parameters
    ----------
    image
        (h, w), (h, w, 3) BGR or (h, w, 4) BGRA pixels, 8 or 16 bit or floating, as decoded: not undistorted, not
        turned by EXIF. It is measured in gray; where colors or alpha have edges that gray does not show, also in the
        mix of the channels that shows them (`CircleResult.color_mix`). The gain and offset of floating levels do not
        count, and none of them is clipped. Pixels that are not finite (dead pixels) are left out.
    camera
        The calibration.
    target
        What to look for, and how many.
    world_board
        A target of kind board in the same image, of which `ImageResult.world` is the pose; `relative_to_world` takes
        it as the frame. Its circles are not taken for the target's. Without it in the image, or with more than one,
        the status is `no_world_board`.
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
    min_score
        Least score of a contour, 0 to 1, in place of the default (`DetectionOptions.least_score`): less takes
        doubtful ones, too, which are flagged `doubtful`; more only sure ones. Rims of ring targets need half of it.
    max_residual_px
        Leave out rims whose edges are farther than this from an ellipse as the lens shows it, rms px. By default they
        are reported and flagged `poor_fit`.
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
        method, `fu-zhou` for a target of kind circle, a world board of another kind, or one that is the target.
    """
    return estimate_with_trace(
        image,
        camera,
        target,
        world_board=world_board,
        method=method,
        refine=refine,
        extraction=extraction,
        scale_calibration=scale_calibration,
        force_calibration=force_calibration,
        min_score=min_score,
        max_residual_px=max_residual_px,
        name=name,
        options=options,
        keep_fits=False,
    )[0]


def estimate_with_trace(
    image: Image,
    camera: Camera,
    target: Target,
    *,
    world_board: Target | None = None,
    method: str = "chen-huang",
    refine: bool = True,
    extraction: str = EXTRACTIONS[0],
    scale_calibration: bool = False,
    force_calibration: bool = False,
    min_score: float | None = None,
    max_residual_px: float | None = None,
    name: str = "",
    options: EstimateOptions = ESTIMATE_OPTIONS,
    keep_fits: bool = True,
) -> tuple[ImageResult, Trace]:
    """As `estimate`, with what the stages handed on.

    `keep_fits` keeps the pixels of each fit to the gray levels, some 100 kB a circle.
    """
    _arguments.instance_of(Camera, "camera", camera, _arguments.HOW_CAMERA)
    _arguments.instance_of(Target, "target", target, _arguments.HOW_TARGET)
    check_world_board(world_board, target)
    _arguments.one_of(("all", *METHODS), "method", method)
    _arguments.one_of(EXTRACTIONS, "extraction", extraction)
    _arguments.instance_of(EstimateOptions, "options", options, "circlepose.pipeline.EstimateOptions(...)")
    refine = _arguments.truth("refine", refine)
    force_calibration = _arguments.truth("force_calibration", force_calibration)
    scale_calibration = _arguments.truth("scale_calibration", scale_calibration)
    min_score = _arguments.score("min_score", min_score)
    max_residual_px = _arguments.bound_px("max_residual_px", max_residual_px)
    _arguments.text("name", name)
    methods = methods_for(target.kind, method)
    channels = to_channels(image)
    size = (int(channels.shape[1]), int(channels.shape[0]))
    unfit = _unfit(camera, size, scaled=scale_calibration, forced=force_calibration)
    if unfit is not None:
        return ImageResult(name, unfit.status, unfit.reason, image_size=size), Trace(camera, channels)
    world = None
    if world_board is not None:
        world = estimate(
            image,
            camera,
            replace(world_board, count=None),
            refine=refine,
            extraction=extraction,
            scale_calibration=scale_calibration,
            force_calibration=force_calibration,
            options=options,
        )
    if camera.image_size not in (None, size):
        camera = camera.scaled_to(size)
    others = circles_of_boards(world, camera)
    intervals = axis_intervals(target, camera, size, options.measurement.detection)
    numbers = options.measurement.with_bounds(min_score, max_residual_px)
    views = (None, *color_mixes(channels, options.color_mixes))
    incomplete = ""
    boards: MeasuredBoards | None = None
    planes: tuple[Plane, ...] = ()
    own = replace(options, measurement=numbers)
    if target.kind in ("circle", "board"):
        measured = lone_circles(
            channels,
            views,
            camera,
            target,
            intervals,
            methods,
            extraction=extraction,
            refine=refine,
            keep_fits=keep_fits,
            others=others,
            options=own,
        )
        circles, boards, planes = measured.circles, measured.boards, measured.planes
        trace, rejected, remark = measured.trace, measured.rejected, measured.remark
    else:
        found, trace, remark = ring_targets_in_views(
            channels,
            views,
            camera,
            target,
            intervals,
            methods,
            extraction=extraction,
            refine=refine,
            keep_fits=keep_fits,
            others=others,
            numbers=numbers,
            options=options.rings,
        )
        circles, incomplete, rejected = list(found.circles), found.incomplete, found.rejected
    circles = [_with_mix(circle, trace) for circle in circles] if len(views) > 1 else circles
    if boards is None or not boards.boards:
        circles = with_all_terms(circles, camera, target)
    if min_score is not None:
        usual = options.measurement.detection
        circles = with_doubt(circles, usual.least_score * (1.0 if target.kind == "circle" else usual.ring_leniency))
    result = replace(_image_result(name, size, target, circles, rejected, incomplete, intervals), planes=planes)
    if boards is not None and circles:
        result = replace(result, status=boards.status, reason=boards.reason, boards=boards.boards)
    if remark:
        reason = "; ".join(each for each in (result.reason, remark) if each)
        result = replace(result, remark=remark, reason=reason if result.status is not Status.OK else "")
    return with_world(result, world), trace


def _with_mix(circle: CircleResult, trace: Trace) -> CircleResult:
    """Return a result with the mix in which its rim was measured."""
    number = trace.number_of(circle)
    mix = None if number is None else trace.mixes[number]
    return circle if mix is None else replace(circle, color_mix=mix.by_name)


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
        reason = why_none(rejected) + _sizes_of_depths(target, intervals)
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


def _unfit(camera: Camera, size: tuple[int, int], *, scaled: bool, forced: bool) -> Failure | None:
    """Return why `camera` cannot be used for an image of `size` (width, height) px; None where it can."""
    insist = "; to measure it all the same, set force_calibration"
    if camera.image_size is not None and not (scaled and forced):
        mismatch = size_mismatch(size, camera.image_size, scaled=scaled)
        if mismatch is not None:
            return Failure(Status.SIZE_MISMATCH, mismatch + (insist if scaled else ""))
    reason = None if forced else misfit(camera, size)
    return None if reason is None else Failure(Status.SIZE_MISMATCH, reason + insist)
