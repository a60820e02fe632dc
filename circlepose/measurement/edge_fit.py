"""Contours -> rims: the viewing cone of each, fitted to edges that are located along the predicted rim."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from circlepose._typing import FloatArray, Image
from circlepose.camera.camera import Camera
from circlepose.detection.contour import Contour
from circlepose.fitting.cone_fit import ConeFit, direct_cones, fit_cone, fit_cone_to
from circlepose.fitting.cone_projection import factors_from_ellipses, residuals_px, rim_pixels
from circlepose.fitting.observations import Observations, rim_distance_px
from circlepose.fitting.ransac import local_scatter, on_one_ellipse
from circlepose.geometry.ellipse import Ellipse
from circlepose.imaging.subpixel_edges import contour_normals, locate_edges
from circlepose.measurement.options import DEFAULT, MeasurementOptions
from circlepose.measurement.rim import EdgeRim, Rim, axis_error_px, rim_from_fit
from circlepose.measurement.thin_rim import edges_determine_length, fit_thin_rim, has_sharp_tips
from circlepose.photometry.thin.fit import are_thin
from circlepose.results import Failure, Status


@dataclass(frozen=True, slots=True, eq=False)
class _LocatedEdges:
    """Edges found along a predicted rim."""

    edges: Observations
    samples: int
    """places along the rim at which an edge was searched"""


@dataclass(frozen=True, slots=True, eq=False)
class _TrimmedFit:
    """A cone and the edges that it was fitted to."""

    cone: ConeFit
    edges: Observations


def fit_rims(
    levels: Image,
    camera: Camera,
    contours: Sequence[Contour],
    *,
    refine: bool = True,
    are_starts: bool = False,
    options: MeasurementOptions = DEFAULT,
) -> Iterator[Rim | Failure]:
    """Fit the viewing cones of contours, one after the other as they are asked for.

    Parameters
    ----------
    levels
        (h, w) gray image without gaps.
    camera
        The calibration for this image size.
    contours
        The contours to measure.
    refine
        Locate edges anew along the predicted rims. Without it the contours' own points are fitted.
    are_starts
        Whether a fit to the gray levels follows: then the ellipse of a contour that is seen whole is a good enough
        start, and no edges are located along it.
    options
        The numbers of the measurement.

    Returns
    -------
    For each contour in turn its rim, or why it has none.
    """
    starts: dict[int, EdgeRim] = {}
    if refine and are_starts:
        may = [
            i
            for i, each in enumerate(contours)
            if (each.rim_used > options.whole_rim_share or each.blur_px > 0.0)
            and not are_thin(each.ellipse, options=options.photometry)
        ]
        starts = dict(zip(may, _rims_of_contours(camera, [contours[i] for i in may], options), strict=True))
    for i, contour in enumerate(contours):
        yield _fit_rim(levels, camera, contour, starts.get(i), refine=refine, options=options)


def _fit_rim(
    levels: Image,
    camera: Camera,
    contour: Contour,
    start: EdgeRim | None,
    *,
    refine: bool,
    options: MeasurementOptions,
) -> Rim | Failure:
    """Fit the viewing cone of one contour; `start` is the rim of its own ellipse, where that may suffice."""
    is_thin = bool(are_thin(contour.ellipse, options=options.photometry))
    is_sharp = contour.rim_used < options.whole_rim_share and has_sharp_tips(contour.ellipse, options)
    if is_thin or is_sharp:
        thin = fit_thin_rim(levels, camera, contour, options)
        # Edges contain little about the tips of a thin rim, and where a part is hidden the tips give the length.
        if not isinstance(thin, Failure) or (is_thin and contour.rim_used < options.hidden_rim_share):
            return thin
    if start is not None and (start.cone.rms_px < options.smooth_px or contour.blur_px > 0.0):
        return start
    fit = fit_cone(camera, contour.points)
    if fit is None:
        return Failure(Status.NO_POSE, "no ellipse fits the contour")
    rim = rim_from_fit(camera, fit, contour.points, contour.rim_used, contour.polarity, options=options)
    if isinstance(rim, Failure):
        return rim
    rim = replace(rim, contour=contour)
    # Noise or blur hides edges in the full image that were located in a reduced one.
    if not refine or contour.blur_px > 0.0 or (start is not None and fit.rms_px < options.smooth_px):
        return rim
    located = with_edges_located(levels, camera, rim, options=options)
    if isinstance(located, EdgeRim) and (is_thin or is_sharp) and not edges_determine_length(located, options):
        return Failure(Status.NO_POSE, "the edges that are visible do not determine its length")
    return located


def _rims_of_contours(camera: Camera, contours: Sequence[Contour], options: MeasurementOptions) -> list[EdgeRim]:
    """Return the rims of cones through the contours' ellipses, or through their points where a lens bends them."""
    if not contours:
        return []
    ellipses = Ellipse.batch([contour.ellipse for contour in contours])
    points = [contour.points for contour in contours]
    if camera.is_free_of_distortion:
        factors, _ = factors_from_ellipses(camera, ellipses)
        residuals = residuals_px(camera, factors, ellipses, points)
    else:
        factors, residuals = direct_cones(camera, points)
    rims = []
    for contour, factor, own in zip(contours, factors, residuals, strict=True):
        fit = ConeFit(factor, own)
        error_px = axis_error_px(fit, len(own), options)
        rims.append(
            EdgeRim(
                fit, contour.points, contour.ellipse, contour.rim_used, contour.polarity, error_px, contour=contour
            )
        )
    return rims


def with_edges_located(
    levels: Image, camera: Camera, rim: Rim, *, options: MeasurementOptions = DEFAULT
) -> EdgeRim | Failure:
    """Measure a rim again on edges located along it in the gray image `levels` (h, w)."""
    factor = rim.cone.factor
    for last in (False, True):
        located = _locate_edges(levels, camera, factor, rim.ellipse, options)
        if isinstance(located, Failure):
            return located
        edges, samples = located.edges, located.samples
        trimmed = _without_outliers(edges, factor, options)
        if isinstance(trimmed, Failure):
            return trimmed
        fit = trimmed
        scatter = max(local_scatter(fit.edges.pixels), options.least_outlier_px / options.agreeing_sigmas)
        is_smooth = fit.cone.rms_px < max(options.smooth_ratio * scatter, options.smooth_px)
        is_whole = len(fit.edges) > options.whole_rim_share * samples
        if (is_whole and is_smooth) or samples < options.least_samples_for_parts or _is_rough(rim, options):
            break
        # Something hides part of the rim.
        fit = _fit_to_agreeing(edges, samples, scatter, fit, options)
        if last:
            break
        factor = fit.cone.factor
    rim_used = len(fit.edges) / samples
    again = rim_from_fit(camera, fit.cone, fit.edges.pixels, rim_used, rim.polarity, options=options)
    if isinstance(again, Failure):
        return again
    return replace(again, contour=rim.contour, is_located_anew=True)


def _is_rough(rim: Rim, options: MeasurementOptions) -> bool:
    """Whether the edges of a rim that is seen whole stray by themselves: then all count, not those that agree."""
    contour, whole = rim.contour, options.detection.whole_rim
    return contour is not None and contour.ragged > options.least_ragged and contour.rim_used >= whole


def _locate_edges(
    levels: Image, camera: Camera, factor: FloatArray, ellipse: Ellipse, options: MeasurementOptions
) -> _LocatedEdges | Failure:
    """Locate edges along the rim of the cone with `factor` (3, 3), whose image is about `ellipse`."""
    perimeter = np.pi * float(ellipse.semi_major + ellipse.semi_minor)
    samples = int(np.clip(perimeter / options.edge_spacing_px, options.least_samples, options.most_samples))
    predicted = rim_pixels(camera, factor, samples)
    if not np.all(np.isfinite(predicted)):
        return Failure(Status.NO_POSE, "the predicted rim lies outside the valid field of the lens model")
    half_width = min(options.edge_half_width_px, max(0.45 * float(ellipse.semi_minor) + 0.5, 1.0))
    edges = locate_edges(levels, predicted[None], contour_normals(predicted[None]), np.array([half_width]))
    return _LocatedEdges(Observations.of(camera, edges.points[0][edges.valid[0]]), samples)


def _without_outliers(edges: Observations, start: FloatArray, options: MeasurementOptions) -> _TrimmedFit | Failure:
    """Fit a cone to edges without outliers, from the cone with the factor `start` (3, 3)."""
    for trim in range(options.outlier_rounds + 1):
        fit = fit_cone_to(edges, start=start)
        if fit is None:
            break
        distance = np.abs(fit.residuals_px)
        robust_sigma = 1.4826 * float(np.median(distance))
        is_near = distance <= max(options.outlier_sigmas * robust_sigma, options.least_outlier_px)
        if is_near.all() or trim == options.outlier_rounds:
            return _TrimmedFit(fit, edges)
        edges, start = edges[is_near], fit.factor
    return Failure(Status.NO_POSE, "too few edges along the predicted rim agree")


def _fit_to_agreeing(
    edges: Observations, samples: int, scatter: float, before: _TrimmedFit, options: MeasurementOptions
) -> _TrimmedFit:
    """Fit the ellipse that the most edges agree on; the fit `before` stands where there is no such ellipse."""
    agreeing = on_one_ellipse(edges.pixels, scatter)
    if agreeing.sum() < options.least_agreeing_share * samples:
        return before
    consensus = fit_cone_to(edges[agreeing])
    if consensus is None:
        return before
    distance = np.abs(rim_distance_px(consensus.factor, edges.rays, edges.jacobians))
    near = edges[distance <= options.agreeing_sigmas * scatter]
    again = fit_cone_to(near, start=consensus.factor)
    return before if again is None else _TrimmedFit(again, near)
