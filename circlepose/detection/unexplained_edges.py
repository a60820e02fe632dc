"""Where an image shows edges that no known rim explains: only there a finer image can show more."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from circlepose._typing import BoolArray, Image
from circlepose.detection.edges.canny import TILE_PX, edge_map
from circlepose.detection.options import DEFAULT, DetectionOptions
from circlepose.geometry.ellipse import Ellipse
from circlepose.imaging.pyramid import to_reduced

_TILE_PX = TILE_PX // 2
"""px; side of a tile of the next finer image in this one."""
_CORNERS = 48
"""Corners of the polygon that is drawn for a known rim."""


def unexplained_tiles(image: Image, known: Ellipse, scale: float, options: DetectionOptions = DEFAULT) -> BoolArray:
    """Return which tiles (rows, columns) of `image`, reduced by `scale`, have an edge off the rims `known`.

    And which are next to one. This image shows what the next finer one does, as it has less noise.
    """
    edges = edge_map(image, replace(options.edges, least_gradient=options.edges.unexplained_gradient))
    drawn = rims_drawn(known, scale, image)
    if drawn is not None:
        edges[drawn] = 0
    tiles = np.zeros([-(-side // _TILE_PX) for side in edges.shape], np.uint8)
    points = cv2.findNonZero(edges)
    if points is not None:
        columns, rows = points.reshape(-1, 2).T // _TILE_PX
        tiles[rows, columns] = 1
    return cv2.dilate(tiles, np.ones((3, 3), np.uint8)).view(np.bool_)


def rims_drawn(known: Ellipse, scale: float, image: Image) -> BoolArray | None:
    """Return which pixels (h, w) of `image`, reduced by `scale`, lie on the rims `known` (px of the full image)."""
    if len(known) == 0:
        return None
    drawn = np.zeros(image.shape, np.uint8)
    reduced = Ellipse(
        to_reduced(known.center, scale), known.semi_major / scale, known.semi_minor / scale, known.angle
    )
    # OpenCV's fixed point: four bits of fraction.
    rims = np.rint(16.0 * reduced.points(_CORNERS).clip(-1e6, 1e6)).astype(np.int32)
    cv2.polylines(drawn, list(rims), True, 1, 3, cv2.LINE_8, 4)
    return drawn.view(np.bool_)
