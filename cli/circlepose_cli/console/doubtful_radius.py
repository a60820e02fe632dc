"""A radius that was probably given in meters: its circles are nearer than a photograph can be taken."""

from __future__ import annotations

import math

from circlepose.results import CircleResult, ImageResult

_NEAREST_MM = 10.0
"""Ordinary lenses focus no nearer; with a radius in m, all that is within 10 m of the camera is nearer than this."""
_MICROSCOPE_DEG = 6.0
"""Field of view of a microscope, at most: from its tube lens, 200 mm away, the camera's sensor is some 20 mm wide."""


def doubt(result: ImageResult) -> str | None:
    """Return a question about the radius, or None where the circles are where a camera may see them.

    Only the distance is judged, never the radius: a microscope sees small circles from near, but in a narrow field.
    """
    for circle in result.circles:
        pose = circle.pose
        if pose is None:
            continue
        distance_mm = math.hypot(*pose.center.tolist())
        field_deg = _field_of_view_deg(result, circle, distance_mm)
        if distance_mm < _NEAREST_MM and field_deg is not None and field_deg > _MICROSCOPE_DEG:
            radius = circle.radius_mm
            return (
                f"a circle of radius {radius:g} mm would be only {distance_mm:.3g} mm from the camera; "
                f"if the radius is {radius:g} m, give {1000.0 * radius:g} mm"
            )
    return None


def _field_of_view_deg(result: ImageResult, circle: CircleResult, distance_mm: float) -> float | None:
    """Return the angle, roughly, that the image's diagonal spans; None where that is not known."""
    if result.image_size is None or circle.ellipse is None or not distance_mm > 0.0:
        return None
    rim_px = float(circle.ellipse.semi_major)
    if not rim_px > 0.0:
        return None
    diagonal_mm = math.hypot(*result.image_size) * circle.radius_mm / rim_px
    return 2.0 * math.degrees(math.atan(diagonal_mm / (2.0 * distance_mm)))
