"""Which lengths an ellipse's axes can have in the image, from the radius and the depth range."""

from __future__ import annotations

import numpy as np

from circlepose._numerics import angle_between
from circlepose.camera.camera import Camera
from circlepose.targets.target import AxisIntervals, Target

_SMALLEST_MAJOR_PX = 5.0
_GRID = 9
_FARTHER = 0.8
"""The smaller of two coaxial circles may be the farther one, by less than a quarter of the distance."""


def axis_intervals(target: Target, camera: Camera, image_size: tuple[int, int]) -> AxisIntervals:
    """Return the target's own axis intervals, or those that follow from radius and depth range, or none.

    A circle of radius R at distance d has a largest apex angle between 2 atan(R/d) and 2 asin(R/d), however it
    is tilted; the lens turns angles into px at a rate that varies over the image (`image_size`: width, height).
    The minor axis has no lower bound from this: the circle may be seen edge-on. Intervals are the largest
    circle's; those returned hold the others' as well.
    """
    smallest = _smallest_share(target)
    given = target.axis_intervals
    if given is not None and given.major_px is not None:
        return AxisIntervals(_lowered(given.major_px, smallest), _lowered(given.minor_px, smallest))
    minor = given.minor_px if given is not None else None
    if target.depth_range_mm is None:
        return AxisIntervals(minor_px=_lowered(minor, smallest))
    nearest, farthest = target.depth_range_mm
    slowest, fastest, widest = _px_per_radian(camera, image_size)
    radius = target.radii_mm[0]
    # Depth is along the axis; off axis the same depth is farther away.
    small = 2.0 * np.arctan(radius * np.cos(widest) / farthest) * slowest
    large = 2.0 * np.arcsin(min(1.0, radius / max(nearest, radius))) * fastest
    low = max(_SMALLEST_MAJOR_PX, 0.9 * float(small) * smallest)
    return AxisIntervals(major_px=(low, max(1.1 * float(large), low + 1.0)), minor_px=_lowered(minor, smallest))


def _smallest_share(target: Target) -> float:
    """Return how small the target's smallest circle can appear, as a share of its largest."""
    share = target.radii_mm[-1] / target.radii_mm[0]
    return share if target.kind != "coaxial" else _FARTHER * share


def _lowered(interval: tuple[float, float] | None, share: float) -> tuple[float, float] | None:
    return None if interval is None else (interval[0] * share, interval[1])


def _px_per_radian(camera: Camera, image_size: tuple[int, int]) -> tuple[float, float, float]:
    """Return the smallest and largest local image scale (px/rad) and the widest field angle (rad)."""
    width, height = image_size
    x, y = np.meshgrid(np.linspace(0.0, width - 1.0, _GRID), np.linspace(0.0, height - 1.0, _GRID))
    rays, jacobian = camera.rays_with_jacobian(np.stack([x, y], axis=-1).reshape(-1, 2))
    usable = np.all(np.isfinite(rays), axis=-1) & np.all(np.isfinite(jacobian), axis=(-2, -1))
    if not np.any(usable):
        return 1.0, 1e6, 0.0
    per_px = np.linalg.svd(jacobian[usable], compute_uv=False)
    widest = float(angle_between(rays[usable], np.array([0.0, 0.0, 1.0])).max())
    return float(1.0 / per_px.max()), float(1.0 / per_px.min()), min(widest, np.radians(85.0))
