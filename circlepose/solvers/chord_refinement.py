"""The chords' four points, exact on an exact contour: read off what is left between the contour and their own rim.

A polynomial through the contour itself cuts off its next power. What is left between the contour and the rim that the
four points give, r = |(x/s, y/t)| - 1 over the eccentric angle, is small where they are nearly right, and so is what
a polynomial cuts off of it: each round takes the error down to a share of itself, to rounding in the end. Only the
contour near the four points is used. At the tips of a sliver noise across it makes the eccentric angle uncertain;
where that would pass on more noise than the polynomials through the contour do, these stand.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from circlepose._typing import FloatArray
from circlepose.geometry.cone import PrincipalFrame

_ROUNDS = 40
_SETTLED = 1e-13
_DEGREE = 2
_CUT_OFF = 4e-5
"""What the polynomials through the contour cut off, as a share of the chord."""
_PASSED_ON = 1.5
"""Noise of a cubic's value in its middle, and of an extreme, in units of a point's over the root of their number."""
_LARGEST_TURN = 0.2
"""rad about the axis in one round"""
_ROUNDEST = 1.0 - 1e-12
_ANCHORS = (0.0, np.pi, np.pi / 2.0, -np.pi / 2.0)


@dataclass(frozen=True, slots=True)
class _Parabola:
    """What is left of r at one of the four points."""

    value: float
    slope: float
    """per rad"""
    error: float
    """standard deviation of `value`, in units of a point's noise"""


def refined_frame(rays: FloatArray, frame: PrincipalFrame, half_window: int) -> PrincipalFrame | None:
    """Return the frame that the four points span, read again off a closed contour of unit `rays` (n, 3), in order.

    `frame` is a first one, and so many contour points either side of each of the four have a say (`half_window`).
    None where noise would grow, or the points do not settle.
    """
    rotation, s, t = frame.rotation, float(frame.tan_half_major), float(frame.tan_half_minor)
    if t <= 0.0 or len(rays) < 2 * half_window + 1:
        return None
    for _ in range(_ROUNDS):
        angle, left = _over_rim(rays, rotation, s, t)
        spread = np.hypot(np.cos(angle) / s, np.sin(angle) / t)
        fits = [_near(angle, left, spread, anchor, half_window) for anchor in _ANCHORS]
        before = rotation, s, t
        rotation, s, t = _next(rotation, s, t, fits)
        if not (np.isfinite(s) and np.isfinite(t) and 0.0 < t < 1.5 * s):
            return None
        if _change(before, (rotation, s, t)) < _SETTLED:
            break
    noise = _scatter(left / spread)
    plain = _CUT_OFF + _PASSED_ON * noise / s / np.sqrt(2.0 * half_window + 1.0)
    if max(fits[0].error, fits[1].error) * noise > plain:
        return None
    return PrincipalFrame(rotation, np.asarray(s), np.asarray(min(t, s)))


def _over_rim(rays: FloatArray, rotation: FloatArray, s: float, t: float) -> tuple[FloatArray, FloatArray]:
    """Return the eccentric angles (n,) of the contour on the rim of the frame, and r (n,)."""
    local = rays @ rotation
    x, y = local[:, 0] / (s * local[:, 2]), local[:, 1] / (t * local[:, 2])
    return np.arctan2(y, x), np.hypot(x, y) - 1.0


def _scatter(distance: FloatArray) -> float:
    """Return how far neighboring points stray from each other, of their distances (n,) from a curve, robustly."""
    second = distance - (np.roll(distance, 1) + np.roll(distance, -1)) / 2.0
    return 1.4826 * float(np.median(np.abs(second))) / float(np.sqrt(1.5))


def _near(angle: FloatArray, left: FloatArray, spread: FloatArray, anchor: float, half_window: int) -> _Parabola:
    """Fit a parabola to r around the angle `anchor`; `spread` (n,) is what a point's noise makes of r."""
    offset = (angle - anchor + np.pi) % (2.0 * np.pi) - np.pi
    middle = int(np.argmin(np.abs(offset)))
    window = (middle + np.arange(-half_window, half_window + 1)) % len(angle)
    width = max(float(np.abs(offset[window]).max()), 1e-300)
    powers = np.vander(offset[window] / width, _DEGREE + 1, increasing=True)
    solution = np.linalg.pinv(powers / spread[window, None])
    value, slope = solution[:2] @ (left[window] / spread[window])
    return _Parabola(float(value), float(slope) / width, float(np.linalg.norm(solution[0])))


def _next(rotation: FloatArray, s: float, t: float, fits: list[_Parabola]) -> tuple[FloatArray, float, float]:
    """Return the frame, s and t that r at p, q, b and c asks for."""
    p, q, b, c = fits
    # The vertex is where (1 + r) cos(angle) is largest.
    ends = []
    for side, end in ((1.0, p), (-1.0, q)):
        tip = np.arctan(end.slope / (1.0 + end.value))
        level = 1.0 + end.value + end.slope * tip
        ray = rotation @ np.array([side * s * level * np.cos(tip), side * t * level * np.sin(tip), 1.0])
        ends.append(ray / np.linalg.norm(ray))
    w = ends[0] + ends[1]
    w = w / np.linalg.norm(w)
    u = ends[0] - ends[1]
    u = u / np.linalg.norm(u)
    # An ellipse's topmost point turns by 1 - (t/s)^2 of the ellipse's own turn.
    turn = float(np.arcsin(np.clip(u @ rotation[:, 1], -1.0, 1.0)))
    round_ = min((t / s) ** 2, _ROUNDEST)
    more = float(np.clip(turn * round_ / (1.0 - round_), -_LARGEST_TURN, _LARGEST_TURN))
    v = np.cross(w, u)
    u, v = np.cos(more) * u + np.sin(more) * v, np.cos(more) * v - np.sin(more) * u
    half_major = float(np.linalg.norm(ends[0] - ends[1]) / np.linalg.norm(ends[0] + ends[1]))
    upper, lower = t * (1.0 + b.value), t * (1.0 + c.value)
    half_minor = float(np.tan((np.arctan(upper) + np.arctan(lower)) / 2.0))
    return np.stack([u, v, w], axis=-1), half_major, half_minor


def _change(before: tuple[FloatArray, float, float], after: tuple[FloatArray, float, float]) -> float:
    """Return how far the rim moved, as a share of s: a turn about the axis moves a round one little."""
    (r0, s0, t0), (r1, s1, t1) = before, after
    turn = abs(float(r1[:, 0] @ r0[:, 1])) * abs(s1 - t1) / s1
    tilt = float(np.linalg.norm(r1[:, 2] - r0[:, 2])) / s1
    return max(abs(s1 - s0) / s1, abs(t1 - t0) / s1, turn, tilt)
