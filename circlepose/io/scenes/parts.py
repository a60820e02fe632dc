"""The parts of a scene file: planes, paints and shapes, each a YAML mapping."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Annotated, Any, Literal

from pydantic import Field

from circlepose.errors import SceneError
from circlepose.io.text.validation import Strict, parse
from circlepose.synthesis.scene import Box, Paint, Patch, Plane, Polygon, Round, Shape, Texture

Unit = Literal["mm", "px"]
Pair = Annotated[list[float], Field(min_length=2, max_length=2)]
Triple = Annotated[list[float], Field(min_length=3, max_length=3)]
Positive = Annotated[float, Field(gt=0.0)]
Level = Annotated[float, Field(ge=0.0, le=255.0)]
LEVEL = "a gray level from 0 to 255"
_TEXTURE = "a mapping with amplitude, scale_mm (or scale_px in the image) and seed"


class _Texture(Strict):
    amplitude: Annotated[float, Field(ge=0.0)] = Field(description="a number of at least 0, in gray levels")
    scale_mm: Positive | None = Field(None, description="a positive number, the size of the spots in mm")
    scale_px: Positive | None = Field(None, description="a positive number, the size of the spots in px")
    seed: Annotated[int, Field(ge=0)] = Field(0, description="a whole number of at least 0")


class PaintForm(Strict):
    """The look of a surface."""

    level: Level = Field(description=LEVEL)
    texture: dict[str, Any] | None = Field(None, description=_TEXTURE)


class _Plane(Strict):
    center_mm: Triple = Field(description="[x, y, z] in mm, camera frame")
    normal: Triple = Field(description="[x, y, z], a direction in the camera frame")
    right: Triple = Field([1.0, 0.0, 0.0], description="[x, y, z], the direction of the plane's first axis")


class _Shape(PaintForm):
    kind: Literal["box", "polygon", "disc"] = Field(description="one of box, polygon, disc")
    plane: str | dict[str, Any] | None = Field(None, description="the name of a plane, or a mapping that is one")
    angle_deg: float = Field(0.0, description="the turn of a box in degrees")
    at_mm: Pair | None = Field(None, description="[x, y] in mm on the plane")
    at_px: Pair | None = Field(None, description="[x, y] in px")
    size_mm: Pair | None = Field(None, description="[width, height] in mm")
    size_px: Pair | None = Field(None, description="[width, height] in px")
    corner_radius_mm: float | None = Field(None, description="the radius of a box's corners in mm")
    corner_radius_px: float | None = Field(None, description="the radius of a box's corners in px")
    radius_mm: Positive | None = Field(None, description="a positive radius in mm")
    radius_px: Positive | None = Field(None, description="a positive radius in px")
    points_mm: list[Pair] | None = Field(None, description="a list of corners [x, y] in mm on the plane")
    points_px: list[Pair] | None = Field(None, description="a list of corners [x, y] in px")


def paint(entries: Mapping[str, Any], where: str, unit: Unit) -> Paint:
    """Return a look; its texture's scale is in `unit`."""
    return paint_of(parse(PaintForm, entries, where, SceneError), where, unit)


def plane(entries: Mapping[str, Any], where: str) -> Plane:
    """Return a plane."""
    form = parse(_Plane, entries, where, SceneError)
    with at_place(where):
        return Plane.create(form.center_mm, form.normal, form.right)


def shape_patch(entries: Mapping[str, Any], where: str, planes: Mapping[str, Plane]) -> Patch:
    """Return a painted shape: in mm on its plane, or in px where it has none."""
    form = parse(_Shape, entries, where, SceneError)
    unit: Unit = "px" if form.plane is None else "mm"
    other = "mm" if unit == "px" else "px"
    for key in sorted(form.model_fields_set):
        if key.endswith(f"_{other}"):
            why = "a shape with a plane is measured in mm" if unit == "mm" else "a shape without a plane is in px"
            raise SceneError(f"{where}: {key}: {why}; write {key.removesuffix(other)}{unit}.")
    base = None if form.plane is None else plane_of(form.plane, where, planes)
    with at_place(where):
        return Patch(_shape(form, where, unit), paint_of(form, where, unit), base)


@contextmanager
def at_place(where: str) -> Iterator[None]:
    """Name the place in the file of a value that the scene refuses."""
    try:
        yield
    except SceneError as reason:
        text = str(reason)
        raise SceneError(text if text.startswith(where) else f"{where}: {text}") from None


def plane_of(given: str | Mapping[str, Any], where: str, planes: Mapping[str, Plane]) -> Plane:
    """Return the plane of a name in `planes`, or of a mapping; raises `SceneError`."""
    if not isinstance(given, str):
        return plane(given, f"{where}: plane")
    if given not in planes:
        known = ", ".join(planes) or "none is given"
        raise SceneError(f"{where}: plane: expected the name of one of the file's planes ({known}), got {given!r}.")
    return planes[given]


def paint_of(form: PaintForm, where: str, unit: Unit) -> Paint:
    """Return the look that a form describes; its texture's scale is in `unit`; raises `SceneError`."""
    if form.texture is None:
        return Paint(form.level)
    texture = parse(_Texture, form.texture, f"{where}: texture", SceneError)
    scale, other = (texture.scale_mm, texture.scale_px) if unit == "mm" else (texture.scale_px, texture.scale_mm)
    if scale is None or other is not None:
        raise SceneError(f"{where}: texture: expected its scale as scale_{unit}, and no other.")
    return Paint(form.level, Texture(texture.amplitude, scale, texture.seed))


def _shape(form: _Shape, where: str, unit: Unit) -> Shape:
    millimetres = unit == "mm"
    at = (form.at_mm if millimetres else form.at_px) or [0.0, 0.0]
    center = (at[0], at[1])
    used = {"kind", "plane", "level", "texture"}
    if form.kind == "polygon":
        _check_keys(form, where, used | {f"points_{unit}"}, f"points_{unit}")
        points = (form.points_mm if millimetres else form.points_px) or []
        return Polygon(tuple((x, y) for x, y in points))
    if form.kind == "disc":
        _check_keys(form, where, used | {f"at_{unit}", f"radius_{unit}"}, f"radius_{unit}")
        return Round((form.radius_mm if millimetres else form.radius_px) or 0.0, center)
    keys = {f"at_{unit}", f"size_{unit}", f"corner_radius_{unit}", "angle_deg"}
    _check_keys(form, where, used | keys, f"size_{unit}")
    width, height = (form.size_mm if millimetres else form.size_px) or [0.0, 0.0]
    corner = (form.corner_radius_mm if millimetres else form.corner_radius_px) or 0.0
    return Box((width, height), center, math.radians(form.angle_deg), corner)


def _check_keys(form: _Shape, where: str, allowed: set[str], needed: str) -> None:
    for key in sorted(form.model_fields_set - allowed):
        raise SceneError(f"{where}: {key}: does not belong to a {form.kind}; it takes {', '.join(sorted(allowed))}.")
    if needed not in form.model_fields_set:
        raise SceneError(f"{where}: {needed}: is missing; expected {_Shape.model_fields[needed].description}.")
