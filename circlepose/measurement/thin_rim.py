"""Rims too thin for edges to be located on both sides: a blurred ellipse is fitted to the gray levels."""

from __future__ import annotations

import numpy as np

from circlepose._typing import FloatArray, Image
from circlepose.camera.camera import Camera
from circlepose.detection.contour import Contour
from circlepose.fitting.arc_precision import axis_errors
from circlepose.fitting.cone_fit import ConeFit
from circlepose.fitting.cone_projection import factor_from_ellipse
from circlepose.geometry.cone import SIGNATURE
from circlepose.geometry.cone_perturbation import coefficients_between
from circlepose.geometry.ellipse import Ellipse
from circlepose.measurement.options import MeasurementOptions
from circlepose.measurement.rim import EdgeRim, FittedRim
from circlepose.photometry.thin.fit import ThinEllipse, fit_thin_ellipse
from circlepose.results import Failure, Status

_SAMPLES = 180
"""Points that represent the rim."""
_STEP_PX = 1e-4
"""Step of the numerical derivative of the modes."""


def fit_thin_rim(levels: Image, camera: Camera, contour: Contour, options: MeasurementOptions) -> FittedRim | Failure:
    """Fit a blurred ellipse to the gray image `levels` (h, w) around a contour."""
    fitted = fit_thin_ellipse(levels, contour.ellipse, seen=contour.points, options=options.photometry)
    if fitted is None:
        return _failure("no blurred ellipse fits the gray levels around it")
    if fitted.rms_levels > options.worst_thin_rms_share * fitted.peak_levels:
        return _failure("the residuals of its gray levels are too large")
    if not _length_is_determined(fitted, options):
        return _failure("what is visible of it does not determine its length")
    factor = factor_from_ellipse(camera, fitted.ellipse)
    if factor is None:
        return _failure("it lies outside the valid field of the lens model")
    points = fitted.ellipse.points(_SAMPLES)
    return FittedRim(
        # There are no edges whose scatter the residuals could be.
        ConeFit(factor, np.full(len(points), fitted.error_px)),
        points,
        fitted.ellipse,
        fitted.rim_used,
        -1 if fitted.contrast > 0.0 else 1,
        axis_error_px=float(np.sqrt(fitted.covariance[3, 3])),
        contour=contour,
        modes_covariance=_modes_covariance(camera, fitted, factor, options),
        ellipse_covariance=fitted.covariance,
    )


def has_sharp_tips(ellipse: Ellipse, options: MeasurementOptions) -> bool:
    """Whether an image ellipse (px) is long and so sharply curved at its tips that edges there are biased."""
    major, minor = float(ellipse.semi_major), float(ellipse.semi_minor)
    is_long = major > options.sharp_semi_major_px and minor < options.sharp_axis_ratio * major
    return is_long and minor**2 / major < options.sharp_radius_px


def edges_determine_length(rim: EdgeRim, options: MeasurementOptions) -> bool:
    """Whether the edges of a rim with sharp tips lie far enough around it to determine its length."""
    error = float(axis_errors(rim.ellipse, rim.points, options.sharp_edge_error_px)[0])
    return error < options.worst_edge_length_share * float(rim.ellipse.semi_major)


def _length_is_determined(fitted: ThinEllipse, options: MeasurementOptions) -> bool:
    """Whether the gray levels determine how long a thin ellipse is, and with it the distance of the circle."""
    relative = float(np.sqrt(fitted.covariance[2, 2])) / float(fitted.ellipse.semi_major)
    if fitted.rim_used >= options.whole_rim_share:
        return relative < options.worst_length_share
    # Of a partly hidden one nothing of what hides it may be left in the residuals.
    strict = min(options.worst_hidden_length_share, options.worst_length_share)
    return relative < strict and not fitted.is_structured


def _modes_covariance(
    camera: Camera, fitted: ThinEllipse, factor: FloatArray, options: MeasurementOptions
) -> FloatArray | None:
    """Return the covariance (5, 5) of the modes of the cone with `factor` (3, 3), from that of the image ellipse.

    None where the ellipse may be a segment, whose modes are not small, or the lens model does not reach.
    """
    ellipse = fitted.ellipse
    if float(ellipse.semi_minor) < options.segment_sigmas * float(np.sqrt(fitted.covariance[3, 3])):
        return None
    theta = np.array([*ellipse.center, ellipse.semi_major, ellipse.semi_minor, ellipse.angle])
    columns = []
    for i, step in enumerate((_STEP_PX, _STEP_PX, _STEP_PX, _STEP_PX, _STEP_PX / float(ellipse.semi_major))):
        changed = theta + step * (np.arange(5) == i)
        other = factor_from_ellipse(camera, Ellipse(changed[:2], changed[2], changed[3], changed[4]))
        if other is None:
            return None
        columns.append(coefficients_between(factor, other @ np.diag(SIGNATURE) @ other.T) / step)
    slopes = np.stack(columns, axis=-1)
    return np.asarray(slopes @ fitted.covariance @ slopes.T)


def _failure(reason: str) -> Failure:
    return Failure(Status.NO_POSE, reason)
