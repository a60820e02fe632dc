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
_LAST_STEP = 1e-7
_FEW_ROUNDS, _MORE_ROUNDS = 6, 24
"""Newton's steps for all pixels, and more for those that need them."""
_SEARCH_RADIUS = 20.0
"""tan of the largest field angle considered for a pinhole model (87 deg off axis)."""


def distort_pinhole(points: FloatArray, dist_coeffs: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Project camera-frame `points` (..., 3) to the distorted plane (..., 2), with the Jacobian (..., 2, 3)."""
    x, y, inverse_depth = _on_plane(points, dist_coeffs)
    with np.errstate(invalid="ignore"):
        u, v, xx, xy, yx, yy = _distorted(x, y, _fourteen(dist_coeffs))
        jacobian = np.empty((*x.shape, 2, 3))
        for row, (by_x, by_y) in enumerate(((xx, xy), (yx, yy))):
            jacobian[..., row, 0], jacobian[..., row, 1] = by_x * inverse_depth, by_y * inverse_depth
            jacobian[..., row, 2] = -(by_x * x + by_y * y) * inverse_depth
    return np.stack([u, v], axis=-1), jacobian


def project_pinhole(points: FloatArray, dist_coeffs: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return u and v (...) of the distorted plane where camera-frame `points` (..., 3) are seen, NaN where not."""
    x, y, _ = _on_plane(points, dist_coeffs)
    if not np.any(dist_coeffs):
        return x, y
    with np.errstate(invalid="ignore"):
        u, v, *_ = _distorted(x, y, _fourteen(dist_coeffs))
    return u, v


def pinhole_plane(x: FloatArray, y: FloatArray, dist_coeffs: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Distort points x, y (...) of the normalized plane by the formula alone, also where the model folds back."""
    u, v, *_ = _distorted(x, y, _fourteen(dist_coeffs))
    return u, v


def _on_plane(points: FloatArray, dist_coeffs: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return x and y (...) of `points` (..., 3) on the normalized plane, and 1 / z; NaN beyond the lens model."""
    p = np.asarray(points, dtype=np.float64)
    limit = valid_radius(tuple(dist_coeffs)) ** 2
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse_depth = np.where(p[..., 2] > 0.0, 1.0 / p[..., 2], np.nan)
        x, y = p[..., 0] * inverse_depth, p[..., 1] * inverse_depth
        if np.isfinite(limit):
            inside = x * x + y * y < limit
            x, y = np.where(inside, x, np.nan), np.where(inside, y, np.nan)
    return x, y, inverse_depth


def undistort_pinhole(
    u: FloatArray, v: FloatArray, dist_coeffs: FloatArray
) -> tuple[FloatArray, FloatArray, tuple[FloatArray | float, ...]]:
    """Return x and y (...) of the normalized plane that are seen at u and v (...) of the distorted one, NaN if none.

    And dx/du, dx/dv, dy/du, dy/dv, each (...) or one number for all. By components, as `_distorted`.
    """
    if not np.any(dist_coeffs):
        return u, v, (1.0, 0.0, 0.0, 1.0)
    k = _fourteen(dist_coeffs)
    limit = valid_radius(tuple(dist_coeffs))
    with np.errstate(all="ignore"):
        found = [*map(np.asarray, _undistorted(u, v, u, v, k, _FEW_ROUNDS))]
        # A pixel that the lens model has no light for never comes to rest; the others need not wait for it.
        late = ~(found[2] <= _LAST_STEP)
        if late.any():
            more = _undistorted(u[late], v[late], found[0][late], found[1][late], k, _MORE_ROUNDS)
            for values, again in zip(found, more, strict=True):
                values[late] = again
        x, y, length, xx, xy, yx, yy = found
        per_determinant = 1.0 / (xx * yy - xy * yx)
        good = (length <= _LAST_STEP) & (per_determinant > 0.0) & (np.hypot(x, y) < limit)
        per_determinant = np.where(good, per_determinant, np.nan)
    slopes = (yy * per_determinant, -xy * per_determinant, -yx * per_determinant, xx * per_determinant)
    return np.where(good, x, np.nan), np.where(good, y, np.nan), slopes


def _undistorted(
    u: FloatArray, v: FloatArray, x: FloatArray, y: FloatArray, coefficients: FloatArray, rounds: int
) -> tuple[FloatArray, ...]:
    """Find x and y, from some start on, that are seen at u and v, by Newton's iteration; returns also the last step.

    And du/dx, du/dy, dv/dx, dv/dy where that was made.
    """
    for _ in range(rounds):
        seen_u, seen_v, xx, xy, yx, yy = _distorted(x, y, coefficients)
        miss_u, miss_v = u - seen_u, v - seen_v
        per_determinant = 1.0 / (xx * yy - xy * yx)
        step_x = (yy * miss_u - xy * miss_v) * per_determinant
        step_y = (xx * miss_v - yx * miss_u) * per_determinant
        length = np.sqrt(step_x * step_x + step_y * step_y)
        # Near a fold Newton leaps; half the field at a time is always enough to come back.
        longest = 0.25 * (1.0 + np.sqrt(x * x + y * y))
        short = np.minimum(1.0, longest / np.maximum(length, 1e-300))
        x, y = x + step_x * short, y + step_y * short
        # The square of the last step remains.
        if np.nanmax(length, initial=0.0) <= _LAST_STEP:
            break
    return x, y, length, xx, xy, yx, yy


def _fourteen(dist_coeffs: FloatArray) -> FloatArray:
    k = np.zeros(14)
    k[: len(dist_coeffs)] = dist_coeffs
    return k


def _distorted(x: FloatArray, y: FloatArray, coefficients: FloatArray) -> tuple[FloatArray, ...]:
    """Distort points of the normalized plane by 14 coefficients: u, v, and du/dx, du/dy, dv/dx, dv/dy.

    By components, as loops over a last axis of two take several times longer.
    """
    k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, tau_x, tau_y = coefficients.tolist()
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    # Derivative of the radial factor with respect to r^2, doubled as d(r^2) = 2 (x dx + y dy).
    slope = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * (3.0 * k3)))
    if k4 or k5 or k6:
        below = 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6))
        radial /= below
        slope = (slope - 2.0 * radial * (k4 + r2 * (2.0 * k5 + r2 * (3.0 * k6)))) / below
    x_slope, y_slope = x * slope, y * slope
    u, v = x * radial, y * radial
    xx, xy, yx, yy = radial + x * x_slope, x_slope * y, x_slope * y, radial + y * y_slope
    if p1 or p2:
        u, v = u + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x), v + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y
        both = 2.0 * (p1 * x + p2 * y)
        xx, xy = xx + 2.0 * p1 * y + 6.0 * p2 * x, xy + both
        yx, yy = yx + both, yy + 6.0 * p1 * y + 2.0 * p2 * x
    if s1 or s2 or s3 or s4:
        u, v = u + r2 * (s1 + s2 * r2), v + r2 * (s3 + s4 * r2)
        prism_x, prism_y = 2.0 * (s1 + 2.0 * s2 * r2), 2.0 * (s3 + 2.0 * s4 * r2)
        xx, xy, yx, yy = xx + prism_x * x, xy + prism_x * y, yx + prism_y * x, yy + prism_y * y
    if tau_x or tau_y:
        return _tilted(u, v, (xx, xy, yx, yy), tau_x, tau_y)
    return u, v, xx, xy, yx, yy


def distort_fisheye(points: FloatArray, dist_coeffs: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Project camera-frame `points` (..., 3) with the fisheye model; plane points (..., 2), Jacobian (..., 2, 3)."""
    p = np.asarray(points, dtype=np.float64)
    axial_distance = np.hypot(p[..., 0], p[..., 1])
    theta = np.arctan2(axial_distance, p[..., 2])
    theta = np.where(theta < fisheye_valid_angle(tuple(dist_coeffs)), theta, np.nan)
    bent, bent_slope = fisheye_radius(theta, dist_coeffs)
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
        bent, slope = fisheye_radius(theta, dist_coeffs)
        step = (bent - radius) / np.where(slope > 0.0, slope, 1.0)
        theta = np.clip(theta - step, 0.0, limit)
        if np.all(np.abs(step) <= 1e-15):
            break
    bent, _ = fisheye_radius(theta, dist_coeffs)
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
    growing = np.diff(fisheye_radius(theta, np.array(dist_coeffs))[0]) > 0.0
    return float(np.pi) if growing.all() else float(theta[np.argmin(growing)])


def fisheye_radius(theta: FloatArray, dist_coeffs: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the radius on the distorted plane of field angles `theta` (rad), and its derivative, by the formula."""
    k1, k2, k3, k4 = dist_coeffs
    t2 = theta * theta
    bent = theta * (1.0 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4))))
    slope = 1.0 + t2 * (3.0 * k1 + t2 * (5.0 * k2 + t2 * (7.0 * k3 + t2 * 9.0 * k4)))
    return bent, slope


def _tilted(
    u: FloatArray, v: FloatArray, slopes: tuple[FloatArray, ...], tau_x: float, tau_y: float
) -> tuple[FloatArray, ...]:
    """Apply the tilted-sensor homography of OpenCV's 14-coefficient model, to points and their derivatives."""
    cx, sx, cy, sy = np.cos(tau_x), np.sin(tau_x), np.cos(tau_y), np.sin(tau_y)
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cx, sx], [0.0, -sx, cx]])
    about_y = np.array([[cy, 0.0, -sy], [0.0, 1.0, 0.0], [sy, 0.0, cy]])
    turn = about_y @ about_x
    to_sensor = np.array([[turn[2, 2], 0.0, -turn[0, 2]], [0.0, turn[2, 2], -turn[1, 2]], [0.0, 0.0, 1.0]])
    homography = (to_sensor @ turn).tolist()
    first, second, depth = (row[0] * u + row[1] * v + row[2] for row in homography)
    tilted = (first / depth, second / depth)
    found = [*tilted]
    for place, row in zip(tilted, homography, strict=False):
        by_u, by_v = ((row[j] - place * homography[2][j]) / depth for j in range(2))
        found += [by_u * slopes[j] + by_v * slopes[2 + j] for j in range(2)]
    return tuple(found)
