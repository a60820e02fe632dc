"""What is drawn for one circle: its rim by the chosen pose, its gaps, its center, and its normals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from circlepose._typing import BoolArray, FloatArray
from circlepose.camera.camera import Camera, circle_contour
from circlepose.diagnostics.explain import rim_places
from circlepose.drawing import words
from circlepose.drawing.canvas import Pen
from circlepose.drawing.labels import Room
from circlepose.drawing.style import AMBIGUOUS, CHOSEN, OTHER, REJECTED, UNUSED, Color
from circlepose.results import CircleResult

_LEAST_RIM_POINTS, _MOST_RIM_POINTS, _RIM_STEP = 48, 720, 4.0
"""Corners of a drawn rim, and picture px between them: a chord leaves its arc by less than a tenth of a px."""
_WIDE_GAP = (3.0, 8.0)
"""A gap of the contour: times the usual step, and deg."""


@dataclass(frozen=True, slots=True, eq=False)
class Drawn:
    """A circle, and what is drawn for it, in image px."""

    circle: CircleResult
    color: Color
    rim: FloatArray
    """(n, 2) of the chosen pose, or else of the fitted ellipse, or else the contour"""
    hidden: BoolArray
    """(n,) which of these points are in a gap of the contour"""
    arrows: tuple[tuple[FloatArray, FloatArray, Color, float], ...]
    """normals of the candidates: tail, head, color and width in units"""

    @classmethod
    def of(cls, circle: CircleResult, camera: Camera, enlargement: int) -> Drawn:
        """Return what is drawn for `circle`."""
        color = color_of(circle)
        rim = rim_of(circle, camera, enlargement)
        arrows = (
            (candidate.imaged_center, camera.project(candidate.center + circle.radius_mm * candidate.normal))
            for candidate in circle.candidates
        )
        styles = ((color, 2.2) if n == circle.chosen else (OTHER, 1.0) for n in range(len(circle.candidates)))
        both = tuple((*ends, *style) for ends, style in zip(arrows, styles, strict=True))
        return cls(circle, color, rim, _hidden(circle, rim), both)


def draw_rims(pen: Pen, room: Room, drawn: Sequence[Drawn]) -> None:
    """Draw the rims of circles, thin, and keep labels off them."""
    for each in drawn:
        if not len(each.rim):
            continue
        room.keep_disc(pen.at(each.rim))
        if not each.circle.candidates and each.circle.contour is not None:
            pen.hairline(_with_gaps(each.circle.contour), REJECTED)
            continue
        pen.hairline(each.rim, each.color, closed=True)
        if each.hidden.any():
            pen.hairline(np.where(each.hidden[:, None], each.rim, np.nan), UNUSED, closed=True)


def draw_center(pen: Pen, circle: CircleResult) -> None:
    """Draw a cross at the imaged center of the chosen pose."""
    if circle.candidates:
        reach = np.inf if circle.ellipse is None else 0.18 * float(circle.ellipse.semi_minor)
        pen.cross(circle.candidates[circle.chosen].imaged_center, reach)


def rim_of(circle: CircleResult, camera: Camera, enlargement: int) -> FloatArray:
    """Return the rim (n, 2) px of the chosen pose, or else of the fitted ellipse, or else the contour."""
    if circle.ellipse is None:
        number = _MOST_RIM_POINTS
    else:
        length = 2.0 * np.pi * float(circle.ellipse.semi_major) * enlargement
        number = int(np.clip(length / _RIM_STEP, _LEAST_RIM_POINTS, _MOST_RIM_POINTS))
    if circle.candidates:
        chosen = circle.candidates[circle.chosen]
        return circle_contour(camera, chosen.center, chosen.normal, circle.radius_mm, number)
    if circle.ellipse is not None:
        return circle.ellipse.points(number)
    return np.empty((0, 2)) if circle.contour is None else circle.contour


def _hidden(circle: CircleResult, rim: FloatArray) -> BoolArray:
    """Return which points of the rim (n, 2) of the chosen pose are in a gap of the contour."""
    if not circle.candidates or circle.ellipse is None or circle.contour is None or len(circle.contour) < 2:
        return np.zeros(len(rim), dtype=np.bool_)
    known = np.sort(rim_places(circle.ellipse, circle.contour))
    steps = np.diff(known, append=known[0] + 360.0)
    times, least_deg = _WIDE_GAP
    wide = steps > max(times * float(np.median(steps)), least_deg)
    if not wide.any():
        return np.zeros(len(rim), dtype=np.bool_)
    place = np.nan_to_num(rim_places(circle.ellipse, rim))
    return np.asarray(wide[(np.searchsorted(known, place, side="right") - 1) % len(known)])


def _with_gaps(contour: FloatArray) -> FloatArray:
    """Close a contour (n, 2), with NaN where neighbors are far apart: an arc that was not used."""
    closed = np.concatenate([contour, contour[:1]])
    steps = np.linalg.norm(np.diff(closed, axis=0), axis=1)
    far = np.flatnonzero(steps > max(4.0 * float(np.median(steps)), 3.0))
    return np.insert(closed, far + 1, np.nan, axis=0)


def color_of(circle: CircleResult) -> Color:
    """Return the color of a circle's rim."""
    return REJECTED if not circle.candidates else AMBIGUOUS if words.is_doubtful(circle) else CHOSEN
