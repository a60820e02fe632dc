"""What is to be rendered: a camera, targets, clutter and the flaws of an image. Frozen values, mm and px.

Grey levels are on the scale 0 to 255 whatever the bit depth. Later covers earlier: background, then
`shapes`, `targets` and `occluders`, each in their order; depth is not compared.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Literal, Self, TypeAlias

import numpy as np

from circlepose._typing import FloatArray, frozen
from circlepose.camera import Camera
from circlepose.cone import plane_basis
from circlepose.errors import SceneError
from circlepose.target import Kind


@dataclass(frozen=True, slots=True)
class Texture:
    """Smooth random mottle; the same seed gives the same pattern everywhere."""

    amplitude: float
    """standard deviation, grey levels"""
    scale: float
    """size of the coarsest spots: mm on a plane, px in the image"""
    seed: int = 0

    def __post_init__(self) -> None:
        _check("texture.amplitude", self.amplitude, lowest=0.0)
        _check("texture.scale", self.scale, above=0.0)
        _check("texture.seed", self.seed, lowest=0.0)


@dataclass(frozen=True, slots=True)
class Paint:
    """The look of a surface: a grey level (0 to 255) and perhaps a texture."""

    level: float
    texture: Texture | None = None

    def __post_init__(self) -> None:
        _check("level", self.level)


@dataclass(frozen=True, slots=True)
class Shading:
    """Relative illumination of the image plane, 1 at the image's centre; a linear gradient."""

    right: float = 0.0
    """change from the left border to the right one: 0.2 is from 0.9 to 1.1"""
    down: float = 0.0
    """change from the upper border to the lower one"""


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
        origin, n = _placed("plane", center, normal)
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
    """its centre"""
    angle: float = 0.0
    """rad, turn of its width from the first axis towards the second"""
    corner_radius: float = 0.0

    def __post_init__(self) -> None:
        _check("size", min(self.size), above=0.0)
        _check("corner_radius", self.corner_radius, lowest=0.0)
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
        _check("radius", self.radius, above=0.0)


Shape: TypeAlias = Box | Polygon | Round


@dataclass(frozen=True, slots=True, eq=False)
class Patch:
    """A painted shape that is no target: a plate, clutter, an occluder."""

    shape: Shape
    paint: Paint
    plane: Plane | None = None
    """the plane it lies on, and its unit is mm; None: the image, in px"""


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
        _check("height_mm", self.height_mm, above=0.0)
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
        """(3,) centre of the small circle, camera frame."""
        height = self.height_mm if self.form == "boss" else -self.height_mm
        return np.asarray(self.center_mm + height * self.normal)

    @property
    def circles(self) -> tuple[Circle, ...]:
        """The truth, big first."""
        return (
            Circle("big", self.center_mm, self.normal, self.radii_mm[0]),
            Circle("small", self.small_center_mm, self.normal, self.radii_mm[1]),
        )


TargetPart: TypeAlias = Disc | Rings | CoaxialPart


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
    """standard deviation of the camera's noise, grey levels"""
    noise_seed: int = 0
    bit_depth: Literal[8, 16] = 8
    name: str = "scene"
    """name of the image, without its suffix"""

    def __post_init__(self) -> None:
        if self.camera.image_size is None:
            raise SceneError("camera: a scene's camera must state its image_size (width, height).")
        _check("blur_px", self.blur_px, lowest=0.0)
        _check("noise_levels", self.noise_levels, lowest=0.0)
        _check("noise_seed", self.noise_seed, lowest=0.0)
        if self.bit_depth not in (8, 16):
            raise SceneError(f"bit_depth: expected 8 or 16, got {self.bit_depth}.")

    @property
    def image_size(self) -> tuple[int, int]:
        """(width, height) px."""
        if self.camera.image_size is None:
            raise SceneError("camera: a scene's camera must state its image_size (width, height).")
        return self.camera.image_size


def _placed(what: str, center: object, normal: object) -> tuple[FloatArray, FloatArray]:
    c, n = np.array(center, dtype=np.float64), np.array(normal, dtype=np.float64)
    if c.shape != (3,) or n.shape != (3,) or not (np.all(np.isfinite(c)) and np.all(np.isfinite(n))):
        raise SceneError(f"{what}: expected center_mm and normal as three finite numbers each.")
    length = np.linalg.norm(n)
    if length == 0.0:
        raise SceneError(f"{what}: normal: expected a direction, got a vector of length 0.")
    return frozen(c), frozen(n / (length if np.dot(n, c) <= 0.0 else -length))


def _place(part: TargetPart, what: str) -> None:
    center, normal = _placed(what, part.center_mm, part.normal)
    object.__setattr__(part, "center_mm", center)
    object.__setattr__(part, "normal", normal)


def _check_radii(what: str, radii: tuple[float, ...]) -> None:
    ordered = all(a > b for a, b in pairwise(radii))
    if not (ordered and all(math.isfinite(r) and r > 0.0 for r in radii)):
        listed = ", ".join(f"{r:g}" for r in radii)
        raise SceneError(f"{what}: expected positive radii in mm, each smaller than the last, got {listed}.")


def _check(key: str, value: float, *, lowest: float = -math.inf, above: float = -math.inf) -> None:
    if math.isfinite(value) and value >= lowest and value > above:
        return
    wanted = "a finite number"
    if lowest > -math.inf:
        wanted = f"a number of at least {lowest:g}"
    elif above > -math.inf:
        wanted = f"a number above {above:g}"
    raise SceneError(f"{key}: expected {wanted}, got {value:g}.")
