"""Any image -> a gray one."""

from __future__ import annotations

import cv2
import numpy as np

from circlepose._arguments import shown
from circlepose._typing import Image
from circlepose.errors import ArgumentError
from circlepose.imaging.float_levels import filled, in_steps

_FLOATS = (np.float16, np.float32, np.float64)
GRAY_WEIGHTS = (0.114, 0.587, 0.299)
"""Of blue, green and red in the gray image, as OpenCV has them."""


def to_grey(image: Image) -> Image:
    """Return an image as gray levels of its own depth.

    Parameters
    ----------
    image
        As of `to_channels`.

    Returns
    -------
    (h, w) uint8, uint16 or float32. Color is weighted as OpenCV does; an alpha channel is dropped.

    Raises
    ------
    ArgumentError
        As `to_channels`.
    """
    return gray_of(to_channels(image))


def gray_of(channels: Image) -> Image:
    """Return the gray levels (h, w) of what `to_channels` returns, in its depth."""
    if channels.ndim == 2:
        return channels
    if channels.shape[2] == 2:
        return np.ascontiguousarray(channels[:, :, 0])
    return cv2.cvtColor(channels, cv2.COLOR_BGR2GRAY if channels.shape[2] == 3 else cv2.COLOR_BGRA2GRAY)


def to_channels(image: Image) -> Image:
    """Return the channels of an image, of its own depth.

    Parameters
    ----------
    image
        (h, w), (h, w, 3) BGR, (h, w, 4) BGRA or (h, w, 2) gray and alpha, of uint8, uint16, floating levels or
        booleans.

    Returns
    -------
    (h, w) or (h, w, c) uint8, uint16 or float32. Booleans become 0 and 255. Floating levels are in steps of their
    own, see `float_levels`; NaN where a pixel is not finite. Where alpha is 0 in a part of the image the colors mean
    nothing: they are those of the nearest pixel that is not fully transparent.

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
    if array.ndim == 2 or array.shape[2] == 3:
        return in_steps(array) if array.dtype.kind == "f" else array
    alpha = np.ascontiguousarray(array[:, :, -1])
    visible = np.count_nonzero(alpha)
    if array.dtype.kind == "f":
        # Alpha has steps of its own.
        colors = in_steps(array)[:, :, :3] if array.shape[2] == 4 else in_steps(array[:, :, :1])
        own = in_steps(alpha) if np.isfinite(alpha).any() else np.zeros(alpha.shape, np.float32)
        array = np.dstack([colors, own])
    if 0 < visible < alpha.size:
        array = array.copy()
        array[:, :, :-1] = filled(array[:, :, :-1], alpha == 0)
    return array


def _array(image: object) -> Image:
    try:
        array = np.asarray(image)
    except Exception as error:  # whatever an object's own conversion raises
        raise ArgumentError(f"image: expected an array of pixels, got {shown(image)}.") from error
    if array.dtype.kind in "biuf":
        return array
    raise ArgumentError(f"image: expected an array of pixels, got {shown(image)}.")
