"""Where an image shows edges that no known rim explains: only there is anything left for a finer one to show."""

from __future__ import annotations

import cv2
import numpy as np

from circlepose._typing import BoolArray, Image
from circlepose.detection.edges.canny import LEAST_GRADIENT, TILE_PX, edge_map
from circlepose.geometry.ellipse import Ellipse
from circlepose.imaging.pyramid import to_reduced

_TILE_PX = TILE_PX // 2
"""Side of a tile of the next finer image in the one that is looked at."""
_FAINTER = 0.5
"""A line one px wide loses half of its contrast in the next smaller image."""
_CORNERS = 48
"""Of the polygon that stands for a known rim."""


def unexplained_tiles(image: Image, known: Ellipse, scale: float) -> BoolArray:
    """Tell (rows, columns) which tiles of `image`, reduced by `scale`, have an edge beside the rims `known`.

    And those next to them. What the next finer image shows this one shows, too, as there is less noise in it; but
    thin lines, for which the fainter edges count.
    """
    edges = edge_map(image, least_gradient=_FAINTER * LEAST_GRADIENT)
    drawn = rims_drawn(known, scale, image)
    if drawn is not None:
        edges[drawn] = 0
    tiles = np.zeros([-(-side // _TILE_PX) for side in edges.shape], np.uint8)
    places = cv2.findNonZero(edges)
    if places is not None:
        columns, rows = places.reshape(-1, 2).T // _TILE_PX
        tiles[rows, columns] = 1
    return cv2.dilate(tiles, np.ones((3, 3), np.uint8)).view(np.bool_)


def rims_drawn(known: Ellipse, scale: float, image: Image) -> BoolArray | None:
    """Return (h, w) what of an `image`, reduced by `scale`, lies on rims `known` (full-size px); None without any."""
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
