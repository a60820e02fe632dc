"""Whether a fit to the gray levels is accepted: then the rim is that of the fit, with its covariance."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from circlepose._typing import BoolArray, FloatArray, Image
from circlepose.camera.camera import Camera
from circlepose.fitting.cone_fit import ConeFit
from circlepose.fitting.cone_projection import image_ellipses, residuals_px
from circlepose.geometry.ellipse import Ellipse, rim_distance
from circlepose.measurement.options import MeasurementOptions
from circlepose.measurement.rim import EdgeRim, FittedRim, Rim
from circlepose.photometry.levels_fit import LevelsFit
from circlepose.results import Failure, Status

_SAMPLES = 48
"""Points around a rim at which its distance from the edges is measured."""
_NOISE_ROWS, _NOISE_COLUMNS = 64, 128
"""Rows and columns of the image from which its noise is estimated."""
_LEAST_NOISE = 0.5
"""Gray levels; about the rounding to whole levels."""


def accepted(
    gray: Image,
    camera: Camera,
    rims: Sequence[Rim],
    fit: LevelsFit,
    is_alone: BoolArray,
    options: MeasurementOptions,
) -> list[FittedRim | Failure]:
    """Return the rims of a fit to the gray levels, or why the fit is rejected.

    Parameters
    ----------
    gray
        (h, w) levels that were fitted.
    camera
        The calibration for this image size.
    rims
        (m) the rims at which the fit began.
    fit
        The fit to the levels around them.
    is_alone
        (m,) whether no neighbor enters the band around the rim.
    options
        The numbers of the measurement.
    """
    reasons = _reasons(gray, rims, fit, is_alone, options)
    done: list[FittedRim | Failure] = [Failure(Status.NO_POSE, reason) for reason in reasons]
    kept = [k for k, reason in enumerate(reasons) if not reason]
    if not kept:
        return done
    factors = fit.factors[kept]
    ellipses, found = image_ellipses(camera, factors)
    # What hides a part of a rim has levels of its own, which bias the fit: there the edges that agree decide.
    hidden = np.array([_is_hidden(rims[k], float(fit.rim_used[k]), options) for k in kept])
    before = Ellipse.batch([rims[k].ellipse for k in kept])
    moved = np.max(np.abs(rim_distance(before, ellipses.points(_SAMPLES))), axis=1)
    is_near = moved <= np.where(hidden, options.farthest_hidden_px, options.farthest_px)
    residuals = residuals_px(camera, factors, ellipses, [rims[k].points for k in kept])
    for j, k in enumerate(kept):
        if not found[j]:
            done[k] = Failure(Status.NO_POSE, "the fitted rim lies outside the valid field of the lens model")
        elif not is_near[j]:
            done[k] = Failure(Status.NO_POSE, "the fitted rim is too far from the edges")
        else:
            done[k] = _fitted_rim(rims[k], fit, k, ellipses[j], residuals[j])
    return done


def _fitted_rim(rim: Rim, fit: LevelsFit, number: int, ellipse: Ellipse, residuals: FloatArray) -> FittedRim:
    """Return rim `number` of a fit that began at `rim`; `residuals` (n,) px are those of the edges."""
    points = rim.points
    ellipse_covariance = None
    if isinstance(rim, FittedRim):
        # It has no edges: its points are those of its own ellipse.
        points, residuals = ellipse.points(len(points)), rim.cone.residuals_px
        ellipse_covariance = rim.ellipse_covariance
    relative_error = np.sqrt(np.trace(fit.covariance[number, 3:, 3:]) / 2.0)
    return FittedRim(
        ConeFit(fit.factors[number], residuals),
        points,
        ellipse,
        float(fit.rim_used[number]),
        -1 if fit.contrast_levels[number] > 0.0 else 1,
        axis_error_px=float(2.0 * relative_error * ellipse.semi_major),
        contour=rim.contour,
        modes_covariance=fit.covariance[number],
        ellipse_covariance=ellipse_covariance,
    )


def _is_hidden(rim: Rim, used_again: float, options: MeasurementOptions) -> bool:
    """Whether a part of a rim is hidden. A thin rim leaves out what is only shaded, too."""
    hidden = options.visible_rim_share
    return rim.rim_used < hidden and (isinstance(rim, EdgeRim) or used_again < hidden)


def _reasons(
    gray: Image, rims: Sequence[Rim], fit: LevelsFit, is_alone: BoolArray, options: MeasurementOptions
) -> list[str]:
    """Return for each of m rims why its fit is rejected by its own figures; empty for one that is not."""
    minor = np.array([float(rim.ellipse.semi_minor) for rim in rims])
    before: FloatArray = np.array([rim.rim_used for rim in rims])
    noise_share = fit.noise_levels / np.maximum(np.abs(fit.contrast_levels), 1e-9)
    # Where the model does not explain the levels of a tiny disc, the fit is no better than its edges.
    is_tiny = minor < np.where(is_alone, options.tiny_px, options.tiny_crowded_px)
    is_unexplained = is_tiny | (noise_share > options.textured_noise_share)
    if is_unexplained.any():
        is_unexplained &= fit.noise_levels > options.unexplained_noise_ratio * noise_of(gray)
    uses_enough = (fit.rim_used > options.least_rim_share) & (fit.rim_used >= options.least_kept_share * before)
    rejections = {
        "the fit does not converge": ~fit.converged,
        "the residuals are too large for the contrast": ~(noise_share < options.worst_noise_share),
        "the residuals are too large for the noise of the image": is_unexplained,
        "the blur is too wide for the rim": minor < options.least_width_sigmas * np.exp(fit.blur[:, 0]),
        "too little of the rim is in use": ~uses_enough,
    }
    return [next((reason for reason, marked in rejections.items() if marked[k]), "") for k in range(len(rims))]


def noise_of(gray: Image) -> float:
    """Return about the standard deviation of the noise of `gray` (h, w), levels, from neighbors in sampled rows."""
    height, width = gray.shape
    if width < 3:
        return _LEAST_NOISE
    down, across = max(1, height // _NOISE_ROWS), max(1, width // _NOISE_COLUMNS)
    left, middle, right = (gray[::down, i : width - 2 + i : across].astype(np.float32) for i in range(3))
    bends = middle - (left + right) / 2.0
    return max(1.4826 * float(np.nanmedian(np.abs(bends))) / np.sqrt(1.5), _LEAST_NOISE)
