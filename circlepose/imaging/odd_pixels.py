"""Dead, hot and stuck pixels, and dead rows and columns: levels that no lens can have made.

A lens blurs: what is bright in one pixel is brighter than its surroundings in the next ones, too. The sharpest lens
here has a blur of 0.4 px beside the pixel's own box; of a point it leaves 53 % of the peak in the four next pixels
together, and of a line 27 % in the next two.

Let r be the level of a pixel less the median of its 3 x 3 neighborhood, which blurred edges hardly change. Odd pixels
are groups of up to four connected ones of which

- each has a sixth of the sum of |r| over the 9 x 9 pixels around it, or more. In white noise that is a spike of 11
  standard deviations; texture has other pixels like it;
- each is above, or below, all pixels beside the group by four standard deviations of the noise;
- those beside the group, above and below, left and right, have less than a fifth of the group's |r| together.

A row, or two, are odd if at their median over the columns they are above, or below, both rows beside them by 8 times
as much as rows nearby are, and the rows beside them have less than a tenth of it. Columns alike.
"""

from __future__ import annotations

from functools import reduce

import cv2
import numpy as np

from circlepose._typing import BoolArray, Image, IntArray, RealArray
from circlepose.imaging.noise import noise_of

_MOST_IN_GROUP = 4
"""Pixels of the largest group, as a 3 x 3 median outvotes no more; exact."""
_LEAST_SHARE = 1.0 / 6.0
"""Share of a pixel in the sum of |r| around it: of four alike each has a quarter; statistical."""
_REACH_PX = 4
"""px; half a side of the square around it; empirical."""
_MOST_LEAK = 0.2
"""Share of a group's |r| in the pixels beside it. The sharpest lens leaves 0.53 by one pixel, 0.4 by four; exact."""
_LEAST_SIGMAS = 11.0
"""Noises; least |r|: a sixth of the sum in white noise; statistical."""
_LEAST_ABOVE = 4.0
"""Noises by which an odd pixel is above, or below, all pixels beside its group; statistical."""
_LEAST_COUNTS = 8.0
"""Counts; least |r|, as rounding and compression make a few; empirical."""
_FEW = 1_000
"""Pixels that stand out, up to which their surroundings are read one by one; cost."""
_MOST_ODD = 0.02
"""Share of odd pixels; more are the kind of the image, such as a halftone; empirical."""
_LINE_RATIO = 8.0
"""Departure of an odd row over that of the rows near it; statistical."""
_LINE_LEAK = 0.1
"""Share of its departure in the next rows. The sharpest lens leaves 0.13 on either side; exact."""
_WIDEST_LINE = 2
"""Neighboring rows that may be odd; empirical."""
_ACROSS = 48
"""Columns in which a row is looked at; cost."""
_AT_FIRST = 16
"""The same at first; cost."""
_LEAST_SIDE_PX = 16
"""px; shorter side from which an image has odd pixels; numerical."""
_BESIDE = ((-1, 0), (0, -1), (0, 1), (1, 0))
_AROUND = ((-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1))


def odd_lines(grey: Image) -> BoolArray | None:
    """Return (h, w) the odd rows and columns of a gray image without gaps (h, w); None where there are none."""
    if min(grey.shape) < _LEAST_SIDE_PX:
        return None
    rows, columns = (_odd_rows(each) for each in (grey, grey.T))
    if len(rows) + len(columns) == 0:
        return None
    odd = np.zeros(grey.shape, np.bool_)
    odd[rows] = True
    odd[:, columns] = True
    return odd


def odd_pixels(grey: Image, where: Image | None = None) -> BoolArray | None:
    """Return (h, w) the odd pixels of a gray image without gaps (h, w); None where there are none.

    With `where` (h, w) uint8, only those at which it is 1.
    """
    if min(grey.shape) < _LEAST_SIDE_PX:
        return None
    spikes = _spikes(grey, where)
    if len(spikes) == 0:
        return None
    odd = np.zeros(grey.shape, np.bool_)
    odd.ravel()[spikes] = True
    return odd


def _odd_rows(grey: Image) -> IntArray:
    """Return the indices of the odd rows of `grey` (h, w)."""
    widths = range(1, _WIDEST_LINE + 1)
    # Counting in few columns is faster than the medians, and says no of nearly every image.
    few = np.ascontiguousarray(grey[:, :: max(1, grey.shape[1] // _AT_FIRST)])
    if not any(_may_be_odd(few, width) for width in widths):
        return np.empty(0, np.int64)
    few = np.ascontiguousarray(grey[:, :: max(1, grey.shape[1] // _ACROSS)])
    levels = few.astype(np.float32)
    # Rows two and three away: those next to an odd row are beside one themselves.
    nearby = _departures(levels, 1)
    odd: list[IntArray] = []
    for width in widths:
        departure = nearby if width == 1 else _departures(levels, width)
        near = np.zeros(len(departure), np.float32)
        for shift in (-3, -2, width + 1, width + 2):
            beside = nearby[max(shift, 0) : len(departure) + shift]
            near[max(-shift, 0) :][: len(beside)] = np.maximum(near[max(-shift, 0) :][: len(beside)], beside)
        firsts = np.flatnonzero(departure > np.maximum(_LINE_RATIO * near, _LEAST_COUNTS)).tolist()
        if firsts:
            least = _LEAST_ABOVE * noise_of(grey)
            odd += [
                np.arange(first, first + width)
                for first in firsts
                if departure[first] > least and not _leaks(levels, first, width)
            ]
    return np.unique(np.concatenate(odd)) if odd else np.empty(0, np.int64)


def _may_be_odd(few: Image, width: int) -> bool:
    """Return whether any `width` rows of `few` (h, w) stand out in half of the columns or more."""
    high = (_heights(few, width) > _LEAST_COUNTS).view(np.uint8)
    return bool(cv2.reduce(high, 1, cv2.REDUCE_SUM, dtype=cv2.CV_32S).max() >= few.shape[1] / 2.0)


def _departures(levels: RealArray, width: int) -> RealArray:
    """Return the medians (h - width + 1) of `_heights` over the columns; 0 at the border."""
    heights = _heights(levels, width)
    middle = heights.shape[1] // 2
    return np.pad(np.partition(heights, middle, axis=1)[:, middle], 1)


def _heights(levels: Image, width: int) -> Image:
    """Return by how much `width` rows from row 1, 2, ... on are above, or below, both rows beside them; 0 if between.

    (h - width - 1, w) of `levels` (h, w).
    """
    number = len(levels) - width - 1
    before, after = levels[:number], levels[width + 1 :]
    rows = [levels[1 + i : 1 + i + number] for i in range(width)]
    # Of whole numbers OpenCV's differences are 0 at least.
    above = cv2.subtract(reduce(cv2.min, rows), cv2.max(before, after))
    below = cv2.subtract(cv2.min(before, after), reduce(cv2.max, rows))
    return np.asarray(np.maximum(cv2.max(above, below), levels.dtype.type(0)))


def _leaks(levels: RealArray, first: int, width: int) -> bool:
    """Return whether the rows beside `first` to `first` + `width` have a part of their departure, as by a lens."""
    last = len(levels) - 1
    outer, before, row, after, beyond = (
        levels[min(max(i, 0), last)] for i in (first - 2, first - 1, first, first + width, first + width + 1)
    )
    height = row - 0.5 * (before + after)
    leak = 0.5 * (before - outer + after - beyond) * np.sign(height)
    return bool(abs(float(np.median(leak))) >= _LINE_LEAK * float(np.median(np.abs(height))))


def _spikes(grey: Image, where: Image | None) -> IntArray:
    """Return the indices into the flattened image of the odd pixels, see above."""
    none = np.empty(0, np.int64)
    height, width = grey.shape
    smooth = cv2.medianBlur(grey, 3)
    departure = cv2.absdiff(grey, smooth)
    stands_out = _at_least(departure, _LEAST_COUNTS)
    if where is not None:
        stands_out &= where
    if cv2.countNonZero(stands_out) == 0:
        return none
    noise = noise_of(grey)
    if noise * _LEAST_SIGMAS > _LEAST_COUNTS:
        stands_out &= _at_least(departure, _LEAST_SIGMAS * noise)
    number = cv2.countNonZero(stands_out)
    if number == 0:
        return none
    side = 2 * _REACH_PX + 1
    if number > _FEW:
        around = cv2.boxFilter(departure, cv2.CV_32F, (side, side), normalize=False, borderType=cv2.BORDER_REPLICATE)
        stands_out &= (departure >= np.float32(_LEAST_SHARE) * around).view(np.uint8)
        if cv2.countNonZero(stands_out) == 0:
            return none
    x, y = cv2.findNonZero(stands_out).reshape(-1, 2).T.astype(np.int64)
    if number <= _FEW:
        steps = np.arange(-_REACH_PX, _REACH_PX + 1)
        around_y, around_x = (y[:, None] + steps).clip(0, height - 1), (x[:, None] + steps).clip(0, width - 1)
        around = departure.ravel().take(around_y[:, :, None] * width + around_x[:, None, :])
        is_alone = _at(departure, y, x) >= _LEAST_SHARE * around.sum(axis=(1, 2), dtype=np.float32)
        x, y = x[is_alone], y[is_alone]
    if len(x) == 0:
        return none
    index = y * width + x
    group = _groups(index, width, height)
    residual = _at(grey, y, x).astype(np.float32) - _at(smooth, y, x)
    sign = np.sign(residual)
    mass, size = np.bincount(group, np.abs(residual)), np.bincount(group)
    leak = np.zeros(len(mass))
    # The candidates themselves would move the medians of the pixels beside them.
    cleaned = grey.copy()
    cleaned[y, x] = smooth[y, x]
    is_extreme = np.ones(len(x), np.bool_)
    for i, j in _AROUND:
        beside_y, beside_x = (y + i).clip(0, height - 1), (x + j).clip(0, width - 1)
        is_beside = _places(index, beside_y * width + beside_x) < 0
        level = _at(grey, beside_y, beside_x).astype(np.float32)
        is_extreme &= ~is_beside | (sign * (_at(grey, y, x) - level) > _LEAST_ABOVE * noise)
        if (i, j) in _BESIDE:
            square = [_at(cleaned, beside_y + down, beside_x + right) for down, right in (*_AROUND, (0, 0))]
            share = np.where(is_beside, sign * (level - np.median(square, axis=0)), 0.0)
            leak += np.bincount(group, share, len(mass))
    is_odd = (size <= _MOST_IN_GROUP) & (np.abs(leak) < _MOST_LEAK * mass)
    is_odd &= np.bincount(group, ~is_extreme, len(mass)) == 0
    found = index[is_odd[group]]
    return found if len(found) <= _MOST_ODD * grey.size else none


def _at_least(image: Image, least: float) -> Image:
    """Return (h, w) uint8: 1 where `image` (h, w) is `least` or more."""
    limit = least if image.dtype.kind == "f" else min(np.ceil(least), np.iinfo(image.dtype).max)
    return np.asarray((image >= image.dtype.type(limit)).view(np.uint8))


def _at(image: Image, y: IntArray, x: IntArray) -> Image:
    """Return the levels (n,) at rows `y` and columns `x`, or those nearest in the image."""
    height, width = image.shape
    return np.asarray(image.ravel().take(y.clip(0, height - 1) * width + x.clip(0, width - 1)))


def _places(index: IntArray, wanted: IntArray) -> IntArray:
    """Return where each of `wanted` (n,) stands in the ascending `index` (m,); -1 where it does not."""
    place = np.searchsorted(index, wanted).clip(0, len(index) - 1)
    return np.where(index[place] == wanted, place, -1)


def _groups(index: IntArray, width: int, height: int) -> IntArray:
    """Return (n,) the number of the connected group of each pixel of the ascending `index` (n,)."""
    group = np.arange(len(index))
    y, x = np.divmod(index, width)
    beside = [_places(index, (y + i).clip(0, height - 1) * width + (x + j).clip(0, width - 1)) for i, j in _AROUND]
    # Groups longer than this are too large in any case.
    for _ in range(2 * _MOST_IN_GROUP):
        for place in beside:
            group = np.where(place >= 0, np.minimum(group, group[place]), group)
    return group
