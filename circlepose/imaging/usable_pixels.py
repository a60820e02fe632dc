"""A gray image -> its levels where they were measured, and an image without gaps for detection.

Odd pixels are left out, see `odd_pixels`. Of an image whose pixels are no plain grid, see `sampling_pattern`, the
part that is one is kept at its place, and what is between is interpolated for detection alone:

- a mosaic: the color plane with the strongest edges over its noise, or both green ones;
- interlaced: the even rows.

Repeated pixels all stay: their positions are off by half a pixel to either side, which cancels around a rim, and are
interpolated for detection.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from circlepose._typing import BoolArray, Image, RealArray
from circlepose.geometry.ellipse import Ellipse
from circlepose.imaging.float_levels import filled, without_gaps
from circlepose.imaging.noise import noise_of
from circlepose.imaging.odd_pixels import odd_lines, odd_pixels
from circlepose.imaging.sampling_pattern import SamplingPattern, sampling_pattern
from circlepose.imaging.stretch import has_low_range

_ALIKE_SIGMAS = 3.0
"""Noises up to which two planes of a mosaic are of one color, by their median difference; statistical."""
_EDGE_SIGMAS = 6.0
"""Noises of a gradient from which it is an edge; statistical."""
_NEAR_PX = 24
"""px; distance from a rim up to which its fit reads levels, but for strong blur; numerical."""
_ACROSS = 128
"""Rows and columns, about, from which the range of an image is estimated; cost."""
_CORNERS = 48
"""Corners of the polygon that is drawn for a rim."""
_TENT = np.array([0.5, 1.0, 0.5], np.float32)
"""Linear interpolation between every second pixel."""


@dataclass(frozen=True, slots=True, eq=False)
class UsablePixels:
    """The levels of one image."""

    own: Image
    """(h, w) NaN where a pixel is not to be used"""
    whole: Image
    """(h, w) without gaps"""
    full_scale: int | None = None
    """the highest level of the type in which integer levels were stored; None where `own` is of that type"""
    remark: str = ""
    """what is special of the pixels, in words"""
    is_partial: bool = False
    """whether the pixels between those of `own` have other levels, as of another color or time"""


def usable_pixels(levels: Image) -> UsablePixels:
    """Return the usable pixels of gray `levels` (h, w), NaN where a pixel has none.

    Of ordinary images of 8 bits odd pixels are not sought here, but near rims, see `without_odd_near`.
    """
    whole = without_gaps(levels)
    pattern = sampling_pattern(whole)
    if pattern is not None:
        return _of_pattern(levels, whole, pattern)
    pixels = _without(UsablePixels(levels, whole), odd_lines(whole))
    if levels.dtype != np.uint8 or _is_nearly_flat(whole):
        pixels = _without(pixels, odd_pixels(pixels.whole))
    return pixels


def without_odd_near(pixels: UsablePixels, rims: Sequence[Ellipse]) -> UsablePixels:
    """Return the `pixels` without the odd ones of 8 bits near `rims`, px."""
    if pixels.whole.dtype != np.uint8 or pixels.is_partial or not rims:
        return pixels
    height, width = pixels.whole.shape
    outlines = np.rint(Ellipse.batch(rims).points(_CORNERS)).clip(
        -4.0 * _NEAR_PX, max(height, width) + 4.0 * _NEAR_PX
    )
    (left, top), (right, bottom) = outlines.min(axis=(0, 1)) - _NEAR_PX, outlines.max(axis=(0, 1)) + _NEAR_PX
    box = slice(max(int(top), 0), max(int(bottom) + 1, 0)), slice(max(int(left), 0), max(int(right) + 1, 0))
    near = np.zeros(pixels.whole[box].shape, np.uint8)
    if near.size == 0:
        return pixels
    corner = np.array([box[1].start, box[0].start])
    cv2.polylines(near, list((outlines - corner).astype(np.int32)), True, 1, 2 * _NEAR_PX)
    found = odd_pixels(np.ascontiguousarray(pixels.whole[box]), near)
    if found is None:
        return pixels
    odd = np.zeros(pixels.whole.shape, np.bool_)
    odd[box] = found
    return _without(pixels, odd)


def _without(pixels: UsablePixels, odd: BoolArray | None) -> UsablePixels:
    if odd is None:
        return pixels
    own = pixels.own.astype(np.float32)
    own[odd] = np.nan
    return replace(pixels, own=own, whole=filled(pixels.whole, odd), full_scale=_full_scale(pixels))


def _full_scale(pixels: UsablePixels) -> int | None:
    dtype = pixels.own.dtype
    return pixels.full_scale if dtype.kind == "f" else int(np.iinfo(dtype).max)


def _is_nearly_flat(grey: Image) -> bool:
    """Return whether all but single pixels of 8 bits `grey` (h, w) use few levels."""
    step = max(8, int(np.sqrt(grey.size)) // _ACROSS)
    some = np.ascontiguousarray(grey[::step, ::step]).ravel()
    # A disc of half a percent of the image is no single pixel.
    last = len(some) // 200
    some.partition([last, len(some) - 1 - last])
    low, high = some[last], some[-1 - last]
    return has_low_range(np.array([[low, high]], np.uint8)) and not has_low_range(grey)


def _of_pattern(levels: Image, whole: Image, pattern: SamplingPattern) -> UsablePixels:
    if pattern.kind == "repeated":
        return _of_repeated(levels, whole, pattern)
    kept = np.zeros(whole.shape, np.bool_)
    if pattern.kind == "interlaced":
        kept[::2] = True
        remark = (
            f"the image is interlaced: odd rows are {abs(pattern.shift_px)} px apart from even ones; "
            "the even rows alone were measured"
        )
    else:
        planes = _strongest_planes(whole)
        for row, column in planes:
            kept[row::2, column::2] = True
        remark = (
            "the image is a raw color mosaic (Bayer), one color a pixel; "
            f"{len(planes)} of the 4 pixels of each square, of one color, were measured"
        )
    own = levels.astype(np.float32)
    own[~kept] = np.nan
    return UsablePixels(own, _interpolated(whole, kept), _full_scale(UsablePixels(levels, whole)), remark, True)


def _strongest_planes(mosaic: Image) -> tuple[tuple[int, int], ...]:
    """Return the first row and column of the plane with the strongest edges, or of both that have its color."""
    places = ((0, 0), (0, 1), (1, 0), (1, 1))
    rows, columns = (side // 2 for side in mosaic.shape)
    planes = {at: mosaic[at[0] :: 2, at[1] :: 2][:rows, :columns].astype(np.float32) for at in places}
    noises = {at: noise_of(plane) for at, plane in planes.items()}
    strength = {at: _edge_strength(plane, noises[at]) for at, plane in planes.items()}
    best = max(places, key=lambda at: strength[at])
    # Two planes of one color stand at a diagonal.
    for pair in (((0, 0), (1, 1)), ((0, 1), (1, 0))):
        apart = float(np.median(np.abs(planes[pair[0]] - planes[pair[1]])))
        alike = apart < _ALIKE_SIGMAS * max(noises[at] for at in pair)
        if alike and strength[pair[0]] + strength[pair[1]] >= strength[best]:
            return pair
    return (best,)


def _edge_strength(plane: RealArray, noise: float) -> float:
    """Return the sum of squared gradients of `plane` (h, w) at edges, in noises."""
    across, down = (cv2.Sobel(plane, cv2.CV_32F, *order) for order in ((1, 0), (0, 1)))
    # A Sobel gradient has the variance of 12 pixels.
    square = (across * across + down * down) / np.float32(12.0 * noise * noise)
    return float(square[square > _EDGE_SIGMAS**2].sum())


def _interpolated(levels: Image, kept: BoolArray) -> Image:
    """Return `levels` (h, w) with those that are not `kept` interpolated linearly from those that are."""
    weight = kept.astype(np.float32)
    sums, weights = (
        cv2.sepFilter2D(each, cv2.CV_32F, _TENT, _TENT, borderType=cv2.BORDER_CONSTANT)
        for each in (np.where(kept, levels, 0).astype(np.float32), weight)
    )
    between = sums / np.maximum(weights, 1e-6)
    if levels.dtype.kind == "u":
        between = np.rint(between)
    return np.where(kept, levels, between.astype(levels.dtype))


def _of_repeated(levels: Image, whole: Image, pattern: SamplingPattern) -> UsablePixels:
    across, down = pattern.repeats
    smooth = cv2.sepFilter2D(whole, -1, _mean_of(across), _mean_of(down), borderType=cv2.BORDER_REFLECT)
    remark = (
        f"each pixel is there {_times(across)} along x and {_times(down)} along y, as in an image enlarged without "
        "interpolation; the calibration must be of the enlarged image"
    )
    return UsablePixels(levels, smooth, None, remark)


def _mean_of(repeats: int) -> RealArray:
    """Return the symmetric kernel that interpolates linearly between pixels that are there `repeats` times."""
    box = np.full(repeats, 1.0 / repeats, np.float32)
    return box if repeats % 2 else np.asarray(np.convolve(box, [0.5, 0.5]), np.float32)


def _times(number: int) -> str:
    return {1: "once", 2: "twice"}.get(number, f"{number} times")
