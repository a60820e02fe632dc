"""A predicted rim -> the edges along it, to sub-pixel, on gray profiles across it. Many rims at once."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from circlepose._typing import BoolArray, FloatArray, Image, RealArray
from circlepose.geometry.ellipse import Ellipse, own_normals
from circlepose.imaging.pyramid import to_full_size

_STEP_PX = 0.5
"""px; spacing of the samples of a profile; empirical."""
_DIFFERENCE_VARIANCE = 1.0 / 12.0
"""px^2; variance that differencing over 1 px adds to the gradient along a profile; exact."""
_HALF_WINDOW = 4
"""Steps on either side of the steepest point over which the gradient's centroid is taken: 2 px; empirical."""
_LEAST_STEP_SHARE = 0.35
"""Least height of an edge, over the median height along its rim; empirical."""

_EDGE_NOISE, _EDGE_NOISE_PER_BLUR, _WIDEST_BLUR_PX = 0.7, 1.5, 1.2
"""px, 1 and px; scatter of edges by noise: see `edge_noise_px`; measured."""
STEP_NOISE = 0.83
"""Scatter of an edge's height over the noise: see `RimEdges.step`; measured on rendered edges."""


@dataclass(frozen=True, slots=True, eq=False)
class RimEdges:
    """Edges located along m rims, at k samples each."""

    points: FloatArray
    """(m, k, 2) px, sub-pixel; arbitrary where not valid"""
    offset_px: FloatArray
    """(m, k) from the predicted rim, positive outwards"""
    step: FloatArray
    """(m, k) gray levels, outside minus inside"""
    valid: BoolArray
    """(m, k) whether there is an edge with the sign asked for, inside the image and within the half-width"""
    polarity: FloatArray
    """(m,) +1 the inside is darker, -1 it is brighter, along most of the rim"""
    blur_px: FloatArray
    """(m,) about the blur of the edges; that of one wider than the profiles is not seen"""

    def __getitem__(self, which: BoolArray | list[int]) -> Self:
        """Return the rims that `which`, a mask (m,) or indices, selects."""
        return type(self)(*(getattr(self, field.name)[which] for field in fields(self)))

    def in_full_size(self, scale: float) -> Self:
        """Return edges located in an image reduced by `scale`, in px of the full image."""
        if scale == 1:
            return self
        return replace(
            self,
            points=to_full_size(self.points, scale),
            offset_px=self.offset_px * scale,
            blur_px=self.blur_px * scale,
        )


def ellipse_rim(ellipse: Ellipse, number: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return points along the rims of ellipses, with their normals and curvature.

    Parameters
    ----------
    ellipse
        (m,) px.
    number
        Points along each rim.

    Returns
    -------
    Points (m, number, 2), px, outward unit normals (m, number, 2), and curvature (m, number), 1/px: a b / |(b cos p,
    a sin p)|^3.
    """
    normal_x, normal_y, per_norm = own_normals(ellipse, number)
    cos, sin = np.cos(ellipse.angle)[:, None], np.sin(ellipse.angle)[:, None]
    normals = np.empty((*normal_x.shape, 2))
    normals[..., 0] = cos * normal_x - sin * normal_y
    normals[..., 1] = sin * normal_x + cos * normal_y
    area = (ellipse.semi_major * ellipse.semi_minor)[:, None]
    return ellipse.points(number), normals, area * per_norm**3


def noise_share(noise: float, step: FloatArray, valid: BoolArray) -> FloatArray:
    """Return (m,) the `noise`, levels, over the mean height of the `valid` edges (m, k)."""
    count = np.maximum(np.count_nonzero(valid, axis=1), 1)
    return np.asarray(noise / np.maximum(np.sum(np.where(valid, np.abs(step), 0.0), axis=1) / count, 1e-9))


def edge_noise_px(noise_share: FloatArray, blur_px: FloatArray) -> FloatArray:
    """Return the standard deviation (px) of an edge's place by white noise.

    `noise_share` is the noise over the edge's height. Measured on rendered edges of blurs from 0.6 to 1.2 px; up to a
    share of 0.4 it holds within a tenth.
    """
    return np.asarray((_EDGE_NOISE + _EDGE_NOISE_PER_BLUR * np.minimum(blur_px, _WIDEST_BLUR_PX)) * noise_share)


def edges_along(
    grey: Image,
    ellipse: Ellipse,
    half_width_px: float,
    samples: int,
    *,
    quick: bool = False,
    of_either_sign: bool = False,
) -> RimEdges:
    """Locate the edges along the rims of ellipses.

    Parameters
    ----------
    grey
        (h, w) levels.
    ellipse
        (m,) px, the predicted rims.
    half_width_px
        How far from a predicted rim its edge may be; less in small and thin ellipses.
    samples
        Samples along each rim.
    quick
        For many rims: levels are rounded, which costs some hundredths of a px.
    of_either_sign
        See `locate_edges`.
    """
    points, normals, curvature = ellipse_rim(ellipse, samples)
    # In a small or thin ellipse the search must not reach the other side.
    half_width = np.minimum(half_width_px, np.maximum(0.45 * ellipse.semi_minor + 0.5, 1.0))
    return locate_edges(grey, points, normals, half_width, curvature, quick=quick, of_either_sign=of_either_sign)


def contour_normals(points: FloatArray) -> FloatArray:
    """Return the outward unit normals of closed contours, from differences of neighboring points.

    Parameters
    ----------
    points
        (m, k, 2) of densely sampled convex contours, in order.

    Returns
    -------
    (m, k, 2).
    """
    tangent = np.roll(points, -1, axis=1) - np.roll(points, 1, axis=1)
    normals = np.stack([tangent[..., 1], -tangent[..., 0]], axis=-1)
    outward = np.sum(normals * (points - points.mean(axis=1, keepdims=True)), axis=(1, 2))
    normals = normals * np.where(outward < 0.0, -1.0, 1.0)[:, None, None]
    return normals / np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-12)


def locate_edges(
    grey: Image,
    points: FloatArray,
    normals: FloatArray,
    half_width_px: FloatArray,
    curvature: FloatArray | None = None,
    *,
    quick: bool = False,
    of_either_sign: bool = False,
) -> RimEdges:
    """Locate the edge near each predicted rim point.

    Parameters
    ----------
    grey
        (h, w) levels.
    points, normals
        (m, k, 2) predicted rim, px, and its outward unit normals.
    half_width_px
        (m,) how far from the predicted rim the edge may be.
    curvature
        (m, k) of the predicted rim, 1/px; by default it is computed from the points.
    quick
        Round levels as `quick_profiles` does.
    of_either_sign
        Whether edges may be brighter outside in one place and darker in another.

    Notes
    -----
    The edge is the centroid of the gradient with the sign of the rim within 2 px of its steepest point. For a
    symmetric blur that is the position of the step, except for the inward shift of a curved edge, (variance of the
    blur) * curvature / 2, which is corrected. Gradients of the other sign, of a neighbor's edge, have no weight.
    """
    steps = int(np.ceil(float(np.max(half_width_px)) / _STEP_PX)) + 1
    t: NDArray[Any] = _STEP_PX * np.arange(-steps, steps + 1)
    profile, inside = (quick_profiles if quick else _profiles)(grey, points, normals, t)
    gradient = profile[..., 2:] - profile[..., :-2]
    gradient *= 1.0 / (2.0 * _STEP_PX)
    t = t[1:-1].astype(profile.dtype)
    near: NDArray[Any]
    near = np.maximum(1.0 - np.abs(t) / (half_width_px[:, None] + _STEP_PX), 0.0).astype(profile.dtype)
    inwards = np.matmul(gradient.sum(axis=1)[:, None, :], near[:, :, None])[:, 0, 0] < 0.0
    polarity = np.where(inwards, -1.0, 1.0)
    gradient[inwards] *= -1.0
    sign: NDArray[Any] | float = polarity[:, None]
    if of_either_sign:
        sign = sign * np.where(np.sum(gradient * near[:, None, :], axis=-1) < 0.0, -1.0, 1.0)
        gradient *= (sign * polarity[:, None])[..., None]
    rising = np.maximum(gradient, 0.0, out=gradient)
    # Of equal gradients the one nearest to the prediction counts.
    peak = np.argmax(rising * ((0.25 + near) * (near > 0.0))[:, None, :], axis=-1)
    center = t[peak]
    half = (_HALF_WINDOW + 0.5) * _STEP_PX
    for _ in range(2):
        # The ends of the window have part of the weight, so that it can move by less than a step.
        window = np.subtract(t, center[..., None])
        np.abs(window, out=window)
        np.subtract(half, window, out=window)
        window *= 1.0 / _STEP_PX
        np.maximum(window, 0.0, out=window)
        np.minimum(window, 1.0, out=window)
        window *= rising
        mass = window.sum(axis=-1)
        center = np.where(mass > 0.0, (window @ t) / np.maximum(mass, 1e-12), center)
    # The second moment about the middle of the profile, from the same sums as the center.
    mean_square = (window @ (t * t)) / np.maximum(mass, 1e-12)
    variance = np.where(mass > 0.0, mean_square - center * center, 0.0)
    blur = np.maximum(_middle(variance) - _DIFFERENCE_VARIANCE, 0.0)
    center = center + 0.5 * blur * (_curvature(points, normals) if curvature is None else curvature)
    step = mass * _STEP_PX
    typical = _middle(step)
    valid = inside & (step > _LEAST_STEP_SHARE * typical) & (step > 0.0) & (np.abs(center) <= half_width_px[:, None])
    return RimEdges(
        points=points + center[..., None] * normals,
        offset_px=center.astype(np.float64),
        step=step * sign,
        valid=valid,
        polarity=polarity,
        blur_px=np.sqrt(blur[:, 0]).astype(np.float64),
    )


def _middle(values: NDArray[Any]) -> NDArray[Any]:
    """Return the upper median (m, 1) of each row of `values` (m, k)."""
    middle = values.shape[1] // 2
    return np.partition(values, middle, axis=1)[:, middle, None]


def _curvature(points: FloatArray, normals: FloatArray) -> FloatArray:
    """Return the curvature (m, k), 1/px, of closed contours from their points and normals (m, k, 2)."""
    chord = np.roll(points, -1, axis=1) - np.roll(points, 1, axis=1)
    turning = np.roll(normals, -1, axis=1) - np.roll(normals, 1, axis=1)
    return np.sum(chord * turning, axis=-1) / np.maximum(np.sum(chord**2, axis=-1), 1e-12)


def _profiles(grey: Image, points: FloatArray, normals: FloatArray, t: FloatArray) -> tuple[NDArray[Any], BoolArray]:
    """Return the levels (m, k, l) at `points` + `t` (l,) `normals`, and which profiles lie in the image (m, k)."""
    level, inside = sample(grey, points[:, :, None, :] + t[:, None] * normals[:, :, None, :])
    return level, np.asarray(inside.all(axis=-1))


def quick_profiles(
    grey: Image, points: FloatArray, normals: FloatArray, t: FloatArray
) -> tuple[NDArray[Any], BoolArray]:
    """Return the float32 levels (m, k, l) at `points` + `t` (l,) `normals`, and which profiles are inside (m, k).

    `cv2.remap` would be faster still, but rounds levels and positions, differently in each release of OpenCV.
    """
    height, width = grey.shape
    offset = t.astype(np.float32)
    x, y = (
        points[..., i, None].astype(np.float32) + offset * normals[..., i, None].astype(np.float32) for i in (0, 1)
    )
    # The image is convex: a profile whose ends lie in it lies in it.
    ends_x, ends_y = x[..., [0, -1]], y[..., [0, -1]]
    inside = ((ends_x >= 0.0) & (ends_x <= width - 1.0) & (ends_y >= 0.0) & (ends_y <= height - 1.0)).all(axis=-1)
    return _bilinear(grey, x, y).astype(np.float32, copy=False), inside


def sample(grey: Image, where: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return the bilinear levels of an image at positions, and which positions lie inside it.

    Parameters
    ----------
    grey
        (h, w) levels.
    where
        (..., 2) px, (0, 0) being the center of the first pixel.

    Returns
    -------
    Levels (...), 0 outside, and whether each position lies inside (...).
    """
    height, width = grey.shape
    x, y = where[..., 0], where[..., 1]
    inside = (x >= 0.0) & (x <= width - 1.0) & (y >= 0.0) & (y <= height - 1.0)
    return np.where(inside, _bilinear(grey, x, y), 0.0).astype(np.float64), inside


def _bilinear(grey: Image, x: RealArray, y: RealArray) -> RealArray:
    """Return the bilinear levels at `x`, `y` (...), px; outside the image those of its border."""
    height, width = grey.shape
    # Unlike clip, these take NaN for the border.
    x = np.fmin(np.fmax(x, 0.0), width - 1.0)
    y = np.fmin(np.fmax(y, 0.0), height - 1.0)
    # The last row and column have no next neighbor: they are interpolated from the one before.
    x0 = np.minimum(x.astype(np.int32), max(width - 2, 0))
    y0 = np.minimum(y.astype(np.int32), max(height - 2, 0))
    fx, fy = (x - x0).astype(np.float32), (y - y0).astype(np.float32)
    flat = np.ascontiguousarray(grey).reshape(-1)
    index = y0 * width + x0
    right, below = (1 if width > 1 else 0), (width if height > 1 else 0)
    before = 1.0 - fx
    top = flat.take(index) * before + flat.take(index + right) * fx
    bottom = flat.take(index + below) * before + flat.take(index + (below + right)) * fx
    return np.asarray(top * (1.0 - fy) + bottom * fy)
