"""The pixels around predicted rims, with their rays: many rims at once, padded to the longest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from circlepose._typing import BoolArray, FloatArray, Image, IntArray, RealArray
from circlepose.camera import Camera
from circlepose.conic import Ellipse


@dataclass(frozen=True, slots=True, eq=False)
class Bands:
    """Pixels of the raw image around m rims, up to k each; those that pad a row have weight 0."""

    levels: RealArray
    """(m, k)"""
    weight: RealArray
    """(m, k) 1, or 0 for a pixel that does not count"""
    rays: RealArray
    """(3, m, k) unit length"""
    jacobians: RealArray
    """(3, 2, m, k) d ray / d pixel"""
    pixels: FloatArray
    """(m, k, 2)"""

    def __getitem__(self, which: BoolArray | IntArray) -> Bands:
        """Return the bands of the rims `which` (m,)."""
        return Bands(
            self.levels[which],
            self.weight[which],
            self.rays[:, which],
            self.jacobians[:, :, which],
            self.pixels[which],
        )

    def less(self, light: RealArray) -> Bands:
        """Return the same pixels with `light` (m, k) taken off their levels."""
        return replace(self, levels=self.levels - light)

    def thinned(self, step: int) -> Bands:
        """Return every so many-th of the pixels."""
        return Bands(
            self.levels[:, ::step],
            self.weight[:, ::step],
            self.rays[:, :, ::step],
            self.jacobians[:, :, :, ::step],
            self.pixels[:, ::step],
        )

    def weighted(self, weight: RealArray) -> Bands:
        """Return the same pixels with another `weight` (m, k)."""
        return replace(self, weight=weight)


def bands_around(grey: Image, camera: Camera, rims: Sequence[Ellipse], reach_px: FloatArray) -> Bands:
    """Gather the pixels of `grey` (h, w) within about `reach_px` (m,) of m rims, given by their image ellipses."""
    found = [pixels_around(ellipse, float(reach), grey.shape) for ellipse, reach in zip(rims, reach_px, strict=True)]
    longest = max(1, *(len(x) for x, _ in found))
    x, y = np.zeros((2, len(found), longest), dtype=np.int64)
    weight = np.zeros((len(found), longest))
    for i, (columns, rows) in enumerate(found):
        # What pads a row is a pixel of the same rim, so that all numbers stay finite.
        x[i], y[i] = (columns[0], rows[0]) if len(columns) else (0, 0)
        x[i, : len(columns)], y[i, : len(rows)] = columns, rows
        weight[i, : len(columns)] = 1.0
    pixels = np.stack([x, y], axis=-1).astype(np.float64)
    rays, jacobians = camera.rays_with_jacobian(pixels)
    unseen = ~(np.isfinite(rays).all(axis=-1) & np.isfinite(jacobians).all(axis=(-2, -1)))
    if unseen.any():
        # Beyond the lens model; any ray that is finite will do.
        weight[unseen] = 0.0
        rays[unseen], jacobians[unseen] = np.array([0.0, 0.0, 1.0]), np.eye(3)[:, :2]
    return Bands(
        levels=grey[y, x].astype(np.float32),
        weight=weight.astype(np.float32),
        rays=np.ascontiguousarray(np.moveaxis(rays, -1, 0), dtype=np.float32),
        jacobians=np.ascontiguousarray(np.moveaxis(jacobians, (-2, -1), (0, 1)), dtype=np.float32),
        pixels=pixels,
    )


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
