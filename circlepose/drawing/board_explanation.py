"""A picture of what the pose of a board is based on: its plane from the front, with the residuals of its circles."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from circlepose._typing import FloatArray, Image
from circlepose.camera.camera import Camera
from circlepose.diagnostics.boards import BoardView, board_views, front_mm, residuals_mm
from circlepose.drawing import board_words
from circlepose.drawing.canvas import Pen, polylines
from circlepose.drawing.heading import Heading, LegendItem
from circlepose.drawing.labels import Label, Room, draw_labels, plan_labels
from circlepose.drawing.plots import INK
from circlepose.drawing.style import MISFIT, SMALL_SIZE, TEXT_SIZE, UNUSED, Color, Font
from circlepose.results import ImageResult

MOST_BOARDS = 3
"""drawn in one picture"""
MOST_NAMES = 40
"""with more circles only those at the corners, those that misfit the most and those that do not count are named"""
_WORST = 5
_WIDTH, _MOST_HEIGHT, _MARGIN = 1560, 1000, 60
_UNIT = 1.2
"""picture px; as of the picture of circles"""
_TEXT, _SMALL = Font.of_scale(TEXT_SIZE * _UNIT), Font.of_scale(SMALL_SIZE * _UNIT)
_NAME_SIZES = (0.42, 0.34, 0.28)
_RIM: Color = (165, 165, 165)
_ARROW: Color = (40, 40, 200)
_MISFIT_ARROW: Color = (0, 90, 190)
_TOP, _BOTTOM = 80, 60
_TYPICAL, _MOST = 0.4, 1.5
"""Spacings: the drawn length of a large residual, of nine in ten circles that count; of the longest arrow."""
_BAR_PX = 160.0
_ROOMY_PX = 80.0
"""A board is drawn with bolder arrows where a spacing is more."""
_RIM_POINTS = 96


@dataclass(frozen=True, slots=True, eq=False)
class _Sheet:
    """A board on a panel; places are picture px."""

    view: BoardView
    scale: float
    """picture px per mm"""
    origin: FloatArray
    """(2,) where mm (0, 0) of the front is"""
    places: FloatArray
    """(n, 2) of the circles"""
    arrows: FloatArray
    """(n, 2) as drawn; NaN without one"""
    enlargement: float
    """of the arrows"""
    px_per_mm: float
    """of the image, in the middle of the circles"""
    is_cut: bool
    """whether an arrow would be longer than is drawn"""
    height: int
    """of the panel"""

    @classmethod
    def of(cls, view: BoardView, camera: Camera) -> _Sheet:
        """Return a board, as large as there is room."""
        front, radii = front_mm(view), view.radii_mm[:, None]
        low, high = (front - radii).min(axis=0), (front + radii).max(axis=0)
        spacing = view.spacing_mm
        room = 0.5 * spacing
        size = high - low + 2.0 * room
        space = np.array([_WIDTH - 2.0 * _MARGIN, _MOST_HEIGHT - _TOP - _BOTTOM])
        scale = float((space / size).min())
        top_left = np.array([(_WIDTH - scale * size[0]) / 2.0, _TOP])
        origin = top_left - scale * (low - room)
        residuals, px_per_mm = residuals_mm(view, camera)
        enlargement = _enlargement(view, residuals, spacing)
        arrows = residuals * enlargement * scale
        length = np.linalg.norm(arrows, axis=1, keepdims=True)
        most = _MOST * spacing * scale
        with np.errstate(invalid="ignore", divide="ignore"):
            is_cut = bool((length > most).any())
            arrows = np.where(length > most, arrows * (most / length), arrows)
        height = round(_TOP + scale * size[1] + _BOTTOM)
        middle = float(np.nanmedian(px_per_mm))
        return cls(view, scale, origin, origin + scale * front, arrows, enlargement, middle, is_cut, height)


def draw_board_explanation(result: ImageResult, camera: Camera) -> Image:
    """Return a picture (h, w, 3), BGR uint8, of the residuals of the circles of boards.

    Parameters
    ----------
    result
        With boards.
    camera
        Of the image that was measured.
    """
    views = board_views(result)
    sheets = [_Sheet.of(view, camera) for view in views[:MOST_BOARDS]]
    sentences = [
        "The plane of the board from the front. An arrow goes from where the pose puts the center of a circle's "
        "image to where that is; its scale stands below.",
    ]
    if any(sheet.is_cut for sheet in sheets):
        sentences.append(f"Arrows longer than {_MOST:g} spacings are cut off.")
    if len(views) > len(sheets):
        sentences.append(f"the first {len(sheets)} of {len(views)} boards")
    heading = Heading(result.image, tuple(sentences), _legend(sheets))
    return np.concatenate([heading.drawn(_WIDTH, _UNIT), *(_panel(sheet) for sheet in sheets)])


def _legend(sheets: list[_Sheet]) -> tuple[LegendItem, ...]:
    """Return what is drawn, and nothing else."""
    fits = [fit for sheet in sheets for fit in sheet.view.fits]
    items = []
    if any(fit is not None and fit.is_used for fit in fits):
        items.append(LegendItem("line", _RIM, "circle that counts in the pose"))
        items.append(LegendItem("thin arrow", _ARROW, "its residual, enlarged"))
    if any(fit is not None and not fit.is_used for fit in fits):
        items.append(LegendItem("line", MISFIT, "seen, but does not count in the pose"))
        items.append(LegendItem("thin arrow", _MISFIT_ARROW, "its residual"))
    if any(fit is None for fit in fits):
        items.append(LegendItem("dashes", UNUSED, "not seen"))
    return tuple(items)


def _enlargement(view: BoardView, residuals: FloatArray, spacing_mm: float) -> float:
    """Return a round factor by which residuals (n, 2) are large enough to be seen, and hide no neighbors."""
    lengths = np.linalg.norm(residuals, axis=1)
    used = [i for i, fit in enumerate(view.fits) if fit is not None and fit.is_used and np.isfinite(lengths[i])]
    large = float(np.quantile(lengths[used], 0.9)) if used else 0.0
    return _round_down(_TYPICAL * spacing_mm / large) if large > 0.0 else 1.0


def _round_down(value: float) -> float:
    """Return the largest of 1, 2, 5, 10 ... (and their like below 1) that is no larger than `value`."""
    power = 10.0 ** math.floor(math.log10(value))
    return next(step for step in (5.0, 2.0, 1.0) if step * power <= value * (1.0 + 1e-9)) * power


def _panel(sheet: _Sheet) -> Image:
    panel = np.full((sheet.height, _WIDTH, 3), 255, dtype=np.uint8)
    pen, room = Pen(panel, 1, _UNIT), Room.of(panel, _UNIT)
    board = sheet.view.board
    said = [f"board {board.instance}: {board_words.circles_used(board)} circles, rms {board_words.rms_px(board)} px"]
    said[0] += f", {board_words.misfit(board)}; {board_words.marks(board)}"
    said.append(
        f"origin {board_words.origin(board)} mm   sigma {board_words.sigma_mm(board)} mm   "
        f"rotation (w, x, y, z) {board_words.quaternion(board)}   sigma {board_words.sigma_deg(board)} deg"
    )
    font = _TEXT.fitting(said, _WIDTH - _MARGIN)
    font.write(panel, said, _MARGIN / 2.0 - font.margin, 4.0, INK)
    outlines = _circles(panel, room, sheet)
    _axes(pen, sheet)
    units = 2.0 if sheet.view.spacing_mm * sheet.scale > _ROOMY_PX else 1.0
    for fit, place, arrow in zip(sheet.view.fits, sheet.places, sheet.arrows, strict=True):
        if fit is not None:
            pen.arrow(place, place + arrow, _ARROW if fit.is_used else _MISFIT_ARROW, units, has_shadow=False)
    room.spare_lines(
        [np.stack([place, place + arrow]) for place, arrow in zip(sheet.places, sheet.arrows, strict=True)]
    )
    labels = _labels(sheet, outlines)
    draw_labels(panel, plan_labels(panel, room, labels, [size * _UNIT for size in _NAME_SIZES]))
    _bar(panel, sheet)
    return panel


def _color(sheet: _Sheet, index: int) -> Color:
    fit = sheet.view.fits[index]
    return UNUSED if fit is None else _RIM if fit.is_used else MISFIT


def _circles(panel: Image, room: Room, sheet: _Sheet) -> list[FloatArray]:
    """Draw the circles as circles, and return their outlines."""
    angle = np.linspace(0.0, 2.0 * np.pi, _RIM_POINTS, endpoint=False)
    unit = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    outlines = []
    for i, (place, radius) in enumerate(zip(sheet.places, sheet.view.radii_mm.tolist(), strict=True)):
        outline = place + radius * sheet.scale * unit
        closed = np.concatenate([outline, outline[:1]])
        if sheet.view.fits[i] is None:
            closed = np.where((np.arange(len(closed)) // 4 % 2 == 0)[:, None], closed, np.nan)
        polylines(panel, [closed], _color(sheet, i), 2)
        room.keep_disc(outline)
        outlines.append(outline)
    return outlines


def _axes(pen: Pen, sheet: _Sheet) -> None:
    """Draw the x and the y axis from the origin, half a spacing long."""
    length = 0.5 * sheet.view.spacing_mm * sheet.scale
    side = sheet.view.side
    for name, along in (("x", np.array([side, 0.0])), ("y", np.array([0.0, 1.0]))):
        polylines(pen.canvas, [np.stack([sheet.origin, sheet.origin + length * along])], INK, 1)
        left, top = (sheet.origin + (length + 10.0) * along - [0.5 * _SMALL.width(name), 0.0]).tolist()
        _SMALL.write(pen.canvas, [name], left - _SMALL.margin, top - _SMALL.plate([name])[1] / 2.0, INK)


def _labels(sheet: _Sheet, outlines: list[FloatArray]) -> list[Label]:
    view = sheet.view
    chosen = list(range(len(view.circles)))
    if len(chosen) > MOST_NAMES:
        out = [i for i, fit in enumerate(view.fits) if fit is not None and not fit.is_used]
        chosen = list(dict.fromkeys([*view.worst(_WORST), *view.extreme(chosen), *out]))[:MOST_NAMES]
    return [Label(((view.circles[i].circle,),) * len(_NAME_SIZES), _color(sheet, i), outlines[i]) for i in chosen]


def _bar(panel: Image, sheet: _Sheet) -> None:
    """Draw the scale of the arrows."""
    drawn = sheet.enlargement * sheet.scale
    length_mm = _round_down(_BAR_PX / drawn)
    left, top = float(_MARGIN), sheet.height - 0.55 * _BOTTOM
    right = left + length_mm * drawn
    polylines(panel, [np.array([[left, top], [right, top]])], INK, 2)
    for end in (left, right):
        polylines(panel, [np.array([[end, top - 5.0], [end, top + 5.0]])], INK, 2)
    said = (
        f"of an arrow: {length_mm:.2g} mm on the board, about {length_mm * sheet.px_per_mm:.2g} px in the image; "
        f"arrows are enlarged {sheet.enlargement:g} times"
    )
    _SMALL.write(panel, [said], right + 4.0, top - _SMALL.plate([said])[1] / 2.0, INK)
