"""Whether a fit to the gray levels is accepted: then the rim is that of the fit, with its covariance."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from circlepose._typing import BoolArray, FloatArray, Image
from circlepose.camera.camera import Camera
from circlepose.detection.contour import Rejection
from circlepose.fitting.cone_fit import ConeFit
from circlepose.fitting.cone_projection import image_ellipses, residuals_px
from circlepose.geometry.ellipse import Ellipse, rim_distance
from circlepose.imaging.noise import noise_of
from circlepose.measurement.options import MeasurementOptions
from circlepose.measurement.rim import EdgeRim, FittedRim, Rim, blur_px
from circlepose.photometry.levels_fit import LevelsFit
from circlepose.results import Failure, Status

WITHOUT_EDGE = "the blur is too wide for the rim"
"""Why a fit is rejected that finds a blob without an edge."""
NOT_CONVERGED = "the fit does not converge"
DROWNED = "the residuals are too large for the contrast"
"""Why a fit is rejected that explains less than the scatter that it leaves."""
_SAMPLES = 48
"""Points around a rim at which its distance from the edges is measured."""


def why_no_disc(rim: Rim, options: MeasurementOptions) -> Rejection | None:
    """Return why a rim is not a circle's after all, now that its levels were fitted; None where it may be one."""
    if rim.cone.rms_px > options.most_residual_px:
        return Rejection.RESIDUAL
    if isinstance(rim, EdgeRim) and rim.level_fit is not None:
        reason, is_small = rim.level_fit.reason, float(rim.ellipse.semi_minor) < options.detection.chance_px
        if reason == WITHOUT_EDGE or (is_small and reason == DROWNED):
            return Rejection.WITHOUT_EDGE
    return None


def are_of(ellipses: Ellipse, circles: Ellipse, options: MeasurementOptions) -> BoolArray:
    """Return which rims (m) are those of `circles` (k) that were seen, or of something printed in one."""
    is_inside = rim_distance(circles, ellipses.center) < 0.0
    is_larger = ellipses.semi_major > options.largest_of_circle * circles.semi_major[:, None]
    return np.asarray((is_inside & ~is_larger).any(axis=0))


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
    # In a reduced image edges are located as coarsely as they are blurred.
    blurred = np.array([blur_px(rims[k]) for k in kept])
    is_near = moved <= np.where(hidden, options.farthest_hidden_px, np.maximum(options.farthest_px, blurred))
    residuals = residuals_px(camera, factors, ellipses, [rims[k].points for k in kept])
    blur = np.exp(fit.blur[kept, 0])
    is_near &= _are_of_edges(residuals, [rims[k] for k in kept], ellipses, blur, options)
    # Edges may be anywhere on the slope of a blob.
    is_blob = ~is_near & _are_like_their_blur(ellipses.semi_minor, blur, options)
    is_blob |= ellipses.semi_minor < options.least_settled_sigmas * blur
    for j, k in enumerate(kept):
        if not found[j]:
            done[k] = Failure(Status.NO_POSE, "the fitted rim lies outside the valid field of the lens model")
        elif is_blob[j]:
            done[k] = Failure(Status.NO_POSE, WITHOUT_EDGE)
        elif not is_near[j]:
            done[k] = Failure(Status.NO_POSE, "the fitted rim is too far from the edges")
        else:
            done[k] = _fitted_rim(rims[k], fit, k, ellipses[j], residuals[j])
    return done


def _are_of_edges(
    residuals: Sequence[FloatArray],
    rims: Sequence[Rim],
    ellipse: Ellipse,
    blur: FloatArray,
    options: MeasurementOptions,
) -> BoolArray:
    """Return (m,) which fitted rims `ellipse` are those of the edges they began at, not of something beside them.

    `residuals` are those of the edges, px, and `blur` (m,) is that of the fit, px.
    """
    # A curved edge is seen too far inside, the more so the wider its blur.
    bias_px = 0.5 * blur**2 / ellipse.semi_minor
    most_px = options.farthest_from_edges * np.maximum([_scatter_px(rim, options) for rim in rims], bias_px)
    scatter_px = np.array([float(np.std(own)) for own in residuals])
    # Clipped levels shift the edges all alike, by a part of the blur.
    shift_px = np.abs([float(np.mean(own)) for own in residuals])
    return np.asarray((scatter_px <= most_px) & (shift_px <= np.maximum(most_px, options.most_shift * blur)))


def _scatter_px(rim: Rim, options: MeasurementOptions) -> float:
    """Return about how far the edges of a rim are from it by themselves."""
    if rim.contour is None:
        # Its points need not be edges.
        return np.inf
    return max(rim.cone.rms_px, rim.contour.noise_px, options.least_edge_error_px)


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


def _are_without_edge(minor: FloatArray, fit: LevelsFit, options: MeasurementOptions) -> BoolArray:
    """Return (m,) which fits do not tell the width `minor` (m,), px, of a rim from its blur."""
    is_settled = np.sqrt(np.maximum(fit.covariance[:, 0, 0], 0.0)) < options.worst_growth_share
    return _are_like_their_blur(minor, np.exp(fit.blur[:, 0]), options) & ~is_settled


def _are_like_their_blur(minor: FloatArray, blur: FloatArray, options: MeasurementOptions) -> BoolArray:
    """Return (m,) which rims have a width `minor` (m,) that is like their `blur` (m,), px.

    In focus a dot of a few px is as blurred, and a dot it is.
    """
    return np.asarray((minor < options.least_width_sigmas * blur) & (blur > options.focused_px))


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
    is_drowned = ~(noise_share < options.worst_noise_share)
    if is_unexplained.any() or is_drowned.any():
        over_noise = fit.noise_levels / noise_of(gray)
        is_unexplained &= over_noise > options.unexplained_noise_ratio
        # Pure noise, however large, is what the covariance states.
        is_drowned &= ~((over_noise < options.explained_noise_ratio) & (noise_share < options.worst_explained_share))
    uses_enough = (fit.rim_used > options.least_rim_share) & (fit.rim_used >= options.least_kept_share * before)
    rejections = {
        WITHOUT_EDGE: _are_without_edge(minor, fit, options),
        NOT_CONVERGED: ~fit.converged,
        DROWNED: is_drowned,
        "the residuals are too large for the noise of the image": is_unexplained,
        "too little of the rim is in use": ~uses_enough,
    }
    return [next((reason for reason, marked in rejections.items() if marked[k]), "") for k in range(len(rims))]
