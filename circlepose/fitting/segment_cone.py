"""A contour on a line: the viewing cone of a circle seen edge-on, a plane sector, which no ellipse fit gives.

Its rays lie in one plane through the camera. Where the contour has a width, however small, an ellipse is fitted with
that width as the unit across it, which keeps the digits that one unit for both would lose. Where it has none its two
extreme points are the ends of the sector, as in section III of Chen & Huang (1999). Pure NumPy.
"""

from __future__ import annotations

import numpy as np

from circlepose._typing import FloatArray
from circlepose.fitting.cone_fit import ConeFit, SeenPoints
from circlepose.fitting.direct import fit_ellipse
from circlepose.geometry.conic import Ellipse, rim_distance

FLAT_PX = 0.35
"""Half the width up to which a contour may be a segment: what is narrower is taken to be seen edge-on."""
_FLATTEST = 1e-4
"""Axis ratio below which an ellipse fit loses its digits."""
_LEAST_WIDTH = 1e-9
"""The same, below which the width is rounding."""
_RAGGED = 1e-3
"""rms distance from the ellipse, in semi-minor axes, from which the width is noise and says nothing of the length."""


def is_flat(fit: ConeFit) -> bool:
    """Tell whether a fitted cone is so flat that an ellipse fit in one unit has lost its digits."""
    values = np.linalg.svd(fit.factor / np.linalg.norm(fit.factor[:, 2]), compute_uv=False)
    return bool(values[2] < _FLATTEST * values[1])


def fit_flat_cone(seen: SeenPoints) -> ConeFit | None:
    """Fit the flat viewing cone of a closed contour whose rays lie in a plane; None where they do not, or are one.

    Its residuals are the distances from the plane, in px.
    """
    rays = seen.rays
    if len(rays) < 2 or not np.all(np.isfinite(rays)):
        return None
    w = rays.sum(axis=0)
    w = w / np.linalg.norm(w)
    along = np.linalg.svd(rays - (rays @ w)[:, None] * w, full_matrices=False)[2][0]
    across = np.linalg.svd(rays, full_matrices=False)[2][-1]
    # A round contour has no such plane.
    px = np.linalg.norm(np.einsum("nij,i->nj", seen.jacobians, across), axis=1)
    residuals = (rays @ across) / np.maximum(px, 1e-300)
    if float(np.abs(residuals).max()) > FLAT_PX:
        return None
    first, last = rays[int(np.argmin(rays @ along))], rays[int(np.argmax(rays @ along))]
    if float(np.linalg.norm(last - first)) < 1e-12:
        return None
    factor = _sector(*_ends(rays, across, first, last), across)
    factor[:, 1] = 0.0
    return ConeFit(factor, residuals)


def _ends(rays: FloatArray, across: FloatArray, first: FloatArray, last: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the rays of both ends: those of the ellipse that the contour is, if it has a width, or its extremes."""
    factor = _sector(first, last, across)
    local = rays @ np.linalg.inv(factor).T
    plane = local[:, :2] / local[:, 2:]
    width = float(np.abs(plane[:, 1]).max())
    s = float(np.linalg.norm(factor[:, 0]) / np.linalg.norm(factor[:, 2]))
    if width < _LEAST_WIDTH * s:
        return first, last
    plane = plane / [1.0, width]
    ellipse = fit_ellipse(plane)
    if ellipse is None or float(np.sqrt(np.mean(rim_distance(ellipse[None], plane[None])[0] ** 2))) > _RAGGED:
        return first, last
    return _extremes(factor, ellipse)


def _extremes(factor: FloatArray, ellipse: Ellipse) -> tuple[FloatArray, FloatArray]:
    """Return the rays at the ends of `ellipse`, given in units of `factor`, along its first axis."""
    cos, sin = float(np.cos(ellipse.angle)), float(np.sin(ellipse.angle))
    reach = float(np.hypot(float(ellipse.semi_major) * cos, float(ellipse.semi_minor) * sin))
    ends = [factor[:, 2] + (float(ellipse.center[0]) + side * reach) * factor[:, 0] for side in (-1.0, 1.0)]
    return ends[0] / np.linalg.norm(ends[0]), ends[1] / np.linalg.norm(ends[1])


def _sector(first: FloatArray, last: FloatArray, across: FloatArray) -> FloatArray:
    """Return a factor (3, 3) of the plane sector between two rays. Its second column is `across`, for a basis."""
    first, last = (end - (end @ across) * across for end in (first, last))
    first, last = first / np.linalg.norm(first), last / np.linalg.norm(last)
    w = first + last
    u = last - first
    return np.stack([u / np.linalg.norm(w), across, w / np.linalg.norm(w)], axis=-1)
