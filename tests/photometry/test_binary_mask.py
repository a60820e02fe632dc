"""Masks: images of two levels, whatever these are, are measured at least as well as their contours are."""

from __future__ import annotations

import numpy as np
import pytest

import circlepose
from circlepose import Camera, Target
from circlepose.geometry.ellipse import Ellipse
from circlepose.photometry.binary_mask import is_mask, with_mask_scaled

SIZE = (320, 240)
CAMERA = Camera.create([[400.0, 0, 159.5], [0, 400.0, 119.5], [0, 0, 1]], (), SIZE)
RADIUS = 60.0
TARGET = Target.circle(RADIUS)
LEVELS = {
    "0/1": (np.uint8, 0, 1),
    "1/0": (np.uint8, 1, 0),
    "0/255": (np.uint8, 0, 255),
    "255/60": (np.uint8, 255, 60),
    "60/255": (np.uint8, 60, 255),
    "0/198": (np.uint8, 0, 198),
    "16 bit 0/1": (np.uint16, 0, 1),
    "16 bit": (np.uint16, 0, 65535),
    "floating": (np.float32, 0.0, 1.0),
}


def inside(center: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Return (h, w) where the ray of a pixel's center meets the disc."""
    x, y = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    rays = np.stack([(x - 159.5) / 400.0, (y - 119.5) / 400.0, np.ones(x.shape)], axis=-1)
    points = rays * ((normal @ center) / (rays @ normal))[..., None]
    return np.linalg.norm(points - center, axis=-1) < RADIUS


def discs(number: int) -> list[tuple[np.ndarray, np.ndarray]]:
    rng = np.random.default_rng(16)
    found = []
    for _ in range(number):
        center = np.array([*rng.uniform([-40, -25], [40, 25]), rng.uniform(380.0, 800.0)])
        sight = -center / np.linalg.norm(center)
        tilt, turn = np.radians(rng.uniform(10.0, 65.0)), rng.uniform(0.0, 2.0 * np.pi)
        across = np.cross(sight, [0.0, 1.0, 0.0])
        across /= np.linalg.norm(across)
        side = np.cos(turn) * across + np.sin(turn) * np.cross(sight, across)
        found.append((center, np.cos(tilt) * sight + np.sin(tilt) * side))
    return found


def errors(kind: str, *, refine: bool, number: int = 30) -> np.ndarray:
    type_, outside, within = LEVELS[kind]
    found = []
    for center, normal in discs(number):
        image = np.where(inside(center, normal), within, outside).astype(type_)
        (circle,) = circlepose.estimate(image, CAMERA, TARGET, refine=refine).circles
        found.append(min(np.linalg.norm(each.center - center) for each in circle.candidates))
    return np.array(found)


@pytest.fixture(scope="module")
def of_contours() -> np.ndarray:
    return errors("60/255", refine=False)


@pytest.mark.parametrize("kind", LEVELS)
def test_a_mask_is_measured_better_than_its_contour(kind: str, of_contours: np.ndarray) -> None:
    refined = errors(kind, refine=True)
    assert np.median(refined) < np.median(of_contours)
    assert np.percentile(refined, 90) < np.percentile(of_contours, 90)


def test_which_two_levels_they_are_does_not_count() -> None:
    center, normal = discs(1)[0]
    within = inside(center, normal)
    results = [
        circlepose.estimate(np.where(within, dark, light).astype(kind), CAMERA, TARGET)
        .circles[0]
        .candidates[0]
        .center
        for kind, light, dark in LEVELS.values()
    ]
    assert np.max(np.ptp(results, axis=0)) < 0.05


RIM = Ellipse.from_axes([[30.0, 24.0]], [[15.0, 9.0]], [0.4])


def test_what_has_levels_between_is_no_mask() -> None:
    y, x = np.mgrid[:48, :64]
    u, v = x - 30.0, y - 24.0
    along, across = (u * np.cos(0.4) + v * np.sin(0.4)) / 15.0, (v * np.cos(0.4) - u * np.sin(0.4)) / 9.0
    growth = (np.hypot(along, across) - 1.0) * 10.0
    averaged = np.rint(255.0 * np.clip(0.5 + growth, 0.0, 1.0)).astype(np.uint8)
    assert not is_mask(averaged, RIM)
    assert with_mask_scaled(averaged, [RIM[0]]) is averaged
    decided = np.where(growth > 0.0, 255, 0).astype(np.uint8)
    assert is_mask(decided, RIM)
    # Rims of classes of their own, such as labels 1, 2, 3, are masks as well; an even image shows none.
    assert is_mask((decided > 0) * np.uint8(3) + np.uint8(1), RIM)
    assert not is_mask(np.full((48, 64), 9, np.uint8), RIM)
    assert not is_mask(decided, Ellipse.from_axes([[500.0, 400.0]], [[15.0, 9.0]], [0.4]))
