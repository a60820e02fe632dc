"""A target as a camera is to see it: its pose, and the picture that would be taken. Pure but for the renderer."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from circlepose._typing import FloatArray
from circlepose.boards.pose import rotation_between
from circlepose.camera.camera import Camera, circle_contour
from circlepose.errors import SceneError, UsageError
from circlepose.geometry.cone import plane_basis
from circlepose.synthesis.scene import BoardPart, CoaxialPart, Disc, Paint, Rings, Scene, TargetPart
from circlepose.targets.board import BoardLayout
from circlepose.targets.target import Target

_AZIMUTH = math.radians(30.0)
"""Direction in which the normal leans from the line of sight: along no axis of the pixels."""
_X = np.array([1.0, 0.0, 0.0])
_MOST_BLUR_PX = 30.0
"""No circle is measured in more, and pictures of more take long."""
_MARGIN_PX, _MARGIN_SHARE, _MARGIN_BLURS = 24.0, 0.25, 8.0
"""Of the picture around the target: px, of its extent, and of the blur; the fit looks no farther."""


@dataclass(frozen=True, slots=True)
class Look:
    """How a picture shows the target."""

    noise_levels: float = 2.0
    """standard deviation of a pixel's noise, gray levels of 255"""
    blur_px: float = 0.7
    """sigma of the lens; the pixel's own box comes on top"""
    contrast_levels: float = 150.0
    """gray levels between target and ground"""

    def __post_init__(self) -> None:
        if not 0.0 < self.contrast_levels <= 255.0:
            raise UsageError(f"contrast: expected gray levels above 0 and up to 255, got {self.contrast_levels:g}.")
        if not 0.0 <= self.noise_levels < math.inf:
            raise UsageError(f"noise: expected gray levels of 0 or more, got {self.noise_levels:g}.")
        if not 0.0 <= self.blur_px <= _MOST_BLUR_PX:
            raise UsageError(f"blur_px: expected 0 to {_MOST_BLUR_PX:g} px, got {self.blur_px:g}.")


USUAL = Look()


@dataclass(frozen=True, slots=True)
class View:
    """Where the target is: its middle at `distance_mm` along the line of sight of a pixel, tilted from that line."""

    distance_mm: float
    tilt_deg: float
    """angle of the normal to the line of sight"""
    place_px: tuple[float, float]
    """(u, v) where its middle is seen"""


@dataclass(frozen=True, slots=True, eq=False)
class PlacedTarget:
    """A target in its true pose."""

    part: TargetPart
    ground: Paint
    """behind it"""
    middle: FloatArray
    """(3,) mm, camera frame"""
    normal: FloatArray
    """(3,) unit, towards the camera"""


def placed(target: Target, camera: Camera, view: View, look: Look) -> PlacedTarget | str:
    """Return a target in a view, painted for a look; a part of two heights as a boss. Or why it cannot be seen so.

    Raises `UsageError` where the height of a coaxial part is not known.
    """
    ray = camera.rays(np.array([view.place_px]))[0]
    if not np.all(np.isfinite(ray)):
        return f"the lens model does not reach px ({view.place_px[0]:.0f}, {view.place_px[1]:.0f})"
    sight = ray / np.linalg.norm(ray)
    lean = np.stack(plane_basis(-sight)).T @ [math.cos(_AZIMUTH), math.sin(_AZIMUTH)]
    tilt = math.radians(view.tilt_deg)
    normal = -math.cos(tilt) * sight + math.sin(tilt) * lean
    middle = view.distance_mm * sight
    ground = Paint(127.5 + 0.5 * _sign(target) * look.contrast_levels)
    try:
        return PlacedTarget(_part(target, middle, normal, look), ground, middle, normal)
    except SceneError as error:
        return str(error).rstrip(".")


def picture_of(place: PlacedTarget, camera: Camera, look: Look) -> Scene | str:
    """Return the scene around a target, without noise: the part of the image that holds it, by the same camera.

    Or why there is none.
    """
    assert camera.image_size is not None
    circles = place.part.circles
    rims = np.concatenate([circle_contour(camera, each.center, each.normal, each.radius, 90) for each in circles])
    rims = rims[np.isfinite(rims).all(axis=1)]
    size = np.array(camera.image_size)
    if not len(rims) or np.any(rims.max(axis=0) < 0.0) or np.any(rims.min(axis=0) > size - 1.0):
        return "nothing of the target is in the image"
    low, high = rims.min(axis=0), rims.max(axis=0)
    margin = _MARGIN_PX + _MARGIN_BLURS * look.blur_px + _MARGIN_SHARE * float(np.max(high - low))
    first = np.maximum(np.floor(low - margin), 0.0)
    last = np.minimum(np.ceil(high + margin), size - 1.0)
    matrix = camera.camera_matrix.copy()
    matrix[:2, 2] -= first
    width, height = (int(length) for length in last - first + 1.0)
    window = Camera.create(matrix, camera.dist_coeffs, (width, height), camera.model, sigma=camera.sigma)
    return Scene(window, (place.part,), place.ground, blur_px=look.blur_px)


def scaled(target: Target, factor: float) -> Target:
    """Return a target all of whose lengths are larger by `factor`; how well they are known stays the same in mm."""
    layout = target.layout
    if layout is not None:
        circles = tuple(
            replace(
                circle,
                center_mm=(factor * circle.center_mm[0], factor * circle.center_mm[1], factor * circle.center_mm[2]),
                radii_mm=tuple(factor * radius for radius in circle.radii_mm),
            )
            for circle in layout.circles
        )
        grid = None if layout.grid is None else replace(layout.grid, spacing_mm=factor * layout.grid.spacing_mm)
        layout = replace(layout, circles=circles, grid=grid)
    return replace(
        target,
        radii_mm=tuple(factor * radius for radius in target.radii_mm),
        generatrix_mm=None if target.generatrix_mm is None else factor * target.generatrix_mm,
        layout=layout,
    )


def _sign(target: Target) -> float:
    """Return +1 for a target that is darker than its ground, -1 for a brighter one."""
    return -1.0 if target.polarity == "bright" else 1.0


def _part(target: Target, middle: FloatArray, normal: FloatArray, look: Look) -> TargetPart:
    half = 0.5 * _sign(target) * look.contrast_levels
    own, ground = Paint(127.5 - half), Paint(127.5 + half)
    if target.kind == "circle":
        return Disc(middle, normal, target.radii_mm[0], own)
    if target.kind == "coplanar":
        paints = tuple(ground if i % 2 else own for i in range(len(target.radii_mm)))
        return Rings(middle, normal, target.radii_mm, paints)
    if target.kind == "coaxial":
        big, small = target.radii_mm
        if target.generatrix_mm is None:
            raise UsageError("target: the height of a coaxial part is needed: give height_mm or generatrix_mm.")
        height = math.sqrt(target.generatrix_mm**2 - (big - small) ** 2)
        return CoaxialPart(middle, normal, (big, small), height, "boss", own, ground)
    assert target.layout is not None
    return _board(target.layout, middle, normal, (own, ground))


def _board(layout: BoardLayout, middle: FloatArray, normal: FloatArray, paints: tuple[Paint, ...]) -> BoardPart:
    """Return a board whose x axis runs to the right as far as its tilt allows."""
    rotation = rotation_between(layout.normals[0], _X, normal, _X)
    most = max(len(circle.radii_mm) for circle in layout.circles)
    every = tuple(paints[i % 2] for i in range(most))
    return BoardPart(middle - rotation @ layout.centers_mm.mean(axis=0), rotation, layout, every)
