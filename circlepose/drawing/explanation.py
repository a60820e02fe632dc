"""A picture of what a pose is based on: the band around the rim, its residuals, and the profile across the edge."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np

from circlepose._typing import FloatArray, Image
from circlepose.camera.camera import Camera, circle_contour
from circlepose.diagnostics.explain import ExplainedCircle, Explanation, camera_of, rim_places, segments_left_out
from circlepose.diagnostics.residuals import LevelResiduals, edge_offsets
from circlepose.drawing import captions
from circlepose.drawing.captions import Color
from circlepose.drawing.overlay import draw_overlay, to_bgr8
from circlepose.drawing.plots import FAINT, INK, Plot, diverging, lines, means, text
from circlepose.geometry.ellipse import Ellipse

MOST_CIRCLES = 6
"""drawn in one picture"""
LEGEND = (
    "green: rim of the pose   blue: limits of the band   orange: left out at the rim   violet: left out beside it   "
    "red: clipped.   Places along the rim are in deg, as marked on the crop."
)
_WIDTH, _HEIGHT = 1560, 660
_CROP = 580
_MARGIN = 30
_RIM: Color = (60, 200, 60)
_LIMIT: Color = (230, 150, 60)
_CROSSES: Color = (0, 140, 255)
_OTHER_EDGE: Color = (200, 90, 170)
_CLIPPED: Color = (60, 60, 230)
_SHADE: Color = (200, 226, 255)
_DATA: Color = (170, 170, 170)
_MODEL: Color = (40, 40, 200)
_FULL_SCALE = 4.0
"""Noise sigmas of the strongest color."""
_TINT = 0.55
_SEGMENT_PX = 6.0


def draw_explanation(image: Image, explanation: Explanation, camera: Camera) -> Image:
    """Return a picture (h, w, 3), BGR uint8, of what the poses of the first few circles are based on.

    `image` is the one that was explained, `camera` the one that it was explained with. Without a circle it is the
    picture that `draw_overlay` makes.
    """
    camera = camera_of(explanation.result, camera)
    shown = explanation.circles[:MOST_CIRCLES]
    if not shown:
        return draw_overlay(image, explanation.result, camera)
    base = to_bgr8(image)
    name, number = explanation.result.image, len(explanation.circles)
    some = "" if number == len(shown) else f"   the first {len(shown)} of {number} circles"
    heading = captions.strip(_WIDTH, [(f"{name}{some}", 0.6), (LEGEND, 0.45)], (60, 50, 40))
    return np.concatenate([heading, *(_panel(base, circle, camera) for circle in shown)])


def _panel(base: Image, circle: ExplainedCircle, camera: Camera) -> Image:
    panel = np.full((_HEIGHT, _WIDTH, 3), 255, dtype=np.uint8)
    result, levels = circle.result, circle.levels
    ellipse = result.ellipse
    text(panel, f"#{result.instance} {result.circle}   {result.status}   {' '.join(result.flags)}", _MARGIN, 24)
    if ellipse is None:
        return panel
    crop = _crop(base, circle, ellipse, camera)
    panel[40 : 40 + _CROP, _MARGIN : _MARGIN + _CROP] = crop
    if levels is None:
        text(panel, "no levels could be looked at around this rim", _MARGIN + _CROP + 90, 70)
        return panel
    _residuals(panel, circle, levels, ellipse)
    _profile(panel, levels)
    return panel


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
            lines(crop, at(np.concatenate([limit, limit[:1]])), _LIMIT, 1)
    result = circle.result
    if result.candidates:
        chosen = result.candidates[result.chosen]
        rim = circle_contour(camera, chosen.center, chosen.normal, result.radius_mm)
        lines(crop, at(np.concatenate([rim, rim[:1]])), _RIM, 1)
    _mark_places(crop, at, ellipse, half_width)
    return crop


def _mark_places(crop: Image, at: Callable[[FloatArray], FloatArray], ellipse: Ellipse, half_width_px: float) -> None:
    outer = Ellipse(
        ellipse.center, ellipse.semi_major + half_width_px, ellipse.semi_minor + half_width_px, ellipse.angle
    )
    tips = outer.points(8)[[0, 2, 4, 6]]
    for place, tip in zip((0, 90, 180, 270), tips, strict=True):
        x, y = (round(v) for v in at(tip + 1.5 * (tip - ellipse.center) / np.linalg.norm(tip - ellipse.center)))
        x, y = int(np.clip(x, 6, _CROP - 34)), int(np.clip(y, 14, _CROP - 6))
        for color, weight in ((INK, 3), ((255, 255, 255), 1)):
            cv2.putText(crop, str(place), (x, y), cv2.FONT_HERSHEY_SIMPLEX, 0.5, color, weight, cv2.LINE_AA)


def _tinted(base: Image, levels: LevelResiduals | None) -> Image:
    if levels is None:
        return base
    tinted = base.copy()
    columns, rows = levels.pixels.astype(np.int64).T
    for which, color in ((levels.crosses, _CROSSES), (levels.beside, _OTHER_EDGE), (levels.clipped, _CLIPPED)):
        under = tinted[rows[which], columns[which]]
        tinted[rows[which], columns[which]] = np.round((1.0 - _TINT) * under + _TINT * np.array(color))
    return tinted


def _colors(levels: LevelResiduals) -> Image:
    colors = diverging(levels.residual / (_FULL_SCALE * levels.noise_levels))
    for which, color in ((levels.crosses, _CROSSES), (levels.beside, _OTHER_EDGE), (levels.clipped, _CLIPPED)):
        colors[which] = color
    return colors


def _residuals(panel: Image, circle: ExplainedCircle, levels: LevelResiduals, ellipse: Ellipse) -> None:
    """Draw the residuals of all pixels, unrolled along the rim, and where the edge is in segments of it."""
    left, width = _MARGIN + _CROP + 90, _WIDTH - _CROP - 2 * _MARGIN - 100
    perimeter = np.pi * float(ellipse.semi_major + ellipse.semi_minor)
    half_width = levels.half_width_px
    place = rim_places(ellipse, levels.pixels)
    unrolled = Plot(panel, left, 40, width, 150, (0.0, 360.0), (-half_width, half_width))
    unrolled.bands([(0.0, 360.0)], FAINT)
    size = (max(2.0, 1.4 * width / perimeter), 1.5 * 150 / (2.0 * half_width))
    unrolled.marks(place, levels.distance_px, _colors(levels), size)
    unrolled.frame(
        f"residuals by place and distance from the rim (px, up is outside): white 0, red or blue "
        f"{_FULL_SCALE:g} sigma; 1 sigma is {levels.noise_levels:.2f} levels",
        range(0, 361, 45),
        [-round(half_width), 0, round(half_width)],
    )
    number = int(np.clip(perimeter / _SEGMENT_PX, 12, 120))
    offset, error = edge_offsets(levels, place / 360.0, number)
    known = np.isfinite(offset)
    most = (
        max(3.0 * float(np.median(error[known])), 1.1 * float(np.max(np.abs(offset[known])))) if known.any() else 1.0
    )
    edge = Plot(panel, left, 250, width, 110, (0.0, 360.0), (-most, most))
    edge.bands(segments_left_out(circle), _SHADE)
    middle = (np.arange(number) + 0.5) * 360.0 / number
    edge.line(np.array([0.0, 360.0]), np.zeros(2), INK, 1)
    for sign in (-1.0, 1.0):
        edge.line(middle, sign * error, _LIMIT, 1)
    edge.line(middle, offset, _MODEL, 2)
    tick = float(f"{0.7 * most:.1g}")
    edge.frame(
        "the edge from the rim of the pose, px by place; blue: one sigma if pixels err alone",
        range(0, 361, 45),
        [-tick, 0, tick],
    )


def _profile(panel: Image, levels: LevelResiduals) -> None:
    """Draw the levels against the distance from the rim, measured and of the model."""
    left, width = _MARGIN + _CROP + 90, _WIDTH - _CROP - 2 * _MARGIN - 100
    half_width = levels.half_width_px
    low, high = (float(v) for v in np.percentile(levels.measured, [0.5, 99.5]))
    margin = 0.08 * max(high - low, 1.0)
    plot = Plot(panel, left, 420, width, 200, (-half_width, half_width), (low - margin, high + margin))
    colors = np.tile(np.array(_DATA, dtype=np.uint8), (len(levels.measured), 1))
    for which, color in ((levels.crosses, _CROSSES), (levels.beside, _OTHER_EDGE), (levels.clipped, _CLIPPED)):
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
