"""Any image as a grey one."""

from __future__ import annotations

import cv2
import numpy as np

from circlepose._typing import Image
from circlepose.errors import ArgumentError


def to_grey(image: Image) -> Image:
    """Return `image` as (h, w) grey levels of its own depth (uint8, uint16 or float32).

    Colour is BGR, weighted as OpenCV does; an alpha channel is dropped. Booleans become 0 and 255.

    Raises
    ------
    ArgumentError
        When the array is no image: wrong number of dimensions or channels, empty, of another type.
    """
    array = np.asarray(image)
    if array.ndim == 3 and array.shape[2] == 1:
        array = array[:, :, 0]
    if array.dtype == np.bool_:
        array = array.astype(np.uint8) * np.uint8(255)
    if array.dtype == np.float64:
        array = array.astype(np.float32)
    if array.ndim not in (2, 3) or array.size == 0 or (array.ndim == 3 and array.shape[2] not in (2, 3, 4)):
        raise ArgumentError(f"image: expected (h, w), (h, w, 3) or (h, w, 4) pixels, got shape {array.shape}.")
    if array.dtype not in (np.uint8, np.uint16, np.float32):
        raise ArgumentError(f"image: expected 8 or 16 bit or floating levels, got {array.dtype}.")
    if array.ndim == 2:
        return array
    if array.shape[2] == 2:
        return np.ascontiguousarray(array[:, :, 0])
    return cv2.cvtColor(array, cv2.COLOR_BGR2GRAY if array.shape[2] == 3 else cv2.COLOR_BGRA2GRAY)


def eight_bit(grey: Image) -> Image:
    """Return `grey` (h, w) as uint8, its used range stretched when it holds more than 8 bits."""
    if grey.dtype == np.uint8:
        return grey
    low, high = float(np.nanmin(grey)), float(np.nanmax(grey))
    if not high > low:
        return np.zeros(grey.shape, np.uint8)
    return cv2.convertScaleAbs(grey.astype(np.float32), alpha=255.0 / (high - low), beta=-255.0 * low / (high - low))
