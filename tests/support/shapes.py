"""Pictures of discs and other shapes: by their radius over the angle, in the plane of a tilted circle."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from circlepose._typing import FloatArray, Image
from circlepose.camera.camera import Camera

CAMERA = Camera.create([[900.0, 0.0, 319.5], [0.0, 900.0, 239.5], [0.0, 0.0, 1.0]], (), (640, 480))
RADIUS_MM = 30.0
_FINER = 5
Shape = Callable[[FloatArray], FloatArray]
"""Angles -> radius over that of the circle."""


@dataclass(frozen=True)
class Disc:
    """A circle at a place in the image, with the pose that it has."""

    center: FloatArray
    normal: FloatArray
    place: FloatArray
    """(2,) px, of the center"""


def discs(places: Sequence[tuple[float, float]], radius_px: float, seed: int = 0) -> list[Disc]:
    """Circles of about that radius, each tilted by 10 to 45 deg its own way."""
    rng = np.random.default_rng(seed)
    found = []
    for place in places:
        tilt, way = rng.uniform(0.17, 0.79), rng.uniform(0.0, 2.0 * np.pi)
        normal = np.array([np.sin(tilt) * np.cos(way), np.sin(tilt) * np.sin(way), -np.cos(tilt)])
        depth = 900.0 * RADIUS_MM / radius_px
        center = depth * np.array([(place[0] - 319.5) / 900.0, (place[1] - 239.5) / 900.0, 1.0])
        found.append(Disc(center, normal if normal @ center < 0.0 else -normal, np.array(place)))
    return found


def coverage(circles: Sequence[Disc], radius_px: float, shapes: Sequence[Shape] | None = None) -> FloatArray:
    """The share (480, 640) of each pixel that shapes cover; by default circles."""
    covered = np.zeros((480, 640))
    offsets = (np.arange(_FINER) + 0.5) / _FINER - 0.5
    for number, circle in enumerate(circles):
        across = np.cross(circle.normal, [0.0, 0.0, 1.0])
        across /= np.linalg.norm(across)
        along = np.cross(circle.normal, across)
        x0, y0 = (int(each) for each in circle.place)
        reach = int(1.3 * radius_px) + 6
        y, x = np.mgrid[max(y0 - reach, 0) : y0 + reach + 1, max(x0 - reach, 0) : x0 + reach + 1]
        inside = np.zeros(x.shape)
        for dy in offsets:
            for dx in offsets:
                rays = np.stack([(x + dx - 319.5) / 900.0, (y + dy - 239.5) / 900.0, np.ones(x.shape)], axis=-1)
                away = rays * (circle.center @ circle.normal / (rays @ circle.normal))[..., None] - circle.center
                radius = np.hypot(away @ across, away @ along) / RADIUS_MM
                limit = 1.0 if shapes is None else shapes[number](np.arctan2(away @ along, away @ across))
                inside += radius < limit
        covered[y[0, 0] : y[0, 0] + y.shape[0], x[0, 0] : x[0, 0] + x.shape[1]] += inside / _FINER**2
    return covered


def photographed(levels: FloatArray, blur_px: float = 0.7, noise: float = 1.0, seed: int = 0) -> Image:
    """The picture (480, 640) with that blur and noise, in whole levels."""
    noisy = cv2.GaussianBlur(levels, (0, 0), blur_px) + np.random.default_rng(seed).normal(0.0, noise, levels.shape)
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)


def polygon(corners: int, turn: float) -> Shape:
    """The radius of a regular polygon with as much area as the circle."""

    def radius(angle: FloatArray) -> FloatArray:
        step = 2.0 * np.pi / corners
        size = np.sqrt(step / np.sin(step))
        return size * np.cos(step / 2.0) / np.cos((angle - turn) % step - step / 2.0)

    return radius


def rough(share: float, seed: int) -> Shape:
    """A radius that varies smoothly by that share, rms."""
    rng = np.random.default_rng(seed)
    orders = np.arange(3, 14)
    heights, phases = rng.normal(0.0, 1.0, len(orders)) / orders, rng.uniform(0.0, 2.0 * np.pi, len(orders))
    heights *= share / np.sqrt(0.5 * np.sum(heights**2))
    return lambda angle: 1.0 + np.sum(heights * np.cos(orders * angle[..., None] + phases), axis=-1)
