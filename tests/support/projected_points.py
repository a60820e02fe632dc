"""Points before a camera whose pixels a test works out from a tool's own formula."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from circlepose.camera.camera import Camera

POINTS = ((0.11, -0.17, 1.0), (-0.31, 0.24, 1.25), (0.06, 0.21, 0.8))


def assert_pixels(camera: Camera, formula: Callable[[float, float], tuple[float, float]]) -> None:
    """Assert that the camera's pixels are those of `formula`, which takes x / z and y / z, to 1e-9 px."""
    expected = [formula(x / z, y / z) for x, y, z in POINTS]
    np.testing.assert_allclose(camera.project(np.array(POINTS)), expected, rtol=0.0, atol=1e-9)


def brown(x: float, y: float, k: tuple[float, ...], p1: float = 0.0, p2: float = 0.0) -> tuple[float, float]:
    """Return the distorted point of OpenCV's documentation: k1 k2 k3 and the tangential p1 p2."""
    r2 = x * x + y * y
    radial = 1.0 + sum(each * r2 ** (i + 1) for i, each in enumerate(k))
    return (
        x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
        y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
    )


def equidistant(x: float, y: float, k: tuple[float, ...]) -> tuple[float, float]:
    """Return the distorted point of a fisheye lens: the angle to the axis, and its odd powers."""
    r = float(np.hypot(x, y))
    angle = float(np.arctan(r))
    distorted = angle * (1.0 + sum(each * angle ** (2 * i + 2) for i, each in enumerate(k)))
    return x * distorted / r, y * distorted / r
