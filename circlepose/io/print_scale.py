"""`print_scale:` of a target file: how much larger than drawn a printer made it, as its bars were measured."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from pydantic import Field

from circlepose import _arguments
from circlepose.errors import TargetError
from circlepose.io.text.validation import Strict, parse
from circlepose.targets.board import BoardLayout

EXPECTED = "measured length / stated length of the bars, one number such as 1.002, or {x: 1.0021, y: 1.0015}"
LIMITS = (0.5, 2.0)
MOST_DIFFERENCE = 1e-3
"""Largest relative difference of the scales in x and y. The discs are ellipses then, whose axes differ by as much;
taken for circles, one seen at 45 deg has a tilt that is off by up to as many radians, 0.06 deg."""


class _ScaleForm(Strict):
    x: float = Field(description="one number, measured length / stated length of the bar x")
    y: float = Field(description="one number, measured length / stated length of the bar y")


@dataclass(frozen=True, slots=True)
class PrintScale:
    """Printed lengths over those drawn."""

    x: float
    """along the sheet's bar x"""
    y: float

    @property
    def is_even(self) -> bool:
        """Whether it is the same in x and y."""
        return self.x == self.y

    @property
    def mean(self) -> float:
        """The factor of radii: the geometric mean, by which the area of a disc is right."""
        return self.x if self.is_even else math.sqrt(self.x * self.y)

    def refuse_ellipses(self) -> None:
        """Raise `TargetError` where discs came out too elliptical to be taken for circles."""
        difference = abs(self.x / self.y - 1.0)
        # As much as one reads from a decimal fraction.
        if difference > MOST_DIFFERENCE * (1.0 + 1e-6):
            raise TargetError(
                f"print_scale: x and y differ by {100.0 * difference:.3g} %, so the discs are ellipses; up to "
                f"{100.0 * MOST_DIFFERENCE:g} % they are taken for circles. Print this file with circlepose print, "
                "which draws it the other way about, so that the same printer makes it true."
            )


def print_scale_of(value: object, where: str) -> PrintScale:
    """Return the scale that a target file states; raises `TargetError` that begins with `where`."""
    if isinstance(value, Mapping):
        form = parse(_ScaleForm, value, f"{where}: print_scale", TargetError)
        scale = PrintScale(form.x, form.y)
    else:
        number = _arguments.number(f"{where}: print_scale", value, EXPECTED, TargetError)
        scale = PrintScale(number, number)
    for each in (scale.x, scale.y):
        if not LIMITS[0] <= each <= LIMITS[1]:
            raise TargetError(
                f"{where}: print_scale: expected {EXPECTED}, from {LIMITS[0]:g} to {LIMITS[1]:g}, got {each:g}."
            )
    return scale


def printed_layout(layout: BoardLayout, scale: PrintScale) -> BoardLayout:
    """Return a planar layout as it was printed: places moved along the sheet's x and y, radii by the mean.

    Raises `TargetError` where the layout is not planar: it was not printed.
    """
    if not layout.is_planar:
        raise TargetError("print_scale: is of a sheet, and these circles do not lie in one plane.")
    grid = None if layout.grid is None else replace(layout.grid, spacing_mm=scale.mean * layout.grid.spacing_mm)
    if grid is not None and scale.is_even:
        # A grid remains one, to the last digit.
        places = [(*(np.array(node) @ grid.basis_mm).tolist(), 0.0) for node in layout.nodes or ()]
    else:
        seen = layout.seen_from_behind if layout.side == "back" else layout
        stretch = np.eye(3) + seen.front_axes.T @ np.diag([scale.x - 1.0, scale.y - 1.0]) @ seen.front_axes
        places = [tuple(each) for each in (layout.centers_mm @ stretch).tolist()]
    circles = tuple(
        replace(circle, center_mm=place, radii_mm=tuple(scale.mean * radius for radius in circle.radii_mm))
        for circle, place in zip(layout.circles, places, strict=True)
    )
    return replace(layout, circles=circles, grid=grid)
