"""The camera of another lens model that is nearest to a camera, and how far it is off over the image.

For a person who has to decide whether another model will do; nothing here is measured with.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from circlepose._typing import FloatArray
from circlepose.camera import lens
from circlepose.camera.camera import Camera, LensModel

_FITTED = (41, 31)
_COMPARED = (81, 61)
"""Columns and rows of the grids of pixels to which a model is fitted, and at which it is compared: to the corners."""
WIDEST_DEG = 80.0
"""Field angle up to which a pinhole model is fitted: at 90 deg it has no image."""
_LEAST_PIXELS = 30
_STEPS = 60
_SMALLEST_GAIN = 1e-5
"""The fit ends where a step makes the sum of squares smaller by less than this share."""


@dataclass(frozen=True, slots=True)
class Approximation:
    """How well the best camera of a model follows another camera."""

    rms_px: float
    """root mean square of the distances between the pixels at which both see the same rays"""
    max_px: float
    """the largest of these distances"""
    share: float
    """of the image that was compared: without what lies beyond the lens model, or too far off a pinhole's axis"""


def approximate(camera: Camera, model: LensModel, count: int) -> Approximation | None:
    """Fit a camera without skew of another lens model to `camera`, by least squares over the pixels of its image.

    Parameters
    ----------
    camera
        The camera to follow; its image size has to be known.
    model, count
        The lens model of the other, and how many coefficients it has, in OpenCV's order.

    Returns
    -------
    How far it is off, in px; None where the image size is not known, or too little of the image can be compared.
    """
    from scipy.optimize import least_squares  # noqa: PLC0415 - takes long to import, and is rarely needed

    if camera.image_size is None:
        return None
    pixels, rays, _ = _samples(camera, model, _FITTED)
    if len(pixels) < _LEAST_PIXELS:
        return None
    project = _projection(model, rays)

    def residuals(parameters: FloatArray) -> FloatArray:
        return (project(parameters) - pixels).ravel()

    matrix = camera.camera_matrix
    core = [matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2]]
    own = camera.dist_coeffs[:count] if camera.model == model else np.zeros(0)
    starts = [np.array([*core, *own, *np.zeros(count - len(own))]), np.array([*core, *np.zeros(count)])]
    with np.errstate(all="ignore"):
        fits = [
            least_squares(
                residuals, start, x_scale="jac", max_nfev=_STEPS, ftol=_SMALLEST_GAIN, xtol=1e-12, gtol=1e-12
            )
            for start in starts
            if np.isfinite(residuals(start)).all()
        ]
    if not fits:
        return None
    best = min(fits, key=lambda fit: float(fit.cost)).x
    pixels, rays, share = _samples(camera, model, _COMPARED)
    with np.errstate(all="ignore"):
        distances = np.hypot(*(_projection(model, rays)(best) - pixels).T)
    return Approximation(float(np.sqrt(np.mean(distances**2))), float(distances.max()), share)


def _samples(camera: Camera, model: LensModel, grid: tuple[int, int]) -> tuple[FloatArray, FloatArray, float]:
    """Return pixels (n, 2) of the image, their rays (n, 3), and the share of the image that they stand for."""
    width, height = camera.image_size or (1, 1)
    places = np.meshgrid(np.linspace(0.0, width - 1.0, grid[0]), np.linspace(0.0, height - 1.0, grid[1]))
    pixels = np.stack([each.ravel() for each in places], axis=-1)
    rays = camera.rays(pixels)
    least_depth = np.cos(np.radians(WIDEST_DEG)) if model == "pinhole" else -1.0
    with np.errstate(invalid="ignore"):
        is_seen = rays[:, 2] >= least_depth
    return pixels[is_seen], rays[is_seen], float(np.mean(is_seen))


def _projection(model: LensModel, rays: FloatArray) -> Callable[[FloatArray], FloatArray]:
    """Return what takes fx, fy, cx, cy and the coefficients to the pixels (n, 2) of `rays` (n, 3)."""
    axial_distance = np.hypot(rays[:, 0], rays[:, 1])
    theta = np.arctan2(axial_distance, rays[:, 2])
    direction = rays[:, :2] / np.maximum(axial_distance, 1e-300)[:, None]

    def project(parameters: FloatArray) -> FloatArray:
        fx, fy, cx, cy = parameters[:4]
        if model == "fisheye":
            u, v = (direction * lens.fisheye_radius(theta, parameters[4:])[0][:, None]).T
        else:
            u, v = lens.pinhole_plane(rays[:, 0] / rays[:, 2], rays[:, 1] / rays[:, 2], parameters[4:])
        return np.stack([fx * u + cx, fy * v + cy], axis=-1)

    return project
