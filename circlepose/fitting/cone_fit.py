"""Contour pixels -> the circle's viewing cone, through the full lens model.

A circle's image under a distorting lens is no ellipse, its viewing cone always is a cone. So the contour is
turned into rays, the ellipse is fitted in a plane that faces them, and residuals are brought back to pixels
through the local derivative of pixel -> ray.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from circlepose._typing import BoolArray, FloatArray, IntArray
from circlepose.camera.camera import Camera
from circlepose.fitting.direct import MINIMUM_POINTS, Contours, fit_ellipse, fit_ellipses
from circlepose.fitting.sampson import refine_ellipse
from circlepose.geometry.cone import plane_basis
from circlepose.geometry.conic import Ellipse

_STEPS = 12
"""The direct fit is a good start: two or three steps do for a whole rim."""
_FORWARD = 0.2
"""z of a unit ray from which the plane z = 1 serves: within 78 deg of the axis."""


@dataclass(frozen=True, slots=True, eq=False)
class SeenPoints:
    """Image points with their rays, which under a distorting lens cost more than a fit."""

    pixels: FloatArray
    """(n, 2) raw image"""
    rays: FloatArray
    """(n, 3) unit length"""
    jacobians: FloatArray
    """(n, 3, 2) d ray / d pixel"""

    @classmethod
    def of(cls, camera: Camera, pixels: FloatArray) -> Self:
        """Look up the rays of `pixels` (n, 2)."""
        return cls(pixels, *camera.rays_with_jacobian(pixels))

    def __getitem__(self, which: BoolArray) -> Self:
        return type(self)(self.pixels[which], self.rays[which], self.jacobians[which])

    def __len__(self) -> int:
        return len(self.pixels)


@dataclass(frozen=True, slots=True, eq=False)
class ConeFit:
    """A viewing cone fitted to a contour."""

    factor: FloatArray
    """(3, 3) in the camera frame, see `cone`"""
    residuals_px: FloatArray
    """(n,) signed first-order distance of each contour point to the fitted rim, positive outside"""

    @property
    def rms_px(self) -> float:
        """Root mean square of the residuals."""
        return float(np.sqrt(self.residuals_px @ self.residuals_px / len(self.residuals_px)))


def fit_cone(camera: Camera, pixels: FloatArray, weights: FloatArray | None = None) -> ConeFit | None:
    """Fit the viewing cone of the contour `pixels` (n, 2) of the raw image.

    None when no ellipse fits: fewer than 6 points, on a line, or outside the lens model's valid field.
    """
    return fit_cone_to(SeenPoints.of(camera, pixels), weights)


def fit_cone_to(
    seen: SeenPoints, weights: FloatArray | None = None, start: FloatArray | None = None
) -> ConeFit | None:
    """As `fit_cone`, for points whose rays are known already; `start` (3, 3) may be the factor of a cone close by."""
    rays, jacobians = seen.rays, seen.jacobians
    if len(rays) < MINIMUM_POINTS or not np.all(np.isfinite(rays)):
        return None
    axis = rays.sum(axis=0)
    axis = axis / np.linalg.norm(axis)
    turn = np.stack([*plane_basis(axis), axis])
    local = rays @ turn.T
    if np.any(local[:, 2] <= 0.05):
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


def _section(factor: FloatArray) -> Ellipse | None:
    """Return the ellipse in which the cone with `factor` (3, 3) meets the plane z = 1; None where it is none."""
    ellipses, found = Ellipse.from_factor(factor[None])
    return ellipses[0] if found[0] else None


def direct_cones(camera: Camera, contours: Sequence[FloatArray]) -> tuple[FloatArray, list[FloatArray]]:
    """Fit the viewing cones of m contours (n, 2) of the raw image at once, by algebraic distance: good to start from.

    Returns factors (m, 3, 3) and the residuals (n,) px of each contour, which are NaN where there is no such cone: no
    ellipse fits, or it is seen too far from the axis for the plane z = 1.
    """
    every = Contours.of(list(contours))
    rays, jacobians = camera.rays_with_jacobian(every.points)
    forward = rays[:, 2] > _FORWARD
    plane = rays[:, :2] / np.where(forward, rays[:, 2], np.inf)[:, None]
    ellipses, found = fit_ellipses(Contours(np.nan_to_num(plane), every.starts))
    found &= every.total((~forward).astype(np.float64)) == 0.0
    factors = np.where(found[:, None, None], ellipses.factor, np.eye(3))
    owner = every.owner
    residuals = np.where(found[owner], rim_distances_px(factors, owner, rays, jacobians), np.nan)
    return factors, np.split(residuals, every.starts[1:])


def factor_from_ellipse(camera: Camera, ellipse: Ellipse) -> FloatArray | None:
    """Return the factor (3, 3) of the cone through one ellipse of the raw image, see `factors_from_ellipses`.

    None outside the lens model's valid field.
    """
    factors, seen = factors_from_ellipses(camera, ellipse[None])
    return factors[0] if seen[0] else None


def factors_from_ellipses(camera: Camera, ellipses: Ellipse) -> tuple[FloatArray, BoolArray]:
    """Return the factors (m, 3, 3) of the cones through ellipses (m,) of the raw image, or segments.

    Exact without distortion; with it, the lens is taken as linear over the ellipse, so keep to small ones. Also tells
    (m,) which lie in the lens model's valid field; of the others the factor is that of no ellipse.
    """
    factor = ellipses.factor
    if camera.is_free_of_distortion:
        return np.asarray(np.linalg.inv(camera.camera_matrix) @ factor), np.ones(len(factor), dtype=np.bool_)
    factor = factor[:, :2]
    middle = factor[:, :, 2]
    ends = np.stack([middle + sign * factor[:, :, axis] for axis in (0, 1) for sign in (1.0, -1.0)], axis=1)
    rays = camera.rays(ends)
    seen = np.asarray(np.isfinite(rays).all(axis=(1, 2)))
    rays[~seen] = np.array([0.0, 0.0, 1.0])
    turn = np.broadcast_to(np.eye(3), (len(rays), 3, 3))
    sideways = np.any(rays[..., 2] <= _FORWARD, axis=1)
    if sideways.any():
        axis = rays.sum(axis=1)
        axis = axis / np.linalg.norm(axis, axis=-1, keepdims=True)
        turn = np.where(sideways[:, None, None], np.stack([*plane_basis(axis), axis], axis=1), turn)
        rays = rays @ np.swapaxes(turn, 1, 2)
    plane = rays / rays[..., 2:]
    columns = [(plane[:, 0] - plane[:, 1]) / 2.0, (plane[:, 2] - plane[:, 3]) / 2.0, plane.mean(axis=1)]
    found = np.stack(columns, axis=-1)
    if sideways.any():
        found = np.swapaxes(turn, 1, 2) @ found
    found[~seen] = np.eye(3)
    return found, seen


def rim_distance_px(factor: FloatArray, rays: FloatArray, jacobians: FloatArray) -> FloatArray:
    """Return the first-order signed distance (n,), in px, of `rays` (n, 3) to a cone's rim, positive outside.

    With the cone's `factor` (3, 3) and `jacobians` (n, 3, 2) = d ray / d pixel. The cone's function is taken as
    |y_12|/y_3 - 1 in the factor's own coordinates y = A^-1 x, in which the rim is a unit circle: nearly linear across
    the rim, so first order goes a long way.
    """
    return _distance_px(np.asarray(np.linalg.inv(factor)), rays, jacobians)


def rim_distances_px(factors: FloatArray, owner: IntArray, rays: FloatArray, jacobians: FloatArray) -> FloatArray:
    """As `rim_distance_px`, each ray to the cone of its `owner` (n,) among those with `factors` (m, 3, 3)."""
    return _distance_px(np.asarray(np.linalg.inv(factors))[owner], rays, jacobians)


def _distance_px(inverse: FloatArray, rays: FloatArray, jacobians: FloatArray) -> FloatArray:
    _, growth, per_px = rim_growth(inverse, rays, jacobians)
    return growth / per_px


def rim_growth(
    inverse: FloatArray, rays: FloatArray, jacobians: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return where rays lie about a cone's rim, in the factor's own coordinates y = A^-1 x.

    Parameters
    ----------
    inverse
        (3, 3) of the factor, or (n, 3, 3) for a cone each.
    rays
        (n, 3)
    jacobians
        (n, 3, 2) = d ray / d pixel.

    Returns
    -------
    The coordinates y (n, 3), the growth |y_12|/y_3 - 1 (n,), and its derivative (n,) per px across the rim.
    """
    y = (inverse @ rays[:, :, None])[..., 0]
    slopes = inverse @ jacobians
    radius = np.hypot(y[:, 0], y[:, 1])
    ratio = radius / y[:, 2]
    along = (y[:, 0, None] * slopes[:, 0] + y[:, 1, None] * slopes[:, 1]) / (radius * y[:, 2])[:, None]
    gradient = along - (ratio / y[:, 2])[:, None] * slopes[:, 2]
    return y, ratio - 1.0, np.hypot(gradient[:, 0], gradient[:, 1])


def _pixel_covariances(rays: FloatArray, jacobians: FloatArray) -> FloatArray:
    """Return the covariance (n, 2, 2), in the plane z = 1, of a pixel with an error of 1 px both ways.

    For `rays` (n, 3) and `jacobians` (n, 3, 2) = d ray / d pixel: distances in standard errors are then in px.
    """
    plane = rays[:, :2] / rays[:, 2:]
    to_plane = (jacobians[:, :2, :] - plane[:, :, None] * jacobians[:, 2:, :]) / rays[:, 2, None, None]
    return np.einsum("nij,nkj->nik", to_plane, to_plane)
