"""What is known beforehand of how a lone circle's surface is turned, which may settle its two candidates.

Directions are in the camera frame: x right, y down, z forward. They may have any length but 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from circlepose import _arguments
from circlepose.errors import TargetError
from circlepose.targets import SIDES, Direction, Side

NORMAL_SPREAD_DEG = 20.0
UP_SPREAD_DEG = 10.0
_LENGTHS = (1e-9, 1e9)
_AWAY_DEG = 30.0
"""Nearer than this to the way the camera looks no visible surface can face."""
_SPREADS = 4.0
"""Two hints that differ by so many spreads exclude each other."""


@dataclass(frozen=True, slots=True)
class DirectionHint:
    """A direction, roughly: how far off it is, per axis, has the standard deviation `spread_deg`."""

    direction: Direction
    spread_deg: float


def facing_direction(facing: Side | Direction) -> Direction:
    """Return the direction (3,) of a named side, or `facing` itself."""
    return SIDES[facing] if isinstance(facing, str) else facing


def check_hints(normal: DirectionHint | None, up: DirectionHint | None, facing: Side | Direction | None) -> None:
    """Raise `TargetError`, naming the key, where a hint says nothing or two exclude each other."""
    for key, hint in (("normal_hint", normal), ("up_hint", up)):
        if hint is not None:
            if not isinstance(hint, DirectionHint):
                raise TargetError(f"{key}: expected a DirectionHint, got {_arguments.shown(hint)}.")
            _check_direction(f"{key}.direction", hint.direction)
            expected = "a positive angle of at most 180 deg"
            if not 0.0 < _arguments.number(f"{key}.spread_deg", hint.spread_deg, expected, TargetError) <= 180.0:
                raise TargetError(f"{key}.spread_deg: expected {expected}, got {hint.spread_deg:g}.")
    if normal is not None and _angle_deg(normal.direction, (0.0, 0.0, 1.0)) < _AWAY_DEG:
        raise TargetError(
            "normal_hint.direction: points away from the camera, so that the surface could not be seen; normals "
            "point towards the camera (negative z), turn it round."
        )
    if facing is not None:
        if isinstance(facing, str):
            if facing not in SIDES:
                raise TargetError(f"facing: expected {', '.join(SIDES)} or a direction [x, y, z], got {facing!r}.")
        else:
            _check_direction("facing", facing)
    if normal is not None and up is not None:
        apart = _angle_deg(normal.direction, up.direction)
        apart = min(apart, 180.0 - apart)
        if apart > _SPREADS * math.hypot(normal.spread_deg, up.spread_deg):
            raise TargetError(
                f"normal_hint, up_hint: exclude each other: the normal is {apart:.0f} deg from the vertical, and a "
                "horizontal surface's is along it."
            )
    if normal is not None and facing is not None:
        apart = _angle_deg(normal.direction, facing_direction(facing))
        # Which side a surface faces is relative to the line of sight, so little more than 90 deg is no contradiction.
        if apart > min(90.0 + _SPREADS * normal.spread_deg, 150.0):
            raise TargetError(
                f"normal_hint, facing: exclude each other: the normal is {apart:.0f} deg from the side that is faced."
            )


def _check_direction(key: str, direction: object) -> None:
    expected = "a direction [x, y, z] of a length other than 0, three numbers in the camera frame"
    length = math.hypot(*_arguments.numbers(key, direction, expected, 3, TargetError))
    if not _LENGTHS[0] <= length <= _LENGTHS[1]:
        raise TargetError(
            f"{key}: expected {expected} (within {_LENGTHS[0]:g} to {_LENGTHS[1]:g}), "
            f"got {_arguments.shown(direction)}."
        )


def _angle_deg(first: Direction, second: Direction) -> float:
    cosine = sum(a * b for a, b in zip(first, second, strict=True)) / (math.hypot(*first) * math.hypot(*second))
    return math.degrees(math.acos(min(1.0, max(-1.0, cosine))))
