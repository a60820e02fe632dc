"""Center (mm) and unit normal of every circle of known radius, from one calibrated photograph.

    import circlepose

    camera = circlepose.read_camera("cam.yaml")
    target = circlepose.Target.circle(radius_mm=60.0)
    result = circlepose.estimate(circlepose.read_image("photo.png"), camera, target)
    for circle in result.circles:
        if circle.pose is not None:
            print(circle.pose.center, circle.pose.normal)

Names are loaded when first used, so that a program that needs only a few of them starts quickly.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from circlepose._version import __version__ as __version__

if TYPE_CHECKING:
    from circlepose.batch.files import measure as measure
    from circlepose.boards.world import relative_to_world as relative_to_world
    from circlepose.camera.camera import Camera as Camera
    from circlepose.camera.camera import CameraSigma as CameraSigma
    from circlepose.diagnostics.explain import Explanation as Explanation
    from circlepose.diagnostics.explain import explain as explain
    from circlepose.diagnostics.inspection import Inspection as Inspection
    from circlepose.diagnostics.inspection import inspect as inspect
    from circlepose.drawing.overlay import draw_overlay as draw_overlay
    from circlepose.errors import CircleposeError as CircleposeError
    from circlepose.errors import ImageError as ImageError
    from circlepose.geometry.cone import ConeKind as ConeKind
    from circlepose.geometry.ellipse import Ellipse as Ellipse
    from circlepose.geometry.measured_cone import Cone as Cone
    from circlepose.io.calibration.reader import read_camera as read_camera
    from circlepose.io.images.reader import read_image as read_image
    from circlepose.io.tables.frames import to_dataframe as to_dataframe
    from circlepose.io.tables.frames import to_rows as to_rows
    from circlepose.io.target_file import read_target as read_target
    from circlepose.measurement.user_contour import estimate_from_contour as estimate_from_contour
    from circlepose.measurement.user_ellipse import estimate_from_ellipse as estimate_from_ellipse
    from circlepose.pipeline import EstimateOptions as EstimateOptions
    from circlepose.pipeline import estimate as estimate
    from circlepose.results import Candidate as Candidate
    from circlepose.results import CircleResult as CircleResult
    from circlepose.results import CovarianceTerms as CovarianceTerms
    from circlepose.results import Flag as Flag
    from circlepose.results import ImageResult as ImageResult
    from circlepose.results import Plane as Plane
    from circlepose.results import SettledBy as SettledBy
    from circlepose.results import Status as Status
    from circlepose.targets.hints import DirectionHint as DirectionHint
    from circlepose.targets.target import AxisIntervals as AxisIntervals
    from circlepose.targets.target import Target as Target

_HOME = {
    "AxisIntervals": "targets.target",
    "Camera": "camera.camera",
    "CameraSigma": "camera.camera",
    "Candidate": "results",
    "CircleResult": "results",
    "CircleposeError": "errors",
    "Cone": "geometry.measured_cone",
    "ConeKind": "geometry.cone",
    "CovarianceTerms": "results",
    "DirectionHint": "targets.hints",
    "Ellipse": "geometry.ellipse",
    "EstimateOptions": "pipeline",
    "Explanation": "diagnostics.explain",
    "Flag": "results",
    "ImageError": "errors",
    "ImageResult": "results",
    "Inspection": "diagnostics.inspection",
    "Plane": "results",
    "SettledBy": "results",
    "Status": "results",
    "Target": "targets.target",
    "draw_overlay": "drawing.overlay",
    "estimate": "pipeline",
    "estimate_from_contour": "measurement.user_contour",
    "estimate_from_ellipse": "measurement.user_ellipse",
    "explain": "diagnostics.explain",
    "inspect": "diagnostics.inspection",
    "measure": "batch.files",
    "read_camera": "io.calibration.reader",
    "read_image": "io.images.reader",
    "read_target": "io.target_file",
    "relative_to_world": "boards.world",
    "to_dataframe": "io.tables.frames",
    "to_rows": "io.tables.frames",
}

__all__ = [  # noqa: PLE0604 - all are strings
    "__version__",
    *_HOME,
]


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module 'circlepose' has no attribute {name!r}")
    return getattr(import_module(f"circlepose.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return __all__
