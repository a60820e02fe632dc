"""Centre (mm) and unit normal of every circle of known radius, from one calibrated photograph.

    import cv2
    import circlepose

    camera = circlepose.read_camera("cam.yaml")
    target = circlepose.Target.circle(radius_mm=60.0)
    result = circlepose.estimate(cv2.imread("photo.png"), camera, target)
    for circle in result.circles:
        print(circle.candidates[circle.chosen].center, circle.candidates[circle.chosen].normal)

Names are loaded when first used, so that a program that needs only a few of them starts quickly.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from circlepose._version import __version__ as __version__

if TYPE_CHECKING:
    from circlepose.camera.camera import Camera as Camera
    from circlepose.camera.camera import CameraSigma as CameraSigma
    from circlepose.errors import CircleposeError as CircleposeError
    from circlepose.geometry.cone import ConeKind as ConeKind
    from circlepose.geometry.ellipse import Ellipse as Ellipse
    from circlepose.io.calibration.reader import read_camera as read_camera
    from circlepose.io.target_file import read_target as read_target
    from circlepose.measurement.user_contour import estimate_from_contour as estimate_from_contour
    from circlepose.pipeline import estimate as estimate
    from circlepose.results import Candidate as Candidate
    from circlepose.results import CircleResult as CircleResult
    from circlepose.results import CovarianceTerms as CovarianceTerms
    from circlepose.results import Flag as Flag
    from circlepose.results import ImageResult as ImageResult
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
    "ConeKind": "geometry.cone",
    "CovarianceTerms": "results",
    "DirectionHint": "targets.hints",
    "Ellipse": "geometry.ellipse",
    "Flag": "results",
    "ImageResult": "results",
    "Status": "results",
    "Target": "targets.target",
    "estimate": "pipeline",
    "estimate_from_contour": "measurement.user_contour",
    "read_camera": "io.calibration.reader",
    "read_target": "io.target_file",
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
