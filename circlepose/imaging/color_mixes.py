"""A color image -> the linear mixes of its channels that show edges which its gray image does not.

Differences of neighboring pixels are whitened with the noise covariance of the channels. Then a mix is a direction,
and the difference along it is the contrast over the noise of that mix; the gray image is one of them. An edge is not
shown where the difference is large and no mix has a good part of it. The dominant direction of these differences is
the next mix: Fisher's discriminant, the inverse noise covariance times the difference in color. The noise is that of
the image's own differences, so it includes the texture of surfaces.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from circlepose._numerics import ROUNDING_VARIANCE
from circlepose._typing import BoolArray, FloatArray, Image
from circlepose.imaging.channel_noise import differences_covariance
from circlepose.imaging.gray import GRAY_WEIGHTS

_NAMES = {2: ("gray", "alpha"), 3: ("blue", "green", "red"), 4: ("blue", "green", "red", "alpha")}


@dataclass(frozen=True, slots=True)
class ColorMixOptions:
    """Numbers of the search for color mixes."""

    tested_pixels: int = 150_000
    """pixels of the reduced image that is tested, at most; cost"""
    most_mixes: int = 2
    """mixes of colors, at most; the alpha channel is one more; cost"""
    least_contrast: float = 12.0
    """contrast over noise of an edge that counts; empirical: chance and compression stay below 10 in photographs"""
    shown_contrast: float = 6.0
    """contrast over noise from which a mix shows an edge, by which circles are found in it; empirical"""
    shown_share: float = 0.5
    """contrast over noise of an edge, as a share of that of its best mix, from which a mix shows it; empirical"""
    least_noise_share: float = 1.5 / 255.0
    """least noise as a share of the range of levels: color steps between the blocks of a JPEG; empirical"""
    least_edges: int = 24
    """pixels of the reduced image that lie on edges not shown; the border of a disc 6 px across; numerical"""


DEFAULT = ColorMixOptions()


@dataclass(frozen=True, slots=True)
class ColorMix:
    """A linear mix of the channels of an image."""

    weights: tuple[float, ...]
    """of the channels as stored; their norm is 1, so that the noise of rounding is that of one channel"""

    def levels(self, channels: Image) -> Image:
        """Return the mix (h, w) float32 of `channels` (h, w, c); NaN where one in use is NaN."""
        mixed = np.zeros(channels.shape[:2], np.float32)
        for k, weight in enumerate(self.weights):
            if weight != 0.0:
                mixed += channels[..., k].astype(np.float32) * np.float32(weight)
        return mixed

    @property
    def by_name(self) -> dict[str, float]:
        """The weights by the names of the channels; those that are not used are left out."""
        names = _NAMES[len(self.weights)]
        return {name: weight for name, weight in zip(names, self.weights, strict=True) if weight != 0.0}


def color_mixes(channels: Image, options: ColorMixOptions = DEFAULT) -> tuple[ColorMix, ...]:
    """Return the mixes that show edges which the gray image does not; none where gray shows all.

    Parameters
    ----------
    channels
        (h, w), or (h, w, c): BGR, BGRA, or gray and alpha. A constant alpha channel does not count.
    options
        The numbers of the search.
    """
    if channels.ndim == 2 or min(channels.shape[:2]) < 3:
        return ()
    number = channels.shape[2]
    reduced = _reduced(channels, options)
    colors = reduced[..., : number - 1] if number in (2, 4) else reduced
    if number in (2, 4):
        # What is fully transparent, in part of a block at least, has no color.
        colors = np.where(reduced[..., -1:] > 0.0, colors, np.float32(np.nan))
    if _is_gray(colors):
        colors = colors[..., :1]
        if number == 3:
            return ()
    found, shown = _mixes_of_colors(colors, channels, options)
    mixes = [ColorMix((*weights, 0.0) if number == 4 else weights) for weights in found]
    if number in (2, 4):
        alpha = reduced[..., -1:]
        strength = _strength(alpha / np.sqrt(_noise(alpha, channels[..., -1:], options)[0, 0]))
        hidden = (strength >= options.least_contrast**2) & ~shown
        if np.count_nonzero(hidden) >= options.least_edges:
            mixes.append(ColorMix((*(0.0,) * (number - 1), 1.0)))
    return tuple(mixes)


def _mixes_of_colors(
    colors: Image, channels: Image, options: ColorMixOptions
) -> tuple[list[tuple[float, ...]], BoolArray]:
    """Return the weights of the mixes of `colors` (h, w, c), and where (h - 2, w - 2) gray or a mix has an edge."""
    number = colors.shape[2]
    # The rows of the inverse root make the noise of the mixes equal and independent.
    root = np.linalg.cholesky(_noise(colors, channels, options))
    whitening = np.linalg.inv(root)
    white = [_mixed(colors, row) for row in whitening]
    total = np.sum([_strength(plane) for plane in white], axis=0)
    gray = np.array(GRAY_WEIGHTS if number == 3 else (1.0,)) @ root
    direction = gray / np.linalg.norm(gray)
    counts = total >= options.least_contrast**2
    has_edge = np.zeros(total.shape, np.bool_)
    weights: list[tuple[float, ...]] = []
    while True:
        mix = direction @ whitening
        own = _strength(_mixed(colors, mix))
        # Blur and compression spread color further than brightness: an edge explains its neighbors, too.
        near = cv2.dilate(np.nan_to_num(own), np.ones((5, 5), np.uint8)) >= options.shown_contrast**2
        has_edge |= near
        counts &= ~(near | (own >= options.shown_share**2 * total))
        if np.count_nonzero(counts) < options.least_edges or len(weights) == options.most_mixes:
            return weights, has_edge
        direction = _dominant(white, counts)
        mix = direction @ whitening
        # Brighter in the mix means brighter in gray, where it means anything in gray.
        mix *= (1.0 if mix @ GRAY_WEIGHTS >= 0.0 else -1.0) / np.linalg.norm(mix)
        weights.append(tuple(mix.tolist()))


def _reduced(channels: Image, options: ColorMixOptions) -> Image:
    """Return `channels` averaged over whole blocks, (h, w, c) float32 of `tested_pixels` at most."""
    height, width = channels.shape[:2]
    shortest = min(height, width)
    # Factors that halving reaches, which OpenCV does fastest, with a last third.
    factors = sorted([*(2**k for k in range(12)), *(3 * 2**k for k in range(11))])
    factor = next(f for f in factors if height * width <= options.tested_pixels * f**2 or shortest < 6 * f)
    reduced = channels
    while factor > 1:
        by = 3 if factor == 3 else 2
        rows, columns = reduced.shape[0] // by, reduced.shape[1] // by
        reduced = cv2.resize(reduced[: rows * by, : columns * by], (columns, rows), interpolation=cv2.INTER_AREA)
        reduced = reduced.reshape(rows, columns, -1)
        factor //= by
    return reduced.astype(np.float32)


def _is_gray(colors: Image) -> bool:
    return all(np.array_equal(colors[..., 0], colors[..., k], equal_nan=True) for k in range(1, colors.shape[2]))


def _noise(reduced: Image, channels: Image, options: ColorMixOptions) -> FloatArray:
    """Return the covariance (c, c) of the noise in differences, with that of single pixels and a least one."""
    number = reduced.shape[2]
    sample = reduced[:: max(1, reduced.shape[0] // 32), :: max(1, reduced.shape[1] // 32)]
    usual = np.sort(sample[np.isfinite(sample)])
    outer = len(usual) // 200
    range_ = float(usual[-1 - outer] - usual[outer]) if len(usual) else 0.0
    least = max(ROUNDING_VARIANCE, (options.least_noise_share * range_) ** 2)
    noise = differences_covariance(reduced) + least * np.eye(number)
    if reduced.shape[:2] == channels.shape[:2]:
        return noise
    alpha = channels[..., -1] if channels.shape[2] in (2, 4) and number != channels.shape[2] else None
    return noise + differences_covariance(channels[..., :number], alpha)


def _mixed(image: Image, weights: FloatArray) -> Image:
    """Return the mix (h, w) of `image` (h, w, c) with `weights` (c,)."""
    return cv2.transform(image, np.asarray(weights, np.float32)[None])


def _strength(plane: Image) -> Image:
    """Return (h - 2, w - 2) the squared differences of the neighbors in `plane`, (h, w), across both ways."""
    plane = plane.reshape(plane.shape[:2])
    across = plane[1:-1, 2:] - plane[1:-1, :-2]
    down = plane[2:, 1:-1] - plane[:-2, 1:-1]
    across *= across
    down *= down
    across += down
    return across


def _dominant(planes: list[Image], which: BoolArray) -> FloatArray:
    """Return the unit vector (c,) along which the differences in `planes` at the pixels `which` are largest.

    Each pixel counts alike.
    """
    across = np.stack([(plane[1:-1, 2:] - plane[1:-1, :-2])[which] for plane in planes], axis=1)
    down = np.stack([(plane[2:, 1:-1] - plane[:-2, 1:-1])[which] for plane in planes], axis=1)
    size = np.sqrt(np.sum(across * across + down * down, axis=1, keepdims=True))
    both = np.concatenate([across / size, down / size]).astype(np.float64)
    return np.asarray(np.linalg.eigh(both.T @ both)[1][:, -1])
