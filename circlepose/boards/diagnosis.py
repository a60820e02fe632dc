"""Why circles in an image are not those of a layout, in one sentence."""

from __future__ import annotations

import numpy as np

from circlepose._typing import BoolArray, IntArray
from circlepose.boards.lattice import in_radii, lattices, shapes_of
from circlepose.boards.options import DEFAULT, BoardOptions
from circlepose.geometry.ellipse import Ellipse
from circlepose.targets.board import BoardLayout

_NAMES = {4: "a square", 6: "a hexagonal"}


def why_no_lattice(ellipse: Ellipse, layout: BoardLayout, options: BoardOptions = DEFAULT) -> str:
    """Return why `ellipse` (m,) px lie on no lattice of a grid; empty where nothing can be said."""
    assert layout.grid is not None
    if len(ellipse) < options.least_diagnosed:
        return ""
    shapes = shapes_of(ellipse)
    nearest = []
    for i in range(min(len(ellipse), options.most_ellipses)):
        apart = in_radii((shapes + shapes[i]) / 2.0, ellipse.center - ellipse.center[i])
        nearest.append(float(np.partition(apart, 1)[1]))
    radii = float(np.median(nearest))
    stated = layout.grid.neighbor_mm / layout.usual_radius_mm
    seen: list[tuple[int, int]] = []
    for order in (4, 6):
        patches = lattices(ellipse, radii, order, options)
        seen.append((len(patches[0].members) if patches else 0, order))
    most, order = max(seen)
    if most < options.least_diagnosed:
        return ""
    if order != layout.grid.order and most > 1.5 * {its: number for number, its in seen}[layout.grid.order]:
        return f"{most} circles lie on {_NAMES[order]} lattice, the layout is {layout.grid.pattern}"
    if abs(radii / stated - 1.0) > options.neighbor_tolerance:
        return (
            f"{most} circles lie on a lattice whose neighbors are {radii:.2f} radii apart, the layout says "
            f"{stated:.2f}: another spacing, or a diameter given as the radius"
        )
    return ""


def why_misfit(layout: BoardLayout, circles: IntArray, growth: float, rms_px: float, used: BoolArray) -> str:
    """Return why `circles` (k,) of a layout do not fit it, after the best fit of the pose."""
    what = f"{np.count_nonzero(used)} of {len(circles)} circles fit the layout, rms {rms_px:.1f} px"
    if abs(growth) > 0.02:
        ratio = 1.0 / (1.0 + growth)
        guess = "another spacing" if layout.grid is not None else "other coordinates or radii"
        return f"{what}: by the size of the circles the distances are {ratio:.3f} of those stated, {guess}?"
    return f"{what}: another layout, or a calibration that is not this camera's"
