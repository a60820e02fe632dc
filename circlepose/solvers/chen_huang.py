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

A right cone (s = t) gives the same pose twice, a degenerate one (t = 0) one centre with opposite normals.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from circlepose._typing import FloatArray
from circlepose.cone import PrincipalFrame, plane_basis


@dataclass(frozen=True, slots=True, eq=False)
class Chords:
    """The paper's feature points as unit rays, and the frame that they span."""

    p: FloatArray
    """(3,) with `q`: the pair of contour rays with the largest angle"""
    q: FloatArray
    """(3,)"""
    b: FloatArray
    """(3,) with `c`: where the contour crosses the plane that bisects the LAA at a right angle"""
    c: FloatArray
    """(3,)"""
    frame: PrincipalFrame


def poses_from_frame(frame: PrincipalFrame, radius: FloatArray | float) -> tuple[FloatArray, FloatArray]:
    """Return both poses of a circle of `radius` (...) with this viewing cone: centres and normals (..., 2, 3).

    The centres are in the unit of `radius`, the normals are unit vectors towards the camera; section III.
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


def chords_from_contour(rays: FloatArray) -> Chords | None:
    """Find the paper's two chords on a closed contour of unit `rays` (n, 3), in order along the contour.

    Only the four points count; the rest of the contour is not used. None when the contour does not cross
    the bisecting plane twice (fewer than 3 rays, all rays equal).
    """
    if len(rays) < 3:
        return None
    first, second = _widest_pair(rays)
    p, q = rays[first], rays[second]
    w = p + q
    w = w / np.linalg.norm(w)
    v = np.cross(p, q)
    if np.linalg.norm(v) == 0.0:
        return None
    v = v / np.linalg.norm(v)
    u = np.cross(v, w)
    crossings = _plane_crossings(rays, u)
    if len(crossings) < 2:
        return None
    # Of more than two crossings (a ragged contour) the outermost belong to the rim.
    elevation = np.arctan2(crossings @ v, crossings @ w)
    b, c = crossings[np.argmax(elevation)], crossings[np.argmin(elevation)]
    s = np.tan(_angle_between(p, q) / 2.0)
    t = np.tan((elevation.max() - elevation.min()) / 2.0)
    frame = PrincipalFrame(
        rotation=np.stack([u, v, w], axis=-1),
        tan_half_major=np.asarray(s),
        tan_half_minor=np.asarray(min(t, s)),
    )
    return Chords(p, q, b, c, frame)


def _widest_pair(rays: FloatArray) -> tuple[int, int]:
    """Return the indices of the two `rays` (n, 3) with the largest angle, by all pairs of the hull's points."""
    axis = rays.sum(axis=0)
    axis = axis / np.linalg.norm(axis)
    e1, e2 = plane_basis(axis)
    plane = np.stack([rays @ e1, rays @ e2], axis=-1) / (rays @ axis)[:, None]
    hull = _convex_hull(plane)
    # 1 - cos loses half the digits of a small angle; the chord's length does not.
    chord = np.linalg.norm(rays[hull][:, None, :] - rays[hull][None, :, :], axis=-1)
    i, j = np.unravel_index(int(np.argmax(chord)), chord.shape)
    return int(hull[i]), int(hull[j])


def _convex_hull(points: FloatArray) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """Return the indices of the convex hull of `points` (n, 2) (monotone chain)."""
    order = np.lexsort((points[:, 1], points[:, 0]))

    def chain(indices: np.ndarray[tuple[int], np.dtype[np.intp]]) -> list[int]:
        hull: list[int] = []
        for i in indices:
            while len(hull) >= 2:
                a, b = points[hull[-1]] - points[hull[-2]], points[i] - points[hull[-2]]
                if a[0] * b[1] - a[1] * b[0] > 0.0:
                    break
                hull.pop()
            hull.append(int(i))
        return hull[:-1]

    return np.array([*chain(order), *chain(order[::-1])], dtype=np.intp)


def _plane_crossings(rays: FloatArray, plane_normal: FloatArray) -> FloatArray:
    """Return the unit rays (m, 3) in which the closed contour `rays` (n, 3) crosses a plane through the apex."""
    side = rays @ plane_normal
    following = np.roll(rays, -1, axis=0)
    side_following = np.roll(side, -1)
    crosses = (side >= 0.0) != (side_following >= 0.0)
    share = side[crosses] / (side[crosses] - side_following[crosses])
    points = rays[crosses] + share[:, None] * (following[crosses] - rays[crosses])
    return np.asarray(points / np.linalg.norm(points, axis=-1, keepdims=True))


def _angle_between(first: FloatArray, second: FloatArray) -> float:
    return float(2.0 * np.arctan2(np.linalg.norm(first - second), np.linalg.norm(first + second)))
