"""What extraction finds in an image, what it rejects and why, and axis intervals that hold what it found."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from circlepose import _arguments
from circlepose._typing import Image
from circlepose.detection.contour import Contour, DetectionResult
from circlepose.detection.detect import find_contours
from circlepose.imaging.float_levels import without_gaps
from circlepose.imaging.gray import to_grey
from circlepose.targets import POLARITIES, Polarity
from circlepose.targets.target import AxisIntervals

_FAMILY = 2.5
"""Circles of one kind differ by no more than this factor in size, from the typical one."""
_ROOM = 1.25
"""Room that suggested intervals leave on either side."""


@dataclass(frozen=True, slots=True, eq=False)
class Inspection:
    """The contours of one image."""

    image_size: tuple[int, int]
    """width, height in px"""
    extraction: DetectionResult
    suggested: AxisIntervals | None
    """intervals that hold the largest family of the contours kept; None where there are none"""


def inspect(
    image: Image, intervals: AxisIntervals | None = None, polarity: Polarity = "any", *, rings: bool = False
) -> Inspection:
    """Look for all circles in `image`, as `estimate` takes it, without a calibration or a radius.

    Parameters
    ----------
    image
        As of `circlepose.estimate`.
    intervals
        Axes, in px, of the ellipses to look for; None for all.
    polarity
        `dark`, `bright` or `any`.
    rings
        Whether to keep those inside others of the same center, too.

    Returns
    -------
    The contours found, those rejected with the reason, and axis intervals that hold the typical ones.

    Raises
    ------
    ArgumentError
        On misuse, naming the parameter.
    """
    if intervals is not None:
        _arguments.instance_of(AxisIntervals, "intervals", intervals, "such as AxisIntervals(major_px=(20.0, 200.0))")
    _arguments.one_of(POLARITIES, "polarity", polarity)
    rings = _arguments.truth("rings", rings)
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
