"""Grey image -> connected edge chains at one scale (Canny on thresholds that follow the image)."""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise

import cv2
import numpy as np

from circlepose._typing import BoolArray, FloatArray, Image, IntArray
from circlepose.detection.edges.chains import Chains

TILE_PX = 64
"""Side of the tiles in which edges are looked for, where not everywhere."""
_MOST_WITHIN = 0.5
"""Share of the image from which all of it is as cheap."""
_MANY_EDGES, _STRIP_PX = 0.1, 64
"""Share of an image from which its edges are followed in strips, and about their height."""
_BLUR_PX, _BLUR_SIZE = 0.8, 5
"""Enough against pixel noise; more would join the edges of discs that nearly touch."""
_QUIET_SHARE = 0.25
_NOISE_FACTOR = 9.5
"""High threshold in units of the gradient that this share of the pixels stays below: that of noise and texture, also
where most of an image is full of edges. (In white noise 6 times the median.)"""
LEAST_GRADIENT = 40.0
"""Floor of the high threshold (L1 Sobel units, 8 per grey level and px): a ramp of 5 levels a px."""
_HYSTERESIS = 0.4
_SAMPLES = 1 << 11
"""So many pixels tell the gradient of noise."""
_STEP, _MEAN, _GAUSSIAN = (
    np.array([-1.0, 0.0, 1.0]),
    np.array([1.0, 2.0, 1.0]),
    cv2.getGaussianKernel(_BLUR_SIZE, _BLUR_PX)[:, 0],
)


def _gradient(step: FloatArray, mean: FloatArray) -> FloatArray:
    """Return the operators (2, side, side) of the change across and down, from those along a line."""
    return np.stack([np.outer(mean, step), np.outer(step, mean)]).astype(np.float32)


_SOBEL = _gradient(_STEP, _MEAN)
_SMOOTH_SOBEL = _gradient(np.convolve(_GAUSSIAN, _STEP), np.convolve(_GAUSSIAN, _MEAN))
"""After the blur."""
_PLASTIC = 1.324717957244746 ** -np.array([1.0, 2.0])


def edge_chains(grey8: Image, shortest: int, tiles: BoolArray | None = None) -> Chains:
    """Return the borders of all connected edges of `grey8` (h, w) uint8 with at least `shortest` points.

    A closed edge gives two borders, its outer one and that of the hole within; an edge that something outside
    has merged with still has its hole. With `tiles` (rows, columns), only of edges in those.
    """
    edges = edge_map(grey8) if tiles is None else _edges_within(grey8, tiles)
    chains = []
    # Borders as they are found take much more memory than chains. (The lowest are found first.)
    for top, bottom in reversed(_strips(edges)):
        found = cv2.findContours(edges[top:bottom], cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE, offset=(0, top))
        if top == 0:
            # Nor is this needed any more.
            del edges
        chains.append(Chains.of_borders(*found, shortest, size=max(grey8.shape)))
    return Chains.joined(chains)


def _strips(edges: Image) -> list[tuple[int, int]]:
    """Return the first row and the one after the last of strips of `edges` (h, w) that no edge crosses.

    All of it is one, where edges are few.
    """
    height = len(edges)
    if cv2.countNonZero(edges) < _MANY_EDGES * edges.size:
        return [(0, height)]
    empty = np.flatnonzero(cv2.reduce(edges, 1, cv2.REDUCE_MAX).ravel() == 0)
    strip = empty // _STRIP_PX
    cuts = empty[np.flatnonzero(np.diff(strip, prepend=-1))].tolist()
    return [(top, bottom) for top, bottom in pairwise([0, *cuts, height]) if bottom > top]


def edge_map(grey8: Image, *, least_gradient: float = LEAST_GRADIENT) -> Image:
    """Return the Canny edges of `grey8` (h, w) uint8: 255 on an edge, 0 elsewhere."""
    smooth = _smooth(grey8)
    return _canny(smooth, max(_NOISE_FACTOR * _quiet_gradient(smooth, _SOBEL), least_gradient))


def _edges_within(grey8: Image, tiles: BoolArray) -> Image:
    """Return the same in boxes around connected `tiles` (rows, columns), and 0 elsewhere."""
    boxes = TILE_PX * cv2.connectedComponentsWithStats(tiles.view(np.uint8))[2][1:, :4]
    if int(np.sum(boxes[:, 2] * boxes[:, 3])) > _MOST_WITHIN * grey8.size:
        return edge_map(grey8)
    high = max(_NOISE_FACTOR * _quiet_gradient(grey8, _SMOOTH_SOBEL), LEAST_GRADIENT)
    edges = np.zeros_like(grey8)
    for left, top, width, height in boxes.tolist():
        box = slice(top, top + height), slice(left, left + width)
        np.maximum(edges[box], _canny(_smooth(grey8[box]), high), out=edges[box])
    return edges


def _smooth(grey8: Image) -> Image:
    return cv2.GaussianBlur(grey8, (_BLUR_SIZE, _BLUR_SIZE), _BLUR_PX)


def _canny(smooth: Image, high: float) -> Image:
    return cv2.Canny(smooth, _HYSTERESIS * high, high)


def _quiet_gradient(image: Image, sobel: FloatArray) -> float:
    """Return the gradient (L1 Sobel units) that the quieter pixels of `image` (h, w) stay below.

    By the operators `sobel` (2, side, side).
    """
    side = sobel.shape[-1]
    if min(image.shape) < side:
        return 0.0
    around = np.ascontiguousarray(image).take(_scattered(*image.shape, side)).astype(np.float32)
    across, down = sobel.reshape(2, -1) @ around
    gradient = np.abs(across) + np.abs(down)
    place = int(_QUIET_SHARE * gradient.size)
    return float(np.partition(gradient, place)[place])


@lru_cache(maxsize=8)
def _scattered(height: int, width: int, side: int) -> IntArray:
    """Return places (side^2, n) in an image laid flat: the neighbourhoods of pixels that cover it evenly.

    In no regular grid, which would see every line of a page of text, or every field of a chessboard, alike: the
    additive recurrence of the plastic number (Roberts' R2).
    """
    number = np.arange(_SAMPLES)[:, None]
    y, x = np.floor((number * _PLASTIC % 1.0) * [height - side + 1, width - side + 1]).astype(np.int64).T
    beside = np.add.outer(width * np.arange(side), np.arange(side)).ravel()
    return beside[:, None] + np.sort(y * width + x)
