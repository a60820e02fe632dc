"""`circlepose plan` at work: camera, target and views -> predictions -> a sheet, and the exit code."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace

from circlepose.camera.camera import Camera, CameraSigma
from circlepose.errors import CalibrationError, TargetError, UsageError
from circlepose.io.calibration.reader import read_camera_file
from circlepose.io.output_conflicts import Outputs, refuse_one_place
from circlepose.io.target_file import read_target
from circlepose.planning.predict import Planned, predict
from circlepose.planning.search import Wanted, farthest, place_px, smallest, steps
from circlepose.planning.views import Look, View
from circlepose.targets.target import Target
from circlepose_cli.console.following import followed
from circlepose_cli.options.plan import PlanRequest, Sought
from circlepose_cli.output.destination import output_place
from circlepose_cli.output.sheets import write_sheet
from circlepose_cli.reports.plan import plan_sheet

USUAL_TILTS_DEG = (15.0, 60.0)
LARGEST_FACTOR = 100.0
"""By which a target is made smaller or larger in the search for a radius."""
NONE_AS_WANTED = 4


def run(request: PlanRequest) -> int:
    """Predict, print, and return the exit code."""
    camera, target = _camera(request), _target(request)
    look = _look(request)
    wanted = Wanted(request.sigma_mm, request.sigma_deg)
    is_search = request.sigma_mm is not None or request.sigma_deg is not None
    if request.find is not None and not is_search:
        raise UsageError("--find: needs the wanted accuracy, --sigma-mm or --sigma-deg.")
    if not request.distance_mm[0] > 0.0:
        raise UsageError("--distance-mm: expected distances above 0.")
    tilts = request.tilt_deg or USUAL_TILTS_DEG
    if tilts[1] >= 90.0:
        raise UsageError(
            f"--tilt-deg: expected angles below 90, got {tilts[1]:g}; at 90 a circle is seen from its edge."
        )
    _check_outputs(request)
    places = request.place or ("middle",)
    asked = [(place, tilt) for place in places for tilt in steps(*tilts, request.steps)]
    distances = steps(*request.distance_mm, request.steps, are_ratios=True)
    sought = request.find or Sought.DISTANCE

    def planned() -> Iterator[Planned]:
        for place, tilt in asked:
            at = place_px(camera, place)
            if is_search and sought is Sought.DISTANCE:
                view = View(request.distance_mm[0], tilt, at)
                found = farthest(camera, target, view, request.distance_mm, wanted, look)
                yield Planned(place, tilt, target, found)
                continue
            for distance in distances:
                view = View(distance, tilt, at)
                if is_search:
                    both = smallest(camera, target, view, (1.0 / LARGEST_FACTOR, LARGEST_FACTOR), wanted, look)
                    yield Planned(place, tilt, both[0] if both else target, both[1] if both else None, distance)
                else:
                    yield Planned(place, tilt, target, predict(camera, target, view, look), distance)

    number = len(asked) * (1 if is_search and sought is Sought.DISTANCE else len(distances))
    rows = tuple(followed(planned(), number, "predicting"))
    if request.plot is not None:
        from circlepose.reporting.plan_plot import plot_plan  # noqa: PLC0415 - needs matplotlib

        plot_plan(rows, request.plot, overwrite=request.overwrite)
    sheet = plan_sheet(rows, camera, target, look, (sought, wanted) if is_search else None)
    write_sheet(sheet, request.output_format, request.output, overwrite=request.overwrite)
    if is_search and not any(row.prediction for row in rows):
        print("circlepose: no view is as accurate as wanted.", file=sys.stderr)
        return NONE_AS_WANTED
    return 0


def _camera(request: PlanRequest) -> Camera:
    lens = (request.focal_mm, request.pixel_um, request.image_size)
    if request.calib is not None:
        if request.focal_mm is not None or request.pixel_um is not None:
            raise UsageError("--calib, --focal-mm, --pixel-um: give the file, or focal length and pixel size.")
        camera = read_camera_file(request.calib, request.camera_name).camera
        if request.image_size is not None and camera.image_size not in (None, request.image_size):
            raise UsageError("--image-size: the calibration states another one; leave the option out.")
        camera = replace(camera, image_size=camera.image_size or request.image_size)
        if camera.image_size is None:
            raise UsageError(f"{request.calib}: states no image size; give --image-size WxH.")
    elif request.camera_name is not None:
        raise UsageError(
            "--camera-name: names a camera of a calibration file; give it with --calib, or leave it out."
        )
    elif None in lens:
        raise UsageError("camera: give --calib FILE, or all of --focal-mm, --pixel-um and --image-size.")
    else:
        camera = _simple_camera(*lens)  # type: ignore[arg-type]
    if request.camera_sigma is None:
        return camera
    try:
        return replace(camera, sigma=CameraSigma(*request.camera_sigma))
    except CalibrationError as error:
        raise UsageError(f"--camera-sigma: {error}") from None


def _simple_camera(focal_mm: float, pixel_um: float, image_size: tuple[int, int]) -> Camera:
    """Return a camera without distortion whose principal point is the middle of its image."""
    for option, value in (("--focal-mm", focal_mm), ("--pixel-um", pixel_um)):
        if not 0.0 < value < float("inf"):
            raise UsageError(f"{option}: expected a positive number, got {value:g}.")
    focal_px = 1000.0 * focal_mm / pixel_um
    width, height = image_size
    matrix = [[focal_px, 0.0, 0.5 * (width - 1)], [0.0, focal_px, 0.5 * (height - 1)], [0.0, 0.0, 1.0]]
    try:
        return Camera.create(matrix, (), image_size)
    except CalibrationError as error:
        raise UsageError(f"--focal-mm, --pixel-um, --image-size: {error}") from None


def _target(request: PlanRequest) -> Target:
    if (request.target_file is None) == (request.radius_mm is None):
        raise UsageError("--target, --radius-mm: give one of them.")
    try:
        target = read_target(request.target_file) if request.target_file else Target.circle(request.radius_mm or 0.0)
        if request.radius_sigma_mm is not None:
            target = replace(target, radius_sigma_mm=request.radius_sigma_mm)
    except TargetError as error:
        keys = ("radius_mm", "radius_sigma_mm")
        text = str(error)
        for key in keys:
            text = text.replace(f"{key}:", f"--{key.replace('_', '-')}:")
        raise UsageError(text) from None
    return target


def _look(request: PlanRequest) -> Look:
    try:
        return Look(request.noise, request.blur_px, request.contrast)
    except UsageError as error:
        raise UsageError(f"--{str(error).replace('blur_px:', 'blur-px:')}") from None


def _check_outputs(request: PlanRequest) -> None:
    """Raise `UsageError` where an output would be written over an input or the other one, or cannot be made."""
    output = output_place(request.output)
    refuse_one_place([("--plot", request.plot), ("-o", output)])
    outputs = Outputs([output, request.plot])
    outputs.refuse(request.calib, "the calibration")
    outputs.refuse(request.target_file, "the target")
    if request.plot is not None:
        from circlepose.reporting.study_plots import check_plot  # noqa: PLC0415 - needs matplotlib

        check_plot(request.plot, overwrite=request.overwrite)
