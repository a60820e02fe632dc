"""Ellipses in a plane: parameters, factors, points and distances. Pure NumPy.

All functions take leading batch axes. The plane's unit is px for images.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Self

import numpy as np

from circlepose import _arguments
from circlepose._typing import BoolArray, FloatArray, frozen
from circlepose.errors import ArgumentError


@dataclass(frozen=True, slots=True, eq=False)
class Ellipse:
    """An ellipse, or a batch of them, in the unit of the plane (px for images).

    `semi_minor` may be 0: the image of a circle seen edge-on is a segment.
    """

    center: FloatArray
    """(..., 2)"""
    semi_major: FloatArray
    """(...)"""
    semi_minor: FloatArray
    """(...)"""
    angle: FloatArray
    """(...) rad, from the x axis towards the y axis to the major axis, in (-pi/2, pi/2]"""

    def __post_init__(self) -> None:
        """Raise `ArgumentError` on what is no array; the shapes are the caller's."""
        for name in ("center", "semi_major", "semi_minor", "angle"):
            value: object = getattr(self, name)
            if not isinstance(value, np.ndarray | np.floating):
                raise ArgumentError(
                    f"{name}: expected an array, got {_arguments.shown(value)}; Ellipse.from_axes converts lists and "
                    "numbers."
                )
        if self.center.shape[-1:] != (2,):
            raise ArgumentError(f"center: expected two numbers for each ellipse, (..., 2), got {self.center.shape}.")

    @classmethod
    def from_axes(cls, center: object, semi_axes: object, angle: object) -> Self:
        """Build from a center, two semi-axes in either order, and the direction of the first.

        Parameters
        ----------
        center
            (..., 2) in the plane's unit.
        semi_axes
            (..., 2) in the plane's unit, not negative.
        angle
            (...) rad, of the first semi-axis, from the x axis towards the y axis.

        Raises
        ------
        ArgumentError
            On another shape, a negative length, or what is not a finite number.
        """
        center_, axes, angle_ = (
            _numbers(name, values)
            for name, values in (("center", center), ("semi_axes", semi_axes), ("angle", angle))
        )
        for name, values in (("center", center_), ("semi_axes", axes)):
            if values.ndim == 0 or values.shape[-1] != 2:
                raise ArgumentError(
                    f"{name}: expected two numbers for each ellipse, (..., 2), got shape {values.shape}."
                )
        if np.any(axes < 0.0):
            raise ArgumentError("semi_axes: expected lengths that are not negative.")
        swap = axes[..., 1] > axes[..., 0]
        return cls(
            center=center_,
            semi_major=np.max(axes, axis=-1),
            semi_minor=np.min(axes, axis=-1),
            angle=wrap_half_turn(np.where(swap, angle_ + np.pi / 2.0, angle_)),
        )

    @classmethod
    def from_square(cls, center: FloatArray, xx: FloatArray, xy: FloatArray, yy: FloatArray) -> Self:
        """Return the ellipses `center + M u`, u on the unit circle, of which M M' (...) is given by its entries."""
        middle, half = (xx + yy) / 2.0, np.hypot((xx - yy) / 2.0, xy)
        return cls(
            center=center,
            semi_major=np.sqrt(np.maximum(middle + half, 0.0)),
            semi_minor=np.sqrt(np.maximum(middle - half, 0.0)),
            angle=0.5 * np.arctan2(2.0 * xy, xx - yy),
        )

    @classmethod
    def from_factor(cls, factor: FloatArray) -> tuple[Self, BoolArray]:
        """Return the ellipses in which cones, given by factors, meet the plane z = 1.

        Parameters
        ----------
        factor
            (..., 3, 3) A, with the homogeneous points A (cos p, sin p, 1).

        Returns
        -------
        The ellipses (...), and which are ellipses (...): the others are hyperbolas or have points at infinity.
        """
        depth = factor[..., 2, :]
        found = np.hypot(depth[..., 0], depth[..., 1]) < depth[..., 2]
        depth = np.where(found[..., None], depth, np.array([0.0, 0.0, 1.0]))
        # Relative to a point near the center: its square would take the digits of the axes.
        origin = factor[..., :2, 2] / depth[..., 2:]
        x, y = (factor[..., i, :] - origin[..., i, None] * depth for i in (0, 1))

        def form(first: FloatArray, second: FloatArray) -> FloatArray:
            product = first * second
            return np.asarray(product[..., 0] + product[..., 1] - product[..., 2])

        scale = -form(depth, depth)
        cx, cy = -form(x, depth) / scale, -form(y, depth) / scale
        xx, xy, yy = (form(first, second) / scale for first, second in ((x, x), (x, y), (y, y)))
        center = origin + np.stack([cx, cy], axis=-1)
        return cls.from_square(center, xx + cx * cx, xy + cx * cy, yy + cy * cy), found

    @classmethod
    def batch(cls, ellipses: Sequence[Self]) -> Self:
        """Return single ellipses as one batch."""
        return cls(
            center=np.array([each.center for each in ellipses]).reshape(-1, 2),
            semi_major=np.array([float(each.semi_major) for each in ellipses]),
            semi_minor=np.array([float(each.semi_minor) for each in ellipses]),
            angle=np.array([float(each.angle) for each in ellipses]),
        )

    def __getitem__(self, which: object) -> Self:
        """Return the ellipses of a batch that `which` (index, mask or indices of the leading axes) names."""
        index: Any = which
        return type(self)(self.center[index], self.semi_major[index], self.semi_minor[index], self.angle[index])

    def __len__(self) -> int:
        return len(self.semi_major)

    def enlarged(self, scale: FloatArray, origin: FloatArray) -> Self:
        """Return the ellipses (m,) times `scale` (m,), then moved by `origin` (m, 2)."""
        return type(self)(
            self.center * scale[:, None] + origin, self.semi_major * scale, self.semi_minor * scale, self.angle
        )

    @property
    def size(self) -> FloatArray:
        """(...) geometric mean of the semi-axes: the radius of the circle of the same area."""
        return np.sqrt(self.semi_major * self.semi_minor)

    @property
    def perimeter(self) -> FloatArray:
        """About the length of the rim (...), in the plane's unit: pi (a + b), a fifth too short of a segment."""
        return np.asarray(np.pi * (self.semi_major + self.semi_minor))

    @property
    def factor(self) -> FloatArray:
        """Matrix `A`, shape (..., 3, 3), with the points `A (cos p, sin p, 1)` on the ellipse.

        Its columns are the semi-major axis, the semi-minor axis and the center, homogeneous. Unlike the
        conic's matrix it stays meaningful, and well conditioned, for a segment (`semi_minor` 0).
        """
        cos, sin = np.cos(self.angle), np.sin(self.angle)
        zero, one = np.zeros_like(cos), np.ones_like(cos)
        major = np.stack([self.semi_major * cos, self.semi_major * sin, zero], axis=-1)
        minor = np.stack([-self.semi_minor * sin, self.semi_minor * cos, zero], axis=-1)
        center = np.stack([self.center[..., 0] * one, self.center[..., 1] * one, one], axis=-1)
        return np.stack([major, minor, center], axis=-1)

    def points(self, number: int = 180) -> FloatArray:
        """Return `number` points of the rim, shape (..., number, 2), evenly spaced in the eccentric angle.

        Raises `ArgumentError` where `number` is no whole number of at least 1.
        """
        expected = "a whole number of at least 1"
        if _arguments.whole("number", number, expected) < 1:
            raise ArgumentError(f"number: expected {expected}, got {number}.")
        unit_x, unit_y = unit_circle(number)
        along, across = unit_x * self.semi_major[..., None], unit_y * self.semi_minor[..., None]
        cos, sin = np.cos(self.angle)[..., None], np.sin(self.angle)[..., None]
        points = np.empty((*along.shape, 2))
        points[..., 0] = self.center[..., :1] + cos * along - sin * across
        points[..., 1] = self.center[..., 1:] + sin * along + cos * across
        return points


def _numbers(name: str, values: object) -> FloatArray:
    array = _arguments.float_array(name, values, "numbers")
    if np.any(np.isinf(array)):
        raise ArgumentError(f"{name}: expected finite numbers, got {_arguments.shown(values)}.")
    return array


@lru_cache(maxsize=64)
def unit_circle(number: int) -> FloatArray:
    """Return x and y (2, number) of points evenly spaced on the unit circle, from (1, 0) towards the y axis."""
    angle = np.linspace(0.0, 2.0 * np.pi, number, endpoint=False)
    return frozen([np.cos(angle), np.sin(angle)])


def own_normals(ellipse: Ellipse, number: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the outward unit normals of ellipses' rims, in the ellipses' own axes.

    Parameters
    ----------
    ellipse
        (m,) with semi-axes a, b.
    number
        Points along each rim, at the eccentric angles p of `Ellipse.points`.

    Returns
    -------
    x and y (m, number) of the normals, and 1 / |(b cos p, a sin p)| (m, number), per plane unit.
    """
    unit_x, unit_y = unit_circle(number)
    x, y = ellipse.semi_minor[:, None] * unit_x, ellipse.semi_major[:, None] * unit_y
    per_norm = 1.0 / np.maximum(np.sqrt(x * x + y * y), 1e-12)
    return x * per_norm, y * per_norm, per_norm


def wrap_half_turn(angle: FloatArray) -> FloatArray:
    """Bring the direction of an undirected line (rad) into (-pi/2, pi/2]."""
    wrapped = np.mod(angle + np.pi / 2.0, np.pi) - np.pi / 2.0
    return np.where(wrapped <= -np.pi / 2.0, np.pi / 2.0, wrapped)


def rim_distance(ellipse: Ellipse, points: FloatArray) -> FloatArray:
    """Return the first-order signed distances of points to the rim.

    Parameters
    ----------
    ellipse
        (...) with semi-axes that are not 0.
    points
        (..., n, 2) in the same plane unit; (n, 2) are the same for each ellipse.

    Returns
    -------
    (..., n) in the plane's unit, negative inside: f / |grad f| with f = |(x/a, y/b)| - 1 in the ellipse's own axes.
    f is nearly linear across the rim, and as precise far from the origin as close to it.
    """
    offset = points - ellipse.center[..., None, :]
    cos, sin = np.cos(ellipse.angle)[..., None], np.sin(ellipse.angle)[..., None]
    a, b = ellipse.semi_major[..., None], ellipse.semi_minor[..., None]
    x = (cos * offset[..., 0] + sin * offset[..., 1]) / a
    y = (cos * offset[..., 1] - sin * offset[..., 0]) / b
    # Three times faster than `np.hypot`, and nothing here is large or small enough to need that.
    radius, slope = np.sqrt(x * x + y * y), np.sqrt((x / a) ** 2 + (y / b) ** 2)
    # At the center itself the distance is that to the nearer vertex.
    return np.where(radius > 1e-9, (radius - 1.0) * radius / np.maximum(slope, 1e-300), -b)


def signed_distance(ellipse: Ellipse, points: FloatArray) -> FloatArray:
    """Return the exact signed distances of points to the rim.

    Parameters
    ----------
    ellipse
        (...) also segments.
    points
        (..., n, 2) in the same plane unit.

    Returns
    -------
    (..., n) in the plane's unit, negative inside.

    Notes
    -----
    The nearest rim point of (p, q), folded into the first quadrant, is (a^2 p/(t + a^2 - b^2), b^2 q/t), with t
    the largest root of (a p/(t + a^2 - b^2))^2 + (b q/t)^2 = 1. That function is convex and falling, so Newton's
    iteration from its left climbs to the root without overshooting.
    """
    a = np.asarray(ellipse.semi_major, dtype=np.float64)[..., None]
    # A floor far below any pixel keeps segments and points on the major axis off the poles.
    floor = 1e-12 * a
    b = np.maximum(np.asarray(ellipse.semi_minor, dtype=np.float64)[..., None], floor)
    offset = np.asarray(points, dtype=np.float64) - ellipse.center[..., None, :]
    cos, sin = np.cos(ellipse.angle)[..., None], np.sin(ellipse.angle)[..., None]
    p = np.abs(cos * offset[..., 0] + sin * offset[..., 1])
    q = np.maximum(np.abs(cos * offset[..., 1] - sin * offset[..., 0]), floor)
    focal2 = (a - b) * (a + b)
    t = np.maximum(b * q, a * p - focal2)
    for _ in range(60):
        x, y = a * p / (t + focal2), b * q / t
        value = x**2 + y**2 - 1.0
        slope = 2.0 * (x**2 / (t + focal2) + y**2 / t)
        step = value / slope
        t = t + step
        if np.all(np.abs(step) <= 1e-15 * t):
            break
    distance = np.hypot(p - a**2 * p / (t + focal2), q - b**2 * q / t)
    inside = (p / a) ** 2 + (q / b) ** 2 < 1.0
    return np.where(inside, -distance, distance)


NO_ELLIPSES = Ellipse(np.empty((0, 2)), np.empty(0), np.empty(0), np.empty(0))
"""A batch without any."""
