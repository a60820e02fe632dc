"""A scene as painted layers: nested regions, each with its look."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from circlepose._typing import FloatArray
from circlepose.synthesis.coverage import Cells
from circlepose.synthesis.regions import (
    CircleRegion,
    Intersection,
    Region,
    patch_region,
    plane_coordinates,
    solid_region,
)
from circlepose.synthesis.scene import (
    BoardPart,
    Circle,
    CoaxialPart,
    Disc,
    Paint,
    Patch,
    Plane,
    Rings,
    Scene,
    TargetPart,
)
from circlepose.synthesis.texture import mottle


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """One region and its look."""

    region: Region
    paint: Paint
    plane: Plane | None
    """carries the texture; None: the image"""

    def levels(self, cells: Cells) -> FloatArray:
        """Return the gray levels (...) that the paint has at `cells`."""
        if self.paint.texture is None:
            return np.full(cells.pixels.shape[:-1], self.paint.level, dtype=np.float64)
        points = cells.pixels if self.plane is None else plane_coordinates(self.plane, cells)[0]
        return self.paint.level + mottle(self.paint.texture, np.nan_to_num(points))


@dataclass(frozen=True, slots=True, eq=False)
class Layer:
    """Parts each of which lies within the one before.

    With coverages u1 >= u2 >= ... a cell under gray level g becomes g + u1 (p1 - g) + u2 (p2 - p1) + ...,
    which is exact also where rims of two parts coincide (the hidden side of a boss).
    """

    parts: tuple[Part, ...]


def layers(scene: Scene) -> tuple[Layer, ...]:
    """Return the layers of `scene` above its background, the lowest first."""
    return (
        *(_patch_layer(patch) for patch in scene.shapes),
        *(layer for target in scene.targets for layer in _target_layers(target)),
        *(_patch_layer(patch) for patch in scene.occluders),
    )


def _patch_layer(patch: Patch) -> Layer:
    return Layer((Part(patch_region(patch), patch.paint, patch.plane),))


def _target_layers(target: TargetPart) -> tuple[Layer, ...]:
    if isinstance(target, BoardPart):
        return tuple(_board_layer(target, rims) for rims in target.seen_rims)
    return (_target_layer(target),)


def _board_layer(target: BoardPart, rims: tuple[Circle, ...]) -> Layer:
    # All circles of a plane have one origin, so that a texture runs on from circle to circle.
    normal, center = rims[0].normal, rims[0].center
    origin = target.translation + normal * float(normal @ (center - target.translation))
    plane = Plane.create(origin, normal, target.rotation[:, 0])
    return Layer(
        tuple(Part(CircleRegion(rim), paint, plane) for rim, paint in zip(rims, target.paints, strict=False))
    )


def _target_layer(target: Disc | Rings | CoaxialPart) -> Layer:
    plane = Plane.create(target.center_mm, target.normal)
    if isinstance(target, Disc):
        rims = ((target.radius_mm, target.paint), *target.marks)
        return _concentric(target, plane, rims)
    if isinstance(target, Rings):
        return _concentric(target, plane, tuple(zip(target.radii_mm, target.paints, strict=True)))
    big, small = (CircleRegion(circle) for circle in target.circles)
    small_plane = Plane.create(target.small_center_mm, target.normal)
    if target.form == "boss":
        return Layer((Part(solid_region(target), target.side, plane), Part(small, target.cap, small_plane)))
    # A frustum is convex: a ray that enters by the mouth and crosses the floor's disc meets no wall between.
    floor = Intersection((big, small))
    return Layer((Part(big, target.side, plane), Part(floor, target.cap, small_plane)))


def _concentric(target: Disc | Rings, plane: Plane, rims: tuple[tuple[float, Paint], ...]) -> Layer:
    return Layer(
        tuple(
            Part(CircleRegion(Circle("", target.center_mm, target.normal, radius)), paint, plane)
            for radius, paint in rims
        )
    )
