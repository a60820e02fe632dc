"""An ellipse that somebody else fitted -> the poses of its circle."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from circlepose import _arguments
from circlepose.camera.camera import Camera
from circlepose.errors import ArgumentError
from circlepose.fitting.cone_fit import ConeFit, fit_cone
from circlepose.fitting.cone_projection import factor_from_ellipse
from circlepose.geometry.ellipse import Ellipse
from circlepose.measurement.options import DEFAULT, MeasurementOptions
from circlepose.measurement.poses import circle_results
from circlepose.measurement.rim import EdgeRim, rim_from_fit
from circlepose.results import CircleResult, Failure, Status
from circlepose.solvers import CIRCLE_METHODS

_POINTS = 360
_FARTHEST_PX = 1e6
_HOW = "such as Ellipse.from_axes(center, semi_axes, angle)"


def estimate_from_ellipse(
    ellipse: Ellipse,
    camera: Camera,
    radius_mm: float,
    *,
    method: str = "chen-huang",
    options: MeasurementOptions = DEFAULT,
) -> CircleResult:
    """Estimate the pose of a circle of `radius_mm` from the ellipse that is its image.

    Parameters
    ----------
    ellipse
        In px of the raw image, taken to be exact. It has semi-axes and an angle in rad: of `cv2.fitEllipse`, whose
        axes are whole and whose angle is in deg, `Ellipse.from_axes(center, np.array(axes) / 2, np.radians(angle))`.
    camera
        Its calibration. Without lens distortion the pose is exact. With it the image of a circle is no ellipse: the
        viewing cone is fitted to points of the ellipse.
    radius_mm
        Of the circle.
    method
        A name of `circlepose.solvers.CIRCLE_METHODS`.
    options
        The numbers of the measurement.

    Returns
    -------
    As `circlepose.estimate` gives for a lone circle, without a covariance. An ellipse with a semi-minor axis of less
    than 0.35 px is taken for a segment, a circle seen edge-on. Status `no_pose` where the ellipse is outside the lens
    model.

    Raises
    ------
    ArgumentError
        On misuse: no single ellipse of finite numbers with a positive semi-major axis, a radius that is not positive,
        an unknown method.
    """
    _check_ellipse(_arguments.instance_of(Ellipse, "ellipse", ellipse, _HOW))
    _arguments.instance_of(Camera, "camera", camera, _arguments.HOW_CAMERA)
    radius_mm = _arguments.length_mm("radius_mm", radius_mm, "a positive radius in mm (not a diameter)")
    _arguments.one_of(CIRCLE_METHODS, "method", method)
    _arguments.instance_of(MeasurementOptions, "options", options, "MeasurementOptions(...)")
    rim = _rim(ellipse, camera)
    if isinstance(rim, Failure):
        return CircleResult(0, "disc", method, radius_mm, ellipse=ellipse, status=rim.status, reason=rim.reason)
    (result,) = circle_results(rim, camera, (method,), radius_mm, 0, "disc", options=options)
    # There are no edges that these could be of.
    return replace(result, ellipse=ellipse, residual_px=None, rim_used=None, contour=None)


def _rim(ellipse: Ellipse, camera: Camera) -> EdgeRim | Failure:
    outside = Failure(Status.NO_POSE, "the ellipse lies outside the lens model")
    points = ellipse.points(_POINTS)
    is_segment = float(ellipse.semi_minor) == 0.0
    if not camera.is_free_of_distortion and not is_segment:
        fit = fit_cone(camera, points)
        return outside if fit is None else rim_from_fit(camera, fit, points)
    factor = factor_from_ellipse(camera, ellipse)
    if factor is None or not np.all(np.isfinite(camera.rays(points))):
        return outside
    return EdgeRim(ConeFit(factor, np.zeros(_POINTS)), points, ellipse, 1.0, 1, axis_error_px=0.0)


def _check_ellipse(ellipse: Ellipse) -> None:
    values = [np.asarray(value) for value in (ellipse.center, ellipse.semi_major, ellipse.semi_minor, ellipse.angle)]
    shapes = tuple(value.shape for value in values)
    if shapes != ((2,), (), (), ()):
        raise ArgumentError(f"ellipse: expected a single one, with a center (2,), got the shapes {shapes}.")
    if not all(np.all(np.abs(value) <= _FARTHEST_PX) for value in values):
        raise ArgumentError(f"ellipse: expected finite numbers within {_FARTHEST_PX:g} px.")
    if not 0.0 <= float(ellipse.semi_minor) <= float(ellipse.semi_major) or float(ellipse.semi_major) == 0.0:
        raise ArgumentError(
            "ellipse: expected a positive semi-major axis and a semi-minor axis of 0 up to that, got "
            f"{float(ellipse.semi_major):g} and {float(ellipse.semi_minor):g} px."
        )
