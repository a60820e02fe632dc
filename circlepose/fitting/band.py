"""The pixels around predicted rims, with their rays: many rims at once, padded to the longest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from circlepose._typing import BoolArray, FloatArray, Image, IntArray, RealArray
from circlepose.camera import Camera
from circlepose.conic import Ellipse

_BEYOND_PX = np.arange(1.0, 12.5, 1.5)
"""What is looked at beyond a band, from its border."""
_PER_PX, _ANGLES = 3.2, (16, 640)
"""Places along each ellipse, for a px of its major axis, and least and most."""


@dataclass(frozen=True, slots=True, eq=False)
class Bands:
    """Pixels of the raw image around m rims, up to k each; those that pad a row have weight 0."""

    levels: RealArray
    """(m, k)"""
    weight: RealArray
    """(m, k) 1, or 0 for a pixel that does not count"""
    rays: RealArray
    """(m, 3, 3, k) unit rays, and beside each its derivatives to the pixel's x and y"""
    pixels: FloatArray
    """(m, k, 2)"""

    def __getitem__(self, which: BoolArray | IntArray) -> Bands:
        """Return the bands of the rims `which` (m,)."""
        return Bands(
            self.levels[which],
            self.weight[which],
            self.rays[which],
            self.pixels[which],
        )

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
    """Pixels farther from m rims than their bands, k each on both sides: the first index is 0 inside, 1 outside."""

    levels: RealArray
    """(2, m, k)"""
    weight: RealArray
    """(2, m, k) 1, or less for a pixel that others of the same place stand beside"""
    rays: RealArray
    """(2, m, 3, k) unit length"""


def bands_around(grey: Image, camera: Camera, rims: Sequence[Ellipse], reach_px: FloatArray) -> Bands:
    """Gather the pixels of `grey` (h, w) within about `reach_px` (m,) of m rims, given by their image ellipses."""
    around = [pixels_around(each, reach, grey.shape) for each, reach in zip(rims, reach_px.tolist(), strict=True)]
    x, y, weight = _joined(around, grey.shape)
    pixels = np.stack([x, y], axis=-1).astype(np.float64)
    rays, jacobians = camera.rays_with_jacobian(pixels)
    unseen = ~(np.isfinite(rays).all(axis=-1) & np.isfinite(jacobians).all(axis=(-2, -1)))
    if unseen.any():
        # Beyond the lens model; any ray that is finite will do.
        weight[unseen] = 0.0
        rays[unseen], jacobians[unseen] = np.array([0.0, 0.0, 1.0]), np.eye(3)[:, :2]
    both = np.empty((len(x), 3, 3, x.shape[1]), np.float32)
    both[:, :, 0] = np.moveaxis(rays, -1, 1)
    both[:, :, 1:] = np.moveaxis(jacobians, 1, -1)
    return Bands(grey[y, x].astype(np.float32), weight.astype(np.float32), both, pixels)


def beyond_bands(
    grey: Image, camera: Camera, rims: Sequence[Ellipse], reach_px: FloatArray, limits: tuple[float, float]
) -> Beyond:
    """Sample pixels along ellipses farther in and out than `reach_px` (m,); those at the `limits` do not count."""
    every = Ellipse.batch(rims)
    axes = np.stack([every.semi_major, every.semi_minor], axis=-1)
    number = int(np.clip(_PER_PX * axes.max(), *_ANGLES))
    off = reach_px[:, None] + _BEYOND_PX
    inside, outside = (
        _sampled(grey, camera, every, axes[:, :, None] + sign * off[:, None], number, limits) for sign in (-1.0, 1.0)
    )
    return Beyond(*(np.stack(pair) for pair in zip(inside, outside, strict=True)))


def _sampled(
    grey: Image, camera: Camera, rims: Ellipse, axes: FloatArray, number: int, limits: tuple[float, float]
) -> tuple[RealArray, RealArray, RealArray]:
    """Return levels (m, k), weight (m, k) and rays (m, 3, k) of pixels at a `number` of places along each ellipse.

    The ellipses around the centres of the `rims` have other `axes` (m, 2, rings), negative where there is none.
    """
    angle = np.linspace(0.0, 2.0 * np.pi, number, endpoint=False, dtype=np.float32)
    cos, sin = (f(rims.angle)[:, None, None].astype(np.float32) for f in (np.cos, np.sin))
    axes = axes.astype(np.float32)
    along, across = axes[:, 0, :, None] * np.cos(angle), axes[:, 1, :, None] * np.sin(angle)
    m = len(axes)
    x = np.rint(rims.center[:, 0, None, None] + cos * along - sin * across).reshape(m, -1)
    y = np.rint(rims.center[:, 1, None, None] + sin * along + cos * across).reshape(m, -1)
    height, width = grey.shape
    # Where more places than pixels are on an ellipse, each counts for less.
    share = np.clip(np.pi * axes.sum(axis=1) * (_BEYOND_PX[1] - _BEYOND_PX[0]) / number, 0.0, 1.0)
    weight = np.repeat(np.where(axes[:, 1] > 0.0, share, 0.0), number, axis=1).astype(np.float32)
    weight *= (x >= 0.0) & (x < width) & (y >= 0.0) & (y < height)
    x, y = np.clip(x, 0.0, width - 1.0), np.clip(y, 0.0, height - 1.0)
    levels = grey[y.astype(np.intp), x.astype(np.intp)].astype(np.float32)
    rays = np.moveaxis(camera.rays(np.stack([x, y], axis=-1)), -1, 1).astype(np.float32)
    unseen = ~np.isfinite(rays[:, 2])
    weight[unseen | (levels <= limits[0]) | (levels >= limits[1])] = 0.0
    return levels, weight, np.ascontiguousarray(np.where(unseen[:, None], np.float32(0.5), rays))


def _joined(
    found: Sequence[tuple[IntArray, IntArray]], shape: tuple[int, ...]
) -> tuple[IntArray, IntArray, FloatArray]:
    """Return columns, rows and weights (m, k) of pixels that were found for each of m rims."""
    longest = max(1, *(len(x) for x, _ in found))
    x, y = np.zeros((2, len(found), longest), dtype=np.int64)
    weight = np.zeros((len(found), longest))
    middle = (shape[1] // 2, shape[0] // 2)
    for i, (columns, rows) in enumerate(found):
        # What pads a row is a pixel of the same rim, or else the middle one, so that all numbers are finite.
        x[i], y[i] = (columns[0], rows[0]) if len(columns) else middle
        x[i, : len(columns)], y[i, : len(rows)] = columns, rows
        weight[i, : len(columns)] = 1.0
    return x, y, weight


def pixels_around(ellipse: Ellipse, reach_px: float, shape: tuple[int, ...]) -> tuple[IntArray, IntArray]:
    """Return columns and rows (n,) of the pixels between the ellipses with axes longer and shorter by `reach_px`.

    Row by row, as two runs where the inner ellipse is crossed, so that the work is that of the band alone.
    """
    a, b, angle = float(ellipse.semi_major), float(ellipse.semi_minor), float(ellipse.angle)
    center_x, center_y = ellipse.center
    height, width = shape
    half_height = np.hypot((a + reach_px) * np.sin(angle), (b + reach_px) * np.cos(angle))
    first = max(int(np.ceil(center_y - half_height)), 0)
    rows = np.arange(first, max(min(int(np.floor(center_y + half_height)) + 1, height), first))
    left, right = _crossings(rows - center_y, a + reach_px, b + reach_px, angle)
    start, end = np.ceil(center_x + left), np.floor(center_x + right) + 1.0
    hole_start = hole_end = end
    if b > reach_px:
        left, right = _crossings(rows - center_y, a - reach_px, b - reach_px, angle)
        crossed = np.isfinite(left)
        hole_start = np.where(crossed, np.ceil(center_x + left), end)
        hole_end = np.where(crossed, np.floor(center_x + right) + 1.0, end)
    runs = np.stack([[start, hole_start], [hole_end, end]], axis=1).reshape(2, -1)
    starts, ends = np.clip(np.nan_to_num(runs), 0, width).astype(np.int64)
    lengths = np.maximum(ends - starts, 0)
    along = np.arange(lengths.sum()) - np.repeat(np.cumsum(lengths) - lengths, lengths)
    return np.repeat(starts, lengths) + along, np.repeat(np.concatenate([rows, rows]), lengths)


def _crossings(dy: FloatArray, a: float, b: float, angle: float) -> FloatArray:
    """Return x (2, n), left and right, where rows at `dy` (n,) from the centre cross an ellipse; NaN where not."""
    cos, sin = np.cos(angle), np.sin(angle)
    xx, xy, yy = (cos / a) ** 2 + (sin / b) ** 2, cos * sin * (a**-2.0 - b**-2.0), (sin / a) ** 2 + (cos / b) ** 2
    under_root = (xy * dy) ** 2 - xx * (yy * dy**2 - 1.0)
    root = np.sqrt(np.where(under_root >= 0.0, under_root, np.nan))
    return np.stack([-xy * dy - root, -xy * dy + root]) / xx
