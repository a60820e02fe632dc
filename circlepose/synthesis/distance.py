"""Signed distances to flat shapes, with gradients, and their outlines. Plane coordinates; pure NumPy."""

from __future__ import annotations

import numpy as np

from circlepose._typing import FloatArray
from circlepose.synthesis.scene import Box, Polygon, Round, Shape


def signed_distance(shape: Shape, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the distance (...) of `points` (..., 2) to the rim, negative inside, and its gradient (..., 2)."""
    if isinstance(shape, Round):
        offset = points - np.array(shape.at)
        length = np.linalg.norm(offset, axis=-1)
        return length - shape.radius, offset / np.maximum(length, 1e-300)[..., None]
    if isinstance(shape, Box):
        return _box(shape, points)
    return _polygon(shape, points)


def outline(shape: Shape, number: int) -> FloatArray:
    """Return about `number` points (n, 2) along the closed rim, evenly spaced on each of its pieces."""
    if isinstance(shape, Round):
        angle = np.linspace(0.0, 2.0 * np.pi, number, endpoint=False)
        return np.asarray(shape.radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1) + np.array(shape.at))
    if isinstance(shape, Polygon):
        return _closed(np.array(shape.points), number)
    half = np.array(shape.size) / 2.0 - shape.corner_radius
    corner_points = max(number // 8, 2) if shape.corner_radius > 0.0 else 1
    quarter = np.linspace(0.0, np.pi / 2.0, corner_points)
    corners = [
        np.array(sign) * half
        + shape.corner_radius
        * np.stack([np.cos(quarter + k * np.pi / 2.0), np.sin(quarter + k * np.pi / 2.0)], axis=-1)
        for k, sign in enumerate([(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)])
    ]
    return np.asarray(_closed(np.concatenate(corners), number) @ _turn(shape.angle).T + np.array(shape.at))


def _turn(angle: float) -> FloatArray:
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array([[cos, -sin], [sin, cos]])


def _closed(corners: FloatArray, number: int) -> FloatArray:
    """Fill the closed polyline through `corners` so that no gap is longer than its length / `number`."""
    sides = np.roll(corners, -1, axis=0) - corners
    lengths = np.linalg.norm(sides, axis=-1)
    counts = np.maximum(np.ceil(lengths * number / lengths.sum()), 1.0).astype(int)
    start = np.repeat(np.arange(len(corners)), counts)
    part = (np.arange(len(start)) - np.repeat(np.cumsum(counts) - counts, counts)) / counts[start]
    return np.asarray(corners[start] + part[:, None] * sides[start])


def _box(box: Box, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    turn = _turn(box.angle)
    local = (points - np.array(box.at)) @ turn
    beyond = np.abs(local) - (np.array(box.size) / 2.0 - box.corner_radius)
    outside = np.maximum(beyond, 0.0)
    length = np.linalg.norm(outside, axis=-1)
    deepest = np.max(beyond, axis=-1)
    distance = np.where(deepest > 0.0, length, deepest) - box.corner_radius
    nearest_side = np.eye(2)[np.argmax(beyond, axis=-1)]
    inward = (deepest <= 0.0)[..., None]
    gradient = np.where(inward, nearest_side, outside / np.maximum(length, 1e-300)[..., None])
    return distance, (gradient * np.where(local < 0.0, -1.0, 1.0)) @ turn.T


def _polygon(polygon: Polygon, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    corners = np.array(polygon.points)
    best = np.full(points.shape[:-1], np.inf)
    offset = np.zeros_like(points)
    inside = np.zeros(points.shape[:-1], dtype=np.bool_)
    outward = np.zeros_like(points)
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        side = b - a
        from_a = points - a
        part = np.clip(from_a @ side / max(side @ side, 1e-300), 0.0, 1.0)
        away = from_a - part[..., None] * side
        square = np.einsum("...i,...i->...", away, away)
        nearer = square < best
        best = np.where(nearer, square, best)
        offset = np.where(nearer[..., None], away, offset)
        across = np.array([side[1], -side[0]]) / max(float(np.hypot(*side)), 1e-300)
        outward = np.where(nearer[..., None], across, outward)
        # Crossing number: a side counts where it spans the point's height to the right of it.
        spans = (a[1] > points[..., 1]) != (b[1] > points[..., 1])
        turn = side[0] * from_a[..., 1] - side[1] * from_a[..., 0]
        inside ^= spans & ((turn > 0.0) == (side[1] > 0.0))
    length = np.sqrt(best)
    sign = np.where(inside, -1.0, 1.0)
    on_rim = (length <= 1e-12)[..., None]
    gradient = np.where(on_rim, outward, sign[..., None] * offset / np.maximum(length, 1e-300)[..., None])
    return sign * length, gradient
