"""Synthetic problems that carry their truth, and the comparison of two-solution sets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from hypothesis import strategies as st

from circlepose._typing import FloatArray
from circlepose.geometry.cone import plane_basis


@dataclass(frozen=True, slots=True, eq=False)
class CircleCase:
    center: FloatArray
    normal: FloatArray
    radius: float
    tilt_deg: float


def circle_case(
    radius: float, distance: float, off_axis_deg: float, azimuth_deg: float, tilt_deg: float, lean_deg: float
) -> CircleCase:
    """A circle `distance` away, seen `off_axis_deg` off the optical axis; tilt is the angle of its normal to the
    line of sight, lean its direction."""
    off, azimuth = np.radians(off_axis_deg), np.radians(azimuth_deg)
    sight = np.array([np.sin(off) * np.cos(azimuth), np.sin(off) * np.sin(azimuth), np.cos(off)])
    e1, e2 = plane_basis(sight)
    tilt, lean = np.radians(tilt_deg), np.radians(lean_deg)
    across = np.cos(lean) * e1 + np.sin(lean) * e2
    normal = -np.cos(tilt) * sight + np.sin(tilt) * across
    return CircleCase(distance * sight, normal / np.linalg.norm(normal), radius, tilt_deg)


def circle_cases(max_off_axis_deg: float = 60.0, tilts: st.SearchStrategy[float] | None = None):
    """Circles over distances, tilts and the field of view; tilts crowd at frontal and at edge-on."""
    close_to_singular = st.sampled_from([0.0, 1e-6, 1e-3, 0.01, 0.1, 1.0, 89.0, 89.9, 89.99, 89.9999, 90.0])
    return st.builds(
        circle_case,
        radius=st.floats(0.5, 500.0),
        distance=st.floats(600.0, 20000.0),
        off_axis_deg=st.floats(0.0, max_off_axis_deg),
        azimuth_deg=st.floats(0.0, 360.0),
        tilt_deg=tilts if tilts is not None else st.one_of(st.floats(0.0, 90.0), close_to_singular),
        lean_deg=st.floats(0.0, 360.0),
    )


def nearest_candidate(
    centers: FloatArray, normals: FloatArray, center: FloatArray, normal: FloatArray
) -> tuple[float, float]:
    """Relative position error and angle (rad) of the candidate that is nearest to the truth."""
    position = np.linalg.norm(centers - center, axis=-1) / np.linalg.norm(center)
    angle = 2.0 * np.arcsin(np.clip(np.linalg.norm(normals - normal, axis=-1) / 2.0, 0.0, 1.0))
    best = int(np.argmin(position + angle))
    return float(position[best]), float(angle[best])


def same_solution_set(
    first: tuple[FloatArray, FloatArray], second: tuple[FloatArray, FloatArray], tolerance: float
) -> bool:
    """Compare two sets of two poses (centres, normals; (2, 3) each), in either order."""
    (c1, n1), (c2, n2) = first, second
    scale = np.linalg.norm(c1)

    def distance(order: list[int]) -> float:
        return float(max(np.abs(c1 - c2[order]).max() / scale, np.abs(n1 - n2[order]).max()))

    return min(distance([0, 1]), distance([1, 0])) <= tolerance


def random_rotation(seed: int) -> FloatArray:
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0.0 else -q
