"""A circle's rim as measured in the image: located by its edges, or fitted to the gray levels with a covariance."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from circlepose._typing import FloatArray
from circlepose.camera.camera import Camera
from circlepose.detection.contour import Contour
from circlepose.fitting.arc_precision import axis_errors
from circlepose.fitting.cone_fit import ConeFit
from circlepose.fitting.cone_projection import image_ellipses
from circlepose.geometry.cone import principal_frame
from circlepose.geometry.cone_perturbation import MODES
from circlepose.geometry.ellipse import Ellipse
from circlepose.measurement.options import DEFAULT, MeasurementOptions
from circlepose.results import Failure, Status


@dataclass(frozen=True, slots=True, eq=False)
class _MeasuredRim:
    """What edge rims and fitted rims have in common."""

    cone: ConeFit
    """the viewing cone, in the camera frame, with the residuals of `points`"""
    points: FloatArray
    """(n, 2) px of the raw image, in order along the rim"""
    ellipse: Ellipse
    """of the rim in the raw image"""
    rim_used: float
    """share of the rim that the measurement uses, 0 to 1"""
    polarity: int
    """+1: darker inside, -1: brighter inside"""
    axis_error_px: float
    """standard deviation of the semi-axes"""
    contour: Contour | None = field(default=None, kw_only=True)
    """the contour that was measured; None where the rim was sought at a predicted place"""

    @property
    def score(self) -> float | None:
        """The score of the contour, 0 to 1; None without a contour."""
        return None if self.contour is None else self.contour.score


@dataclass(frozen=True, slots=True, eq=False)
class EdgeRim(_MeasuredRim):
    """A rim located by edge points, whose errors are correlated along it: only a rough one has a covariance."""

    is_located_anew: bool = field(default=False, kw_only=True)
    """whether the edges were located along the predicted rim; else they are the contour's own"""
    is_given: bool = field(default=False, kw_only=True)
    """whether a caller gave the points; else they were found in an image"""
    level_fit: Failure | None = field(default=None, kw_only=True)
    """why the fit to the gray levels was rejected; None where there was no such fit"""
    modes_covariance: FloatArray | None = field(default=None, kw_only=True)
    """(5, 5) of the modes of `cone.factor`, from the residuals, where these are the rim's own shape"""


@dataclass(frozen=True, slots=True, eq=False)
class FittedRim(_MeasuredRim):
    """A rim fitted to the gray levels around it."""

    modes_covariance: FloatArray | None = field(kw_only=True)
    """(5, 5) of the modes of `cone.factor` (`geometry.cone_perturbation`); None where the ellipse may be a segment"""
    ellipse_covariance: FloatArray | None = field(default=None, kw_only=True)
    """(5, 5) of center x, y, semi-major, semi-minor (px) and angle (rad); only of a rim fitted as a thin ellipse"""


Rim = EdgeRim | FittedRim


def blur_px(rim: Rim) -> float:
    """Return about the blur of a rim whose contour was found in a reduced image; 0 of any other."""
    return 0.0 if rim.contour is None else rim.contour.blur_px


def modes_covariance(rim: Rim) -> FloatArray | None:
    """Return the covariance (5, 5) of the modes of a rim's cone, where it is known."""
    return rim.modes_covariance


def rim_from_fit(
    camera: Camera,
    fit: ConeFit,
    points: FloatArray,
    rim_used: float = 1.0,
    polarity: int = 1,
    *,
    options: MeasurementOptions = DEFAULT,
) -> EdgeRim | Failure:
    """Return the rim of a cone fitted to `points` (n, 2) px; fails outside the lens model's valid field."""
    ellipses, found = image_ellipses(camera, fit.factor[None])
    if not found[0]:
        return Failure(Status.NO_POSE, "the fitted rim lies outside the valid field of the lens model")
    return EdgeRim(fit, points, ellipses[0], rim_used, polarity, axis_error_px(fit, len(points), options))


def segment_from_fit(
    camera: Camera, fit: ConeFit, points: FloatArray, *, options: MeasurementOptions = DEFAULT
) -> EdgeRim:
    """Return the rim of a flat cone fitted to `points` (n, 2): a segment or sliver, straight in the image."""
    frame = principal_frame(fit.factor)
    u, v, w = frame.rotation.T
    sides = np.array([[-1.0], [1.0]])
    ends = camera.project(w + sides * frame.tan_half_major * u)
    half = np.diff(ends, axis=0)[0] / 2.0
    across = np.diff(camera.project(w + sides * frame.tan_half_minor * v), axis=0)[0]
    axes = [np.hypot(*half), np.hypot(*across) / 2.0]
    ellipse = Ellipse.from_axes(ends.mean(axis=0), axes, np.arctan2(half[1], half[0]))
    return EdgeRim(fit, points, ellipse, 1.0, 1, axis_error_px(fit, len(points), options))


def as_given(rim: EdgeRim) -> EdgeRim:
    """Return the rim of points that a caller gave: their scatter alone shows how exact they are."""
    number = len(rim.points)
    error = rim.cone.rms_px * np.sqrt(number / max(number - MODES, 1)) / np.sqrt(number / 4.0)
    return replace(rim, axis_error_px=float(error), is_given=True)


def determines_length(rim: EdgeRim, *, options: MeasurementOptions = DEFAULT) -> bool:
    """Whether the points of a rim, by their scatter about it, determine its semi-major axis."""
    error = float(axis_errors(rim.ellipse, rim.points, rim.cone.rms_px)[0])
    return error < options.worst_length_share * float(rim.ellipse.semi_major)


def axis_error_px(fit: ConeFit, number: int, options: MeasurementOptions = DEFAULT) -> float:
    """Return the standard deviation (px) of the semi-axes of a rim with `number` edges."""
    # Of n radial errors around the rim, two combinations change the axes alike, and two change them unequally.
    return float(max(fit.rms_px, options.least_edge_noise_px) / np.sqrt(number / 4.0))
