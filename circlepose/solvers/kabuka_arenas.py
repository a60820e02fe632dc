"""Approximate circle pose from the image ellipse's axes, after Kabuka & Arenas (1987).

Our form of it, from what Chen & Huang say of it: the optical axis is taken to pass through the circle's
center, and perspective within the circle is left out. Turn the camera so that it looks at the ellipse's
center; a and b are the semi-axes there (f = 1). Then

    distance = R/a,    cos(tilt) = b/a,

the center lies on the ray of the ellipse's center, and the circle is tilted about the major axis, one way or
the other. The error grows with the tilt and with R/distance: the ellipse's center is not the circle's, and
the nearer half of the circle looks larger.
"""

from __future__ import annotations

import numpy as np

from circlepose._typing import FloatArray
from circlepose.geometry.cone import plane_basis, principal_frame
from circlepose.geometry.ellipse import Ellipse


def poses_from_factor(factor: FloatArray, radius: float) -> tuple[FloatArray, FloatArray] | None:
    """Return both poses (centers and normals, (2, 3)) from a viewing cone's `factor` (3, 3).

    None when the image has no area (edge-on view): the axis ratio is then no measure of the tilt.
    """
    if bool(principal_frame(factor).is_degenerate):
        return None
    axis = factor[:, 2] / np.linalg.norm(factor[:, 2])
    for _ in range(20):
        e1, e2 = plane_basis(axis)
        turn = np.stack([e1, e2, axis])
        sections, found = Ellipse.from_factor((turn @ factor)[None])
        if not found[0]:
            return None
        ellipse = sections[0]
        offset = ellipse.center
        axis = turn.T @ np.array([offset[0], offset[1], 1.0])
        axis = axis / np.linalg.norm(axis)
        if np.hypot(*offset) < 1e-12:
            break
    return _tilted_about_major_axis(ellipse, turn, radius)


def _tilted_about_major_axis(ellipse: Ellipse, turn: FloatArray, radius: float) -> tuple[FloatArray, FloatArray]:
    cos_tilt = float(ellipse.semi_minor / ellipse.semi_major)
    sin_tilt = float(np.sqrt(max(0.0, 1.0 - cos_tilt**2)))
    minor = np.array([-np.sin(ellipse.angle), np.cos(ellipse.angle), 0.0])
    center = np.array([0.0, 0.0, radius / float(ellipse.semi_major)])
    normals = np.stack([sign * sin_tilt * minor - np.array([0.0, 0.0, cos_tilt]) for sign in (1.0, -1.0)])
    return np.stack([center, center]) @ turn, normals @ turn
