"""A contour that the caller extracted -> the poses of its circle, or what is wrong with the contour."""

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
from circlepose.measurement.edge_fit import fit_rims
from circlepose.measurement.intensity_fit import refined
from circlepose.measurement.options import DEFAULT, MeasurementOptions
from circlepose.measurement.poses import circle_results
from circlepose.measurement.rim import EdgeRim, Rim, as_given, determines_length, rim_from_fit, segment_from_fit
from circlepose.results import CircleResult, Failure, Status
from circlepose.solvers import CIRCLE_METHODS
from circlepose.targets.target import Target
from circlepose.uncertainty.systematic import with_all_terms

_EXPECTED = "the (n, 2) px of one contour, in order along the rim"
_FARTHEST_PX = 1e6
_MOST_CROSSING_CHECK = 400
"""Points to which a contour is thinned before its sides are tested for crossing, pair by pair."""
_NO_SIDES = Failure(Status.NO_POSE, "a segment has no sides whose levels could be fitted")


def estimate_from_contour(
    contour: ArrayLike,
    camera: Camera,
    radius_mm: float,
    *,
    method: str = "chen-huang",
    image: Image | None = None,
    options: MeasurementOptions = DEFAULT,
) -> CircleResult:
    """Estimate the pose of a circle from the contour of its rim in the raw image, closed and in order.

    Parameters
    ----------
    contour
        (n, 2) px, an array or a list of points; also (n, 1, 2), one contour of those that `cv2.findContours` returns.
    camera
        The calibration.
    radius_mm
        Radius of the circle, mm.
    method
        A name of `circlepose.solvers.CIRCLE_METHODS`.
    image
        The image that the contour is of, as `circlepose.estimate` takes it, of the calibration's size. With it the
        contour, within 2 px of the rim, is only the start: edges are placed again along the rim and the pose is
        fitted to the gray levels, with a covariance. Where these cannot be fitted, the flag is `edges_only`, and the
        pose that of the edges or of the contour, whichever scatters less.
    options
        The numbers of the measurement.

    Returns
    -------
    The result for a lone circle, as `circlepose.estimate` gives it: centers in mm, camera frame.

    How exact the points are follows from their scatter about the ellipse alone: the cone is right where the axes
    differ by less than three standard errors, and degenerate where the minor axis is less than three. On the exact
    contour of 16 points or more the pose is exact, also nearly frontal, but for rounding: within 1e-15/w of the
    distance, for an image with the axis ratio w. An image with w < 1e-10 is a segment. Its ends are points of the
    contour, so with n points the center is within 1 - cos(pi/n) of the distance. A segment, a circle seen edge-on,
    has two poses by `chen-huang` and `chen-huang-contour`: one center and opposite normals.

    What is wrong with a contour is a status: `too_few_points`, `points_coincide`, `self_crossing`, `touches_border`
    (if the camera has an image size), `no_pose`; `size_mismatch` for an image of another size than the calibration's.

    Raises
    ------
    ArgumentError
        On misuse: not (n, 2) finite numbers, a radius that is not positive, an unknown method, no image.
    """
    points = _points(contour)
    _arguments.instance_of(Camera, "camera", camera, _arguments.HOW_CAMERA)
    radius_mm = _arguments.length_mm("radius_mm", radius_mm, "a positive radius in mm (not a diameter)")
    _arguments.one_of(CIRCLE_METHODS, "method", method)
    _arguments.instance_of(MeasurementOptions, "options", options, "MeasurementOptions(...)")
    levels = None if image is None else to_grey(image)
    rim = _size_mismatch(levels, camera) or _rim_of_contour(points, camera, options)
    if isinstance(rim, Failure):
        return CircleResult(0, "disc", method, radius_mm, contour=points, status=rim.status, reason=rim.reason)
    if levels is None:
        return circle_results(rim, camera, (method,), radius_mm, 0, "disc", options=options)[0]
    on_levels = _on_levels(levels, camera, rim, options)
    results = circle_results(on_levels, camera, (method,), radius_mm, 0, "disc", options=options)
    return with_all_terms(results, camera, Target.circle(radius_mm))[0]


def _on_levels(levels: Image, camera: Camera, rim: EdgeRim, options: MeasurementOptions) -> Rim:
    """Return `rim` with edges located along it anew and fitted to the gray levels (h, w)."""
    ellipse = rim.ellipse
    if float(ellipse.semi_minor) < options.least_start_px:
        ellipse = replace(ellipse, semi_minor=np.asarray(options.least_start_px))
    # What detection would say of the edge is not known, and not used.
    contour = Contour(rim.points, ellipse, rim.polarity, 0.0, rim.rim_used, rim.cone.rms_px, 0.0, 1.0)
    found = next(iter(fit_rims(without_gaps(levels), camera, [contour], options=options)))
    placed = rim if isinstance(found, Failure) else replace(found, contour=None)
    if isinstance(placed, EdgeRim) and float(placed.ellipse.semi_minor) < options.least_start_px:
        return replace(rim, level_fit=_NO_SIDES)
    done = refined(levels, camera, [placed], options=options)[0]
    # Of edges alone, and of the contour itself, those are used that lie closer to a rim.
    if isinstance(done, EdgeRim) and done.cone.rms_px >= rim.cone.rms_px:
        return replace(rim, level_fit=done.level_fit)
    return done


def _size_mismatch(levels: Image | None, camera: Camera) -> Failure | None:
    """Return why the camera does not hold for an image (h, w)."""
    if levels is None:
        return None
    size = (int(levels.shape[1]), int(levels.shape[0]))
    if camera.image_size in (None, size):
        return None
    reason = "the image is {} x {} px, the calibration holds for {} x {}".format(*size, *camera.image_size)
    return Failure(Status.SIZE_MISMATCH, reason)


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


def _rim_of_contour(points: FloatArray, camera: Camera, options: MeasurementOptions) -> EdgeRim | Failure:
    """Return the rim of a contour (n, 2), or what is wrong with the contour."""
    if len(points) < MINIMUM_POINTS:
        return Failure(Status.TOO_FEW_POINTS, f"an ellipse needs {MINIMUM_POINTS} points or more")
    if float(np.ptp(points, axis=0).max()) == 0.0:
        return Failure(Status.POINTS_COINCIDE, "all points of the contour are the same")
    size = camera.image_size
    if size is not None and _border_share(points, size, options.border_px) > options.worst_border_share:
        return Failure(
            Status.TOUCHES_BORDER,
            "part of the contour is the image's border, not the circle's rim; leave that part out",
        )
    rim = _fitted_rim(points, camera, options)
    # A segment comes back on itself, and rounding makes it cross.
    if isinstance(rim, EdgeRim) and _has_width(rim) and _crosses_itself(points):
        return Failure(Status.SELF_CROSSING, "the contour crosses itself; give its points in order along the rim")
    return rim


def _fitted_rim(points: FloatArray, camera: Camera, options: MeasurementOptions) -> EdgeRim | Failure:
    """Fit an ellipse to a contour (n, 2), or a segment where the contour is as narrow as one."""
    nothing = Failure(
        Status.NO_POSE, "no ellipse fits the contour, and it is no segment either; or it lies outside the lens model"
    )
    seen = Observations.of(camera, points)
    fit = fit_cone_to(seen)
    is_ellipse = fit is not None and not is_flat(fit)
    rim = rim_from_fit(camera, fit, points, options=options) if fit is not None and is_ellipse else nothing
    flat = fit_flat_cone(seen)
    if flat is not None and np.any(flat.factor[:, 1] != 0.0):
        return as_given(segment_from_fit(camera, flat, points, options=options))
    if isinstance(rim, EdgeRim):
        is_wide = flat is None and float(rim.ellipse.semi_minor) > options.sliver_px
        if is_wide or determines_length(rim, options=options):
            return as_given(rim)
    if flat is not None:
        return as_given(segment_from_fit(camera, flat, points, options=options))
    if isinstance(rim, EdgeRim):
        return Failure(Status.NO_POSE, "the contour is nearly a segment and its points do not settle how long it is")
    return nothing


def _has_width(rim: EdgeRim) -> bool:
    return float(rim.cone.factor[:, 1] @ rim.cone.factor[:, 1]) > 0.0


def _border_share(points: FloatArray, image_size: tuple[int, int], border_px: float) -> float:
    """Return the share of the contour that lies on the image's border."""
    last = np.array(image_size) - 1.0
    return float(np.mean(np.any((points < border_px) | (points > last - border_px), axis=1)))


def _crosses_itself(points: FloatArray) -> bool:
    """Whether two sides of the closed polygon (n, 2) cross properly, away from their common ends."""
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
