"""Rendered images of several discs with known poses: the layout, the light and the flaws that the families share.

Every disc has the same radius in mm, as one target has; its distance sets its radius in px. Shares of pixels are
exact; a blur above `LENS_PX` is added to the rendered image, whose rims are then already band-limited.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from circlepose._typing import FloatArray, Image
from circlepose.camera.camera import Camera
from circlepose.fitting.cone_projection import image_ellipses
from circlepose.geometry.cone import factor_from_circle, plane_basis
from circlepose.geometry.ellipse import Ellipse
from circlepose.synthesis.render import render_float
from circlepose.synthesis.scene import Box, Disc, Paint, Patch, Plane, Polygon, Scene

FOCAL_PX, RADIUS_MM = 1200.0, 30.0
LENS_PX = 0.7
LEAST_CELL_PX = 60.0
TILT_DEG = (10.0, 60.0)
PLANE_TILT_DEG = (10.0, 35.0)


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """An image and what is in it."""

    setting: str
    """the row of the table"""
    image: Image
    """as `estimate` takes it"""
    camera: Camera
    discs: tuple[Disc, ...]
    """those that are counted"""
    besides: tuple[Disc, ...] = ()
    """others that are there"""

    def ellipses(self) -> Ellipse:
        """Return the rims of `discs`, then of `besides`, px."""
        return rims(self.camera, (*self.discs, *self.besides))


@dataclass(frozen=True, slots=True, eq=False)
class Board:
    """Where the discs of an image are. They have no look yet."""

    camera: Camera
    poses: tuple[tuple[FloatArray, FloatArray], ...]
    """center (3,) mm and unit normal (3,) of each disc"""
    plane: Plane | None = None
    """the plane that all lie in, if they do"""

    def discs(self, levels: float | Sequence[float]) -> tuple[Disc, ...]:
        """Return the discs, of one gray level or of their own."""
        each = np.broadcast_to(levels, len(self.poses))
        return tuple(
            Disc(c, n, RADIUS_MM, Paint(float(level))) for (c, n), level in zip(self.poses, each, strict=True)
        )


def rims(camera: Camera, discs: Sequence[Disc]) -> Ellipse:
    """Return the ellipses that discs are seen as, px."""
    factors = np.array([factor_from_circle(d.center_mm, d.normal, d.radius_mm) for d in discs])
    return image_ellipses(camera, factors)[0]


def board(
    generator: np.random.Generator,
    radii_px: float | Sequence[float],
    margin_px: float = 8.0,
    size: tuple[int, int] = (4, 3),
    *,
    in_plane: bool = False,
) -> Board:
    """Return discs in columns and rows, each off its cell's center by a part of a px or more, randomly tilted."""
    columns, rows = size
    radii = np.broadcast_to(radii_px, columns * rows)
    cell = max(LEAST_CELL_PX, 2.0 * float(radii.max()) * (1.2 if in_plane else 1.0) + 2.0 * margin_px)
    width, height = int(columns * cell), int(rows * cell)
    middle = np.array([(width - 1) / 2.0, (height - 1) / 2.0])
    camera = Camera.create(
        [[FOCAL_PX, 0.0, middle[0]], [0.0, FOCAL_PX, middle[1]], [0.0, 0.0, 1.0]], (), (width, height)
    )
    shared = _tilted(np.array([0.0, 0.0, 1.0]), generator, PLANE_TILT_DEG)
    poses = []
    for number, radius in enumerate(radii):
        at = (np.array([number % columns, number // columns]) + 0.5) * cell - 0.5
        room = max(0.5, 0.25 * margin_px)
        ray = np.array([*((at + generator.uniform(-room, room, 2) - middle) / FOCAL_PX), 1.0])
        depth = FOCAL_PX * RADIUS_MM / float(radius)
        if in_plane:
            poses.append((depth * shared[2] / (shared @ ray) * ray, shared))
        else:
            sight = ray / np.linalg.norm(ray)
            poses.append((depth * ray, _tilted(sight, generator, TILT_DEG)))
    depth = FOCAL_PX * RADIUS_MM / float(radii[0])
    return Board(camera, tuple(poses), Plane.create((0.0, 0.0, depth), shared) if in_plane else None)


def hiding(disc: Disc, share: float, pieces: int, level: float, generator: np.random.Generator) -> Iterator[Patch]:
    """Yield straight-edged patches in the disc's plane that hide this share of its rim, in one or two pieces."""
    plane = Plane.create(disc.center_mm, disc.normal)
    turn = generator.uniform(0.0, 2.0 * np.pi)
    for piece in range(pieces):
        angle = turn + piece * generator.uniform(0.7, 1.3) * np.pi
        inner = np.cos(np.pi * share / pieces)
        length = 1.12 - inner
        distance = RADIUS_MM * (inner + 0.5 * length)
        box = Box(
            size=(2.24 * RADIUS_MM, length * RADIUS_MM),
            at=(distance * np.cos(angle), distance * np.sin(angle)),
            angle=angle - 0.5 * np.pi,
        )
        yield Patch(box, Paint(level), plane)


def stripes(plane: Plane, width_mm: float, levels: tuple[float, float], reach_mm: float) -> Iterator[Patch]:
    """Yield a sheet with stripes, in a plane."""
    yield Patch(Box(size=(2.0 * reach_mm, 2.0 * reach_mm)), Paint(levels[0]), plane)
    for number in range(-int(reach_mm / width_mm / 2.0), int(reach_mm / width_mm / 2.0)):
        at = 2.0 * number * width_mm
        yield Patch(Box(size=(width_mm, 2.0 * reach_mm), at=(at, 0.0)), Paint(levels[1]), plane)


def rough_patch(disc: Disc, share: float, level: float, generator: np.random.Generator) -> Patch:
    """Return a shape whose edge departs from the disc's by a smooth random function.

    `share` is its standard deviation over the radius. It has 3 to 15 waves around, so that the ellipse that fits best
    is the disc's own.
    """
    turn = 2.0 * np.pi * np.arange(360) / 360.0
    waves = np.arange(3, 16)
    heights = generator.normal(size=(2, len(waves))) / np.sqrt(waves)
    off = heights[0] @ np.cos(np.outer(waves, turn)) + heights[1] @ np.sin(np.outer(waves, turn))
    radii = RADIUS_MM * (1.0 + share * off / off.std())
    points = tuple(zip((radii * np.cos(turn)).tolist(), (radii * np.sin(turn)).tolist(), strict=True))
    return Patch(Polygon(points), Paint(level), Plane.create(disc.center_mm, disc.normal))


def rendered(scene: Scene, blur_px: float = LENS_PX) -> FloatArray:
    """Return the gray levels (h, w) of a scene without noise."""
    levels = render_float(replace(scene, blur_px=min(blur_px, LENS_PX)))
    if blur_px <= LENS_PX:
        return levels
    return cv2.GaussianBlur(levels, (0, 0), float(np.sqrt(blur_px**2 - LENS_PX**2)), borderType=cv2.BORDER_REPLICATE)


def photographed(levels: FloatArray, noise: float, generator: np.random.Generator) -> Image:
    """Return levels as 8 bit pixels, with noise."""
    noisy = levels + noise * generator.standard_normal(levels.shape)
    return np.clip(np.rint(noisy), 0.0, 255.0).astype(np.uint8)


def _tilted(sight: FloatArray, generator: np.random.Generator, limits_deg: tuple[float, float]) -> FloatArray:
    """Return a unit normal towards the camera, tilted from the line of sight."""
    first, second = plane_basis(sight)
    tilt, lean = np.radians(generator.uniform(*limits_deg)), generator.uniform(0.0, 2.0 * np.pi)
    return -np.cos(tilt) * sight + np.sin(tilt) * (np.cos(lean) * first + np.sin(lean) * second)
