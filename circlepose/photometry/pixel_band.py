"""The pixels around predicted rims, with their rays: many rims at once, padded to the longest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from circlepose._typing import BoolArray, FloatArray, Image, IntArray, RealArray
from circlepose.camera.camera import Camera
from circlepose.geometry.ellipse import Ellipse, unit_circle

_APART_PX = 2.4
_BEYOND_PX = 1.0 + _APART_PX * np.arange(8).reshape(2, 4)
"""What is looked at beyond a band, from its border: ellipses so far apart, in two rings."""
_PER_PX, _ANGLES = 2.7, (16, 540)
"""Places along each ellipse, for a px of its major axis, and least and most."""


@dataclass(frozen=True, slots=True, eq=False)
class Bands:
    """Pixels of the raw image around m rims, up to k each; those that pad a row have weight 0."""

    levels: RealArray
    """(m, k)"""
    weight: RealArray
    """(m, k) 1, or 0 for a pixel that does not count"""
    rays: RealArray
    """(m, 3, 3, k) rays of any length, and beside each its derivatives to the pixel's x and y"""
    pixels: FloatArray
    """(m, k, 2)"""

    def less(self, light: RealArray) -> Bands:
        """Return the same pixels with `light` (m, k) taken off their levels."""
        return replace(self, levels=self.levels - light)

    def thinned(self, step: int) -> Bands:
        """Return every so many-th of the pixels."""
        levels, weight, rays = (
            np.ascontiguousarray(each[..., ::step]) for each in (self.levels, self.weight, self.rays)
        )
        return Bands(levels, weight, rays, self.pixels[:, ::step])

    def weighted(self, weight: RealArray) -> Bands:
        """Return the same pixels with another `weight` (m, k)."""
        return replace(self, weight=weight)


@dataclass(frozen=True, slots=True, eq=False)
class Beyond:
    """Squares of four pixels farther from m rims than their bands, k each.

    The first index is 0 inside and 1 outside in a first ring, and so on in rings farther off.
    """

    levels: RealArray
    """(2 r, m, k) mean of the four"""
    weight: RealArray
    """(2 r, m, k) 4, or less for a square that others of the same place stand beside"""
    rays: RealArray
    """(2 r, m, 3, k) of any length, the lens taken as linear from the rim on"""


def bands_around(grey: Image, camera: Camera, rims: Sequence[Ellipse], reach_px: FloatArray) -> Bands:
    """Gather the pixels of `grey` (h, w) within about `reach_px` (m,) of m rims, given by their image ellipses."""
    x, y, weight = _pixels_around(Ellipse.batch(rims), reach_px, grey.shape)
    pixels = np.stack([x, y], axis=-1).astype(np.float64)
    sights = camera.sights(pixels)
    rays = np.empty((len(x), 3, 3, x.shape[1]), np.float32)
    rays[...] = np.moveaxis(sights, 2, 0)
    unseen = ~np.isfinite(rays).all(axis=(1, 2))
    if unseen.any():
        # Beyond the lens model; any ray that is finite will do.
        weight[unseen] = 0.0
        np.moveaxis(rays, -1, 1)[unseen] = np.eye(3)[:, [2, 0, 1]]
    levels = grey[y, x].astype(np.float32)
    if grey.dtype.kind == "f":
        weight[_made_zero_gaps(levels)] = 0.0
    return Bands(levels, weight, rays, pixels)


def _made_zero_gaps(levels: RealArray) -> BoolArray:
    """Make `levels` (...) 0 where the image has none (NaN), and return where that is."""
    gaps = np.isnan(levels)
    levels[gaps] = 0.0
    return np.asarray(gaps)


def beyond_bands(
    grey: Image, camera: Camera, rims: Sequence[Ellipse], reach_px: FloatArray, limits: tuple[float, float]
) -> Beyond:
    """Sample squares of pixels along ellipses farther in and out than `reach_px` (m,).

    A square with a pixel at the `limits` does not count.
    """
    every = Ellipse.batch(rims)
    axes = np.stack([every.semi_major, every.semi_minor], axis=-1)[:, None]
    off = reach_px[:, None] + _BEYOND_PX[:, None]
    # (ring, inside or outside, m, ellipse, axis)
    beyond = axes + np.stack([-off, off], axis=1)[..., None]
    beyond = beyond.reshape(-1, *beyond.shape[2:])
    number = int(np.clip(_PER_PX * axes.max(), *_ANGLES))
    rim_x, rim_y = _on_ellipses(every, axes, number)
    # Of each square of four pixels the upper left one, and whether it lies in the image.
    x, y = (np.rint(each - 0.5) for each in _on_ellipses(every, beyond, number))
    height, width = grey.shape
    inside = (x >= 0.0) & (x < width - 1.0) & (y >= 0.0) & (y < height - 1.0)
    np.clip(x, 0.0, max(width - 2.0, 0.0), out=x)
    np.clip(y, 0.0, max(height - 2.0, 0.0), out=y)
    first, flat = y.astype(np.intp) * width + x.astype(np.intp), np.ascontiguousarray(grey).ravel()
    right, below = int(width > 1), width * int(height > 1)
    four = [flat.take(first + beside) for beside in (0, right, below, below + right)]
    lowest, highest = reduce(np.minimum, four), reduce(np.maximum, four)
    levels = 0.25 * sum(each.astype(np.float32) for each in four)
    # A square counts for its pixels, but where more squares than fit are on an ellipse each for less.
    area = np.pi * beyond.sum(axis=-1) * _APART_PX / number
    weight = np.where(beyond[..., 1] > 0.0, np.minimum(area, 4.0), 0.0).astype(np.float32)[..., None] * inside
    sights = camera.sights(np.stack([rim_x, rim_y], axis=-1)).astype(np.float32)
    unseen = ~np.isfinite(sights).all(axis=(0, 1))
    sights[:, :, unseen] = 0.5
    weight[(lowest <= limits[0]) | (highest >= limits[1]) | unseen] = 0.0
    if grey.dtype.kind == "f":
        weight[_made_zero_gaps(levels)] = 0.0
    dx, dy = x + 0.5 - rim_x, y + 0.5 - rim_y
    rays = np.stack([each[0] + each[1] * dx + each[2] * dy for each in sights], axis=2)
    return Beyond(*(each.reshape(*each.shape[:-2], -1) for each in (levels, weight, rays)))


def _on_ellipses(rims: Ellipse, axes: FloatArray, number: int) -> tuple[RealArray, RealArray]:
    """Return x and y (..., m, r, number) of places along ellipses about the centres of m rims, r with each.

    The ellipses, turned as the rim, have other `axes` (..., m, r, 2).
    """
    unit_x, unit_y = unit_circle(number).astype(np.float32)
    lengths = axes.astype(np.float32)[..., None, :]
    along, across = lengths[..., 0] * unit_x, lengths[..., 1] * unit_y
    cos, sin, x, y = (
        each.astype(np.float32)[:, None, None] for each in (np.cos(rims.angle), np.sin(rims.angle), *rims.center.T)
    )
    return x + (cos * along - sin * across), y + (sin * along + cos * across)


def _pixels_around(
    rims: Ellipse, reach_px: FloatArray, shape: tuple[int, ...]
) -> tuple[IntArray, IntArray, RealArray]:
    """Return columns, rows and weights (m, k) of the pixels between ellipses longer and shorter than the m `rims`.

    By `reach_px` (m,). Row by row, as two runs where the inner ellipse is crossed, so that the work is that of the
    bands alone.
    """
    height, width = shape
    a, b = rims.semi_major, rims.semi_minor
    half = np.hypot((a + reach_px) * np.sin(rims.angle), (b + reach_px) * np.cos(rims.angle))
    first = np.clip(np.ceil(rims.center[:, 1] - half), 0, height).astype(np.int64)
    last = np.clip(np.floor(rims.center[:, 1] + half) + 1, first, height).astype(np.int64)
    rows, owner = _runs(first, last - first), np.repeat(np.arange(len(rims)), last - first)
    x = rims.center[owner, 0]
    off = np.array([[1.0], [-1.0]]) * reach_px
    # Both (outer or inner, n); NaN where the inner ellipse is not crossed.
    left, right = _crossings(
        rows - rims.center[owner, 1], (a + off)[:, owner], (b + off)[:, owner], rims.angle[owner]
    )
    (start, hole_start), (end, hole_end) = np.ceil(x + left), np.floor(x + right) + 1.0
    crossed = np.isfinite(hole_start)
    hole_start, hole_end = np.where(crossed, [hole_start, hole_end], end)
    # Neither sees NaN, of rows that are not crossed.
    starts, ends = np.fmin(np.fmax([[start, hole_end], [hole_start, end]], 0.0), width).astype(np.int64)
    lengths = np.maximum(ends - starts, 0)
    # Of each row both runs, one after the other.
    each = lengths.T.ravel()
    columns, rows = _runs(starts.T.ravel(), each), np.repeat(np.repeat(rows, 2), each)
    number = np.bincount(owner, lengths.sum(axis=0), len(rims)).astype(np.int64)
    within = np.arange(int(number.max(initial=1))) < number[:, None]
    # What pads a row is a pixel of the same rim, or else the middle one, so that all numbers are finite.
    x, y = np.empty((2, *within.shape), np.int64)
    own = number > 0
    x[:], y[:] = width // 2, height // 2
    if not within.all():
        first = (np.cumsum(number) - number)[own]
        x[own], y[own] = columns[first, None], rows[first, None]
    x[within], y[within] = columns, rows
    return x, y, within.astype(np.float32)


def _runs(starts: IntArray, lengths: IntArray) -> IntArray:
    """Return the numbers (n,) of runs of `lengths` that count from `starts`, one after the other."""
    ends = np.cumsum(lengths)
    return np.arange(int(lengths.sum())) + np.repeat(starts - (ends - lengths), lengths)


def _crossings(dy: FloatArray, a: FloatArray, b: FloatArray, angle: FloatArray) -> FloatArray:
    """Return x (2, ..., n), left and right, where rows at `dy` (n,) from the centres cross ellipses; NaN where not.

    Of axes `a` and `b` (..., n) and `angle` (n,).
    """
    cos, sin = np.cos(angle), np.sin(angle)
    a, b = np.maximum(a, 0.0), np.maximum(b, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        aa, bb = 1.0 / (a * a), 1.0 / (b * b)
        xx, xy, yy = cos * cos * aa + sin * sin * bb, cos * sin * (aa - bb), sin * sin * aa + cos * cos * bb
        under_root = (xy * dy) ** 2 - xx * (yy * dy**2 - 1.0)
        root = np.sqrt(np.where(under_root >= 0.0, under_root, np.nan))
        return np.stack([-xy * dy - root, -xy * dy + root]) / xx
