"""Any image -> a gray one."""

from __future__ import annotations

import cv2
import numpy as np

from circlepose._arguments import shown
from circlepose._typing import Image
from circlepose.errors import ArgumentError
from circlepose.imaging.float_levels import in_steps, without_gaps

_LOW_RANGE = 32
"""Levels; an 8 bit image that spans fewer is stretched before its edges are sought; empirical."""
_FLOATS = (np.float16, np.float32, np.float64)


def to_grey(image: Image) -> Image:
    """Return an image as gray levels of its own depth.

    Parameters
    ----------
    image
        (h, w), (h, w, 3) BGR or (h, w, 4) BGRA of uint8, uint16, floating levels or booleans.

    Returns
    -------
    (h, w) uint8, uint16 or float32. Color is weighted as OpenCV does; an alpha channel is dropped. Booleans become 0
    and 255. Floating levels are in steps of their own, see `float_levels`; NaN where a pixel is not finite.

    Raises
    ------
    ArgumentError
        When the array is not an image: wrong number of dimensions or channels, empty, of another type, or without a
        finite level.
    """
    if isinstance(image, np.ma.MaskedArray):
        raise ArgumentError("image: expected an array without a mask; set masked pixels of a floating image to NaN.")
    array = _array(image)
    if array.ndim == 3 and array.shape[2] == 1:
        array = array[:, :, 0]
    if array.dtype == np.bool_:
        array = array.astype(np.uint8) * np.uint8(255)
    if array.ndim not in (2, 3) or array.size == 0 or (array.ndim == 3 and array.shape[2] not in (2, 3, 4)):
        raise ArgumentError(f"image: expected (h, w), (h, w, 3) or (h, w, 4) pixels, got shape {array.shape}.")
    if array.dtype not in (np.uint8, np.uint16, *_FLOATS):
        raise ArgumentError(
            f"image: expected 8 or 16 bit levels without sign (uint8, uint16) or floating ones, got {array.dtype}."
        )
    if array.ndim == 3 and array.shape[2] == 2:
        array = np.ascontiguousarray(array[:, :, 0])
    if array.dtype.kind == "f":
        array = in_steps(array)
    if array.ndim == 2:
        return array
    return cv2.cvtColor(array, cv2.COLOR_BGR2GRAY if array.shape[2] == 3 else cv2.COLOR_BGRA2GRAY)


def eight_bit(grey: Image) -> Image:
    """Return `grey` (h, w) as uint8; its range is stretched where it has more than 8 bits, or uses few of them."""
    is_narrow = has_low_range(grey)
    if grey.dtype == np.uint8 and not is_narrow:
        return grey
    levels = without_gaps(grey)
    low, high = float(levels.min()), float(levels.max())
    if not high > low:
        return np.zeros(grey.shape, np.uint8)
    return cv2.convertScaleAbs(
        levels.astype(np.float32), alpha=255.0 / (high - low), beta=-255.0 * low / (high - low)
    )


def has_low_range(grey: Image) -> bool:
    """Return whether `grey` (h, w) has 8 bits and uses few of them, so that rounding between pixels matters."""
    if grey.dtype != np.uint8:
        return False
    low, high, _, _ = cv2.minMaxLoc(grey)
    return bool(high - low < _LOW_RANGE)


def _array(image: object) -> Image:
    try:
        array = np.asarray(image)
    except Exception as error:  # whatever an object's own conversion raises
        raise ArgumentError(f"image: expected an array of pixels, got {shown(image)}.") from error
    if array.dtype.kind in "biuf":
        return array
    raise ArgumentError(f"image: expected an array of pixels, got {shown(image)}.")
