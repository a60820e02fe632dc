"""A picture of a result: what was measured, drawn over the image that it was measured in."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from circlepose import _arguments
from circlepose._typing import FloatArray, Image
from circlepose.camera.camera import Camera, circle_contour
from circlepose.drawing import captions
from circlepose.drawing.captions import Box, Color
from circlepose.imaging.float_levels import in_steps
from circlepose.imaging.gray import to_grey
from circlepose.results import Candidate, CircleResult, ImageResult, Status

SMALLEST_PICTURE = 1000
"""px; an image whose longer side is less is enlarged by a whole factor so that text has room"""
MOST_FULL_CAPTIONS = 4
"""with more circles a caption is center and normal only"""
MOST_CAPTIONS = 12
"""with more circles a caption is only the number of the target"""
LEGEND = (
    "bold arrow: chosen normal, a radius long   thin arrow: other candidate   cross: imaged center   pink: contour"
)

_CONTOUR: Color = (255, 80, 255)
_OTHER: Color = (205, 205, 205)
_AXES: Color = (225, 140, 60)
_FAILED: Color = (70, 70, 255)
_SHADOW: Color = (20, 20, 20)
# BGR, distinct by hue and lightness also on gray photographs.
_INSTANCES: tuple[Color, ...] = (
    (60, 220, 60),
    (0, 190, 255),
    (255, 210, 0),
    (90, 120, 255),
    (0, 240, 240),
)
_SUBPIXEL_BITS = 4
_FARTHEST = 30000.0
"""px; beyond it OpenCV's fixed-point coordinates overflow"""


@dataclass(frozen=True, slots=True)
class _Pen:
    """Draws on `canvas` in the image's own pixel coordinates, whatever the enlargement."""

    canvas: Image
    enlargement: int
    unit: float
    """picture px; a thousandth of the picture's longer side"""

    def at(self, points: FloatArray) -> FloatArray:
        """Return image `points` (..., 2) in the picture; pixel centers are integers in both."""
        return (points + 0.5) * self.enlargement - 0.5

    def width(self, units: float) -> int:
        """Return a line's width in picture px."""
        return max(1, round(units * self.unit))

    def line(self, points: FloatArray, color: Color, units: float, *, closed: bool = False) -> None:
        """Draw the image points (n, 2), leaving out those that are NaN."""
        path = self.at(np.concatenate([points, points[:1]]) if closed else points)
        gaps = np.flatnonzero(~np.all(np.isfinite(path), axis=1))
        runs = [run[np.all(np.isfinite(run), axis=1)] for run in np.split(path, gaps)]
        fixed = [np.round(np.clip(run, -_FARTHEST, _FARTHEST) * 2**_SUBPIXEL_BITS).astype(np.int32) for run in runs]
        cv2.polylines(self.canvas, fixed, False, color, self.width(units), cv2.LINE_AA, shift=_SUBPIXEL_BITS)

    def arrow(self, tail: FloatArray, head: FloatArray, color: Color, units: float) -> None:
        """Draw an arrow between two image points (2,) with a shadow that parts it from the background."""
        if not np.all(np.isfinite([tail, head])):
            return
        along = head - tail
        length = float(np.linalg.norm(along))
        # A short arrow is a slim one, or it would be a blob.
        units = min(units, 0.08 * length * self.enlargement / self.unit)
        tip = min(7.0 * units * self.unit / self.enlargement, 0.4 * length)
        shape = [np.stack([tail, head])]
        if length > 0.0:
            back = along / length * tip
            side = 0.45 * np.array([-back[1], back[0]])
            shape.append(np.stack([head - back + side, head, head - back - side]))
        for shade, extra in ((_SHADOW, 1.5), (color, 0.0)):
            for part in shape:
                self.line(part, shade, units + extra)


def draw_overlay(image: Image, result: ImageResult, camera: Camera) -> Image:
    """Draw `result` over `image`.

    Drawn for each circle are the contour in use, the fitted rim with its axes, the imaged center, both
    candidates' normals (one radius long; the chosen one bold) and a caption of the numbers; above the image its
    name and status. Small images are enlarged. Of several methods the first is drawn.

    Parameters
    ----------
    image
        (height, width) or (height, width, 3 or 4), 8 or 16 bit, raw as it was measured.
    result
        What `estimate` returned for it.
    camera
        With which it was measured.

    Returns
    -------
    The picture (height, width, 3), BGR uint8. It is higher than the image by its heading.

    Raises
    ------
    ArgumentError
        On misuse, naming the parameter.
    """
    _arguments.instance_of(ImageResult, "result", result, "of estimate or measure")
    _arguments.instance_of(Camera, "camera", camera, _arguments.HOW_CAMERA)
    base = to_bgr8(image)
    size = (base.shape[1], base.shape[0])
    if result.circles and camera.image_size not in (None, size):
        camera = camera.scaled_to(size)
    longest = max(base.shape[:2])
    enlargement = max(1, -(-SMALLEST_PICTURE // longest))
    if enlargement > 1:
        base = cv2.resize(base, None, fx=enlargement, fy=enlargement, interpolation=cv2.INTER_CUBIC)
    pen = _Pen(base, enlargement, max(base.shape[:2]) / 1000.0)
    methods = {circle.method: None for circle in result.circles}
    circles = [circle for circle in result.circles if circle.method == next(iter(methods))]
    _translucent(pen, 0.55, lambda soft: _draw_contours(soft, circles))
    _translucent(pen, 0.7, lambda soft: _draw_axes(soft, circles))
    for circle in circles:
        _draw_rim(pen, circle, camera)
    _draw_normals(pen, circles, camera)
    _draw_captions(pen, circles, camera)
    return np.concatenate([_heading(pen, result, circles), pen.canvas])


def to_bgr8(image: Image) -> Image:
    """Return a new picture for display; more than 8 bits are stretched to the range that is there."""
    to_grey(image)  # which raises an ArgumentError on what is no image
    array = np.asarray(image)
    if array.ndim == 3 and array.shape[2] == 2:
        array = array[:, :, 0]
    if array.dtype != np.uint8:
        if array.dtype.kind == "f":
            array = np.nan_to_num(in_steps(array))
        low, high = float(array.min()), float(array.max())
        array = ((array - low) * (255.0 / max(high - low, 1e-12))).astype(np.uint8)
    if array.ndim == 2 or array.shape[2] == 1:
        return cv2.cvtColor(array, cv2.COLOR_GRAY2BGR)
    return np.ascontiguousarray(array[..., :3]).copy()


def _translucent(pen: _Pen, opacity: float, draw: Callable[[_Pen], None]) -> None:
    layer = _Pen(pen.canvas.copy(), pen.enlargement, pen.unit)
    draw(layer)
    cv2.addWeighted(layer.canvas, opacity, pen.canvas, 1.0 - opacity, 0.0, dst=pen.canvas)


def _draw_contours(pen: _Pen, circles: Sequence[CircleResult]) -> None:
    for circle in circles:
        if circle.contour is not None and len(circle.contour) > 2:
            pen.line(_with_gaps(circle.contour), _CONTOUR, 3.6)


def _with_gaps(contour: FloatArray) -> FloatArray:
    """Close a contour (n, 2), with NaN where neighbors are far apart: an arc that was not used."""
    closed = np.concatenate([contour, contour[:1]])
    steps = np.linalg.norm(np.diff(closed, axis=0), axis=1)
    far = np.flatnonzero(steps > max(4.0 * float(np.median(steps)), 3.0))
    return np.insert(closed, far + 1, np.nan, axis=0)


def _draw_axes(pen: _Pen, circles: Sequence[CircleResult]) -> None:
    for circle in circles:
        if circle.ellipse is not None:
            tips = circle.ellipse.points(4)
            pen.line(tips[[0, 2]], _AXES, 1.0)
            pen.line(tips[[1, 3]], _AXES, 1.0)


def _draw_rim(pen: _Pen, circle: CircleResult, camera: Camera) -> None:
    pen.line(_rim(circle, camera), _color(circle), 1.6, closed=True)


def _draw_normals(pen: _Pen, circles: Sequence[CircleResult], camera: Camera) -> None:
    measured = [circle for circle in circles if circle.candidates]
    for circle in measured:
        for number, candidate in enumerate(circle.candidates):
            if number != circle.chosen:
                pen.arrow(*_normal_ends(candidate, circle, camera), _OTHER, 1.2)
    for circle in measured:
        chosen = circle.candidates[circle.chosen]
        pen.arrow(*_normal_ends(chosen, circle, camera), _color(circle), 3.0)
    for circle in measured:
        _draw_center(pen, circle)


def _draw_center(pen: _Pen, circle: CircleResult) -> None:
    center = circle.candidates[circle.chosen].imaged_center
    reach = 6.0 * pen.unit / pen.enlargement
    if circle.ellipse is not None:
        reach = min(reach, 0.3 * float(circle.ellipse.semi_major))
    cross = reach * np.array([[[-1.0, 0.0], [1.0, 0.0]], [[0.0, -1.0], [0.0, 1.0]]])
    for color, units in ((_SHADOW, 2.4), ((255, 255, 255), 1.0)):
        for bar in cross:
            pen.line(center + bar, color, units)


def _rim(circle: CircleResult, camera: Camera) -> FloatArray:
    """Return the rim (n, 2) px of the chosen pose, or of the fitted ellipse where there is no pose."""
    if circle.candidates:
        chosen = circle.candidates[circle.chosen]
        return circle_contour(camera, chosen.center, chosen.normal, circle.radius_mm)
    return np.empty((0, 2)) if circle.ellipse is None else circle.ellipse.points(360)


def _normal_ends(candidate: Candidate, circle: CircleResult, camera: Camera) -> tuple[FloatArray, FloatArray]:
    head = camera.project(candidate.center + circle.radius_mm * candidate.normal)
    return candidate.imaged_center, head


def _color(circle: CircleResult) -> Color:
    return _INSTANCES[circle.instance % len(_INSTANCES)] if circle.candidates else _FAILED


def _draw_captions(pen: _Pen, circles: Sequence[CircleResult], camera: Camera) -> None:
    texts = [
        captions.Caption(_lines(circle, len(circles)), _color(circle), extent)
        for circle in circles
        if (extent := _extent(pen, circle, camera)) is not None
    ]
    text_scale = 0.5 * pen.unit
    crowded = len(texts) > MOST_CAPTIONS
    if crowded:
        text_scale = min(text_scale, 0.012 * float(np.median([t.extent[3] - t.extent[1] for t in texts])))
    captions.place(pen.canvas, texts, text_scale=text_scale, stay_near=crowded)


def _extent(pen: _Pen, circle: CircleResult, camera: Camera) -> Box | None:
    """Return the picture's box that holds all that is drawn for a circle."""
    parts = [_rim(circle, camera)]
    for candidate in circle.candidates:
        parts.extend(end[None, :] for end in _normal_ends(candidate, circle, camera))
    if circle.contour is not None:
        parts.append(circle.contour)
    points = np.concatenate(parts)
    points = pen.at(points[np.all(np.isfinite(points), axis=1)])
    if len(points) == 0:
        return None
    (left, top), (right, bottom) = points.min(axis=0).tolist(), points.max(axis=0).tolist()
    return left, top, right, bottom


def _lines(circle: CircleResult, circles: int) -> tuple[str, ...]:
    """Return the caption of one of so many `circles`: the more there are, the shorter it is."""
    if circles > MOST_CAPTIONS:
        return (str(circle.instance),)
    name = f"#{circle.instance} {circle.circle}"
    if not circle.candidates:
        return (f"{name}  {circle.status}", *((circle.reason,) if circle.reason else ()))
    chosen = circle.candidates[circle.chosen]
    center = "({:.2f}, {:.2f}, {:.2f}) mm".format(*chosen.center)
    normal = "n ({:.3f}, {:.3f}, {:.3f})".format(*chosen.normal)
    if circles > MOST_FULL_CAPTIONS:
        return (f"#{circle.instance} {center}", normal)
    if chosen.covariance is not None:
        variances = np.diagonal(chosen.covariance)
        center += f" +-{np.sqrt(variances[:3].sum()):.2g}"
        normal += f" +-{np.degrees(np.sqrt(variances[3:].sum())):.2g} deg"
    remarks = f"  ({', '.join(circle.flags)})" if circle.flags else ""
    return (
        f"{name}  R {circle.radius_mm:g} mm",
        f"c {center}",
        normal,
        f"ambiguity {circle.ambiguity:.2g}{remarks}",
    )


def _heading(pen: _Pen, result: ImageResult, circles: Sequence[CircleResult]) -> Image:
    failed = result.status is not Status.OK
    instances = len({circle.instance for circle in circles})
    found = f"{instances} target{'' if instances == 1 else 's'}"
    what = f"{result.status}: {result.reason}" if failed else f"{found}, {circles[0].method}" if circles else "ok"
    color = (50, 40, 120) if failed and not circles else (30, 90, 140) if failed else (60, 50, 40)
    lines = [(f"{result.image}   {what}", 0.6 * pen.unit)]
    if circles:
        lines.append((LEGEND, 0.4 * pen.unit))
    return captions.strip(pen.canvas.shape[1], lines, color)
