"""Which lengths an ellipse's axes can have in the image, from the radius and the depth range."""

from __future__ import annotations

import numpy as np

from circlepose._numerics import angle_between
from circlepose.camera.camera import Camera
from circlepose.detection.options import DEFAULT, DetectionOptions
from circlepose.targets.target import AxisIntervals, Target

_GRID = 9
"""Points each way at which the scale of the image is evaluated."""
_WIDEST_RAD = np.radians(85.0)
"""rad; widest field angle for which a depth along the axis means a distance."""


def axis_intervals(
    target: Target, camera: Camera, image_size: tuple[int, int], options: DetectionOptions = DEFAULT
) -> AxisIntervals:
    """Return the lengths that the axes of the target's circles can have in the image.

    A circle of radius R at distance d has a largest apex angle between 2 atan(R/d) and 2 asin(R/d), at any tilt. The
    lens turns angles into px at a rate that varies over the image. The minor axis has no lower bound from this: the
    circle may be seen edge-on.

    Parameters
    ----------
    target
        With its own intervals or a depth range, in mm; those of a target are for its largest circle.
    camera
        The calibration, for this image size.
    image_size
        Width and height, px.
    options
        The numbers of the detection.

    Returns
    -------
    Intervals in px that hold the axes of all circles of the target: its own, or those that follow from radius and
    depth range; without both, no limits.
    """
    smallest = _smallest_share(target, options)
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
    low = max(options.smallest_major_px, (1.0 - options.size_slack) * float(small) * smallest)
    return AxisIntervals(
        major_px=(low, max((1.0 + options.size_slack) * float(large), low + 1.0)), minor_px=_lowered(minor, smallest)
    )


def _smallest_share(target: Target, options: DetectionOptions) -> float:
    """Return how small the target's smallest circle can appear, as a share of its largest."""
    share = target.radii_mm[-1] / target.radii_mm[0]
    return share if target.kind != "coaxial" else options.far_circle_share * share


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
    return float(1.0 / per_px.max()), float(1.0 / per_px.min()), min(widest, _WIDEST_RAD)
