"""What is to be rendered: a camera, targets, clutter and the flaws of an image. Frozen values, mm and px.

Gray levels are on the scale 0 to 255 whatever the bit depth. Later covers earlier: background, then
`shapes`, `targets` and `occluders`, each in their order; depth is not compared.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Literal, TypeAlias

import numpy as np

from circlepose._typing import FloatArray
from circlepose.camera.camera import Camera
from circlepose.errors import SceneError
from circlepose.synthesis.board_part import BoardPart
from circlepose.synthesis.surfaces import (
    Box,
    Circle,
    Paint,
    Patch,
    Plane,
    Polygon,
    Round,
    Shape,
    Texture,
    check,
    placed,
)
from circlepose.targets import Kind

__all__ = [
    "BoardPart",
    "Box",
    "Circle",
    "CoaxialPart",
    "Disc",
    "Paint",
    "Patch",
    "Plane",
    "Polygon",
    "Rings",
    "Round",
    "Scene",
    "Shading",
    "Shape",
    "TargetPart",
    "Texture",
]


@dataclass(frozen=True, slots=True)
class Shading:
    """Relative illumination of the image plane, 1 at the image's center; a linear gradient."""

    right: float = 0.0
    """change from the left border to the right one: 0.2 is from 0.9 to 1.1"""
    down: float = 0.0
    """change from the upper border to the lower one"""


@dataclass(frozen=True, slots=True, eq=False)
class Disc:
    """A disc: the target of kind `circle`."""

    center_mm: FloatArray
    """(3,) camera frame"""
    normal: FloatArray
    """(3,) any length and side; kept as the unit vector towards the camera"""
    radius_mm: float
    paint: Paint
    marks: tuple[tuple[float, Paint], ...] = ()
    """(radius mm, paint) of concentric marks on it that are no part of the target (a hole, a hub), largest first"""

    def __post_init__(self) -> None:
        _place(self, "disc")
        _check_radii("disc", (self.radius_mm, *(radius for radius, _ in self.marks)))

    @property
    def kind(self) -> Kind:
        """Kind of the target."""
        return "circle"

    @property
    def circles(self) -> tuple[Circle, ...]:
        """The truth."""
        return (Circle("disc", self.center_mm, self.normal, self.radius_mm),)


@dataclass(frozen=True, slots=True, eq=False)
class Rings:
    """Coplanar concentric circles: the target of kind `coplanar`."""

    center_mm: FloatArray
    """(3,) camera frame"""
    normal: FloatArray
    """(3,) any length and side; kept as the unit vector towards the camera"""
    radii_mm: tuple[float, ...]
    """largest first"""
    paints: tuple[Paint, ...]
    """from each radius inwards to the next"""

    def __post_init__(self) -> None:
        _place(self, "rings")
        _check_radii("rings", self.radii_mm)
        if len(self.radii_mm) < 2 or len(self.paints) != len(self.radii_mm):
            raise SceneError("rings: expected two or more radii_mm and as many levels.")

    @property
    def kind(self) -> Kind:
        """Kind of the target."""
        return "coplanar"

    @property
    def circles(self) -> tuple[Circle, ...]:
        """The truth, outer first."""
        names = ("outer", "inner", *(f"ring{i}" for i in range(2, len(self.radii_mm))))
        return tuple(
            Circle(name, self.center_mm, self.normal, radius)
            for name, radius in zip(names, self.radii_mm, strict=True)
        )


@dataclass(frozen=True, slots=True, eq=False)
class CoaxialPart:
    """A frustum between two circles on one axis: the target of kind `coaxial`."""

    center_mm: FloatArray
    """(3,) camera frame, of the big circle"""
    normal: FloatArray
    """(3,) any length and side; kept as the unit vector towards the camera"""
    radii_mm: tuple[float, float]
    """big, small"""
    height_mm: float
    form: Literal["boss", "recess"]
    """boss: the small circle is nearer to the camera; recess: it is the floor, seen through the big one"""
    side: Paint
    """of the lateral surface"""
    cap: Paint
    """of the small circle's disc: a boss's top, a recess's floor"""

    def __post_init__(self) -> None:
        _place(self, self.form)
        _check_radii(self.form, self.radii_mm)
        check("height_mm", self.height_mm, above=0.0)
        if np.dot(self.normal, self.small_center_mm) >= 0.0:
            raise SceneError("boss: its top faces away from the camera; give a smaller height or another pose.")

    @property
    def kind(self) -> Kind:
        """Kind of the target."""
        return "coaxial"

    @property
    def generatrix_mm(self) -> float:
        """Rim to rim distance in the plane of symmetry."""
        return math.hypot(self.height_mm, self.radii_mm[0] - self.radii_mm[1])

    @property
    def small_center_mm(self) -> FloatArray:
        """(3,) center of the small circle, camera frame."""
        height = self.height_mm if self.form == "boss" else -self.height_mm
        return np.asarray(self.center_mm + height * self.normal)

    @property
    def circles(self) -> tuple[Circle, ...]:
        """The truth, big first."""
        return (
            Circle("big", self.center_mm, self.normal, self.radii_mm[0]),
            Circle("small", self.small_center_mm, self.normal, self.radii_mm[1]),
        )


TargetPart: TypeAlias = Disc | Rings | CoaxialPart | BoardPart


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """One image to render. The camera must say its image size."""

    camera: Camera
    targets: tuple[TargetPart, ...] = ()
    background: Paint = field(default_factory=lambda: Paint(200.0))
    """behind everything; the scale of its texture is in px"""
    shapes: tuple[Patch, ...] = ()
    """plates and clutter, under the targets"""
    occluders: tuple[Patch, ...] = ()
    """over the targets"""
    shading: Shading = field(default_factory=Shading)
    blur_px: float = 0.7
    """sigma of the lens's Gaussian; the pixel's own box comes on top"""
    noise_levels: float = 0.0
    """standard deviation of the camera's noise, gray levels"""
    noise_seed: int = 0
    bit_depth: Literal[8, 16] = 8
    name: str = "scene"
    """name of the image, without its suffix"""

    def __post_init__(self) -> None:
        if self.camera.image_size is None:
            raise SceneError("camera: a scene's camera must state its image_size (width, height).")
        check("blur_px", self.blur_px, lowest=0.0)
        check("noise_levels", self.noise_levels, lowest=0.0)
        check("noise_seed", self.noise_seed, lowest=0.0)
        if self.bit_depth not in (8, 16):
            raise SceneError(f"bit_depth: expected 8 or 16, got {self.bit_depth}.")

    @property
    def image_size(self) -> tuple[int, int]:
        """(width, height) px."""
        if self.camera.image_size is None:
            raise SceneError("camera: a scene's camera must state its image_size (width, height).")
        return self.camera.image_size


def _place(part: Disc | Rings | CoaxialPart, what: str) -> None:
    center, normal = placed(what, part.center_mm, part.normal)
    object.__setattr__(part, "center_mm", center)
    object.__setattr__(part, "normal", normal)


def _check_radii(what: str, radii: tuple[float, ...]) -> None:
    ordered = all(a > b for a, b in pairwise(radii))
    if not (ordered and all(math.isfinite(r) and r > 0.0 for r in radii)):
        listed = ", ".join(f"{r:g}" for r in radii)
        raise SceneError(f"{what}: expected positive radii in mm, each smaller than the last, got {listed}.")
