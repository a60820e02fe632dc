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

if TYPE_CHECKING:
    from circlepose.camera import Camera as Camera
    from circlepose.camera import CameraSigma as CameraSigma
    from circlepose.cone import ConeKind as ConeKind
    from circlepose.conic import Ellipse as Ellipse
    from circlepose.contour_pose import estimate_from_contour as estimate_from_contour
    from circlepose.errors import CircleposeError as CircleposeError
    from circlepose.files.camera_file import read_camera as read_camera
    from circlepose.files.target_file import read_target as read_target
    from circlepose.pipeline import estimate as estimate
    from circlepose.pose import Candidate as Candidate
    from circlepose.pose import CircleResult as CircleResult
    from circlepose.pose import CovarianceTerms as CovarianceTerms
    from circlepose.pose import Flag as Flag
    from circlepose.pose import ImageResult as ImageResult
    from circlepose.pose import Status as Status
    from circlepose.target import AxisIntervals as AxisIntervals
    from circlepose.target import Target as Target
    from circlepose.target_hints import DirectionHint as DirectionHint

__version__ = "0.1.0"

_HOME = {
    "AxisIntervals": "target",
    "Camera": "camera",
    "CameraSigma": "camera",
    "Candidate": "pose",
    "CircleResult": "pose",
    "CircleposeError": "errors",
    "ConeKind": "cone",
    "CovarianceTerms": "pose",
    "DirectionHint": "target_hints",
    "Ellipse": "conic",
    "Flag": "pose",
    "ImageResult": "pose",
    "Status": "pose",
    "Target": "target",
    "estimate": "pipeline",
    "estimate_from_contour": "contour_pose",
    "read_camera": "files.camera_file",
    "read_target": "files.target_file",
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
