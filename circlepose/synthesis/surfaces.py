"""Surfaces of a scene: looks, planes, circles and flat shapes. Frozen values; mm in space, px in the image."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Self, TypeAlias

import numpy as np

from circlepose._typing import FloatArray, frozen
from circlepose.errors import SceneError
from circlepose.geometry.cone import plane_basis


@dataclass(frozen=True, slots=True)
class Texture:
    """Smooth random mottle; the same seed gives the same pattern everywhere."""

    amplitude: float
    """standard deviation, gray levels"""
    scale: float
    """size of the coarsest spots: mm on a plane, px in the image"""
    seed: int = 0

    def __post_init__(self) -> None:
        check("texture.amplitude", self.amplitude, lowest=0.0)
        check("texture.scale", self.scale, above=0.0)
        check("texture.seed", self.seed, lowest=0.0)


@dataclass(frozen=True, slots=True)
class Paint:
    """The look of a surface: a gray level (0 to 255) and perhaps a texture."""

    level: float
    texture: Texture | None = None

    def __post_init__(self) -> None:
        check("level", self.level)


@dataclass(frozen=True, slots=True, eq=False)
class Circle:
    """The truth of one circle."""

    name: str
    """as in the tables' column `circle`"""
    center: FloatArray
    """(3,) mm, camera frame"""
    normal: FloatArray
    """(3,) unit, towards the camera"""
    radius: float
    """mm"""


@dataclass(frozen=True, slots=True, eq=False)
class Plane:
    """A plane with a frame in it. Build it with `Plane.create`."""

    center: FloatArray
    """(3,) mm, origin of the plane's coordinates"""
    normal: FloatArray
    """(3,) unit, towards the camera"""
    right: FloatArray
    """(3,) unit, first axis of the plane's coordinates"""
    down: FloatArray
    """(3,) unit, second axis; down in the image for a plane that faces the camera"""

    @classmethod
    def create(cls, center: object, normal: object, right: object = (1.0, 0.0, 0.0)) -> Self:
        """Return the plane through `center` (mm) with `normal` of any length and side; `right` is laid into it."""
        origin, n = placed("plane", center, normal)
        wanted = np.asarray(right, dtype=np.float64)
        first = wanted - np.dot(wanted, n) * n
        if np.linalg.norm(first) <= 1e-9 * np.linalg.norm(wanted):
            first = plane_basis(n)[0]
        first = first / np.linalg.norm(first)
        return cls(origin, n, frozen(first), frozen(np.cross(first, n)))

    def point(self, at: tuple[float, float]) -> FloatArray:
        """Return the point (3,) of the camera frame with the plane's coordinates `at` (mm)."""
        return np.asarray(self.center + at[0] * self.right + at[1] * self.down)


@dataclass(frozen=True, slots=True)
class Box:
    """A rectangle, with round corners if wanted."""

    size: tuple[float, float]
    """width and height"""
    at: tuple[float, float] = (0.0, 0.0)
    """its center"""
    angle: float = 0.0
    """rad, turn of its width from the first axis towards the second"""
    corner_radius: float = 0.0

    def __post_init__(self) -> None:
        check("size", min(self.size), above=0.0)
        check("corner_radius", self.corner_radius, lowest=0.0)
        if self.corner_radius > min(self.size) / 2.0:
            raise SceneError(f"corner_radius: at most half the shorter side, got {self.corner_radius:g}.")


@dataclass(frozen=True, slots=True)
class Polygon:
    """A simple polygon, either way round."""

    points: tuple[tuple[float, float], ...]

    def __post_init__(self) -> None:
        if len(self.points) < 3:
            raise SceneError(f"points: a polygon has at least 3 corners, got {len(self.points)}.")


@dataclass(frozen=True, slots=True)
class Round:
    """A disc."""

    radius: float
    at: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        check("radius", self.radius, above=0.0)


Shape: TypeAlias = Box | Polygon | Round


@dataclass(frozen=True, slots=True, eq=False)
class Patch:
    """A painted shape that is no target: a plate, clutter, an occluder."""

    shape: Shape
    paint: Paint
    plane: Plane | None = None
    """the plane it lies on, and its unit is mm; None: the image, in px"""


def placed(what: str, center: object, normal: object) -> tuple[FloatArray, FloatArray]:
    """Return `center` (3,) and the unit `normal` (3,) towards the camera; raises `SceneError` that names `what`."""
    c, n = np.array(center, dtype=np.float64), np.array(normal, dtype=np.float64)
    if c.shape != (3,) or n.shape != (3,) or not (np.all(np.isfinite(c)) and np.all(np.isfinite(n))):
        raise SceneError(f"{what}: expected center_mm and normal as three finite numbers each.")
    length = np.linalg.norm(n)
    if length == 0.0:
        raise SceneError(f"{what}: normal: expected a direction, got a vector of length 0.")
    return frozen(c), frozen(n / (length if np.dot(n, c) <= 0.0 else -length))


def check(key: str, value: float, *, lowest: float = -math.inf, above: float = -math.inf) -> None:
    """Raise `SceneError` unless `value` is finite, at least `lowest` and above `above`."""
    if math.isfinite(value) and value >= lowest and value > above:
        return
    wanted = "a finite number"
    if lowest > -math.inf:
        wanted = f"a number of at least {lowest:g}"
    elif above > -math.inf:
        wanted = f"a number above {above:g}"
    raise SceneError(f"{key}: expected {wanted}, got {value:g}.")
