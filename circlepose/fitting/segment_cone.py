"""A contour on a line: the viewing cone of a circle seen edge-on, a plane sector, which no ellipse fit gives.

Its rays lie in one plane through the camera. Where the contour has a width, however small, an ellipse is fitted with
that width as the unit across it, which keeps the digits that one unit for both would lose: the cone is that of a
sliver. Where the width is rounding or noise, the two extreme points are the ends of the sector, as in section III of
Chen & Huang (1999). Pure NumPy.
"""

from __future__ import annotations

import numpy as np

from circlepose._typing import FloatArray
from circlepose.fitting.cone_fit import ConeFit, SeenPoints
from circlepose.fitting.direct import fit_ellipse
from circlepose.geometry.conic import rim_distance

FLAT_PX = 0.35
"""Half the width up to which a contour may be a segment: what is narrower is taken to be seen edge-on."""
_FLATTEST = 1e-4
"""Axis ratio below which an ellipse fit loses its digits."""
_LEAST_WIDTH = 1e-10
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
    sector = _sector(first, last, across)
    sliver = _sliver(rays, sector)
    if sliver is not None:
        factor, distance = sliver
        return ConeFit(factor, distance / np.maximum(px, 1e-300))
    sector[:, 1] = 0.0
    return ConeFit(sector, residuals)


def _sliver(rays: FloatArray, sector: FloatArray) -> tuple[FloatArray, FloatArray] | None:
    """Return the factor (3, 3) of the sliver that a contour with a width is, and its distances (n,) from it, in rad.

    None where the width is rounding, or noise.
    """
    local = rays @ np.linalg.inv(sector).T
    plane = local[:, :2] / local[:, 2:]
    width = float(np.abs(plane[:, 1]).max())
    if width < _LEAST_WIDTH * float(np.linalg.norm(sector[:, 0]) / np.linalg.norm(sector[:, 2])):
        return None
    plane = plane / [1.0, width]
    ellipse = fit_ellipse(plane)
    if ellipse is None:
        return None
    distance = rim_distance(ellipse[None], plane[None])[0]
    if float(np.sqrt(np.mean(distance**2))) > _RAGGED:
        return None
    # Errors along the sliver hardly show, so the distances are those across it.
    return sector @ np.diag([1.0, width, 1.0]) @ ellipse.factor, width * distance


def _sector(first: FloatArray, last: FloatArray, across: FloatArray) -> FloatArray:
    """Return a factor (3, 3) of the plane sector between two rays. Its second column is `across`, for a basis."""
    first, last = (end - (end @ across) * across for end in (first, last))
    first, last = first / np.linalg.norm(first), last / np.linalg.norm(last)
    w = first + last
    u = last - first
    return np.stack([u / np.linalg.norm(w), across, w / np.linalg.norm(w)], axis=-1)
