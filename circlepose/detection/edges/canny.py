"""Gray image -> connected edge chains at one scale (Canny, with thresholds that follow the image's noise)."""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise

import cv2
import numpy as np

from circlepose._typing import BoolArray, FloatArray, Image, IntArray
from circlepose.detection.edges.chains import Chains
from circlepose.detection.edges.options import DEFAULT, EdgeOptions

TILE_PX = 64
"""px; side of the tiles in which edges are sought, where not everywhere."""
_MOST_WITHIN = 0.5
"""Share of the image above which the whole image is as fast; cost."""
_MANY_EDGES, _STRIP_PX = 0.1, 64
"""Share of edge pixels from which edges are followed in strips, and about the height of a strip, px; cost."""
_SAMPLES = 1 << 11
"""Pixels from which the gradient of noise is estimated."""
_MOST_GRADIENT = 8192.0
"""L1 Sobel units up to which gradients of floating images are held as they are; numerical."""
_STEP, _MEAN = np.array([-1.0, 0.0, 1.0]), np.array([1.0, 2.0, 1.0])


def _gradient(step: FloatArray, mean: FloatArray) -> FloatArray:
    """Return the operators (2, side, side) of the change across and down, from those along a line."""
    return np.stack([np.outer(mean, step), np.outer(step, mean)]).astype(np.float32)


_SOBEL = _gradient(_STEP, _MEAN)
_PLASTIC = 1.324717957244746 ** -np.array([1.0, 2.0])


def edge_chains(
    grey: Image,
    shortest: int,
    tiles: BoolArray | None = None,
    options: EdgeOptions = DEFAULT,
    *,
    dot_px: float = 0.0,
) -> Chains:
    """Return the borders of all connected edges of `grey` (h, w) uint8 or float32, with at least `shortest` points.

    A closed edge gives two borders, its outer one and that of the hole in it. An edge that has merged with something
    outside still has its hole. With `tiles` (rows, columns), only edges in those are returned. Closed edges
    smaller than `dot_px` are counted.
    """
    edges = edge_map(grey, options) if tiles is None else _edges_within(grey, tiles, options)
    chains = []
    # OpenCV's borders take much more memory than chains. It finds the lowest first.
    for top, bottom in reversed(_strips(edges)):
        found = cv2.findContours(edges[top:bottom], cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE, offset=(0, top))
        if top == 0:
            # Not needed any more.
            del edges
        chains.append(Chains.of_borders(*found, shortest, size=max(grey.shape), dot_px=dot_px))
    return Chains.joined(chains)


def _strips(edges: Image) -> list[tuple[int, int]]:
    """Return the first row, and the one after the last, of strips of `edges` (h, w) that no edge crosses.

    With few edges the image is one strip.
    """
    height = len(edges)
    if cv2.countNonZero(edges) < _MANY_EDGES * edges.size:
        return [(0, height)]
    empty = np.flatnonzero(cv2.reduce(edges, 1, cv2.REDUCE_MAX).ravel() == 0)
    strip = empty // _STRIP_PX
    cuts = empty[np.flatnonzero(np.diff(strip, prepend=-1))].tolist()
    return [(top, bottom) for top, bottom in pairwise([0, *cuts, height]) if bottom > top]


def edge_map(grey: Image, options: EdgeOptions = DEFAULT) -> Image:
    """Return the Canny edges (1986) of `grey` (h, w), uint8 or float32: 255 on an edge, 0 elsewhere."""
    smooth = _smooth(grey, options)
    return _canny(smooth, _high_threshold(smooth, _SOBEL, options), options)


def _edges_within(grey: Image, tiles: BoolArray, options: EdgeOptions) -> Image:
    """Return the edges in boxes around connected `tiles` (rows, columns), and 0 elsewhere."""
    boxes = TILE_PX * cv2.connectedComponentsWithStats(tiles.view(np.uint8))[2][1:, :4]
    if int(np.sum(boxes[:, 2] * boxes[:, 3])) > _MOST_WITHIN * grey.size:
        return edge_map(grey, options)
    high = _high_threshold(grey, _smooth_sobel(options.blur_size, options.blur_px), options)
    edges = np.zeros(grey.shape, np.uint8)
    for left, top, width, height in boxes.tolist():
        box = slice(top, top + height), slice(left, left + width)
        np.maximum(edges[box], _canny(_smooth(grey[box], options), high, options), out=edges[box])
    return edges


def _smooth(grey: Image, options: EdgeOptions) -> Image:
    return cv2.GaussianBlur(grey, (options.blur_size, options.blur_size), options.blur_px)


@lru_cache(maxsize=8)
def _smooth_sobel(blur_size: int, blur_px: float) -> FloatArray:
    """Return the Sobel operators (2, side, side) after the blur."""
    gaussian = cv2.getGaussianKernel(blur_size, blur_px)[:, 0]
    return _gradient(np.convolve(gaussian, _STEP), np.convolve(gaussian, _MEAN))


def _high_threshold(image: Image, sobel: FloatArray, options: EdgeOptions) -> float:
    return max(options.noise_factor * _quiet_gradient(image, sobel, options.quiet_share), options.least_gradient)


def _canny(smooth: Image, high: float, options: EdgeOptions) -> Image:
    if smooth.dtype == np.uint8:
        return cv2.Canny(smooth, options.hysteresis * high, high)
    across, down = (
        cv2.Sobel(smooth, cv2.CV_32F, *order, borderType=cv2.BORDER_REPLICATE) for order in ((1, 0), (0, 1))
    )
    norm = np.abs(across) + np.abs(down)
    if float(norm.max()) > _MOST_GRADIENT:
        # Above this, norms grow as their logarithm: that keeps their order, and they fit into 16 bits.
        norm = np.maximum(norm, np.float32(_MOST_GRADIENT))
        shrunk = _MOST_GRADIENT * (1.0 + np.log(norm * np.float32(1.0 / _MOST_GRADIENT))) / norm
        across *= shrunk
        down *= shrunk
    high = min(high, _MOST_GRADIENT)
    return cv2.Canny(across.astype(np.int16), down.astype(np.int16), options.hysteresis * high, high)


def _quiet_gradient(image: Image, sobel: FloatArray, quiet_share: float) -> float:
    """Return the gradient (L1 Sobel units) that a share of the pixels of `image` (h, w) stays below.

    By the operators `sobel` (2, side, side).
    """
    side = sobel.shape[-1]
    if min(image.shape) < side:
        return 0.0
    around = np.ascontiguousarray(image).take(_scattered(*image.shape, side)).astype(np.float32)
    across, down = sobel.reshape(2, -1) @ around
    gradient = np.abs(across) + np.abs(down)
    place = int(quiet_share * gradient.size)
    return float(np.partition(gradient, place)[place])


@lru_cache(maxsize=8)
def _scattered(height: int, width: int, side: int) -> IntArray:
    """Return indices (side^2, n) into a flattened image: the neighborhoods of pixels that cover it evenly.

    Not in a regular grid, which would see every line of a page of text, or every field of a chessboard, alike: the
    additive recurrence of the plastic number (Roberts' R2).
    """
    number = np.arange(_SAMPLES)[:, None]
    y, x = np.floor((number * _PLASTIC % 1.0) * [height - side + 1, width - side + 1]).astype(np.int64).T
    beside = np.add.outer(width * np.arange(side), np.arange(side)).ravel()
    return beside[:, None] + np.sort(y * width + x)
