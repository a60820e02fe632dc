"""What extraction finds in an image, what it rejects and why, and axis intervals that hold what it found."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from circlepose._typing import Image
from circlepose.detection.contour import Contour, Extraction
from circlepose.detection.detect import find_contours
from circlepose.geometry.conic import Ellipse
from circlepose.imaging.float_levels import without_gaps
from circlepose.imaging.gray import eight_bit, to_grey
from circlepose.targets import Polarity
from circlepose.targets.target import AxisIntervals

_FAMILY = 2.5
"""Circles of one kind differ by no more than this factor in size, from the typical one."""
_ROOM = 1.25
"""Room that suggested intervals leave on either side."""
_KEPT = (60, 220, 60)
_REFUSED = (70, 70, 255)
_SUBPIXEL_BITS = 4
_FARTHEST_PX = 30000.0
_CORNERS = 180


@dataclass(frozen=True, slots=True, eq=False)
class Inspection:
    """The contours of one image."""

    image_size: tuple[int, int]
    """width, height in px"""
    extraction: Extraction
    suggested: AxisIntervals | None
    """intervals that hold the largest family of the contours kept; None where there are none"""


def inspect(
    image: Image, intervals: AxisIntervals | None = None, polarity: Polarity = "any", *, rings: bool = False
) -> Inspection:
    """Look for all circles in `image`, as `estimate` takes it, without a calibration or a radius.

    With `rings` those inside others of the same centre are kept too. Raises `ArgumentError` on what is no image.
    """
    grey = without_gaps(to_grey(image))
    found = find_contours(grey, intervals or AxisIntervals(), polarity, keep_concentric=rings)
    return Inspection((int(grey.shape[1]), int(grey.shape[0])), found, suggested_intervals(found.contours))


def suggested_intervals(contours: tuple[Contour, ...]) -> AxisIntervals | None:
    """Return intervals (whole px) that hold the contours about as large as the typical one, with room to spare."""
    if not contours:
        return None
    major = np.array([2.0 * float(c.ellipse.semi_major) for c in contours])
    minor = np.array([2.0 * float(c.ellipse.semi_minor) for c in contours])
    score = np.array([c.score for c in contours])
    # The size that most of the score has around it.
    alike = np.abs(np.log(major[:, None] / major[None, :])) <= math.log(_FAMILY)
    family = alike[int(np.argmax(alike @ score))]
    return AxisIntervals(_with_room(major[family]), _with_room(minor[family]))


def _with_room(lengths: np.ndarray) -> tuple[float, float]:
    low, high = float(lengths.min()) / _ROOM, float(lengths.max()) * _ROOM
    return float(math.floor(low)), float(math.ceil(high))


def draw_inspection(image: Image, inspection: Inspection) -> Image:
    """Return a picture (h, w, 3), BGR uint8: contours kept in green with number and score, those refused in red."""
    picture = cv2.cvtColor(eight_bit(to_grey(image)), cv2.COLOR_GRAY2BGR)
    thickness = max(1, round(max(picture.shape) / 1000.0))
    _draw(picture, inspection.extraction.refused, _REFUSED, thickness)
    for number, contour in enumerate(inspection.extraction.contours):
        _draw(picture, contour.ellipse, _KEPT, 2 * thickness)
        x, y = (float(v) for v in np.clip(contour.ellipse.center, -_FARTHEST_PX, _FARTHEST_PX))
        at = (round(x + float(contour.ellipse.semi_major)), round(y))
        size = 0.4 * thickness
        cv2.putText(picture, f"{number} {contour.score:.2f}", at, cv2.FONT_HERSHEY_SIMPLEX, size, _KEPT, thickness)
    return picture


def _draw(picture: Image, ellipse: Ellipse, color: tuple[int, int, int], thickness: int) -> None:
    rims = np.clip(ellipse.points(_CORNERS), -_FARTHEST_PX, _FARTHEST_PX).reshape(-1, _CORNERS, 2)
    fixed = np.rint(rims * 2**_SUBPIXEL_BITS).astype(np.int32)
    cv2.polylines(picture, list(fixed), True, color, thickness, cv2.LINE_AA, _SUBPIXEL_BITS)
