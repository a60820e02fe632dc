"""The pixels around predicted rims, with their rays. Many rims at once, padded to the longest.

A band holds the pixels between two ellipses whose semi-axes (px) are those of the rim's image, plus and minus the
half-width. Outside of it, squares of four pixels are sampled along more ellipses of this kind. The ray of a pixel
comes from the full lens model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from circlepose._typing import BoolArray, FloatArray, Image, IntArray, RealArray
from circlepose.camera.camera import Camera
from circlepose.geometry.ellipse import Ellipse, unit_circle
from circlepose.photometry.options import DEFAULT, PhotometryOptions


@dataclass(frozen=True, slots=True, eq=False)
class Bands:
    """Pixels of the raw image around m rims, up to k each, padded with pixels of weight 0."""

    levels: RealArray
    """(m, k)"""
    weight: RealArray
    """(m, k) 1, or 0 for a pixel that is not used"""
    rays: RealArray
    """(m, 3, 3, k) ray of any length and its derivatives to the pixel's x and y (second index: component)"""
    pixels: FloatArray
    """(m, k, 2) px"""

    def less(self, intensity: RealArray) -> Bands:
        """Return the same pixels with `intensity` (m, k) subtracted from their levels."""
        return replace(self, levels=self.levels - intensity)

    def thinned(self, step: int) -> Bands:
        """Return every `step`-th pixel."""
        levels, weight, rays = (
            np.ascontiguousarray(each[..., ::step]) for each in (self.levels, self.weight, self.rays)
        )
        return Bands(levels, weight, rays, self.pixels[:, ::step])

    def weighted(self, weight: RealArray) -> Bands:
        """Return the same pixels with another `weight` (m, k)."""
        return replace(self, weight=weight)


@dataclass(frozen=True, slots=True, eq=False)
class OuterSamples:
    """Squares of four pixels inside and outside the bands of m rims, k each.

    The first index is 0 inside and 1 outside in the first ring, 2 and 3 in the second ring, and so on.
    """

    levels: RealArray
    """(2 r, m, k) mean of the four"""
    weight: RealArray
    """(2 r, m, k) number of pixels: 4, or less where squares overlap"""
    rays: RealArray
    """(2 r, m, 3, k) of any length, with the lens linearized at the rim"""


def bands_around(grey: Image, camera: Camera, rims: Sequence[Ellipse], half_width_px: FloatArray) -> Bands:
    """Return the pixels around m rims.

    Parameters
    ----------
    grey
        (h, w) levels.
    camera
        Camera with its lens.
    rims
        m ellipses in the raw image, px.
    half_width_px
        (m,) half-width of each band, px.
    """
    x, y, weight = _pixels_around(Ellipse.batch(rims), half_width_px, grey.shape)
    pixels = np.stack([x, y], axis=-1).astype(np.float64)
    sights = camera.sights(pixels)
    rays = np.empty((len(x), 3, 3, x.shape[1]), np.float32)
    rays[...] = np.moveaxis(sights, 2, 0)
    unseen = ~np.isfinite(rays).all(axis=(1, 2))
    if unseen.any():
        # Outside the range of the lens model: weight 0 and any finite ray.
        weight[unseen] = 0.0
        np.moveaxis(rays, -1, 1)[unseen] = np.eye(3)[:, [2, 0, 1]]
    levels = grey[y, x].astype(np.float32)
    if grey.dtype.kind == "f":
        weight[_fill_gaps(levels)] = 0.0
    return Bands(levels, weight, rays, pixels)


def _fill_gaps(levels: RealArray) -> BoolArray:
    """Write 0 over NaN in `levels` (...), and return where."""
    gaps = np.isnan(levels)
    levels[gaps] = 0.0
    return np.asarray(gaps)


def outer_samples(
    grey: Image,
    camera: Camera,
    rims: Sequence[Ellipse],
    half_width_px: FloatArray,
    limits: tuple[float, float],
    *,
    options: PhotometryOptions = DEFAULT,
) -> OuterSamples:
    """Return squares of four pixels along ellipses inside and outside the bands of m rims.

    Parameters
    ----------
    grey, camera, rims, half_width_px
        See `bands_around`.
    limits
        Levels at which the image is clipped; a square with such a pixel has the weight 0.
    options
        Tunable numbers.
    """
    every = Ellipse.batch(rims)
    axes = np.stack([every.semi_major, every.semi_minor], axis=-1)[:, None]
    shape = (options.outer_rings, options.outer_ellipses)
    spacing = options.outer_gap_px + options.outer_spacing_px * np.arange(shape[0] * shape[1]).reshape(shape)
    offset = half_width_px[:, None] + spacing[:, None]
    # (ring, inside or outside, m, ellipse, axis)
    outer = axes + np.stack([-offset, offset], axis=1)[..., None]
    outer = outer.reshape(-1, *outer.shape[2:])
    least, most = options.outer_least_samples, options.outer_most_samples
    number = int(np.clip(options.outer_samples_per_px * axes.max(), least, most))
    rim_x, rim_y = _on_ellipses(every, axes, number)
    # The upper left pixel of each square, and whether the square is in the image.
    x, y = (np.rint(each - 0.5) for each in _on_ellipses(every, outer, number))
    height, width = grey.shape
    inside = (x >= 0.0) & (x < width - 1.0) & (y >= 0.0) & (y < height - 1.0)
    np.clip(x, 0.0, max(width - 2.0, 0.0), out=x)
    np.clip(y, 0.0, max(height - 2.0, 0.0), out=y)
    first, flat = y.astype(np.intp) * width + x.astype(np.intp), np.ascontiguousarray(grey).ravel()
    right, below = int(width > 1), width * int(height > 1)
    four = [flat.take(first + shift) for shift in (0, right, below, below + right)]
    lowest, highest = reduce(np.minimum, four), reduce(np.maximum, four)
    levels = 0.25 * sum(each.astype(np.float32) for each in four)
    # The weight is the number of pixels, less where the squares of an ellipse overlap.
    area = np.pi * outer.sum(axis=-1) * options.outer_spacing_px / number
    weight = np.where(outer[..., 1] > 0.0, np.minimum(area, 4.0), 0.0).astype(np.float32)[..., None] * inside
    sights = camera.sights(np.stack([rim_x, rim_y], axis=-1)).astype(np.float32)
    unseen = ~np.isfinite(sights).all(axis=(0, 1))
    sights[:, :, unseen] = 0.5
    weight[(lowest <= limits[0]) | (highest >= limits[1]) | unseen] = 0.0
    if grey.dtype.kind == "f":
        weight[_fill_gaps(levels)] = 0.0
    dx, dy = x + 0.5 - rim_x, y + 0.5 - rim_y
    rays = np.stack([each[0] + each[1] * dx + each[2] * dy for each in sights], axis=2)
    return OuterSamples(*(each.reshape(*each.shape[:-2], -1) for each in (levels, weight, rays)))


def _on_ellipses(rims: Ellipse, axes: FloatArray, number: int) -> tuple[RealArray, RealArray]:
    """Return x and y (..., m, r, number) of points on ellipses with the centers and angles of m rims, r of each.

    The ellipses have their own `axes` (..., m, r, 2), px.
    """
    unit_x, unit_y = unit_circle(number).astype(np.float32)
    lengths = axes.astype(np.float32)[..., None, :]
    along, across = lengths[..., 0] * unit_x, lengths[..., 1] * unit_y
    cos, sin, x, y = (
        each.astype(np.float32)[:, None, None] for each in (np.cos(rims.angle), np.sin(rims.angle), *rims.center.T)
    )
    return x + (cos * along - sin * across), y + (sin * along + cos * across)


def _pixels_around(
    rims: Ellipse, half_width_px: FloatArray, shape: tuple[int, ...]
) -> tuple[IntArray, IntArray, RealArray]:
    """Return columns, rows and weights (m, k) of the pixels within `half_width_px` (m,) of the m `rims`.

    Row by row, in two runs where the row crosses the inner ellipse, so that the time depends on the bands alone.
    """
    height, width = shape
    a, b = rims.semi_major, rims.semi_minor
    half = np.hypot((a + half_width_px) * np.sin(rims.angle), (b + half_width_px) * np.cos(rims.angle))
    first = np.clip(np.ceil(rims.center[:, 1] - half), 0, height).astype(np.int64)
    last = np.clip(np.floor(rims.center[:, 1] + half) + 1, first, height).astype(np.int64)
    rows, owner = _runs(first, last - first), np.repeat(np.arange(len(rims)), last - first)
    x = rims.center[owner, 0]
    offset = np.array([[1.0], [-1.0]]) * half_width_px
    # Both (outer or inner, n); NaN where the row does not cross the ellipse.
    left, right = _crossings(
        rows - rims.center[owner, 1], (a + offset)[:, owner], (b + offset)[:, owner], rims.angle[owner]
    )
    (start, hole_start), (end, hole_end) = np.ceil(x + left), np.floor(x + right) + 1.0
    crossed = np.isfinite(hole_start)
    hole_start, hole_end = np.where(crossed, [hole_start, hole_end], end)
    # `fmin` and `fmax` ignore the NaN of rows that do not cross.
    starts, ends = np.fmin(np.fmax([[start, hole_end], [hole_start, end]], 0.0), width).astype(np.int64)
    lengths = np.maximum(ends - starts, 0)
    # Both runs of each row, one after the other.
    each = lengths.T.ravel()
    columns, rows = _runs(starts.T.ravel(), each), np.repeat(np.repeat(rows, 2), each)
    number = np.bincount(owner, lengths.sum(axis=0), len(rims)).astype(np.int64)
    within = np.arange(int(number.max(initial=1))) < number[:, None]
    # Padding repeats a pixel of the same rim, or the middle of the image, so that all numbers are finite.
    x, y = np.empty((2, *within.shape), np.int64)
    own = number > 0
    x[:], y[:] = width // 2, height // 2
    if not within.all():
        first = (np.cumsum(number) - number)[own]
        x[own], y[own] = columns[first, None], rows[first, None]
    x[within], y[within] = columns, rows
    return x, y, within.astype(np.float32)


def _runs(starts: IntArray, lengths: IntArray) -> IntArray:
    """Return the integers (n,) of runs that begin at `starts` and have these `lengths`, one after the other."""
    ends = np.cumsum(lengths)
    return np.arange(int(lengths.sum())) + np.repeat(starts - (ends - lengths), lengths)


def _crossings(dy: FloatArray, a: FloatArray, b: FloatArray, angle: FloatArray) -> FloatArray:
    """Return x (2, ..., n), left and right, of the intersections of rows with centered ellipses; NaN without any.

    The rows are at `dy` (n,) from the centers; the ellipses have semi-axes `a` and `b` (..., n) and `angle` (n,).
    """
    cos, sin = np.cos(angle), np.sin(angle)
    a, b = np.maximum(a, 0.0), np.maximum(b, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        aa, bb = 1.0 / (a * a), 1.0 / (b * b)
        xx, xy, yy = cos * cos * aa + sin * sin * bb, cos * sin * (aa - bb), sin * sin * aa + cos * cos * bb
        under_root = (xy * dy) ** 2 - xx * (yy * dy**2 - 1.0)
        root = np.sqrt(np.where(under_root >= 0.0, under_root, np.nan))
        return np.stack([-xy * dy - root, -xy * dy + root]) / xx
