"""A contour's ellipse -> the viewing cone, from edges placed again along the rim that the lens model predicts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from circlepose._typing import FloatArray, Image
from circlepose.camera.camera import Camera
from circlepose.detection.contour import Contour
from circlepose.fitting.arc_precision import axis_errors
from circlepose.fitting.cone_fit import (
    ConeFit,
    SeenPoints,
    direct_cones,
    factor_from_ellipse,
    factors_from_ellipses,
    fit_cone,
    fit_cone_to,
    rim_distance_px,
)
from circlepose.fitting.cone_projection import image_ellipses, residuals_px, rim_pixels
from circlepose.fitting.ransac import local_scatter, on_one_ellipse
from circlepose.geometry.cone import SIGNATURE, principal_frame
from circlepose.geometry.cone_perturbation import MODES, amounts_between
from circlepose.geometry.conic import Ellipse
from circlepose.imaging.subpixel_edges import contour_normals, locate_edges
from circlepose.photometry.thin.fit import ThinEllipse, are_thin, fit_thin_ellipse

_REACH_PX = 2.5
_SPACING_PX = 1.5
_PLACES = (48, 360)
_OUTLIER = 4.0
"""Robust standard deviations beyond which an edge is not the rim's."""
_FINEST_PX = 0.05
"""An edge this close is the rim's, however well the others agree."""
_TRIMS = 3
_LEAST_NOISE_PX = 0.005
"""Scatter of edges in an image without noise: there remain its pixels and its whole levels."""
_FULL_RIM = 0.93
_SMOOTH = 1.6
"""A rim that is an edge all around scatters about its ellipse hardly more than neighbouring edges do."""
_FINEST_RMS_PX = 0.12
_LEAST_PLACES = 60
"""Places along a rim from which parts of it can be told from each other."""
_SCATTERS = 3.5
_LEAST_AGREEING = 0.3
"""Share of the rim that must lie on one ellipse."""
_THIN_PLACES = 180
_STEP_PX = 1e-4
_SEGMENT_SIGMAS = 3.0
_WHOLE = 0.8
"""Share of the rim up to which a part of it is taken to be hidden."""
_LONG_PX = 30.0
_LONGISH = 0.3
_SHARP_PX = 5.0
"""Semi-major axis, axis ratio and radius of curvature of long ellipses with tips where edges are biased."""
_WORST_MAJOR = 0.005
"""Standard deviation of the semi-major axis, as a share of it: with its tips hidden a sliver may be of any length."""
_WORST_LENGTH = 0.02
"""The same of a sliver that is seen whole: its distance is no better known."""
_EDGE_ERROR_PX = 0.05
_WORST_SPAN = 0.0005
"""The same, from edges with this error each, none of which is biased in common with its neighbours."""
_WORST_RMS = 0.25
"""Largest rms residual, as a share of the contrast, with which a fit to the levels is believed."""


@dataclass(frozen=True, slots=True, eq=False)
class Rim:
    """A circle's rim as measured in the image."""

    cone: ConeFit
    points: FloatArray
    """(n, 2) px, the edges that the cone was fitted to"""
    ellipse: Ellipse
    """of the fitted rim in the raw image"""
    rim_used: float
    """share of the rim that has such an edge"""
    polarity: int
    """+1: darker inside, -1: brighter inside"""
    axis_error_px: float
    """standard deviation of the semi-axes, from the scatter of the edges"""
    modes_covariance: FloatArray | None = None
    """(5, 5) of the `rim_modes` of the cone's factor; None where only edges were placed, whose errors go together"""
    is_placed: bool = False
    """the edges were placed along it, and are no longer those of the contour"""
    is_edges_only: bool = False
    """the levels were tried, and tell nothing better than the edges"""
    score: float | None = None
    """of the contour that it was found as; None where it was looked for at a known place"""
    least_width_px: float = 0.35
    """semi-minor axis below which it is taken to be seen edge-on: the levels of an image cannot distinguish a thin
    disc of high contrast from a thicker one of low contrast"""
    ellipse_covariance: FloatArray | None = None
    """(5, 5) of a sliver's ellipse, see `ThinEllipse`: it was measured from its levels, of which edges know less"""


def fit_rims(
    levels: Image, camera: Camera, contours: Sequence[Contour], *, refine: bool = True, are_starts: bool = False
) -> Iterator[Rim | None]:
    """Fit the viewing cones of `contours` in the grey image `levels` (h, w) in turn; None of one that has none.

    Without `refine` the contours' own points are fitted and no edge is placed again; nor where the rims `are_starts`
    of fits to the levels and seen whole: good enough for that.
    """
    starts: dict[int, Rim] = {}
    if refine and are_starts:
        may = [i for i, each in enumerate(contours) if each.rim_used > _FULL_RIM and not are_thin(each.ellipse)]
        starts = dict(zip(may, _rims_to_start_at(camera, [contours[i] for i in may]), strict=True))
    for i, contour in enumerate(contours):
        yield fit_rim(levels, camera, contour, refine=refine, start=starts.get(i))


def fit_rim(
    levels: Image, camera: Camera, contour: Contour, *, refine: bool = True, start: Rim | None = None
) -> Rim | None:
    """Fit the viewing cone of one contour, see `fit_rims`; `start` is the rim of its own ellipse, if that may do."""
    is_sliver = bool(are_thin(contour.ellipse))
    has_sharp_tips = contour.rim_used < _FULL_RIM and _has_sharp_tips(contour.ellipse)
    if is_sliver or has_sharp_tips:
        thin = _thin_rim(levels, camera, contour)
        # The edges of a sliver say little of its tips, and where a part is hidden these say how long it is.
        if thin is not None or (is_sliver and contour.rim_used < _WHOLE):
            return thin
    if start is not None and start.cone.rms_px < _FINEST_RMS_PX:
        return start
    fit = fit_cone(camera, contour.points)
    if fit is None:
        return None
    rim = rim_from_fit(camera, fit, contour.points, contour.rim_used, contour.polarity)
    if rim is None or not refine or (start is not None and fit.rms_px < _FINEST_RMS_PX):
        return rim
    rim = with_edges_placed(levels, camera, rim)
    return None if rim is not None and (is_sliver or has_sharp_tips) and not _spans(rim) else rim


def _rims_to_start_at(camera: Camera, contours: Sequence[Contour]) -> list[Rim]:
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
        error_px = _axis_error_px(fit, len(own))
        rims.append(Rim(fit, contour.points, contour.ellipse, contour.rim_used, contour.polarity, error_px))
    return rims


def with_edges_placed(levels: Image, camera: Camera, rim: Rim) -> Rim | None:
    """Return `rim` measured on edges placed anew along it; None where too few agree."""
    factor = rim.cone.factor
    for last in (False, True):
        placed = _place_edges(levels, camera, factor, rim.ellipse)
        if placed is None:
            return None
        edges, places = placed
        refined = _without_outliers(edges, factor)
        if refined is None:
            return None
        cone, used = refined
        scatter = max(local_scatter(used.pixels), _FINEST_PX / _SCATTERS)
        whole = len(used) > _FULL_RIM * places and cone.rms_px < max(_SMOOTH * scatter, _FINEST_RMS_PX)
        if whole or places < _LEAST_PLACES:
            break
        # Something stands along part of the rim.
        agreeing = on_one_ellipse(edges.pixels, scatter)
        consensus = fit_cone_to(edges[agreeing]) if agreeing.sum() >= _LEAST_AGREEING * places else None
        if consensus is not None:
            cone, used = _with_all_near(consensus, edges, _SCATTERS * scatter) or (cone, used)
        if last:
            break
        factor = cone.factor
    again = rim_from_fit(camera, cone, used.pixels, len(used) / places, rim.polarity)
    return None if again is None else replace(again, score=rim.score, is_placed=True)


def _place_edges(
    levels: Image, camera: Camera, factor: FloatArray, ellipse: Ellipse
) -> tuple[SeenPoints, int] | None:
    """Place edges along the rim of the cone with `factor`; returns those found and at how many places."""
    perimeter = np.pi * float(ellipse.semi_major + ellipse.semi_minor)
    places = int(np.clip(perimeter / _SPACING_PX, *_PLACES))
    predicted = rim_pixels(camera, factor, places)
    if not np.all(np.isfinite(predicted)):
        return None
    reach = min(_REACH_PX, max(0.45 * float(ellipse.semi_minor) + 0.5, 1.0))
    edges = locate_edges(levels, predicted[None], contour_normals(predicted[None]), np.array([reach]))
    return SeenPoints.of(camera, edges.points[0][edges.valid[0]]), places


def _with_all_near(fit: ConeFit, edges: SeenPoints, tolerance_px: float) -> tuple[ConeFit, SeenPoints] | None:
    """Fit again to all `edges` within `tolerance_px` of the rim of `fit`."""
    near = np.abs(rim_distance_px(fit.factor, edges.rays, edges.jacobians)) <= tolerance_px
    again = fit_cone_to(edges[near], start=fit.factor)
    return None if again is None else (again, edges[near])


def _has_sharp_tips(ellipse: Ellipse) -> bool:
    major, minor = float(ellipse.semi_major), float(ellipse.semi_minor)
    return major > _LONG_PX and minor < _LONGISH * major and minor**2 / major < _SHARP_PX


def _thin_rim(levels: Image, camera: Camera, contour: Contour) -> Rim | None:
    """Fit a rim whose two sides, and all of its tips, are too close for edges to be placed."""
    fitted = fit_thin_ellipse(levels, contour.ellipse, seen=contour.points)
    if fitted is None or fitted.rms_levels > _WORST_RMS * fitted.peak_levels:
        return None
    if not _has_settled_length(fitted) or (fitted.rim_used < _FULL_RIM and not _is_settled(fitted)):
        return None
    points = fitted.ellipse.points(_THIN_PLACES)
    factor = factor_from_ellipse(camera, fitted.ellipse)
    if factor is None:
        return None
    # There are no edge points, whose scatter the residuals would be.
    cone = ConeFit(factor, np.full(len(points), fitted.error_px))
    return Rim(
        cone,
        points,
        fitted.ellipse,
        fitted.rim_used,
        -1 if fitted.contrast > 0.0 else 1,
        axis_error_px=float(np.sqrt(fitted.covariance[3, 3])),
        modes_covariance=_modes_covariance(camera, fitted, factor),
        ellipse_covariance=fitted.covariance,
    )


def _has_settled_length(fitted: ThinEllipse) -> bool:
    """Tell whether the levels of a sliver settle how long it is, and with it how far away."""
    return float(np.sqrt(fitted.covariance[2, 2])) < _WORST_LENGTH * float(fitted.ellipse.semi_major)


def _is_settled(fitted: ThinEllipse) -> bool:
    """Tell whether what is seen of a partly hidden sliver settles its length, and none of what hides it is left."""
    error = float(np.sqrt(fitted.covariance[2, 2]))
    return error < _WORST_MAJOR * float(fitted.ellipse.semi_major) and not fitted.is_structured


def _spans(rim: Rim) -> bool:
    """Tell whether the edges of a rim with sharp tips, where they are biased, lie far enough around to settle it."""
    error = float(axis_errors(rim.ellipse, rim.points, _EDGE_ERROR_PX)[0])
    return error < _WORST_SPAN * float(rim.ellipse.semi_major)


def _modes_covariance(camera: Camera, fitted: ThinEllipse, factor: FloatArray) -> FloatArray | None:
    """Return the covariance (5, 5) of the modes of the cone with `factor`, from that of the ellipse in the image.

    None where the ellipse may be a segment.
    """
    ellipse = fitted.ellipse
    if float(ellipse.semi_minor) < _SEGMENT_SIGMAS * float(np.sqrt(fitted.covariance[3, 3])):
        # A segment as far as can be told: its modes are not small.
        return None
    theta = np.array([*ellipse.center, ellipse.semi_major, ellipse.semi_minor, ellipse.angle])
    columns = []
    for i, step in enumerate((_STEP_PX, _STEP_PX, _STEP_PX, _STEP_PX, _STEP_PX / float(ellipse.semi_major))):
        changed = theta + step * (np.arange(5) == i)
        other = factor_from_ellipse(camera, Ellipse(changed[:2], changed[2], changed[3], changed[4]))
        if other is None:
            return None
        columns.append(amounts_between(factor, other @ np.diag(SIGNATURE) @ other.T) / step)
    slopes = np.stack(columns, axis=-1)
    return np.asarray(slopes @ fitted.covariance @ slopes.T)


def _without_outliers(edges: SeenPoints, start: FloatArray) -> tuple[ConeFit, SeenPoints] | None:
    """Fit a cone, near that with the factor `start`, to `edges`, leaving out those that stand apart.

    Returns also those in use.
    """
    for _ in range(_TRIMS):
        fit = fit_cone_to(edges, start=start)
        if fit is None:
            return None
        start = fit.factor
        residual = np.abs(fit.residuals_px)
        near = residual <= max(_OUTLIER * 1.4826 * float(np.median(residual)), _FINEST_PX)
        if near.all():
            return fit, edges
        edges = edges[near]
    fit = fit_cone_to(edges, start=start)
    return None if fit is None else (fit, edges)


def rim_from_fit(
    camera: Camera, fit: ConeFit, points: FloatArray, rim_used: float = 1.0, polarity: int = 1
) -> Rim | None:
    """Return the rim of a cone fitted to `points` (n, 2), with its ellipse in the raw image; None where unseen."""
    ellipses, found = image_ellipses(camera, fit.factor[None])
    if not found[0]:
        return None
    return Rim(fit, points, ellipses[0], rim_used, polarity, _axis_error_px(fit, len(points)))


def segment_from_fit(camera: Camera, fit: ConeFit, points: FloatArray) -> Rim:
    """Return the rim of a flat cone fitted to `points` (n, 2): a segment or sliver, straight in the image."""
    frame = principal_frame(fit.factor)
    u, v, w = frame.rotation.T
    sides = np.array([[-1.0], [1.0]])
    ends = camera.project(w + sides * frame.tan_half_major * u)
    half, across = (
        np.diff(ends, axis=0)[0] / 2.0,
        np.diff(camera.project(w + sides * frame.tan_half_minor * v), axis=0),
    )
    axes = [np.hypot(*half), np.hypot(*across[0]) / 2.0]
    ellipse = Ellipse.from_axes(ends.mean(axis=0), axes, np.arctan2(half[1], half[0]))
    return Rim(fit, points, ellipse, 1.0, 1, _axis_error_px(fit, len(points)))


def as_given(rim: Rim) -> Rim:
    """Return the rim of points that were given, not found in an image: only their scatter says how exact they are."""
    freedom = max(len(rim.points) - MODES, 1)
    error = rim.cone.rms_px * np.sqrt(len(rim.points) / freedom) / np.sqrt(len(rim.points) / 4.0)
    return replace(rim, axis_error_px=float(error), least_width_px=0.0)


def has_length(rim: Rim) -> bool:
    """Tell whether the points of a rim, by their scatter about it, settle its semi-major axis."""
    error = float(axis_errors(rim.ellipse, rim.points, rim.cone.rms_px)[0])
    return error < _WORST_LENGTH * float(rim.ellipse.semi_major)


def _axis_error_px(fit: ConeFit, number: int) -> float:
    # Of n radial errors around the rim, two combine to make the axes long or short and as many unequal.
    return float(max(fit.rms_px, _LEAST_NOISE_PX) / np.sqrt(number / 4.0))
