"""A contour -> the two chords of Chen & Huang (1999), section II: four points of it, nothing else.

p and q are the pair of contour rays with the largest angle (LAA), found among all pairs of the hull's points;
b and c are where the contour crosses the plane that bisects that angle, at a right angle to the plane of p and
q. What lies elsewhere on the contour has no say: an outlier there does no harm.

The extreme of many noisy points is biased outwards, and a contour of pixels knows its points to half a pixel.
So each of the four is read off a low polynomial through the contour near it, and then again off what is left between
the contour and the rim that they give (`chord_refinement`): exact on an exact contour of 16 points or more.

Where one of the four lies on the outlier itself, the pose is wrong, however good the rest: the rim that the four
give is held against the whole contour. If less than half of it lies there, the outlier is moved onto the ellipse
that most of the contour agrees on and the four are found again.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from circlepose._numerics import angle_between, cross
from circlepose._typing import BoolArray, FloatArray, IntArray
from circlepose.fitting.direct import fit_ellipse
from circlepose.fitting.ransac import local_scatter, on_one_ellipse
from circlepose.geometry.cone import PrincipalFrame, plane_basis
from circlepose.geometry.ellipse import Ellipse, signed_distance
from circlepose.solvers.chord_refinement import refined_frame

_WINDOW_SHARE = 0.1
"""Share of the contour around a point through which a low polynomial is laid."""
_DEGREE = 3
_WINDOW_LEAST = 2
_GAP = 6.0
"""Gaps in the contour this many times the usual spacing are hidden arcs, not sampling."""
_FLATTEST = 1e-10
"""Width of a contour, as a share of its length, that is rounding."""
_THIN, _CORNER = 0.02, 0.005
"""Axis ratio of a contour that may be a segment, and how far its ends then stand beyond p and q, as a share."""
_ROUNDS = 3
_SUPPORT = 0.55
_LEAST_SUPPORT = 0.45
_NEAR_SHARE = 0.02
_NEAR_LENGTH = 0.003
"""A contour point supports the four within this share of their rim's semi-minor or -major axis, or so much noise."""
_NEAR_NOISE = 4.0


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
    support: float
    """share of the contour that lies on the rim which the four points give"""
    mended: bool = False
    """whether points off the ellipse that most of the contour agrees on were moved onto it first"""


def chords_from_contour(rays: FloatArray, sub_pixel: bool = True) -> Chords | str:
    """Find the two chords on a closed contour of unit `rays` (n, 3), in order along the contour.

    A contour narrower than 1e-10 of its length is a segment between two of its points, p and q. Of the exact contour
    of a circle with n points, nearly edge-on, these are within pi/n rad of the rim's ends: the distance that follows
    is wrong by up to 1 - cos(pi/n) of it. Above that width the error is rounding, 1e-15 over the width's share.

    Without `sub_pixel` the four are contour points (p, q) and linear crossings (b, c), as printed in the paper.
    Returns a reason instead where there are none: fewer than 3 rays, all equal, or a hidden arc at one of them.
    """
    if len(rays) < 3:
        return "the contour has fewer than 3 points"
    if float(np.ptp(rays, axis=0).max()) == 0.0:
        return "all points of the contour are the same"
    chords = _find(rays, sub_pixel)
    if isinstance(chords, str) or chords.support >= _SUPPORT:
        return chords
    mended = _find(_without_outliers(rays), sub_pixel)
    if isinstance(mended, str) or float(np.mean(_near_rim(rays, mended.frame))) < _LEAST_SUPPORT:
        return "one of the chords' four points lies on an outlier, and too little of the contour agrees to mend it"
    return replace(mended, support=float(np.mean(_near_rim(rays, mended.frame))), mended=True)


def _without_outliers(rays: FloatArray) -> FloatArray:
    """Move the points that are off the ellipse on which most of the contour agrees onto it, along their radius."""
    axis = rays.sum(axis=0)
    axis = axis / np.linalg.norm(axis)
    turn = np.stack([*plane_basis(axis), axis])
    plane = _plane(rays, turn)
    agreeing = on_one_ellipse(plane, local_scatter(plane))
    ellipse = fit_ellipse(plane[agreeing])
    if ellipse is None:
        return rays
    cos, sin = np.cos(ellipse.angle), np.sin(ellipse.angle)
    offset = plane - ellipse.center
    along, across = offset @ np.array([cos, sin]), offset @ np.array([-sin, cos])
    radius = np.maximum(np.hypot(along / ellipse.semi_major, across / ellipse.semi_minor), 1e-12)
    filled = np.where(agreeing[:, None], plane, ellipse.center + offset / radius[:, None])
    moved = np.concatenate([filled, np.ones((len(filled), 1))], axis=1) @ turn
    return np.asarray(moved / np.linalg.norm(moved, axis=1, keepdims=True))


def _find(rays: FloatArray, sub_pixel: bool) -> Chords | str:
    first, second = _widest_pair(rays)
    p, q = rays[first], rays[second]
    if float(np.linalg.norm(cross(p, q))) == 0.0:
        return "all points of the contour are the same"
    turn = _frame(p, q)
    x, y = _plane(rays, turn).T
    if float(np.ptp(y)) <= _FLATTEST * float(np.ptp(x)):
        # Edge-on the contour turns back at p and q, where no polynomial follows it; b and c are one.
        s = float(np.tan(angle_between(p, q) / 2.0))
        return Chords(p, q, turn[2], turn[2], PrincipalFrame(turn.T, np.asarray(s), np.asarray(0.0)), 1.0)
    if sub_pixel:
        for _ in range(_ROUNDS):
            local = _plane(rays, turn)
            p, q = _ray(turn, *_vertex(local, 1.0)), _ray(turn, *_vertex(local, -1.0))
            turn = _frame(p, q)
    local = _plane(rays, turn)
    ends = [_crossing(local, sign, sub_pixel) for sign in (1.0, -1.0)]
    if ends[0] is None or ends[1] is None:
        return "the contour does not cross the plane that bisects its largest apex angle, or is hidden there"
    b, c = _ray(turn, 0.0, ends[0]), _ray(turn, 0.0, ends[1])
    s = float(np.tan(angle_between(p, q) / 2.0))
    t = float(np.tan(angle_between(b, c) / 2.0))
    if sub_pixel and t < _THIN * s and float(np.ptp(local[:, 0])) > 2.0 * s * (1.0 + _CORNER):
        # A segment with some noise across it: its ends are corners, which polynomials cut off.
        return _find(rays, sub_pixel=False)
    # The chords bisect each other's angle; the print has v_b' = v_c', which noise leaves to their mean.
    frame = PrincipalFrame(turn.T, np.asarray(s), np.asarray(min(t, s)))
    slack = 0.0 if sub_pixel else np.pi / len(rays)
    support = float(np.mean(_near_rim(rays, frame, slack)))
    refined = refined_frame(rays, frame, _half_window(len(rays))) if sub_pixel and support >= _SUPPORT else None
    if refined is not None:
        better = float(np.mean(_near_rim(rays, refined)))
        if better >= support:
            return Chords(*_ends(refined), refined, better)
    return Chords(p, q, b, c, frame, support)


def _ends(frame: PrincipalFrame) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return the rays p, q, b and c of a frame."""
    s, t, turn = float(frame.tan_half_major), float(frame.tan_half_minor), frame.rotation.T
    return _ray(turn, s, 0.0), _ray(turn, -s, 0.0), _ray(turn, 0.0, t), _ray(turn, 0.0, -t)


def _frame(p: FloatArray, q: FloatArray) -> FloatArray:
    """Return the rows u, v, w: w along the bisector, v normal to the plane of p and q, p on the side of u."""
    w = p + q
    w = w / np.linalg.norm(w)
    v = cross(w, p)
    v = v / np.linalg.norm(v)
    return np.stack([cross(v, w), v, w])


def _plane(rays: FloatArray, turn: FloatArray) -> FloatArray:
    local = rays @ turn.T
    return np.asarray(local[:, :2] / local[:, 2:])


def _ray(turn: FloatArray, x: float, y: float) -> FloatArray:
    ray = turn.T @ np.array([x, y, 1.0])
    return np.asarray(ray / np.linalg.norm(ray))


def _vertex(local: FloatArray, side: float) -> tuple[float, float]:
    """Return x, y of the contour's vertex on the side x > 0 or x < 0, from polynomials through the contour around it.

    Over the place along the contour, not x over y: at the tip of a sliver all points have the same y.
    """
    x = side * local[:, 0]
    top = int(np.argmax(x))
    half = _half_window(len(local))
    if len(local) < 2 * half + 1:
        return float(local[top, 0]), float(local[top, 1])
    place = np.arange(-half, half + 1) / half
    window = local[(top + np.arange(-half, half + 1)) % len(local)]
    curves = [np.polyfit(place, window[:, axis], _DEGREE) for axis in (0, 1)]
    # Parabolas would do but for perspective, which makes one flank of the vertex steeper than the other.
    turning = np.roots(np.polyder(curves[0]))
    real = np.real(turning[np.isreal(turning)])
    vertex = float(real[np.argmin(np.abs(real))]) if len(real) else 0.0
    # A vertex outside the window is no vertex of this contour.
    vertex = min(1.0, max(-1.0, vertex))
    x_at, y_at = (float(np.polyval(curve, vertex)) for curve in curves)
    return x_at, y_at


def _crossing(local: FloatArray, side: float, sub_pixel: bool) -> float | None:
    """Return y where the contour crosses x = 0 on the side y > 0 or y < 0; None where it is hidden or absent."""
    x, y = local[:, 0], local[:, 1]
    following = np.roll(local, -1, axis=0)
    crosses = np.flatnonzero((x >= 0.0) != (following[:, 0] >= 0.0))
    if len(crosses) == 0:
        return None
    share = x[crosses] / (x[crosses] - following[crosses, 0])
    heights = y[crosses] + share * (following[crosses, 1] - y[crosses])
    # Of several crossings on a side (a ragged contour) the outermost is the rim's.
    best = int(np.argmax(side * heights))
    spacing = np.linalg.norm(following - local, axis=1)
    if spacing[crosses[best]] > _GAP * max(float(np.median(spacing)), 1e-12):
        return None
    if not sub_pixel:
        return float(heights[best])
    half = _half_window(len(local))
    near = np.unique((int(crosses[best]) + np.arange(-half, half + 1)) % len(local))
    width = float(np.abs(x[near]).max())
    if len(near) < 4 or width == 0.0:
        return float(heights[best])
    return float(np.polyfit(x[near] / width, y[near], 2)[2])


def _half_window(number: int) -> int:
    return max(_WINDOW_LEAST, round(_WINDOW_SHARE * number / 2.0))


def _near_rim(rays: FloatArray, frame: PrincipalFrame, slack: float = 0.0) -> BoolArray:
    """Return which rays (n,) lie on the rim (x/s)^2 + (y/t)^2 = z^2 of the frame.

    With p and q off their places along the rim by up to `slack` rad of it, as contour points are.
    """
    s, t = float(frame.tan_half_major), float(frame.tan_half_minor)
    rim = Ellipse.from_axes([0.0, 0.0], [s, t], 0.0)
    distance = signed_distance(rim, _plane(rays, frame.rotation.T))
    second = distance - (np.roll(distance, 1) + np.roll(distance, -1)) / 2.0
    noise = 1.4826 * float(np.median(np.abs(second))) / np.sqrt(1.5)
    return np.asarray(np.abs(distance) <= max((_NEAR_SHARE + slack) * t, _NEAR_LENGTH * s, _NEAR_NOISE * noise))


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


def _convex_hull(points: FloatArray) -> IntArray:
    """Return the indices of the convex hull of `points` (n, 2) (monotone chain)."""
    order = np.lexsort((points[:, 1], points[:, 0]))

    def chain(indices: IntArray) -> list[int]:
        hull: list[int] = []
        for i in indices:
            while len(hull) >= 2:
                a, b = points[hull[-1]] - points[hull[-2]], points[i] - points[hull[-2]]
                if a[0] * b[1] - a[1] * b[0] > 0.0:
                    break
                hull.pop()
            hull.append(int(i))
        return hull[:-1]

    return np.array([*chain(order), *chain(order[::-1])], dtype=np.int64)
