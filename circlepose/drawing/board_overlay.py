"""What an overlay draws for boards: rims by the pose, axes at the origin, names of circles."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from circlepose._typing import FloatArray
from circlepose.board_result import BoardPose, BoardResult
from circlepose.camera.camera import Camera
from circlepose.diagnostics.boards import BoardView
from circlepose.drawing import board_words
from circlepose.drawing.canvas import Pen
from circlepose.drawing.heading import LegendItem
from circlepose.drawing.labels import Label, Plan, Room, draw_labels, plan_labels
from circlepose.drawing.rims import rim_of
from circlepose.drawing.style import AMBIGUOUS, AXES, CHOSEN, MISFIT, OTHER, UNUSED, Color

MOST_NAMES = 40
"""with more circles only the four at the corners are named"""
_NAME_SIZES = (0.42, 0.35, 0.29)
_AXIS_SIZES = (0.42,)
_AXIS_UNITS, _OTHER_UNITS = 1.4, 1.0
_AXIS_POINTS = 24
"""Corners of a drawn axis: the lens bends it."""
_DASHES = 12
"""Of a rim that was not seen."""
_LEAST_AXIS_UNITS = 40.0
"""An axis is whole spacings long, and drawn no shorter than this where it is seen from the side."""
_WORLD_STEP = 0.03
"""Of the distance of a world board; its axes are whole powers of ten long, about this or a few."""


@dataclass(frozen=True, slots=True, eq=False)
class DrawnBoards:
    """What was drawn, for the legend and the labels."""

    colors: frozenset[Color]
    """of the rims within the picture"""
    labels: tuple[Label, ...]
    """the names of circles"""
    corners: tuple[Label, ...]
    """those of the corners alone"""
    tips: tuple[Label, ...]
    """the names of axes"""
    lengths_mm: tuple[float, ...]
    """of the axes"""
    has_other: bool
    """whether the z axis of another pose is drawn"""
    is_z_away: bool
    """whether all z axes point away from the viewer; those of a list may not"""


def draw_boards(pen: Pen, room: Room, views: Sequence[BoardView], camera: Camera) -> DrawnBoards:
    """Draw the rims and the axes of boards, and keep labels off them; `camera` is the image's."""
    height, width = pen.canvas.shape[:2]
    colors: set[Color] = set()
    names: list[Label] = []
    corners: list[Label] = []
    for view in views:
        visible = []
        for i, (circle, fit) in enumerate(zip(view.circles, view.fits, strict=True)):
            color = UNUSED if fit is None else _color_of_used(view) if fit.is_used else MISFIT
            rim = rim_of(circle, camera, pen.enlargement)
            points = pen.at(rim)
            with np.errstate(invalid="ignore"):
                inside = ((points >= 0.0) & (points < [width, height])).all(axis=1)
            if not inside.any():
                continue
            visible.append(i)
            colors.add(color)
            room.keep_disc(points)
            pen.hairline(_dashed(rim) if fit is None else rim, color, closed=fit is not None)
            name = circle.circle if len(views) == 1 else f"{view.board.instance} {circle.circle}"
            names.append(Label(((name,),) * len(_NAME_SIZES), color, points))
        at = dict(zip(visible, names[len(names) - len(visible) :], strict=True))
        corners += [at[i] for i in view.extreme(visible)]
    tips, lengths = [], []
    for view in views:
        length = _axis_length(view.board.pose, view.spacing_mm, camera, pen)
        lengths.append(length)
        tips += _draw_axes(pen, room, view.board, camera, length)
    has_other = any(board_words.is_doubtful(view.board) and len(view.board.candidates) > 1 for view in views)
    return DrawnBoards(
        frozenset(colors),
        tuple(names),
        tuple(corners),
        tuple(tips),
        tuple(lengths),
        has_other=has_other,
        is_z_away=all(view.side > 0.0 for view in views),
    )


def draw_world(pen: Pen, room: Room, world: BoardResult, camera: Camera) -> tuple[LegendItem, ...]:
    """Draw the axes of a world board, and return what the legend says of them."""
    far = float(np.linalg.norm(world.pose.translation))
    step = 10.0 ** math.floor(math.log10(max(far, 1e-9) * _WORLD_STEP))
    length = _axis_length(world.pose, step, camera, pen)
    tips = _draw_axes(pen, room, world, camera, length)
    plan = plan_labels(pen.canvas, room, tips, [size * pen.unit for size in _AXIS_SIZES])
    room.keep_labels(plan)
    draw_labels(pen.canvas, plan)
    names = ("x axis", "y axis", f"z axis of the world board, {length:.4g} mm long")
    return tuple(LegendItem("thin arrow", color, name) for color, name in zip(AXES, names, strict=True))


def plan_names(pen: Pen, room: Room, drawn: DrawnBoards) -> list[Plan]:
    """Return where the names go: of the axes, and of all circles, or of those at the corners if all have no room."""
    tips = plan_labels(pen.canvas, room, drawn.tips, [size * pen.unit for size in _AXIS_SIZES])
    room.keep_labels(tips)
    sizes = [size * pen.unit for size in _NAME_SIZES]
    if len(drawn.labels) <= MOST_NAMES:
        plan = plan_labels(pen.canvas, room, drawn.labels, sizes)
        if not plan.left_out:
            return [tips, plan]
    return [tips, plan_labels(pen.canvas, room, drawn.corners, sizes)]


def legend(drawn: DrawnBoards) -> tuple[LegendItem, ...]:
    """Return what is drawn for boards, and nothing else."""
    rims = {
        CHOSEN: "rim by the board's pose",
        AMBIGUOUS: "rim by the first of two possible poses",
        MISFIT: "seen, but does not count in the pose",
        UNUSED: "not seen",
    }
    items = [LegendItem("dashes" if color == UNUSED else "line", color, words) for color, words in rims.items()]
    items = [item for item in items if item.color in drawn.colors]
    long = sorted({f"{length:.4g}" for length in drawn.lengths_mm}, key=float)
    away = ", away from the viewer" if drawn.is_z_away else ""
    said = f"; axes {long[0]} mm long" if len(long) == 1 else ""
    names = (
        "x axis",
        "y axis",
        f"z axis{away}{said}",
    )
    items += [LegendItem("thin arrow", color, name) for color, name in zip(AXES, names, strict=True)]
    if drawn.has_other:
        items.append(LegendItem("thin arrow", OTHER, "z axis of the other pose"))
    return tuple(items)


def _color_of_used(view: BoardView) -> Color:
    return AMBIGUOUS if board_words.is_doubtful(view.board) else CHOSEN


def _axis_length(pose: BoardPose, step_mm: float, camera: Camera, pen: Pen) -> float:
    """Return how long the axes are, mm: a step, or a few where one would be too short to be seen."""
    ends = camera.project(_axis_points(pose, step_mm)[:, [0, -1]])
    seen = float(np.nanmax(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=-1), initial=0.0)) * pen.enlargement
    if not seen > 0.0:
        return step_mm
    return step_mm * max(1, math.ceil(_LEAST_AXIS_UNITS * pen.unit / seen))


def _axis_points(pose: BoardPose, length_mm: float) -> FloatArray:
    """Return points (3, n, 3) along x, y and z, camera frame."""
    along = np.linspace(0.0, length_mm, _AXIS_POINTS)
    return np.asarray(pose.translation + along[:, None] * pose.rotation.T[:, None])


def _draw_axes(pen: Pen, room: Room, board: BoardResult, camera: Camera, length_mm: float) -> list[Label]:
    """Draw the axes of a board, and return the labels of their tips."""
    if board_words.is_doubtful(board):
        for i, pose in enumerate(board.candidates):
            if i != board.chosen:
                other = camera.project(_axis_points(pose, length_mm)[2, [0, -1]])
                pen.arrow(other[0], other[1], OTHER, _OTHER_UNITS)
    labels = []
    for name, color, path in zip("xyz", AXES, camera.project(_axis_points(board.pose, length_mm)), strict=True):
        pen.lines([path[:-1]], color, _AXIS_UNITS)
        pen.arrow(path[-2] + 0.7 * (path[0] - path[-2]), path[-1], color, _AXIS_UNITS)
        room.spare_lines([pen.at(path)])
        if np.isfinite(path[-1]).all():
            tip = pen.at(path[-1:])
            labels.append(Label(((name,),), color, tip + 3.0 * pen.unit * _SQUARE))
    return labels


_SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


def _dashed(rim: FloatArray) -> FloatArray:
    """Return a closed rim (n, 2) with NaN in every second of equal parts."""
    part = (np.arange(len(rim)) * 2 * _DASHES) // max(len(rim), 1)
    return np.where((part % 2 == 0)[:, None], rim, np.nan)
