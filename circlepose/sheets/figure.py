"""What a target looks like from the front, in its plane: the circles, in mm, or why it cannot be drawn."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from circlepose.errors import TargetError
from circlepose.sheets.shapes import Rings
from circlepose.targets.board import BoardLayout
from circlepose.targets.target import Target

MOST_COPIES = 1000
"""Discs or rings on one sheet; cost."""
_PITCH_RADII = 3.0
"""Distance of the centers of several discs, in radii: a gap of one radius."""
_CLEAR_RADII = 0.2
_LEAST_CLEAR_MM = 5.0
"""Bright margin around a disc; detection needs a tenth of the radius."""


@dataclass(frozen=True, slots=True)
class Figure:
    """The circles of a target with a clear margin around them; x to the right, y down, from the top left corner."""

    rings: tuple[Rings, ...]
    width_mm: float
    height_mm: float


def clear_mm(radius_mm: float) -> float:
    """Return the width of the clear margin around a circle of `radius_mm`."""
    return max(_CLEAR_RADII * radius_mm, _LEAST_CLEAR_MM)


def figure_of(target: Target, copies: int | None = None) -> Figure:
    """Return the circles of a target as they are drawn.

    Parameters
    ----------
    target
        Of lone circles, coplanar rings, or a board whose circles lie in one plane.
    copies
        How many discs or ring targets; None for the target's count, or one where that is `all`.

    Raises
    ------
    TargetError
        Where the circles do not lie in one plane, or do not face one side.
    """
    if target.layout is not None:
        return _around(_of_board(target.layout))
    if target.kind == "coaxial":
        apart = ""
        if target.generatrix_mm is not None:
            height = math.sqrt(target.generatrix_mm**2 - (target.radii_mm[0] - target.radii_mm[1]) ** 2)
            apart = f", {height:.4g} mm apart"
        raise TargetError(
            f"kind: the two circles of a coaxial target lie at different heights{apart}, and a sheet is flat; print "
            "kind: coplanar with these radii, which settles the pose as well, or machine the part."
        )
    number = copies if copies is not None else (target.count or 1)
    if number > MOST_COPIES:
        raise TargetError(
            f"count: a sheet has at most {MOST_COPIES} targets, got {number}; give a smaller number of --copies."
        )
    columns = math.ceil(math.sqrt(number))
    pitch = max(_PITCH_RADII * target.radii_mm[0], 2.0 * (target.radii_mm[0] + _LEAST_CLEAR_MM))
    name = target.circle_names[0]
    return _around(
        [
            Rings(
                name if number == 1 else f"{name} {i}", pitch * (i % columns), pitch * (i // columns), target.radii_mm
            )
            for i in range(number)
        ]
    )


def _of_board(layout: BoardLayout) -> list[Rings]:
    if layout.side == "back":
        layout = layout.seen_from_behind
    if not layout.is_planar:
        raise TargetError(_why_not_planar(layout))
    places = layout.centers_mm @ layout.front_axes.T
    return [
        Rings(circle.name, x, y, circle.radii_mm)
        for circle, (x, y) in zip(layout.circles, places.tolist(), strict=True)
    ]


def _why_not_planar(layout: BoardLayout) -> str:
    first = layout.circles[0]
    turned = np.degrees(np.arccos(np.clip(layout.normals @ layout.normals[0], -1.0, 1.0)))
    if turned.max() > 0.1:
        i = int(turned.argmax())
        return (
            f"circles: {layout.circles[i].name} faces {turned[i]:.3g} deg away from {first.name}, and a sheet is "
            "flat; print the circles of each plane by themselves."
        )
    heights = (layout.centers_mm - layout.centers_mm[0]) @ layout.normals[0]
    i = int(np.abs(heights).argmax())
    return (
        f"circles: {layout.circles[i].name} lies {abs(heights[i]):.3g} mm off the plane of {first.name}, and a sheet "
        "is flat; print the circles of each plane by themselves."
    )


def _around(rings: list[Rings]) -> Figure:
    """Return the circles moved so that their clear margins begin at 0."""
    reach = [each.radii_mm[0] + clear_mm(each.radii_mm[0]) for each in rings]
    left = min(each.x_mm - size for each, size in zip(rings, reach, strict=True))
    top = min(each.y_mm - size for each, size in zip(rings, reach, strict=True))
    right = max(each.x_mm + size for each, size in zip(rings, reach, strict=True))
    bottom = max(each.y_mm + size for each, size in zip(rings, reach, strict=True))
    return Figure(tuple(each.moved(-left, -top) for each in rings), right - left, bottom - top)
