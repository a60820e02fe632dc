"""Circle pose from two chords: Chen & Huang, A Vision-Based Method for the Circle Pose Determination (1999).

The first chord subtends the largest apex angle (LAA) of the viewing cone; the second is the diameter whose
plane holds the bisector of that angle. In the frame (u, v, w) of the cone (`cone.principal_frame`), with
s = tan(LAA/2) (the paper's u_p'/f) and t the tangent of half the apex angle in the perpendicular plane
(v_b'/f), the two chords' midpoint and cross product are, for either sign,

    O = (0, +-(R t/s) sqrt((s^2 - t^2)/(1 + t^2)), (R/s) sqrt((1 + s^2)/(1 + t^2)))
    n ~ (0, +-sqrt(s^2 - t^2), -t sqrt(1 + s^2))

Two formulas on the way there are misprinted in the paper, the final ones are right: alpha - beta holds
u_p'^2 - v_b'^2 (printed u_p'^2 - f^2), and gamma = 2 alpha beta/(alpha + beta), which is
(R/s) sqrt((1 + t^2)/(1 + s^2)) (printed as (alpha + beta)/2).

A right cone (s = t) gives the same pose twice, a degenerate one (t = 0) one center with opposite normals.
"""

from __future__ import annotations

import numpy as np

from circlepose._typing import FloatArray
from circlepose.geometry.cone import PrincipalFrame


def poses_from_frame(frame: PrincipalFrame, radius: FloatArray | float) -> tuple[FloatArray, FloatArray]:
    """Return both poses of a circle of `radius` (...) with this viewing cone: centers and normals (..., 2, 3).

    The centers are in the unit of `radius`, the normals are unit vectors towards the camera; section III.
    """
    s, t = frame.tan_half_major, frame.tan_half_minor
    r = np.asarray(radius, dtype=np.float64)
    eccentricity = np.sqrt((s - t) * (s + t))
    center_v = r * t / s * eccentricity / np.sqrt(1.0 + t**2)
    center_w = r / s * np.sqrt((1.0 + s**2) / (1.0 + t**2))
    # The paper's n has the length s sqrt(1 + t^2).
    length = s * np.sqrt(1.0 + t**2)
    normal_v, normal_w = eccentricity / length, -t * np.sqrt(1.0 + s**2) / length
    zero = np.zeros_like(center_v)
    centers = np.stack(
        [np.stack([zero, sign * center_v, center_w], axis=-1) for sign in (1.0, -1.0)],
        axis=-2,
    )
    normals = np.stack(
        [np.stack([zero, sign * normal_v, normal_w], axis=-1) for sign in (1.0, -1.0)],
        axis=-2,
    )
    back = np.swapaxes(frame.rotation, -1, -2)
    return centers @ back, normals @ back
