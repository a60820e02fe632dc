"""The random views of one disc on which methods are compared."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Literal

import numpy as np

from circlepose._typing import FloatArray
from circlepose.camera.camera import Camera, circle_contour
from circlepose.errors import ArgumentError
from circlepose.geometry.cone import plane_basis
from circlepose.synthesis.scene import Disc, Paint, Scene

RADIUS_MM = 60.0
_DISTANCE_MM = (400.0, 1500.0)
_TILT_DEG = (0.0, 75.0)
_BORDER_PX = 12.0
_CAMERAS = {"lo": ((1280, 960), 1200.0), "hi": ((2456, 2058), 3480.0)}


def disc_views(
    name: Literal["lo", "hi"], number: int, seed: int, dist_coeffs: Sequence[float] = ()
) -> Iterator[Scene]:
    """Yield `number` scenes of a black disc of radius 60 mm on white, anywhere in the image and wholly in it.

    Gray 40 on 200, blur 0.7 px, noise 2 gray levels. The center is 400 to 1500 mm from the camera, the
    normal 0 to 75 deg from the line of sight, both uniform. `lo` is 1280 x 960 with f = 1200 px, `hi` is
    2456 x 2058 with f = 3480 px; `dist_coeffs` in OpenCV's order. View k depends on (`seed`, k) alone.
    """
    if name not in _CAMERAS:
        raise ArgumentError(f"name: expected one of {', '.join(_CAMERAS)}, got {name!r}.")
    (width, height), focal = _CAMERAS[name]
    camera = Camera.create(
        [[focal, 0.0, (width - 1) / 2], [0.0, focal, (height - 1) / 2], [0.0, 0.0, 1.0]], dist_coeffs, (width, height)
    )
    for view in range(number):
        generator = np.random.Generator(np.random.PCG64([seed, view]))
        center, normal = _pose_in_view(camera, generator)
        yield Scene(
            camera=camera,
            targets=(Disc(center, normal, RADIUS_MM, Paint(40.0)),),
            background=Paint(200.0),
            blur_px=0.7,
            noise_levels=2.0,
            noise_seed=int(generator.random() * 2.0**32),
            name=f"{view:04d}",
        )


def _pose_in_view(camera: Camera, generator: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Draw until the whole rim is at least `_BORDER_PX` inside the image."""
    size = np.array(camera.image_size)
    while True:
        ray = camera.rays(generator.random(2) * (size - 1.0))
        distance = _between(_DISTANCE_MM, generator.random())
        tilt, azimuth = np.radians(_between(_TILT_DEG, generator.random())), 2.0 * np.pi * generator.random()
        first, second = plane_basis(ray)
        center = distance * ray
        normal = -np.cos(tilt) * ray + np.sin(tilt) * (np.cos(azimuth) * first + np.sin(azimuth) * second)
        rim = circle_contour(camera, center, normal, RADIUS_MM, 90)
        # A NaN, beyond the lens model, is not inside either.
        if np.all((rim >= _BORDER_PX) & (rim <= size - 1.0 - _BORDER_PX)):
            return center, normal


def _between(limits: tuple[float, float], part: float) -> float:
    return limits[0] + part * (limits[1] - limits[0])
