"""The parts of a scene file: planes, paints, shapes and targets, each a YAML mapping."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Annotated, Any, Literal

from pydantic import Field

from circlepose._arguments import shown
from circlepose._typing import FloatArray, frozen
from circlepose.errors import SceneError
from circlepose.io.text.validation import Strict, parse
from circlepose.synthesis.scene import (
    Box,
    CoaxialPart,
    Disc,
    Paint,
    Patch,
    Plane,
    Polygon,
    Rings,
    Round,
    Shape,
    TargetPart,
    Texture,
)

Unit = Literal["mm", "px"]
_Pair = Annotated[list[float], Field(min_length=2, max_length=2)]
_Triple = Annotated[list[float], Field(min_length=3, max_length=3)]
_Positive = Annotated[float, Field(gt=0.0)]
_Level = Annotated[float, Field(ge=0.0, le=255.0)]
_LEVEL = "a grey level from 0 to 255"
_TEXTURE = "a mapping with amplitude, scale_mm (or scale_px in the image) and seed"


class _Texture(Strict):
    amplitude: Annotated[float, Field(ge=0.0)] = Field(description="a number of at least 0, in grey levels")
    scale_mm: _Positive | None = Field(None, description="a positive number, the size of the spots in mm")
    scale_px: _Positive | None = Field(None, description="a positive number, the size of the spots in px")
    seed: Annotated[int, Field(ge=0)] = Field(0, description="a whole number of at least 0")


class _Paint(Strict):
    level: _Level = Field(description=_LEVEL)
    texture: dict[str, Any] | None = Field(None, description=_TEXTURE)


class _Plane(Strict):
    center_mm: _Triple = Field(description="[x, y, z] in mm, camera frame")
    normal: _Triple = Field(description="[x, y, z], a direction in the camera frame")
    right: _Triple = Field([1.0, 0.0, 0.0], description="[x, y, z], the direction of the plane's first axis")


class _Shape(_Paint):
    kind: Literal["box", "polygon", "disc"] = Field(description="one of box, polygon, disc")
    plane: str | dict[str, Any] | None = Field(None, description="the name of a plane, or a mapping that is one")
    angle_deg: float = Field(0.0, description="the turn of a box in degrees")
    at_mm: _Pair | None = Field(None, description="[x, y] in mm on the plane")
    at_px: _Pair | None = Field(None, description="[x, y] in px")
    size_mm: _Pair | None = Field(None, description="[width, height] in mm")
    size_px: _Pair | None = Field(None, description="[width, height] in px")
    corner_radius_mm: float | None = Field(None, description="the radius of a box's corners in mm")
    corner_radius_px: float | None = Field(None, description="the radius of a box's corners in px")
    radius_mm: _Positive | None = Field(None, description="a positive radius in mm")
    radius_px: _Positive | None = Field(None, description="a positive radius in px")
    points_mm: list[_Pair] | None = Field(None, description="a list of corners [x, y] in mm on the plane")
    points_px: list[_Pair] | None = Field(None, description="a list of corners [x, y] in px")


class _Placed(Strict):
    kind: str
    center_mm: _Triple | None = Field(None, description="[x, y, z] in mm, camera frame")
    normal: _Triple | None = Field(None, description="[x, y, z], a direction in the camera frame")
    plane: str | dict[str, Any] | None = Field(None, description="the name of a plane, or a mapping that is one")
    at_mm: _Pair | None = Field(None, description="[x, y] in mm on the plane")


class _Mark(_Paint):
    radius_mm: _Positive = Field(description="a positive radius in mm")


class _Disc(_Placed, _Paint):
    radius_mm: _Positive = Field(description="a positive radius in mm")
    marks: list[dict[str, Any]] = Field([], description="a list of mappings with radius_mm and level")


class _Rings(_Placed):
    radii_mm: list[float] = Field(description="a list of radii in mm, the largest first")
    levels: list[_Level] = Field(description="a list of grey levels, from each radius inwards to the next")


class _Coaxial(_Placed):
    kind: Literal["boss", "recess"]
    radii_mm: _Pair = Field(description="[big, small] radii in mm")
    height_mm: _Positive | None = Field(None, description="a positive number, the distance of the planes in mm")
    generatrix_mm: _Positive | None = Field(None, description="a positive number, the length from rim to rim in mm")
    side_level: _Level = Field(description=_LEVEL)
    cap_level: _Level = Field(description=_LEVEL)


def paint(entries: Mapping[str, Any], where: str, unit: Unit) -> Paint:
    """Return a look; its texture's scale is in `unit`."""
    return _paint(parse(_Paint, entries, where, SceneError), where, unit)


def plane(entries: Mapping[str, Any], where: str) -> Plane:
    """Return a plane."""
    form = parse(_Plane, entries, where, SceneError)
    with _at(where):
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
    base = None if form.plane is None else _plane(form.plane, where, planes)
    with _at(where):
        return Patch(_shape(form, where, unit), _paint(form, where, unit), base)


def target_part(entries: Mapping[str, Any], where: str, planes: Mapping[str, Plane]) -> TargetPart:
    """Return a target, by its `kind`."""
    kind = entries.get("kind")
    build = _TARGETS.get(kind) if isinstance(kind, str) else None
    if build is None:
        got = "it is missing" if kind is None else f"got {shown(kind)}"
        raise SceneError(f"{where}: kind: expected one of {', '.join(_TARGETS)}; {got}.")
    with _at(where):
        return build(entries, where, planes)


def _disc(entries: Mapping[str, Any], where: str, planes: Mapping[str, Plane]) -> Disc:
    form = parse(_Disc, entries, where, SceneError)
    marks = [parse(_Mark, mark, f"{where}.marks[{i}]", SceneError) for i, mark in enumerate(form.marks)]
    looks = tuple((mark.radius_mm, _paint(mark, where, "mm")) for mark in marks)
    return Disc(*_pose(form, where, planes), form.radius_mm, _paint(form, where, "mm"), looks)


def _rings(entries: Mapping[str, Any], where: str, planes: Mapping[str, Plane]) -> Rings:
    form = parse(_Rings, entries, where, SceneError)
    paints = tuple(Paint(level) for level in form.levels)
    return Rings(*_pose(form, where, planes), tuple(form.radii_mm), paints)


def _coaxial(entries: Mapping[str, Any], where: str, planes: Mapping[str, Plane]) -> CoaxialPart:
    form = parse(_Coaxial, entries, where, SceneError)
    big, small = form.radii_mm
    return CoaxialPart(
        *_pose(form, where, planes),
        radii_mm=(big, small),
        height_mm=_height(form, where),
        form=form.kind,
        side=Paint(form.side_level),
        cap=Paint(form.cap_level),
    )


_TARGETS: Mapping[str, Callable[[Mapping[str, Any], str, Mapping[str, Plane]], TargetPart]] = {
    "disc": _disc,
    "rings": _rings,
    "boss": _coaxial,
    "recess": _coaxial,
}


@contextmanager
def _at(where: str) -> Iterator[None]:
    """Name the place in the file of a value that the scene refuses."""
    try:
        yield
    except SceneError as reason:
        text = str(reason)
        raise SceneError(text if text.startswith(where) else f"{where}: {text}") from None


def _pose(form: _Placed, where: str, planes: Mapping[str, Plane]) -> tuple[FloatArray, FloatArray]:
    match form.center_mm, form.normal, form.plane, form.at_mm:
        case list(center), list(normal), None, None:
            return frozen(center), frozen(normal)
        case None, None, str() | dict() as given, [x, y]:
            base = _plane(given, where, planes)
            return base.point((x, y)), base.normal
    raise SceneError(f"{where}: center_mm, plane: expected either center_mm and normal, or plane and at_mm.")


def _plane(given: str | Mapping[str, Any], where: str, planes: Mapping[str, Plane]) -> Plane:
    if not isinstance(given, str):
        return plane(given, f"{where}: plane")
    if given not in planes:
        known = ", ".join(planes) or "none is given"
        raise SceneError(f"{where}: plane: expected the name of one of the file's planes ({known}), got {given!r}.")
    return planes[given]


def _paint(form: _Paint, where: str, unit: Unit) -> Paint:
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


def _height(form: _Coaxial, where: str) -> float:
    if (form.height_mm is None) == (form.generatrix_mm is None):
        raise SceneError(f"{where}: height_mm, generatrix_mm: expected one of the two.")
    if form.height_mm is not None:
        return form.height_mm
    difference = form.radii_mm[0] - form.radii_mm[1]
    generatrix = form.generatrix_mm or 0.0
    if generatrix <= abs(difference):
        raise SceneError(
            f"{where}: generatrix_mm: must be longer than the difference of the radii ({difference:g} mm), "
            f"got {generatrix:g}."
        )
    return math.sqrt(generatrix**2 - difference**2)
