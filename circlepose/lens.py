"""Lens models on the normalized image plane and on the sphere, with their derivatives. Pure NumPy.

Both models map a point of the camera frame to the distorted normalized plane (focal length 1):

- pinhole: OpenCV's rational model with thin prisms and a tilted sensor, 0, 4, 5, 8, 12 or 14 coefficients
  (k1 k2 p1 p2 [k3 [k4 k5 k6 [s1 s2 s3 s4 [tau_x tau_y]]]]);
- fisheye: OpenCV's (Kannala-Brandt, "equidistant" in ROS and Kalibr), 4 coefficients.

Where a model folds back on itself (beyond the radius at which its radial function stops growing) it has
no meaning: such points come out as NaN, never as a plausible wrong number.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from circlepose._typing import FloatArray

PINHOLE_COUNTS = (0, 4, 5, 8, 12, 14)
FISHEYE_COUNT = 4
_SEARCH_RADIUS = 20.0
"""tan of the largest field angle considered for a pinhole model (87 deg off axis)."""


def distort_pinhole(points: FloatArray, dist_coeffs: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Project camera-frame `points` (..., 3) to the distorted plane (..., 2), with the Jacobian (..., 2, 3)."""
    p = np.asarray(points, dtype=np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse_depth = np.where(p[..., 2] > 0.0, 1.0 / p[..., 2], np.nan)
        plane = p[..., :2] * inverse_depth[..., None]
        r2 = np.sum(plane**2, axis=-1)
        plane = np.where((r2 < valid_radius(tuple(dist_coeffs)) ** 2)[..., None], plane, np.nan)
        distorted, inner = distort_plane(plane, dist_coeffs)
    outer = np.zeros((*p.shape[:-1], 2, 3))
    outer[..., 0, 0] = outer[..., 1, 1] = inverse_depth
    outer[..., :, 2] = -plane * inverse_depth[..., None]
    return distorted, inner @ outer


def undistort_pinhole(distorted: FloatArray, dist_coeffs: FloatArray) -> FloatArray:
    """Return the rays (..., 3), unit length, of points (..., 2) of the distorted plane; NaN where there is none."""
    target = np.asarray(distorted, dtype=np.float64)
    plane = target.copy()
    if np.any(dist_coeffs):
        plane = _invert_plane(target, dist_coeffs)
    rays = np.concatenate([plane, np.ones_like(plane[..., :1])], axis=-1)
    return np.asarray(rays / np.linalg.norm(rays, axis=-1, keepdims=True))


def distort_plane(plane: FloatArray, dist_coeffs: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Distort points (..., 2) of the normalized plane; also returns the Jacobian (..., 2, 2)."""
    k = np.zeros(14)
    k[: len(dist_coeffs)] = dist_coeffs
    k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, tau_x, tau_y = k
    x, y = plane[..., 0], plane[..., 1]
    r2 = x * x + y * y
    above = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    below = 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6))
    radial = above / below
    above_slope = k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3)
    below_slope = k4 + r2 * (2.0 * k5 + r2 * 3.0 * k6)
    # Derivative of the radial factor with respect to r^2, doubled as d(r^2) = 2 (x dx + y dy).
    slope = 2.0 * (above_slope - radial * below_slope) / below
    out = np.stack(
        [
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x) + r2 * (s1 + s2 * r2),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y + r2 * (s3 + s4 * r2),
        ],
        axis=-1,
    )
    prism_x, prism_y = 2.0 * (s1 + 2.0 * s2 * r2), 2.0 * (s3 + 2.0 * s4 * r2)
    xx = radial + x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x + prism_x * x
    xy = x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y + prism_x * y
    yx = x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y + prism_y * x
    yy = radial + y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x + prism_y * y
    jacobian = np.stack([np.stack([xx, xy], axis=-1), np.stack([yx, yy], axis=-1)], axis=-2)
    if tau_x == 0.0 and tau_y == 0.0:
        return out, jacobian
    return _tilt(out, jacobian, tau_x, tau_y)


def distort_fisheye(points: FloatArray, dist_coeffs: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Project camera-frame `points` (..., 3) with the fisheye model; plane points (..., 2), Jacobian (..., 2, 3)."""
    p = np.asarray(points, dtype=np.float64)
    axial_distance = np.hypot(p[..., 0], p[..., 1])
    theta = np.arctan2(axial_distance, p[..., 2])
    theta = np.where(theta < fisheye_valid_angle(tuple(dist_coeffs)), theta, np.nan)
    bent, bent_slope = _fisheye_radius(theta, dist_coeffs)
    square = axial_distance**2 + p[..., 2] ** 2
    # On the axis the direction (x, y)/distance is undefined, but all its products have the limit of a pinhole.
    near_axis = axial_distance <= 1e-12 * np.sqrt(square)
    safe = np.where(near_axis, 1.0, axial_distance)
    scale = np.where(near_axis, 1.0 / np.where(p[..., 2] == 0.0, 1.0, p[..., 2]), bent / safe)
    direction = np.where(near_axis[..., None], 0.0, p[..., :2] / safe[..., None])
    growth = bent_slope * p[..., 2] / square
    across = direction[..., :, None] * direction[..., None, :]
    jacobian = np.empty((*p.shape[:-1], 2, 3))
    jacobian[..., :, :2] = scale[..., None, None] * (np.eye(2) - across) + growth[..., None, None] * across
    on_axis = np.where(near_axis, scale, 0.0)[..., None, None] * np.eye(2)
    jacobian[..., :, :2] = np.where(near_axis[..., None, None], on_axis, jacobian[..., :, :2])
    jacobian[..., :, 2] = -(bent_slope * axial_distance / square)[..., None] * direction
    return scale[..., None] * p[..., :2], jacobian


def undistort_fisheye(distorted: FloatArray, dist_coeffs: FloatArray) -> FloatArray:
    """Return the rays (..., 3), unit length, of points (..., 2) of the distorted plane; NaN where there is none."""
    d = np.asarray(distorted, dtype=np.float64)
    radius = np.hypot(d[..., 0], d[..., 1])
    limit = fisheye_valid_angle(tuple(dist_coeffs))
    theta = np.minimum(radius, limit)
    for _ in range(50):
        bent, slope = _fisheye_radius(theta, dist_coeffs)
        step = (bent - radius) / np.where(slope > 0.0, slope, 1.0)
        theta = np.clip(theta - step, 0.0, limit)
        if np.all(np.abs(step) <= 1e-15):
            break
    bent, _ = _fisheye_radius(theta, dist_coeffs)
    with np.errstate(invalid="ignore"):
        theta = np.where((np.abs(bent - radius) < 1e-12 * (1.0 + radius)) & (theta < limit), theta, np.nan)
    direction = d / np.where(radius == 0.0, 1.0, radius)[..., None]
    return np.concatenate([np.sin(theta)[..., None] * direction, np.cos(theta)[..., None]], axis=-1)


@lru_cache(maxsize=64)
def valid_radius(dist_coeffs: tuple[float, ...]) -> float:
    """Return the undistorted radius (tan of the field angle) up to which the pinhole model grows outwards."""
    k = np.zeros(14)
    k[: len(dist_coeffs)] = dist_coeffs
    r = np.linspace(0.0, _SEARCH_RADIUS, 20001)
    r2 = r * r
    above = 1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]))
    below = 1.0 + r2 * (k[5] + r2 * (k[6] + r2 * k[7]))
    falling = (np.diff(r * above / np.where(below > 0.0, below, np.nan)) > 0.0) & (below[1:] > 0.0)
    return float("inf") if falling.all() else float(r[np.argmin(falling)])


@lru_cache(maxsize=64)
def fisheye_valid_angle(dist_coeffs: tuple[float, ...]) -> float:
    """Return the field angle (rad, at most pi) up to which the fisheye model grows outwards."""
    theta = np.linspace(0.0, np.pi, 20001)
    growing = np.diff(_fisheye_radius(theta, np.array(dist_coeffs))[0]) > 0.0
    return float(np.pi) if growing.all() else float(theta[np.argmin(growing)])


def _fisheye_radius(theta: FloatArray, dist_coeffs: FloatArray) -> tuple[FloatArray, FloatArray]:
    k1, k2, k3, k4 = dist_coeffs
    t2 = theta * theta
    bent = theta * (1.0 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4))))
    slope = 1.0 + t2 * (3.0 * k1 + t2 * (5.0 * k2 + t2 * (7.0 * k3 + t2 * 9.0 * k4)))
    return bent, slope


def _invert_plane(target: FloatArray, dist_coeffs: FloatArray) -> FloatArray:
    limit = valid_radius(tuple(dist_coeffs))
    plane = target.copy()
    with np.errstate(all="ignore"):
        for _ in range(60):
            value, jacobian = distort_plane(plane, dist_coeffs)
            miss = target - value
            determinant = jacobian[..., 0, 0] * jacobian[..., 1, 1] - jacobian[..., 0, 1] * jacobian[..., 1, 0]
            step = (
                np.stack(
                    [
                        jacobian[..., 1, 1] * miss[..., 0] - jacobian[..., 0, 1] * miss[..., 1],
                        jacobian[..., 0, 0] * miss[..., 1] - jacobian[..., 1, 0] * miss[..., 0],
                    ],
                    axis=-1,
                )
                / determinant[..., None]
            )
            # Near a fold Newton leaps; half the field at a time is always enough to come back.
            length = np.linalg.norm(step, axis=-1, keepdims=True)
            longest = 0.25 * (1.0 + np.linalg.norm(plane, axis=-1, keepdims=True))
            plane = plane + step * np.minimum(1.0, longest / np.maximum(length, 1e-300))
            if np.nanmax(length, initial=0.0) <= 1e-15:
                break
        value, jacobian = distort_plane(plane, dist_coeffs)
        determinant = jacobian[..., 0, 0] * jacobian[..., 1, 1] - jacobian[..., 0, 1] * jacobian[..., 1, 0]
        miss_size = np.linalg.norm(target - value, axis=-1)
        good = (miss_size < 1e-12 * (1.0 + np.linalg.norm(target, axis=-1))) & (determinant > 0.0)
        good &= np.linalg.norm(plane, axis=-1) < limit
    return np.where(good[..., None], plane, np.nan)


def _tilt(plane: FloatArray, jacobian: FloatArray, tau_x: float, tau_y: float) -> tuple[FloatArray, FloatArray]:
    """Apply the tilted-sensor homography of OpenCV's 14-coefficient model."""
    cx, sx, cy, sy = np.cos(tau_x), np.sin(tau_x), np.cos(tau_y), np.sin(tau_y)
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cx, sx], [0.0, -sx, cx]])
    about_y = np.array([[cy, 0.0, -sy], [0.0, 1.0, 0.0], [sy, 0.0, cy]])
    turn = about_y @ about_x
    to_sensor = np.array([[turn[2, 2], 0.0, -turn[0, 2]], [0.0, turn[2, 2], -turn[1, 2]], [0.0, 0.0, 1.0]])
    homography = to_sensor @ turn
    homogeneous = plane @ homography[:, :2].T + homography[:, 2]
    tilted = homogeneous[..., :2] / homogeneous[..., 2:]
    inner = homography[:2, :2] - tilted[..., :, None] * homography[2, :2]
    return tilted, (inner / homogeneous[..., 2, None, None]) @ jacobian
