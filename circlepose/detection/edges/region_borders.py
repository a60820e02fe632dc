"""Region borders that coincide with edges, the extraction that Chen & Huang use (after Rosenfeld & Kak, 1982).

A threshold gives regions with closed borders, but their position depends on the threshold. An edge detector gives
the position, but its edges are not closed. So the borders of many thresholds are scored by the share of their length
that lies on edges, and of each nest of borders around the same thing the best is kept.
"""

from __future__ import annotations

import cv2
import numpy as np

from circlepose._typing import FloatArray, Image, IntArray
from circlepose.detection.edges.canny import edge_map
from circlepose.detection.edges.chains import Chains
from circlepose.detection.edges.options import DEFAULT, EdgeOptions


def border_chains(grey: Image, shortest: int, options: EdgeOptions = DEFAULT) -> Chains:
    """Return the best border of each nest in `grey` (h, w), uint8 or float32, with at least `shortest` points."""
    on_edge = cv2.dilate(edge_map(grey, options), np.ones((3, 3), np.uint8)) > 0
    smooth = cv2.GaussianBlur(grey, (3, 3), 0.0)
    borders: list[IntArray] = []
    scores: list[float] = []
    for threshold in _thresholds(smooth, options.border_thresholds):
        above = cv2.threshold(smooth, float(threshold), 255, cv2.THRESH_BINARY)[1].astype(np.uint8, copy=False)
        found, _ = cv2.findContours(above, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
        for border in found:
            if len(border) < shortest:
                continue
            points = border[:, 0, :].astype(np.int64)
            score = float(np.mean(on_edge[points[:, 1], points[:, 0]]))
            if score >= options.least_border_on_edge:
                borders.append(points)
                scores.append(score)
    best = [borders[i][:, None, :].astype(np.int32) for i in _best_of_nests(borders, np.array(scores), options)]
    return Chains.of_borders(best, None, shortest, size=max(grey.shape))


def _thresholds(grey: Image, number: int) -> FloatArray:
    """Return levels at equal shares of the levels in use, so that each splits a part of the image."""
    low, high = np.percentile(grey[::4, ::4], [0.5, 99.5])
    return np.unique(np.round(np.linspace(low, high, number + 2)[1:-1]))


def _best_of_nests(borders: list[IntArray], scores: FloatArray, options: EdgeOptions) -> list[int]:
    """Return the indices of the border with the highest score of each nest."""
    if not borders:
        return []
    boxes = np.array([[*b.min(axis=0), *b.max(axis=0)] for b in borders], dtype=np.float64)
    kept: list[int] = []
    kept_boxes = np.empty((0, 4))
    for i in np.argsort(-scores, kind="stable"):
        size = float(np.max(boxes[i, 2:] - boxes[i, :2]))
        near = max(options.nest_px, options.nest_share * size)
        if not np.any(np.all(np.abs(kept_boxes - boxes[i]) < near, axis=1)):
            kept.append(int(i))
            kept_boxes = np.concatenate([kept_boxes, boxes[i : i + 1]])
    return kept
