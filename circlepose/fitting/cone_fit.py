"""Contour pixels -> the circle's viewing cone, through the full lens model.

The image of a circle under a distorting lens is not an ellipse, but its viewing cone is always a cone. So the
contour is turned into rays, an ellipse is fitted in a plane across them, and residuals are brought back to px through
the local derivative of pixel -> ray.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from circlepose._typing import FloatArray
from circlepose.camera.camera import Camera
from circlepose.fitting.direct import MINIMUM_POINTS, Contours, fit_ellipse, fit_ellipses
from circlepose.fitting.observations import Observations, rim_distance_px, rim_distances_px
from circlepose.fitting.sampson import refine_ellipse
from circlepose.geometry.cone import plane_basis
from circlepose.geometry.ellipse import Ellipse

_STEPS = 12
"""Steps of the refinement at most; from the direct fit a whole rim takes two or three. Empirical."""
_LEAST_FORWARD = 0.05
"""Least cosine of the angle between a ray and the axis of the plane in which an ellipse is fitted: 87 deg."""
FORWARD = 0.2
"""Least z of a unit ray for which the plane z = 1 serves: within 78 deg of the optical axis."""


@dataclass(frozen=True, slots=True, eq=False)
class ConeFit:
    """A viewing cone fitted to a contour."""

    factor: FloatArray
    """(3, 3) in the camera frame, see `geometry.cone`"""
    residuals_px: FloatArray
    """(n,) signed first-order distance of each contour point to the fitted rim, positive outside"""

    @property
    def rms_px(self) -> float:
        """Root mean square of the residuals, px."""
        return float(np.sqrt(self.residuals_px @ self.residuals_px / len(self.residuals_px)))


def fit_cone(camera: Camera, pixels: FloatArray, weights: FloatArray | None = None) -> ConeFit | None:
    """Fit the viewing cone of one contour.

    Parameters
    ----------
    camera
        The calibration, for this image size.
    pixels
        (n, 2) px of the raw image.
    weights
        (n,) from 0 to 1, of the squared residuals; 1 by default.

    Returns
    -------
    The cone, in the camera frame. None where no ellipse fits: fewer than 6 points, points on a line, or a point
    outside the lens model's valid field. The ellipse has the least squared Sampson distance in px, see
    `fitting.sampson`.
    """
    return fit_cone_to(Observations.of(camera, pixels), weights)


def fit_cone_to(
    observations: Observations, weights: FloatArray | None = None, start: FloatArray | None = None
) -> ConeFit | None:
    """Fit the viewing cone of one contour whose rays are known.

    Parameters
    ----------
    observations
        The n contour points with their rays.
    weights
        (n,) from 0 to 1, of the squared residuals; 1 by default.
    start
        (3, 3) the factor of a cone close by, camera frame; by default the direct fit is the start.

    Returns
    -------
    As `fit_cone`.
    """
    rays, jacobians = observations.rays, observations.jacobians
    if len(rays) < MINIMUM_POINTS or not np.all(np.isfinite(rays)):
        return None
    axis = rays.sum(axis=0)
    axis = axis / np.linalg.norm(axis)
    turn = np.stack([*plane_basis(axis), axis])
    local = rays @ turn.T
    if np.any(local[:, 2] <= _LEAST_FORWARD):
        return None
    plane = local[:, :2] / local[:, 2:]
    ellipse = None if start is None else _section(turn @ start)
    if ellipse is None:
        ellipse = fit_ellipse(plane, weights)
    if ellipse is None or ellipse.semi_minor <= 0.0:
        return None
    refined, _ = refine_ellipse(ellipse, plane, _pixel_covariances(local, turn @ jacobians), weights, _STEPS)
    factor = turn.T @ refined.factor
    return ConeFit(factor, rim_distance_px(factor, rays, jacobians))


def direct_cones(camera: Camera, contours: Sequence[FloatArray]) -> tuple[FloatArray, list[FloatArray]]:
    """Fit the viewing cones of many contours at once, by algebraic distance: good enough to start from.

    Parameters
    ----------
    camera
        The calibration, for this image size.
    contours
        m arrays (n, 2), px of the raw image.

    Returns
    -------
    The factors (m, 3, 3), camera frame, and the residuals (n,), px, of each contour. The residuals are NaN where
    there is no cone: no ellipse fits, or a point is more than 78 deg off the optical axis. The fit is the direct one
    in the plane z = 1 (Halir & Flusser, 1998).
    """
    every = Contours.of(list(contours))
    rays, jacobians = camera.rays_with_jacobian(every.points)
    forward = rays[:, 2] > FORWARD
    plane = rays[:, :2] / np.where(forward, rays[:, 2], np.inf)[:, None]
    ellipses, found = fit_ellipses(Contours(np.nan_to_num(plane), every.starts))
    found &= every.total((~forward).astype(np.float64)) == 0.0
    factors = np.where(found[:, None, None], ellipses.factor, np.eye(3))
    owner = every.owner
    residuals = np.where(found[owner], rim_distances_px(factors, owner, rays, jacobians), np.nan)
    return factors, np.split(residuals, every.starts[1:])


def _section(factor: FloatArray) -> Ellipse | None:
    """Return the ellipse in which the cone with `factor` (3, 3) meets the plane z = 1; None where there is none."""
    ellipses, found = Ellipse.from_factor(factor[None])
    return ellipses[0] if found[0] else None


def _pixel_covariances(rays: FloatArray, jacobians: FloatArray) -> FloatArray:
    """Return the covariance (n, 2, 2), in the plane z = 1, of a pixel with an isotropic error of 1 px.

    For `rays` (n, 3) and `jacobians` (n, 3, 2) = d ray / d pixel: distances in standard errors are then in px.
    """
    plane = rays[:, :2] / rays[:, 2:]
    to_plane = (jacobians[:, :2, :] - plane[:, :, None] * jacobians[:, 2:, :]) / rays[:, 2, None, None]
    return np.einsum("nij,nkj->nik", to_plane, to_plane)
