"""A contour's ellipse -> the viewing cone, from edges placed again along the rim that the lens model predicts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from circlepose._typing import FloatArray, Image
from circlepose.camera import Camera
from circlepose.conic import Ellipse
from circlepose.extraction.contour import Contour
from circlepose.extraction.rim import contour_normals, locate_edges
from circlepose.fitting.consensus import local_scatter, on_one_ellipse
from circlepose.fitting.direct import fit_ellipse
from circlepose.fitting.thin_ellipse import are_thin, fit_thin_ellipse
from circlepose.fitting.viewing_cone import (
    ConeFit,
    SeenPoints,
    factor_from_ellipse,
    fit_cone,
    fit_cone_to,
    rim_distance_px,
)

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


def fit_rim(levels: Image, camera: Camera, contour: Contour, *, refine: bool = True) -> Rim | None:
    """Fit the viewing cone of `contour` in the grey image `levels` (h, w); None when it has none.

    Without `refine` the contour's own points are fitted and no edge is placed again.
    """
    if are_thin(contour.ellipse):
        thin = _thin_rim(levels, camera, contour.ellipse)
        if thin is not None:
            return thin
    fit = fit_cone(camera, contour.points)
    if fit is None:
        return None
    if not refine:
        return rim_from_fit(camera, fit, contour.points, contour.rim_used, contour.polarity)
    factor = fit.factor
    for last in (False, True):
        placed = _place_edges(levels, camera, factor, contour.ellipse)
        if placed is None:
            return None
        edges, places = placed
        refined = _without_outliers(edges)
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
    return rim_from_fit(camera, cone, used.pixels, len(used) / places, contour.polarity)


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
    again = fit_cone_to(edges[near])
    return None if again is None else (again, edges[near])


def _thin_rim(levels: Image, camera: Camera, start: Ellipse) -> Rim | None:
    """Fit a rim whose two sides, and all of its tips, are too close for edges to be placed."""
    fitted = fit_thin_ellipse(levels, start)
    if fitted is None or fitted.rms_levels > _WORST_RMS * fitted.peak_levels:
        return None
    points = fitted.ellipse.points(_THIN_PLACES)
    factor = factor_from_ellipse(camera, fitted.ellipse)
    if factor is None:
        return None
    # There are no edge points, whose scatter the residuals would be.
    cone = ConeFit(factor, np.full(len(points), fitted.error_px))
    polarity = -1 if fitted.contrast > 0.0 else 1
    return Rim(cone, points, fitted.ellipse, fitted.rim_used, polarity, float(np.sqrt(fitted.covariance[3, 3])))


def _without_outliers(edges: SeenPoints) -> tuple[ConeFit, SeenPoints] | None:
    """Fit a cone to `edges`, leaving out those that stand apart; also returns those in use."""
    for _ in range(_TRIMS):
        fit = fit_cone_to(edges)
        if fit is None:
            return None
        residual = np.abs(fit.residuals_px)
        near = residual <= max(_OUTLIER * 1.4826 * float(np.median(residual)), _FINEST_PX)
        if near.all():
            return fit, edges
        edges = edges[near]
    fit = fit_cone_to(edges)
    return None if fit is None else (fit, edges)


def rim_from_fit(
    camera: Camera, fit: ConeFit, points: FloatArray, rim_used: float = 1.0, polarity: int = 1
) -> Rim | None:
    """Return the rim of a cone fitted to `points` (n, 2), with its ellipse in the raw image; None where unseen."""
    ellipse = fit_ellipse(rim_pixels(camera, fit.factor, 90))
    if ellipse is None:
        return None
    # Of n radial errors around the rim, two combine to make the axes long or short and as many unequal.
    axis_error_px = max(fit.rms_px, _LEAST_NOISE_PX) / np.sqrt(len(points) / 4.0)
    return Rim(fit, points, ellipse, rim_used, polarity, float(axis_error_px))


def rim_pixels(camera: Camera, factor: FloatArray, number: int) -> FloatArray:
    """Return `number` pixels (number, 2) of the rim of the cone with `factor` (3, 3); NaN where unseen."""
    angle = np.linspace(0.0, 2.0 * np.pi, number, endpoint=False)
    unit = np.stack([np.cos(angle), np.sin(angle), np.ones(number)], axis=-1)
    return camera.project(unit @ factor.T)
