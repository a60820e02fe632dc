"""Lens models as their documentation states them, in plain numbers: what a calibration has to agree with."""

from __future__ import annotations

import math

import numpy as np

from circlepose.io.calibration.reader import CameraFile

FX, FY, CX, CY = 1180.5, 1176.25, 655.75, 470.5
SIZE = (1280, 960)
POINTS = np.array([[0.12, -0.08, 1.0], [-0.3, 0.21, 1.1], [0.0, 0.25, 0.9]])


def brown(x: float, y: float, terms: dict[str, float]) -> tuple[float, float]:
    """Distort a point of the plane z = 1 as OpenCV's documentation states it, written out."""
    k = {name: terms.get(name, 0.0) for name in ("k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2")}
    r2 = x * x + y * y
    radial = (1.0 + k["k1"] * r2 + k["k2"] * r2**2 + k["k3"] * r2**3) / (
        1.0 + k["k4"] * r2 + k["k5"] * r2**2 + k["k6"] * r2**3
    )
    return (
        x * radial + 2.0 * k["p1"] * x * y + k["p2"] * (r2 + 2.0 * x * x),
        y * radial + k["p1"] * (r2 + 2.0 * y * y) + 2.0 * k["p2"] * x * y,
    )


def kannala(x: float, y: float, terms: dict[str, float]) -> tuple[float, float]:
    """Distort a point as OpenCV's documentation of the fisheye states it, written out."""
    r = math.hypot(x, y)
    theta = math.atan(r)
    bent = theta * (1.0 + sum(terms[f"k{i}"] * theta ** (2 * i) for i in range(1, 5)))
    return x * bent / r, y * bent / r


def check_pixels(file: CameraFile, terms: dict[str, float], skew: float = 0.0, *, fisheye: bool = False) -> None:
    """Assert that three points are seen where the formulas put them, for fx, fy, cx, cy as above."""
    distort = kannala if fisheye else brown
    expected = []
    for x, y, z in POINTS.tolist():
        u, v = distort(x / z, y / z, terms)
        expected.append([FX * u + skew * v + CX, FY * v + CY])
    np.testing.assert_allclose(file.camera.project(POINTS), expected, rtol=0.0, atol=1e-9)
