from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from circlepose._typing import FloatArray
from circlepose.camera.camera import Camera
from circlepose.synthesis.render import render_float
from circlepose.synthesis.scene import CoaxialPart, Disc, Paint, Scene


def make_camera(focal: float, size: tuple[int, int], dist_coeffs: tuple[float, ...] = ()) -> Camera:
    matrix = [[focal, 0.0, (size[0] - 1) / 2], [0.0, focal, (size[1] - 1) / 2], [0.0, 0.0, 1.0]]
    return Camera.create(matrix, dist_coeffs, size)


def traced(part: CoaxialPart, camera: Camera, plate: float, samples: int) -> FloatArray:
    """An image by tracing rays through the part: discs and lateral cone by their equations, nothing shared."""
    assert camera.image_size is not None
    width, height = camera.image_size
    sub = (np.arange(samples) + 0.5) / samples - 0.5
    x = (np.arange(width)[:, None] + sub).ravel()
    y = (np.arange(height)[:, None] + sub).ravel()
    rays = camera.rays(np.stack(np.meshgrid(x, y), axis=-1))
    big, small = part.circles
    n, along = part.normal, rays @ part.normal

    def disc(center: FloatArray, radius: float) -> FloatArray:
        depth = (center @ n) / along
        miss = np.linalg.norm(depth[..., None] * rays - center, axis=-1) > radius
        return np.where(miss, np.inf, depth)

    at_big, at_small = disc(big.center, big.radius), disc(small.center, small.radius)
    # Points p = t r with a = (p - c).n and |p - c|^2 - a^2 = (R + k a)^2.
    reach = float((small.center - big.center) @ n)
    k = (small.radius - big.radius) / reach
    start = -float(big.center @ n)
    a = 1.0 - along**2 - (k * along) ** 2
    b = -(rays @ big.center) - along * start - (big.radius + k * start) * k * along
    c = float(big.center @ big.center) - start**2 - (big.radius + k * start) ** 2
    root = np.sqrt(np.maximum(b * b - a * c, 0.0))
    wall = np.full(along.shape, np.inf)
    for depth in ((-b - root) / a, (-b + root) / a):
        axial = depth * along + start
        # Through a recess's mouth the wall is met behind the mouth; a wall's outer side is not there.
        usable = (b * b > a * c) & (depth > 0.0) & (axial * (axial - reach) <= 0.0)
        if part.form == "recess":
            usable &= depth >= at_big * (1.0 - 1e-12)
        wall = np.where(usable & (depth < wall), depth, wall)
    if part.form == "boss":
        first = np.minimum(wall, at_small)
        level = np.where(at_small <= wall, part.cap.level, part.side.level)
        level = np.where(np.isinf(np.minimum(first, at_big)), plate, level)
        level = np.where(np.isinf(first) & np.isfinite(at_big), part.side.level, level)
    else:
        level = np.where(at_small < wall, part.cap.level, part.side.level)
        level = np.where(np.isinf(at_big), plate, level)
    return level.reshape(height, samples, width, samples).mean(axis=(1, 3))


@pytest.mark.parametrize("form", ["boss", "recess"])
@pytest.mark.parametrize("normal", [(0.02, 0.0, -1.0), (0.25, 0.1, -1.0), (0.6, -0.3, -1.0), (-1.0, 0.4, -0.6)])
def test_coaxial_part_is_seen_as_rays_see_it(form: str, normal: tuple[float, float, float]) -> None:
    camera = make_camera(115.0, (80, 66), (-0.2, 0.05, 0.001, 0.0))
    part = CoaxialPart((8.0, -6.0, 260.0), normal, (45.0, 30.0), 30.0, form, Paint(60.0), Paint(220.0))
    image = render_float(Scene(camera, (part,), Paint(150.0), blur_px=0.0))
    reference = traced(part, camera, 150.0, 8)
    # The reference's point samples are good to about 1/(2 samples) of a pixel that an edge runs along.
    assert float(np.abs(image - reference).max()) < 12.0
    assert float(np.abs((image - reference).mean())) < 0.03
    assert float(np.sqrt(np.mean((image - reference) ** 2))) < 0.5


def test_coinciding_rims_let_nothing_through() -> None:
    """On the far side of a steep boss cap and body end together: the dark side must not show between."""
    camera = make_camera(400.0, (200, 160))
    bright = CoaxialPart((0.0, 0.0, 400.0), (0.8, 0.0, -1.0), (30.0, 29.0), 40.0, "boss", Paint(0.0), Paint(200.0))
    disc = Disc(bright.small_center_mm, bright.normal, 29.0, Paint(200.0))
    scene = Scene(camera, (bright,), Paint(100.0))
    beyond = slice(135, 200)
    np.testing.assert_allclose(
        render_float(scene)[:, beyond], render_float(replace(scene, targets=(disc,)))[:, beyond], atol=1e-6
    )
