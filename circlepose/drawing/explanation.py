"""A picture of what a pose is based on: the band around the rim, its residuals, and the profile across the edge."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import cv2
import numpy as np

from circlepose._typing import FloatArray, Image
from circlepose.camera.camera import Camera, circle_contour
from circlepose.diagnostics.explain import ExplainedCircle, Explanation, camera_of, rim_places, segments_left_out
from circlepose.diagnostics.residuals import LevelResiduals, edge_offsets
from circlepose.drawing import board_words, words
from circlepose.drawing.board_explanation import draw_board_explanation
from circlepose.drawing.canvas import polylines
from circlepose.drawing.display import boxes_around, displayed
from circlepose.drawing.heading import Heading, LegendItem
from circlepose.drawing.overlay import draw_overlay
from circlepose.drawing.plots import FAINT, INK, Plot, diverging, means
from circlepose.drawing.style import (
    AMBIGUOUS,
    BESIDE,
    CHOSEN,
    CLIPPED,
    LIMIT,
    SMALL_SIZE,
    TEXT_SIZE,
    UNUSED,
    Color,
    Font,
)
from circlepose.geometry.ellipse import Ellipse

MOST_CIRCLES = 6
"""drawn in one picture"""
_WIDTH, _HEIGHT = 1560, 724
_UNIT = 1.2
"""picture px; of text and lines, for a picture viewed at its size or somewhat smaller"""
_TEXT, _SMALL = Font.of_scale(TEXT_SIZE * _UNIT), Font.of_scale(SMALL_SIZE * _UNIT)
_CROP = 620
_MARGIN = 30
_TOP = 78
_LEFT = _MARGIN + _CROP + 90
"""of the plots"""
_SHADE: Color = (255, 215, 255)
"""a light `UNUSED`, behind lines"""
_DATA: Color = (170, 170, 170)
_MODEL: Color = (40, 40, 200)
_FULL_SCALE = 4.0
"""Noise sigmas of the strongest color."""
_TINT = 0.55
_SEGMENT_PX = 6.0


def draw_explanation(image: Image, explanation: Explanation, camera: Camera, *, circle: str | None = None) -> Image:
    """Return a picture (h, w, 3), BGR uint8, of what the poses of the first few circles are based on.

    `image` is the one that was explained, `camera` the one that it was explained with. Of boards it is the plane of
    the board with the residuals of its circles, unless `circle` is the name of one of them. Without a circle it is
    the picture that `draw_overlay` makes.
    """
    camera = camera_of(explanation.result, camera)
    if explanation.result.boards and circle is None:
        return draw_board_explanation(explanation.result, camera)
    named = explanation.named(circle)
    shown = named[:MOST_CIRCLES]
    if not shown:
        return draw_overlay(image, explanation.result, camera)
    base, remark = displayed(image, boxes_around(circle.result.ellipse for circle in shown))
    number = len(named)
    boards = explanation.result.boards
    sentences = [*(board_words.sentences(boards) if boards else [words.summary(explanation.result.circles)])]
    if number > len(shown):
        sentences.append(f"the first {len(shown)} of {number} circles")
    sentences.append(
        "Places along the rim are in deg, clockwise, as marked on the crop. Residuals are white at 0, red or blue at "
        f"{_FULL_SCALE:g} sigma."
    )
    if remark:
        sentences.append(f"Crops: {remark}. The plots have the measured levels.")
    heading = Heading(explanation.result.image, tuple(sentences), _legend(shown))
    panels = [_panel(base, circle, camera) for circle in shown]
    return np.concatenate([heading.drawn(_WIDTH, _UNIT), *panels])


def _legend(circles: Sequence[ExplainedCircle]) -> tuple[LegendItem, ...]:
    """Return what is drawn for `circles`, and nothing else."""
    colors = {_color(circle) for circle in circles if circle.result.candidates}
    levels = [circle.levels for circle in circles if circle.levels is not None]
    items = []
    if CHOSEN in colors:
        items.append(LegendItem("line", CHOSEN, "rim of the pose"))
    if AMBIGUOUS in colors:
        items.append(LegendItem("line", AMBIGUOUS, "rim of the first of two possible poses"))
    items.append(LegendItem("line", LIMIT, "limits of the band"))
    if any(each.crosses.any() for each in levels):
        items.append(LegendItem("patch", UNUSED, "left out at the rim"))
    if any(each.beside.any() for each in levels):
        items.append(LegendItem("patch", BESIDE, "left out beside the rim"))
    if any(each.clipped.any() for each in levels):
        items.append(LegendItem("patch", CLIPPED, "clipped"))
    return tuple(items)


def _color(circle: ExplainedCircle) -> Color:
    return AMBIGUOUS if words.is_doubtful(circle.result) else CHOSEN


def _panel(base: Image, circle: ExplainedCircle, camera: Camera) -> Image:
    panel = np.full((_HEIGHT, _WIDTH, 3), 255, dtype=np.uint8)
    result, levels = circle.result, circle.levels
    ellipse = result.ellipse
    said = _said(circle)
    font = _TEXT.fitting(said, _WIDTH - 2.0 * _MARGIN)
    font.write(panel, said, _MARGIN - font.margin, 4.0, INK)
    if ellipse is None:
        return panel
    crop = _crop(base, circle, ellipse, camera)
    panel[_TOP : _TOP + _CROP, _MARGIN : _MARGIN + _CROP] = crop
    if levels is None:
        _TEXT.write(panel, ["There are no levels to look at around this rim."], _LEFT, _TOP, INK)
        return panel
    _residuals(panel, circle, levels, ellipse)
    _profile(panel, levels)
    return panel


def _said(circle: ExplainedCircle) -> list[str]:
    """Return the pose of a circle in two lines."""
    result = circle.result
    name = f"instance {result.instance}: {result.circle} of radius {result.radius_mm:g} mm"
    name = "   ".join(part for part in (f"{name}, {words.choice(result)}", words.flags([result])) if part)
    pose = result.pose
    if pose is None:
        return [name]
    return [name, f"center {words.center(pose)} mm   normal {words.normal(pose)}   {words.sigmas(pose)}"]


def _crop(base: Image, circle: ExplainedCircle, ellipse: Ellipse, camera: Camera) -> Image:
    """Return the enlarged surroundings of a rim (_CROP, _CROP, 3), with what is in use and what is left out."""
    half_width = 4.0 if circle.levels is None else circle.levels.half_width_px
    half = float(ellipse.semi_major) + half_width + max(4.0, 0.12 * float(ellipse.semi_major))
    scale = _CROP / (2.0 * half)
    corner = ellipse.center - half
    tinted = _tinted(base, circle.levels)
    # Picture px p stand for image px corner + p / scale; pixel centers are integers in both.
    matrix = np.array([[1.0 / scale, 0.0, corner[0]], [0.0, 1.0 / scale, corner[1]]])
    flags = (cv2.INTER_NEAREST if scale > 1.0 else cv2.INTER_LINEAR) | cv2.WARP_INVERSE_MAP
    crop = cv2.warpAffine(tinted, matrix, (_CROP, _CROP), flags=flags, borderValue=(90, 90, 90))

    def at(points: FloatArray) -> FloatArray:
        return (points - corner) * scale

    for change in (-half_width, half_width):
        if float(ellipse.semi_minor) + change > 0.0:
            limit = Ellipse(
                ellipse.center, ellipse.semi_major + change, ellipse.semi_minor + change, ellipse.angle
            ).points(360)
            polylines(crop, [at(np.concatenate([limit, limit[:1]]))], LIMIT, 1)
    result = circle.result
    if result.candidates:
        chosen = result.candidates[result.chosen]
        rim = circle_contour(camera, chosen.center, chosen.normal, result.radius_mm)
        polylines(crop, [at(np.concatenate([rim, rim[:1]]))], _color(circle), 1)
    _mark_places(crop, at, ellipse, half_width)
    return crop


def _mark_places(crop: Image, at: Callable[[FloatArray], FloatArray], ellipse: Ellipse, half_width_px: float) -> None:
    """Write the places along the rim inside of it, clear of the band; beside it where the ellipse is a sliver."""
    for place, tip in zip((0, 90, 180, 270), ellipse.points(8)[[0, 2, 4, 6]], strict=True):
        label = f"{place} deg"
        size = np.array(_SMALL.plate([label]))
        along = (tip - ellipse.center) / np.linalg.norm(tip - ellipse.center)
        apart = float(np.abs(along) @ size) / 2.0 + 6.0
        scale = float(np.linalg.norm(at(tip + along) - at(tip)))
        is_inside = float(ellipse.semi_minor) * scale > 2.2 * (size[1] + half_width_px * scale)
        away = half_width_px * scale + apart
        middle = at(tip) + (-away if is_inside else away) * along
        left, top = np.clip(middle - size / 2.0, 0.0, _CROP - size).tolist()
        _SMALL.plated(crop, [label], (left, top, left + size[0], top + size[1]))


def _tinted(base: Image, levels: LevelResiduals | None) -> Image:
    if levels is None:
        return base
    tinted = base.copy()
    columns, rows = levels.pixels.astype(np.int64).T
    for which, color in ((levels.crosses, UNUSED), (levels.beside, BESIDE), (levels.clipped, CLIPPED)):
        under = tinted[rows[which], columns[which]]
        tinted[rows[which], columns[which]] = np.round((1.0 - _TINT) * under + _TINT * np.array(color))
    return tinted


def _colors(levels: LevelResiduals) -> Image:
    colors = diverging(levels.residual / (_FULL_SCALE * levels.noise_levels))
    for which, color in ((levels.crosses, UNUSED), (levels.beside, BESIDE), (levels.clipped, CLIPPED)):
        colors[which] = color
    return colors


def _residuals(panel: Image, circle: ExplainedCircle, levels: LevelResiduals, ellipse: Ellipse) -> None:
    """Draw the residuals of all pixels, unrolled along the rim, and where the edge is in segments of it."""
    left, width = _LEFT, _WIDTH - _LEFT - _MARGIN - 10
    perimeter = np.pi * float(ellipse.semi_major + ellipse.semi_minor)
    half_width = levels.half_width_px
    place = rim_places(ellipse, levels.pixels)
    unrolled = Plot(panel, _SMALL, left, 106, width, 150, (0.0, 360.0), (-half_width, half_width))
    unrolled.bands([(0.0, 360.0)], FAINT)
    size = (max(2.0, 1.4 * width / perimeter), 1.5 * 150 / (2.0 * half_width))
    unrolled.marks(place, levels.distance_px, _colors(levels), size)
    unrolled.frame(
        f"residuals by place and distance from the rim, px (up: outside); 1 sigma {levels.noise_levels:.2f} levels",
        range(0, 361, 45),
        [-round(half_width), 0, round(half_width)],
    )
    number = int(np.clip(perimeter / _SEGMENT_PX, 12, 120))
    offset, error = edge_offsets(levels, place / 360.0, number)
    known = np.isfinite(offset)
    most = (
        max(3.0 * float(np.median(error[known])), 1.1 * float(np.max(np.abs(offset[known])))) if known.any() else 1.0
    )
    edge = Plot(panel, _SMALL, left, 320, width, 120, (0.0, 360.0), (-most, most))
    edge.bands(segments_left_out(circle), _SHADE)
    middle = (np.arange(number) + 0.5) * 360.0 / number
    edge.line(np.array([0.0, 360.0]), np.zeros(2), INK, 1)
    for sign in (-1.0, 1.0):
        edge.line(middle, sign * error, LIMIT, 1)
    edge.line(middle, offset, _MODEL, 2)
    tick = float(f"{0.7 * most:.1g}")
    edge.frame(
        "the edge from the rim of the pose, px by place; blue: one sigma if pixels err alone",
        range(0, 361, 45),
        [-tick, 0, tick],
    )


def _profile(panel: Image, levels: LevelResiduals) -> None:
    """Draw the levels against the distance from the rim, measured and of the model."""
    left, width = _LEFT, _WIDTH - _LEFT - _MARGIN - 10
    half_width = levels.half_width_px
    low, high = (float(v) for v in np.percentile(levels.measured, [0.5, 99.5]))
    margin = 0.08 * max(high - low, 1.0)
    plot = Plot(panel, _SMALL, left, 504, width, 180, (-half_width, half_width), (low - margin, high + margin))
    colors = np.tile(np.array(_DATA, dtype=np.uint8), (len(levels.measured), 1))
    for which, color in ((levels.crosses, UNUSED), (levels.beside, BESIDE), (levels.clipped, CLIPPED)):
        colors[which] = color
    plot.marks(levels.distance_px, levels.measured, colors, (2.0, 2.0))
    edges = np.linspace(-half_width, half_width, 49)
    middle = (edges[:-1] + edges[1:]) / 2.0
    mean = means(levels.distance_px, levels.measured, levels.in_use, edges)
    plot.line(middle, means(levels.distance_px, levels.model, levels.in_use, edges), _MODEL, 2)
    known = np.isfinite(mean)
    dots = np.tile(np.array(INK, dtype=np.uint8), (int(known.sum()), 1))
    plot.marks(middle[known], mean[known], dots, (5.0, 5.0))
    step = float(f"{max((high - low) / 4.0, 0.1):.1g}")
    ticks = np.arange(np.ceil(low / step) * step, high + margin, step)
    plot.frame(
        f"levels across the edge: pixels, their means (black) and the model (red); blur {levels.sigma_px:.2f} px",
        range(-int(half_width), int(half_width) + 1, max(1, round(half_width / 5.0))),
        ticks.tolist(),
        " px",
    )
