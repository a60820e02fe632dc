"""The targets of a scene file, each a YAML mapping with a kind and a pose."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from circlepose._arguments import shown
from circlepose._typing import FloatArray, frozen
from circlepose.errors import SceneError
from circlepose.io.scenes.boards import board_part
from circlepose.io.scenes.parts import LEVEL, Level, PaintForm, Pair, Positive, Triple, at_place, paint_of, plane_of
from circlepose.io.text.validation import Strict, parse
from circlepose.synthesis.scene import CoaxialPart, Disc, Paint, Plane, Rings, TargetPart


class _Placed(Strict):
    kind: str
    center_mm: Triple | None = Field(None, description="[x, y, z] in mm, camera frame")
    normal: Triple | None = Field(None, description="[x, y, z], a direction in the camera frame")
    plane: str | dict[str, Any] | None = Field(None, description="the name of a plane, or a mapping that is one")
    at_mm: Pair | None = Field(None, description="[x, y] in mm on the plane")


class _Mark(PaintForm):
    radius_mm: Positive = Field(description="a positive radius in mm")


class _Disc(_Placed, PaintForm):
    radius_mm: Positive = Field(description="a positive radius in mm")
    marks: list[dict[str, Any]] = Field([], description="a list of mappings with radius_mm and level")


class _Rings(_Placed):
    radii_mm: list[float] = Field(description="a list of radii in mm, the largest first")
    levels: list[Level] = Field(description="a list of gray levels, from each radius inwards to the next")


class _Coaxial(_Placed):
    kind: Literal["boss", "recess"]
    radii_mm: Pair = Field(description="[big, small] radii in mm")
    height_mm: Positive | None = Field(None, description="a positive number, the distance of the planes in mm")
    generatrix_mm: Positive | None = Field(None, description="a positive number, the length from rim to rim in mm")
    side_level: Level = Field(description=LEVEL)
    cap_level: Level = Field(description=LEVEL)


def target_part(
    entries: Mapping[str, Any], where: str, planes: Mapping[str, Plane], folder: Path = Path()
) -> TargetPart:
    """Return a target, by its `kind`; the files that a board names are sought in `folder`.

    Raises `SceneError`, and `TargetError` on the layout of a board.
    """
    kind = entries.get("kind")
    if kind == "board":
        with at_place(where):
            return board_part(entries, where, planes, folder)
    build = _TARGETS.get(kind) if isinstance(kind, str) else None
    if build is None:
        got = "it is missing" if kind is None else f"got {shown(kind)}"
        raise SceneError(f"{where}: kind: expected one of {', '.join(_TARGETS)}, board; {got}.")
    with at_place(where):
        return build(entries, where, planes)


def _disc(entries: Mapping[str, Any], where: str, planes: Mapping[str, Plane]) -> Disc:
    form = parse(_Disc, entries, where, SceneError)
    marks = [parse(_Mark, mark, f"{where}.marks[{i}]", SceneError) for i, mark in enumerate(form.marks)]
    looks = tuple((mark.radius_mm, paint_of(mark, where, "mm")) for mark in marks)
    return Disc(*_pose(form, where, planes), form.radius_mm, paint_of(form, where, "mm"), looks)


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


def _pose(form: _Placed, where: str, planes: Mapping[str, Plane]) -> tuple[FloatArray, FloatArray]:
    match form.center_mm, form.normal, form.plane, form.at_mm:
        case list(center), list(normal), None, None:
            return frozen(center), frozen(normal)
        case None, None, str() | dict() as given, [x, y]:
            base = plane_of(given, where, planes)
            return base.point((x, y)), base.normal
    raise SceneError(f"{where}: center_mm, plane: expected either center_mm and normal, or plane and at_mm.")


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
