"""Formulas of the lens models in plain arithmetic, as the tools document them: tests compare our own code."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from circlepose.camera.camera import Camera
from circlepose.io.calibration.reader import CameraFile

POINTS = ((0.11, -0.07, 1.0), (-0.32, 0.21, 1.3), (0.05, 0.4, 0.9))
"""three points in front of a camera: x to the right, y down, z forward"""
Pixel = tuple[float, float]


def brown(
    point: Sequence[float], focal: Pixel, center: Pixel, radial: Sequence[float], tangential: Pixel = (0.0, 0.0)
) -> Pixel:
    """Project with Brown and Conrady's model; `radial` is k1 k2 k3, and k4 k5 k6 of a denominator."""
    x, y = point[0] / point[2], point[1] / point[2]
    k1, k2, k3, k4, k5, k6 = (*radial, *[0.0] * (6 - len(radial)))
    p1, p2 = tangential
    r2 = x * x + y * y
    factor = (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3) / (1 + k4 * r2 + k5 * r2**2 + k6 * r2**3)
    u = x * factor + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    v = y * factor + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    return focal[0] * u + center[0], focal[1] * v + center[1]


def kannala_brandt(point: Sequence[float], focal: Pixel, center: Pixel, coefficients: Sequence[float]) -> Pixel:
    """Project with the radius angle + k1 angle**3 + k2 angle**5 ..."""
    x, y = point[0] / point[2], point[1] / point[2]
    radius = math.hypot(x, y)
    angle = math.atan(radius)
    bent = angle + sum(k * angle ** (3 + 2 * i) for i, k in enumerate(coefficients))
    return focal[0] * bent * x / radius + center[0], focal[1] * bent * y / radius + center[1]


def check_pixels(camera: Camera, expected: Sequence[Pixel]) -> None:
    """Assert that `camera` projects `POINTS` to the `expected` pixels."""
    np.testing.assert_allclose(camera.project(np.array(POINTS)), expected, rtol=0, atol=1e-9)


FX, FY, CX, CY = 1180.5, 1176.25, 655.75, 470.5
SIZE = (1280, 960)


def check_terms(file: CameraFile, terms: Mapping[str, float], skew: float = 0.0, *, fisheye: bool = False) -> None:
    """Assert that a file's camera, of FX, FY, CX, CY and the `terms` by name, sees `POINTS` where the formulas do."""
    radial = [terms.get(f"k{i}", 0.0) for i in range(1, 5 if fisheye else 7)]
    expected = []
    for point in POINTS:
        if fisheye:
            u, v = kannala_brandt(point, (FX, FY), (CX, CY), radial)
        else:
            u, v = brown(point, (FX, FY), (CX, CY), radial, (terms.get("p1", 0.0), terms.get("p2", 0.0)))
        expected.append((u + skew * (v - CY) / FY, v))
    check_pixels(file.camera, expected)
