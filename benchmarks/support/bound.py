"""The Cramer-Rao bound of a rendered disc's pose: what image noise leaves to the best of estimators.

From differences of the noise-free renderer, so that nothing of the estimator is in it. Unknown are centre and
normal, blur and both grey levels; known are the camera, the radius, and how the image is lit. Noise is the camera's
and that of rounding to whole levels, 1/12.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from circlepose._typing import FloatArray
from circlepose.camera.camera import Camera, circle_contour
from circlepose.geometry.cone import plane_basis
from circlepose.synthesis.render import render_float
from circlepose.synthesis.scene import Disc, Paint, Scene, Shading

QUANTIZATION = 1.0 / 12.0
STEP_PX = 0.02
"""How far a step moves the rim, about."""
OVERSAMPLING = 3
_BORDER_PX = 4.0
_BORDER_SIGMAS = 5.0


def cropped(scene: Scene) -> Scene:
    """Return the scene seen through a window that just holds its disc, by the same camera, evenly lit."""
    disc = scene.targets[0]
    assert isinstance(disc, Disc)
    rim = circle_contour(scene.camera, disc.center_mm, disc.normal, disc.radius_mm, 180)
    border = _BORDER_PX + _BORDER_SIGMAS * scene.blur_px
    first = np.maximum(np.floor(rim.min(axis=0) - border), 0.0)
    last = np.minimum(np.ceil(rim.max(axis=0) + border), np.array(scene.image_size) - 1.0)
    matrix = scene.camera.camera_matrix.copy()
    matrix[:2, 2] -= first
    width, height = (last - first + 1.0).astype(int)
    camera = Camera.create(matrix, scene.camera.dist_coeffs, (int(width), int(height)), scene.camera.model)
    return replace(scene, camera=camera, shading=Shading())


def share_derivatives(scene: Scene, step_px: float = STEP_PX, oversampling: int = OVERSAMPLING) -> FloatArray:
    """Return (7, n) of the n pixels around the disc: its share in each, and the share's derivatives.

    These are to the centre (3, per mm), two tilts of the normal (per rad) towards the vectors of
    `cone.plane_basis(normal)`, and the blur (per px).
    """
    window = cropped(scene)
    disc = window.targets[0]
    assert isinstance(disc, Disc)

    def share(center: FloatArray, normal: FloatArray, blur_px: float) -> FloatArray:
        seen = Disc(center, normal, disc.radius_mm, Paint(1.0))
        bare = replace(window, targets=(seen,), background=Paint(0.0), blur_px=blur_px)
        return render_float(bare, oversampling).ravel()

    center, normal, blur = np.array(disc.center_mm), np.array(disc.normal), scene.blur_px
    distance = float(np.linalg.norm(center))
    per_px = distance / float(window.camera.camera_matrix[0, 0])
    radius_px = disc.radius_mm / per_px
    step_mm, step_rad = step_px * per_px, step_px / radius_px
    rows = [share(center, normal, blur)]
    for axis in np.eye(3):
        # Along the line of sight a step changes the size alone.
        step = step_mm * (distance / disc.radius_mm if axis[2] else 1.0)
        ahead, back = (share(center + way * step * axis, normal, blur) for way in (1.0, -1.0))
        rows.append((ahead - back) / (2.0 * step))
    for axis in plane_basis(normal):
        # A tilt from frontal moves the rim to second order only, so the step is a wide one.
        step = 4.0 * step_rad
        turned = (np.cos(step) * normal + way * np.sin(step) * axis for way in (1.0, -1.0))
        ahead, back = (share(center, other, blur) for other in turned)
        rows.append((ahead - back) / (2.0 * step))
    ahead, back = (share(center, normal, blur + way * step_px) for way in (1.0, -1.0))
    rows.append((ahead - back) / (2.0 * step_px))
    return np.stack(rows)


def pose_bound(derivatives: FloatArray, contrast: float, noise_levels: float) -> FloatArray:
    """Return the bound (5, 5) on the covariance of centre (mm^2) and tilts (rad^2), from `share_derivatives`."""
    share, slopes = derivatives[0], contrast * derivatives[1:]
    rows = np.concatenate([slopes, share[None], 1.0 - share[None]])
    scale = np.linalg.norm(rows, axis=1)
    scaled = rows / scale[:, None]
    information = scaled @ scaled.T / (noise_levels**2 + QUANTIZATION)
    bound = np.linalg.inv(information) / np.outer(scale, scale)
    return np.asarray(bound[:5, :5])
