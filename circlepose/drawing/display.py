"""Any image -> one that a person can look at: 8 bits, color, neither dark nor pale; and what was changed."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import cv2
import numpy as np

from circlepose._typing import FloatArray, Image
from circlepose.drawing.style import LEAST_WIDTH, Box, unit_of
from circlepose.geometry.ellipse import Ellipse
from circlepose.imaging.gray import to_grey

SMALLEST_PICTURE = 1000
"""px; an image whose longer side is less is enlarged by a whole factor so that text has room"""
_LARGEST_PICTURE = 2000
_SMALL_PX = 48.0
"""A picture is enlarged up to `_LARGEST_PICTURE` px where the typical circle is smaller in it than this."""
_DARK = 128.0
"""Levels; an image is dark whose brightest hundredth around the circles is below this; empirical."""
_PALE = 32.0
"""Levels; an image is pale whose levels spread less; as where `imaging.stretch` stretches it."""
_BRIGHT = 210.0
_MOST_GAIN = 20.0
_SAMPLES = 200_000
_DEEP = (0.1, 99.9)
"""Percent of the pixels that black and white of a picture of more than 8 bits stand for."""


def displayed(image: Image, around: Sequence[Box] = ()) -> tuple[Image, str]:
    """Return an image for display.

    Parameters
    ----------
    image
        As of `circlepose.estimate`.
    around
        Boxes of image px that matter; without any the whole image.

    Returns
    -------
    A new image (h, w, 3), BGR uint8, and how its levels were changed, in words; empty where they are as they were.

    Raises
    ------
    ArgumentError
        On what is no image.
    """
    to_grey(image)  # which raises it
    array = np.asarray(image)
    if array.ndim == 3 and array.shape[2] == 2:
        array = array[:, :, 0]
    if array.ndim == 3:
        array = array[:, :, 0] if array.shape[2] == 1 else array[:, :, :3]
    remarks = []
    if array.dtype == np.bool_:
        array = array.astype(np.uint8) * np.uint8(255)
    elif array.dtype != np.uint8:
        array, words = _stretched(array)
        remarks.append(words)
    gain, offset, words = _correction(array, around)
    if words:
        remarks.append(words)
        levels = np.clip(np.round(np.arange(256) * gain + offset), 0, 255).astype(np.uint8)
        array = cv2.LUT(np.ascontiguousarray(array), levels)
    if array.ndim == 2:
        return cv2.cvtColor(array, cv2.COLOR_GRAY2BGR), ", ".join(remarks)
    return np.ascontiguousarray(array).copy(), ", ".join(remarks)


def boxes_around(ellipses: Iterable[Ellipse | None]) -> list[Box]:
    """Return the boxes around circles that `displayed` looks at; None is skipped."""
    boxes = []
    for ellipse in ellipses:
        if ellipse is not None:
            (x, y), reach = ellipse.center.tolist(), 1.5 * float(ellipse.semi_major)
            boxes.append((x - reach, y - reach, x + reach, y + reach))
    return boxes


def enlarged(picture: Image, seen_px: float = np.inf) -> tuple[Image, int]:
    """Return a new picture large enough for text, and the whole factor.

    It is enlarged more where the typical thing to see is `seen_px` large and would be small; a narrow picture has a
    gray margin on the right.
    """
    longest = max(picture.shape[:2])
    factor = max(1, -(-SMALLEST_PICTURE // longest))
    while seen_px * factor < _SMALL_PX and longest * (factor + 1) <= _LARGEST_PICTURE:
        factor += 1
    if factor > 1:
        picture = cv2.resize(picture, None, fx=factor, fy=factor, interpolation=cv2.INTER_CUBIC)
    missing = round(LEAST_WIDTH * unit_of(picture)) - picture.shape[1]
    if missing > 0:
        picture = cv2.copyMakeBorder(picture, 0, 0, 0, missing, cv2.BORDER_CONSTANT, value=(70, 70, 70))
    return picture, factor


def _stretched(array: Image) -> tuple[Image, str]:
    """Return deeper levels (...) as uint8 over the range that nearly all pixels have, and that range."""
    sample = _sample(array)
    sample = sample[np.isfinite(sample)]
    low, high = (float(v) for v in np.percentile(sample if sample.size else np.zeros(1), _DEEP))
    words = f"levels {low:.4g} to {high:.4g} shown as black to white"
    if not high > low:
        return np.full(array.shape, 128, np.uint8), words
    if array.dtype == np.uint16:
        table = np.clip((np.arange(65536.0) - low) * (255.0 / (high - low)), 0.0, 255.0)
        return table.astype(np.uint8)[array], words
    known = np.clip(np.nan_to_num(array.astype(np.float64), nan=low), low, high)
    return ((known / 2.0 - low / 2.0) / (high / 2.0 - low / 2.0) * 255.0).astype(np.uint8), words


def _correction(array: Image, around: Sequence[Box]) -> tuple[float, float, str]:
    """Return gain and offset of 8-bit levels, and the words for them: for a dark or a pale image, else nothing."""
    parts = [_part(array, box, _SAMPLES // len(around)) for box in around]
    sample = np.concatenate(parts) if parts else np.empty(0)
    low, high = (float(v) for v in np.percentile(sample if sample.size else _sample(array), (1.0, 99.0)))
    if high < _DARK and high - low >= 2.0:
        gain = min(_MOST_GAIN, _BRIGHT / max(high, 1.0))
        return gain, 0.0, f"shown {gain:.2g} times brighter"
    if 2.0 <= high - low < _PALE:
        gain = min(_MOST_GAIN, 0.6 * 255.0 / (high - low))
        return gain, 127.5 - gain * (low + high) / 2.0, f"shown with {gain:.2g} times the contrast"
    return 1.0, 0.0, ""


def _part(array: Image, box: Box, number: int) -> FloatArray:
    left, top, right, bottom = (int(np.clip(side, -1e6, 1e6)) for side in box)
    rows = array[max(top, 0) : max(bottom + 1, 0), max(left, 0) : max(right + 1, 0)]
    return _sample(rows, number)


def _sample(array: Image, number: int = _SAMPLES) -> FloatArray:
    """Return about `number` levels of an image (h, w) or (h, w, 3), spread evenly; the brightest of each color."""
    step = max(1, round((array.shape[0] * array.shape[1] / max(number, 1)) ** 0.5))
    levels = array[::step, ::step]
    return np.asarray(levels.max(axis=-1) if array.ndim == 3 else levels, dtype=np.float64).ravel()
