"""A board of a scene file: its layout in the keys of a target file, its pose and its looks."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from circlepose._typing import FloatArray
from circlepose.errors import SceneError
from circlepose.io.scenes.parts import LEVEL, Level, Pair, Triple, plane_of
from circlepose.io.target_file import target_from_mapping
from circlepose.io.text.validation import Strict, parse
from circlepose.synthesis.scene import BoardPart, Paint, Plane

LAYOUT_KEYS = ("radius_mm", "grid", "marks", "omit", "circles", "side", "shape_file")
"""Keys of a target file that describe a board's layout."""
_Quaternion = Annotated[list[float], Field(min_length=4, max_length=4)]
_LEAST_QUATERNION = 1e-6


class _Board(Strict):
    kind: Literal["board"]
    translation_mm: Triple | None = Field(None, description="[x, y, z] of its origin in mm, camera frame")
    rotation: _Quaternion | None = Field(None, description="a quaternion [w, x, y, z], board to camera")
    plane: str | dict[str, Any] | None = Field(None, description="the name of a plane, or a mapping that is one")
    at_mm: Pair | None = Field(None, description="[x, y] of its origin in mm on the plane")
    angle_deg: float = Field(0.0, description="the turn of the board on its plane in degrees")
    level: Level | None = Field(None, description=LEVEL)
    levels: list[Level] | None = Field(
        None, description="a list of gray levels, from each radius inwards to the next"
    )


def board_part(entries: Mapping[str, Any], where: str, planes: Mapping[str, Plane], folder: Path) -> BoardPart:
    """Return a board; the files that its layout names are sought in `folder`.

    Raises `SceneError`, and `TargetError` on its layout.
    """
    own = {key: value for key, value in entries.items() if key not in LAYOUT_KEYS}
    form = parse(_Board, own, where, SceneError)
    described = {key: value for key, value in entries.items() if key in LAYOUT_KEYS}
    layout = target_from_mapping({"kind": "board", **described}, where, folder).layout
    assert layout is not None
    if (form.level is None) == (form.levels is None):
        raise SceneError(f"{where}: level, levels: expected one of the two.")
    levels = form.levels if form.levels is not None else [form.level]
    return BoardPart(
        *_pose(form, where, planes), layout, tuple(Paint(level) for level in levels if level is not None)
    )


def _pose(form: _Board, where: str, planes: Mapping[str, Plane]) -> tuple[FloatArray, FloatArray]:
    """Return translation (3,) and rotation (3, 3)."""
    match form.translation_mm, form.rotation, form.plane, form.at_mm:
        case list(translation), list(quaternion), None, None if "angle_deg" not in form.model_fields_set:
            return np.array(translation), _matrix(quaternion, where)
        case None, None, str() | dict() as given, [x, y]:
            base = plane_of(given, where, planes)
            turn = math.radians(form.angle_deg)
            along = math.cos(turn) * base.right + math.sin(turn) * base.down
            # The board's z points away from the viewer, the plane's normal towards it.
            return base.point((x, y)), np.stack([along, np.cross(along, base.normal), -base.normal], axis=1)
    raise SceneError(
        f"{where}: translation_mm, plane: expected either translation_mm and rotation, or plane and at_mm "
        "(and perhaps angle_deg)."
    )


def _matrix(quaternion: list[float], where: str) -> FloatArray:
    """Return the rotation (3, 3) of a quaternion w, x, y, z of any length."""
    length = float(np.linalg.norm(quaternion))
    if length < _LEAST_QUATERNION:
        raise SceneError(f"{where}: rotation: expected a quaternion [w, x, y, z], got one of length 0.")
    w, x, y, z = (value / length for value in quaternion)
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )
