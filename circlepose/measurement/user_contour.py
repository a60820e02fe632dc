"""A contour that somebody else extracted -> the poses of its circle, or what is wrong with the contour."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeGuard

import numpy as np
from numpy.typing import ArrayLike

from circlepose import _arguments
from circlepose._typing import FloatArray, Image
from circlepose.camera.camera import Camera
from circlepose.detection.contour import Contour
from circlepose.errors import ArgumentError
from circlepose.fitting.cone_fit import fit_cone_to
from circlepose.fitting.direct import MINIMUM_POINTS
from circlepose.fitting.observations import Observations
from circlepose.fitting.segment_cone import fit_flat_cone, is_flat
from circlepose.imaging.float_levels import without_gaps
from circlepose.imaging.gray import to_grey
from circlepose.measurement.edge_fit import Rim, as_given, fit_rim, has_length, rim_from_fit, segment_from_fit
from circlepose.measurement.intensity_fit import refined
from circlepose.measurement.poses import circle_results
from circlepose.results import CircleResult, Status
from circlepose.solvers import CIRCLE_METHODS
from circlepose.targets.target import Target
from circlepose.uncertainty.systematic import with_all_terms

_EXPECTED = "the (n, 2) px of one contour, in order along the rim"
_FARTHEST_PX = 1e6
_SLIVER_PX = 2.0
"""Semi-minor axis up to which noise may be all the width that a contour has."""
_LEAST_WIDTH_PX = 0.5
"""Semi-minor axis, at least, from which a fit to the gray levels of a sliver starts."""
_BORDER_PX = 1.0
_BORDER_SHARE = 0.05
_MOST_CROSSING_CHECK = 400
"""Points to which a contour is thinned before its sides are tested for crossing, pair by pair."""


def estimate_from_contour(
    contour: ArrayLike, camera: Camera, radius_mm: float, *, method: str = "chen-huang", image: Image | None = None
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
        A name of `circlepose.solvers.CIRCLE_METHODS`.
    image
        The image that the contour is of, as `circlepose.estimate` takes it, of the calibration's size. With it the
        contour, within 2 px of the rim, is only the start: edges are placed again along the rim and the pose is
        fitted to the gray levels, with a covariance. Where these cannot be fitted, the flag is `edges_only`, and the
        pose that of the edges or of the contour, whichever scatters less.

    Returns
    -------
    As `circlepose.estimate` gives for a lone circle. How exact the points are follows from their scatter about the
    ellipse alone: the cone is right, or degenerate, where the axes differ by less than three standard errors, or the
    minor axis is less than three. On the exact contour of 16 points or more the pose is exact, also nearly frontal,
    but for rounding: within 1e-15/w of the distance, of an image with the axis ratio w. An image with w < 1e-10 is a
    segment. Its ends are points of the contour, so with n points the center is within 1 - cos(pi/n) of the distance.
    Of a segment, a circle seen edge-on, `chen-huang` and `chen-huang-contour` give two poses: one centre and opposite
    normals. What is wrong with a contour is a status:
    `too_few_points`, `points_coincide`, `self_crossing`, `touches_border` (the camera must know its image size),
    `no_pose`; `size_mismatch` for an image of another size than the calibration's.

    Raises
    ------
    ArgumentError
        On misuse: not (n, 2) finite numbers, a radius that is not positive, an unknown method, no image.
    """
    points = _points(contour)
    _arguments.instance_of(Camera, "camera", camera, _arguments.HOW_CAMERA)
    radius_mm = _arguments.length_mm("radius_mm", radius_mm, "a positive radius in mm (not a diameter)")
    _arguments.one_of(CIRCLE_METHODS, "method", method)
    measured = None if image is None else to_grey(image)
    failed = CircleResult(0, "disc", method, radius_mm, contour=points)
    mismatch = None if measured is None else _size_mismatch(measured, camera)
    if mismatch is not None:
        return replace(failed, status=Status.SIZE_MISMATCH, reason=mismatch)
    status = _what_is_wrong(points, camera)
    if status is not None:
        return replace(failed, status=status, reason=_REASON[status])
    rim = _rim(points, camera)
    if isinstance(rim, str):
        return replace(failed, status=Status.NO_POSE, reason=rim)
    # A segment comes back on itself, and rounding has it cross.
    if float(rim.cone.factor[:, 1] @ rim.cone.factor[:, 1]) > 0.0 and _crosses_itself(points):
        return replace(failed, status=Status.SELF_CROSSING, reason=_REASON[Status.SELF_CROSSING])
    if measured is None:
        return circle_results(rim, camera, (method,), radius_mm, 0, "disc")[0]
    results = circle_results(_on_levels(measured, camera, rim), camera, (method,), radius_mm, 0, "disc")
    return with_all_terms(results, camera, Target.circle(radius_mm))[0]


def _on_levels(measured: Image, camera: Camera, rim: Rim) -> Rim:
    """Return `rim` with edges placed along it again and fitted to the gray levels `measured` (h, w)."""
    ellipse = rim.ellipse
    if float(ellipse.semi_minor) < _LEAST_WIDTH_PX:
        ellipse = replace(ellipse, semi_minor=np.asarray(_LEAST_WIDTH_PX))
    # What detection would say of the edge is not known, and not used.
    contour = Contour(rim.points, ellipse, rim.polarity, 0.0, rim.rim_used, rim.cone.rms_px, 0.0, 1.0)
    placed = fit_rim(without_gaps(measured), camera, contour) or rim
    if placed.ellipse_covariance is None and float(placed.ellipse.semi_minor) < _LEAST_WIDTH_PX:
        # A segment has no sides, inside and outside, whose levels could be fitted.
        return replace(rim, is_edges_only=True)
    done = refined(measured, camera, [placed])[0]
    # Of edges alone, and of the contour itself, those are used that lie closer to a rim.
    is_closer = not done.is_edges_only or done.cone.rms_px < rim.cone.rms_px
    return done if is_closer else replace(rim, is_edges_only=True)


def _size_mismatch(measured: Image, camera: Camera) -> str | None:
    """Return why the camera is not to be used for an image (h, w), or None."""
    size = (int(measured.shape[1]), int(measured.shape[0]))
    if camera.image_size in (None, size):
        return None
    return "the image is {} x {} px, the calibration holds for {} x {}".format(*size, *camera.image_size)


def _points(contour: object) -> FloatArray:
    """Return `contour` as (n, 2) points; raises `ArgumentError`."""
    several = contour[0] if _is_pair(contour) and _are_contours(contour[0]) else contour
    if _are_contours(several):
        raise ArgumentError(
            f"contour: expected one contour, got {len(several)} as cv2.findContours returns them; give one of them, "
            "such as the longest: max(contours, key=len)."
        )
    points = _arguments.float_array("contour", contour, _EXPECTED)
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


def _rim(points: FloatArray, camera: Camera) -> Rim | str:
    """Return the rim that the contour is, a segment where it is as narrow as one, or why it is none."""
    seen = Observations.of(camera, points)
    fit = fit_cone_to(seen)
    rim = None if fit is None or is_flat(fit) else rim_from_fit(camera, fit, points)
    flat = fit_flat_cone(seen)
    if flat is not None and np.any(flat.factor[:, 1] != 0.0):
        return as_given(segment_from_fit(camera, flat, points))
    is_wide = flat is None and rim is not None and float(rim.ellipse.semi_minor) > _SLIVER_PX
    if rim is not None and (is_wide or has_length(rim)):
        return as_given(rim)
    if flat is not None:
        return as_given(segment_from_fit(camera, flat, points))
    if rim is not None:
        return "the contour is nearly a segment and its points do not settle how long it is"
    return "no ellipse fits the contour, and it is no segment either; or it lies outside the lens model"


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
    return None


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
