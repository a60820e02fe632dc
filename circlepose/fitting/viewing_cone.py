"""Contour pixels -> the circle's viewing cone, through the full lens model.

A circle's image under a distorting lens is no ellipse, its viewing cone always is a cone. So the contour is
turned into rays, the ellipse is fitted in a plane that faces them, and residuals are brought back to pixels
through the local derivative of pixel -> ray.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from circlepose._typing import FloatArray
from circlepose.camera import Camera
from circlepose.cone import SIGNATURE, plane_basis
from circlepose.conic import Ellipse, wrap_half_turn
from circlepose.fitting.direct import fit_ellipse

_FORWARD = 0.2
"""z of a unit ray from which the plane z = 1 serves: within 78 deg of the axis."""


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
        return float(np.sqrt(np.mean(self.residuals_px**2)))


def fit_cone(camera: Camera, pixels: FloatArray, weights: FloatArray | None = None) -> ConeFit | None:
    """Fit the viewing cone of the contour `pixels` (n, 2) of the raw image.

    None when no ellipse fits: fewer than 6 points, on a line, or outside the lens model's valid field.
    """
    rays, jacobians = camera.rays_with_jacobian(pixels)
    if not np.all(np.isfinite(rays)):
        return None
    axis = rays.sum(axis=0)
    axis = axis / np.linalg.norm(axis)
    turn = np.stack([*plane_basis(axis), axis])
    local = rays @ turn.T
    if np.any(local[:, 2] <= 0.05):
        return None
    ellipse = fit_ellipse(local[:, :2] / local[:, 2:], weights)
    if ellipse is None or ellipse.semi_minor <= 0.0:
        return None
    local_jacobians = turn @ jacobians
    refined = _least_squares(ellipse, local, local_jacobians, weights)
    factor = turn.T @ refined.factor
    return ConeFit(factor, rim_distance_px(factor, rays, jacobians))


def factor_from_ellipse(camera: Camera, ellipse: Ellipse) -> FloatArray | None:
    """Return the factor (3, 3) of the cone through an ellipse of the raw image; also of a segment.

    Exact without distortion; with it, the lens is taken as linear over the ellipse, so keep to small ones.
    None outside the lens model's valid field.
    """
    factor = ellipse.factor
    ends = np.stack([factor[:2, 2] + sign * factor[:2, axis] for axis in (0, 1) for sign in (1.0, -1.0)])
    rays = camera.rays(ends)
    if not np.all(np.isfinite(rays)):
        return None
    if np.all(rays[:, 2] > _FORWARD):
        turn = np.eye(3)
    else:
        axis = rays.sum(axis=0)
        axis = axis / np.linalg.norm(axis)
        turn = np.stack([*plane_basis(axis), axis])
    plane = rays @ turn.T
    plane = plane / plane[:, 2:]
    columns = [(plane[0] - plane[1]) / 2.0, (plane[2] - plane[3]) / 2.0, plane.mean(axis=0)]
    return np.asarray(turn.T @ np.stack(columns, axis=-1))


def rim_distance_px(factor: FloatArray, rays: FloatArray, jacobians: FloatArray) -> FloatArray:
    """Return the first-order signed distance (n,), in px, of `rays` (n, 3) to a cone's rim, positive outside.

    With `jacobians` (n, 3, 2) = d ray / d pixel. The cone's function is taken as |y_12|/y_3 - 1 in the
    factor's own coordinates y = A^-1 x, in which the rim is a unit circle: nearly linear across the rim, so
    first order goes a long way.
    """
    coordinates = rays @ np.linalg.inv(factor).T
    radius = np.hypot(coordinates[:, 0], coordinates[:, 1])
    value = radius / coordinates[:, 2] - 1.0
    direction = coordinates * SIGNATURE
    slope = np.stack(
        [
            direction[:, 0] / (radius * coordinates[:, 2]),
            direction[:, 1] / (radius * coordinates[:, 2]),
            -radius / coordinates[:, 2] ** 2,
        ],
        axis=-1,
    ) @ np.linalg.inv(factor)
    gradient = np.einsum("ni,nij->nj", slope, jacobians)
    return value / np.hypot(gradient[:, 0], gradient[:, 1])


def _least_squares(
    ellipse: Ellipse, local: FloatArray, jacobians: FloatArray, weights: FloatArray | None, steps: int = 4
) -> Ellipse:
    """Polish an ellipse (in the plane z = 1 of `local` rays) so that its squared distances in px are least.

    Gauss-Newton on centre, semi-axes and angle; the distance's weight |d plane / d pixel| is held per step.
    """
    root_weights = np.ones(len(local)) if weights is None else np.sqrt(weights)
    plane = local[:, :2] / local[:, 2:]
    to_plane = (jacobians[:, :2, :] - plane[:, :, None] * jacobians[:, 2:, :]) / local[:, 2, None, None]
    current = ellipse
    for _ in range(steps):
        residual, slopes = _plane_distance(current, plane, to_plane)
        scaled = slopes * root_weights[:, None]
        try:
            step = np.linalg.lstsq(scaled, -residual * root_weights, rcond=None)[0]
        except np.linalg.LinAlgError:
            return current
        axes = np.array([current.semi_major, current.semi_minor])
        # A step that would lose half an axis is no refinement: keep what the direct fit gave.
        if not np.all(np.isfinite(step)) or np.any(np.abs(step[2:4]) > 0.5 * axes):
            return current
        current = Ellipse.from_axes(
            current.center + step[:2], axes + step[2:4], wrap_half_turn(current.angle + step[4])
        )
        if np.all(np.abs(step[:4]) < 1e-9 * axes[1]):
            break
    return current


def _plane_distance(ellipse: Ellipse, plane: FloatArray, to_plane: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the distances (n,) in px of points (n, 2) to the rim and their derivatives (n, 5)."""
    cos, sin = np.cos(ellipse.angle), np.sin(ellipse.angle)
    a, b = ellipse.semi_major, ellipse.semi_minor
    offset = plane - ellipse.center
    along = cos * offset[:, 0] + sin * offset[:, 1]
    across = cos * offset[:, 1] - sin * offset[:, 0]
    x, y = along / a, across / b
    radius = np.maximum(np.hypot(x, y), 1e-12)
    value = radius - 1.0
    # d value / d (along, across), then to the plane's axes and on to pixels.
    by_along, by_across = x / (radius * a), y / (radius * b)
    slope = np.stack([by_along * cos - by_across * sin, by_along * sin + by_across * cos], axis=-1)
    gradient = np.einsum("ni,nij->nj", slope, to_plane)
    per_px = np.hypot(gradient[:, 0], gradient[:, 1])
    derivatives = np.stack(
        [
            -slope[:, 0],
            -slope[:, 1],
            -x * x / (radius * a),
            -y * y / (radius * b),
            by_along * across - by_across * along,
        ],
        axis=-1,
    )
    return value / per_px, derivatives / per_px[:, None]
