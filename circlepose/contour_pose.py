"""A contour that somebody else extracted -> the poses of its circle, or what is wrong with the contour."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeGuard

import numpy as np
from numpy.typing import ArrayLike

from circlepose import arguments
from circlepose._typing import FloatArray
from circlepose.camera import Camera
from circlepose.errors import ArgumentError
from circlepose.fitting.direct import MINIMUM_POINTS
from circlepose.fitting.viewing_cone import fit_cone
from circlepose.measure import rim_from_fit
from circlepose.pose import CircleResult, Status
from circlepose.solutions import circle_results
from circlepose.solvers import METHODS

_EXPECTED = "the (n, 2) px of one contour, in order along the rim"
_FARTHEST_PX = 1e6
_BORDER_PX = 1.0
_BORDER_SHARE = 0.05
_MOST_CROSSING_CHECK = 400
"""Points to which a contour is thinned before its sides are tested for crossing, pair by pair."""


def estimate_from_contour(
    contour: ArrayLike, camera: Camera, radius_mm: float, *, method: str = "chen-huang"
) -> CircleResult:
    """Estimate the pose of a circle of `radius_mm` from its contour in px of the raw image, closed, in order.

    Parameters
    ----------
    contour
        (n, 2) px, an array or a list of points; also (n, 1, 2), one contour of those that `cv2.findContours` returns.
    camera
        Its calibration.
    radius_mm
        Of the circle.
    method
        A name of `circlepose.solvers.METHODS`.

    Returns
    -------
    As `circlepose.estimate` gives for a lone circle. What is wrong with a contour is a status: `too_few_points`,
    `points_coincide`, `self_crossing`, `touches_border` (the camera must know its image size), `no_pose`.

    Raises
    ------
    ArgumentError
        On misuse: not (n, 2) finite numbers, a radius that is not positive, an unknown method.
    """
    points = _points(contour)
    arguments.instance_of(Camera, "camera", camera, arguments.HOW_CAMERA)
    radius_mm = arguments.length_mm("radius_mm", radius_mm, "a positive radius in mm (not a diameter)")
    arguments.one_of(METHODS, "method", method)
    status = _what_is_wrong(points, camera)
    if status is not None:
        return CircleResult(0, "disc", method, radius_mm, status=status, reason=_REASON[status], contour=points)
    fit = fit_cone(camera, points)
    rim = None if fit is None else rim_from_fit(camera, fit, points)
    if rim is None:
        reason = "no ellipse fits the contour: its points lie on a line or outside the lens model"
        return CircleResult(0, "disc", method, radius_mm, status=Status.NO_POSE, reason=reason, contour=points)
    return circle_results(rim, camera, (method,), radius_mm, 0, "disc")[0]


def _points(contour: object) -> FloatArray:
    """Return `contour` as (n, 2) points; raises `ArgumentError`."""
    several = contour[0] if _is_pair(contour) and _are_contours(contour[0]) else contour
    if _are_contours(several):
        raise ArgumentError(
            f"contour: expected one contour, got {len(several)} as cv2.findContours returns them; give one of them, "
            "such as the longest: max(contours, key=len)."
        )
    points = arguments.float_array("contour", contour, _EXPECTED)
    if points.ndim == 3 and points.shape[1:] == (1, 2):
        points = points[:, 0, :]
    if points.ndim != 2 or points.shape[1] != 2:
        raise ArgumentError(f"contour: expected {_EXPECTED}, got shape {points.shape}.")
    if not np.all(np.abs(points) <= _FARTHEST_PX):
        raise ArgumentError(
            f"contour: expected {_EXPECTED}, finite and within {_FARTHEST_PX:g} px; not all points are."
        )
    return points


def _is_pair(value: object) -> TypeGuard[tuple[object, object]]:
    return isinstance(value, tuple) and len(value) == 2


def _are_contours(value: object) -> TypeGuard[Sequence[object]]:
    """Whether `value` is a sequence of contours: arrays (n, 1, 2) or (n, 2) of more than one point."""
    if isinstance(value, np.ndarray):
        return value.ndim == 4 or (value.ndim == 1 and value.dtype.kind == "O" and _are_contours(list(value)))
    if not isinstance(value, list | tuple) or len(value) == 0:
        return False
    return all(
        isinstance(each, np.ndarray) and (each.ndim == 3 or (each.ndim == 2 and len(each) > 1)) for each in value
    )


_REASON = {
    Status.TOO_FEW_POINTS: f"an ellipse needs {MINIMUM_POINTS} points or more",
    Status.POINTS_COINCIDE: "all points of the contour are the same",
    Status.SELF_CROSSING: "the contour crosses itself; give its points in order along the rim",
    Status.TOUCHES_BORDER: "part of the contour is the image's border, not the circle's rim; leave that part out",
}


def _what_is_wrong(points: FloatArray, camera: Camera) -> Status | None:
    if len(points) < MINIMUM_POINTS:
        return Status.TOO_FEW_POINTS
    if float(np.ptp(points, axis=0).max()) == 0.0:
        return Status.POINTS_COINCIDE
    if camera.image_size is not None and _on_border(points, camera.image_size) > _BORDER_SHARE:
        return Status.TOUCHES_BORDER
    return Status.SELF_CROSSING if _crosses_itself(points) else None


def _on_border(points: FloatArray, image_size: tuple[int, int]) -> float:
    """Return the share of the contour that runs along the image's border."""
    last = np.array(image_size) - 1.0
    return float(np.mean(np.any((points < _BORDER_PX) | (points > last - _BORDER_PX), axis=1)))


def _crosses_itself(points: FloatArray) -> bool:
    """Tell whether two sides of the closed polygon (n, 2) cross properly, away from their common ends."""
    step = -(-len(points) // _MOST_CROSSING_CHECK)
    start = points[::step]
    side = np.roll(start, -1, axis=0) - start
    offset = start[None, :, :] - start[:, None, :]

    def cross(a: FloatArray, b: FloatArray) -> FloatArray:
        return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])

    area = cross(side[:, None, :], side[None, :, :])
    # Parallel sides do not cross, and one that turns back along a line is no loop.
    length = np.linalg.norm(side, axis=1)
    area = np.where(np.abs(area) > 1e-9 * length[:, None] * length[None, :], area, np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        along_first = cross(offset, side[None, :, :]) / area
        along_second = cross(offset, side[:, None, :]) / area
    inner = (along_first > 1e-9) & (along_first < 1.0 - 1e-9) & (along_second > 1e-9) & (along_second < 1.0 - 1e-9)
    return bool(np.any(inner))
