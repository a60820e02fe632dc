from __future__ import annotations

import itertools

import numpy as np
import pytest

from circlepose.camera.camera import circle_contour
from circlepose.errors import ArgumentError
from circlepose.synthesis.disc_sets import disc_views


@pytest.mark.parametrize("dist_coeffs", [(), (-0.3, 0.1, 0.0, 0.0)])
@pytest.mark.parametrize(("name", "size", "focal"), [("lo", (1280, 960), 1200.0), ("hi", (2456, 2058), 3480.0)])
def test_views_are_what_they_say(name, size, focal, dist_coeffs) -> None:
    tilts, distances = [], []
    for scene in disc_views(name, 150, 4, dist_coeffs):
        (disc,) = scene.targets
        camera = scene.camera
        assert camera.image_size == size
        assert camera.camera_matrix[0, 0] == focal
        assert tuple(camera.dist_coeffs) == dist_coeffs
        assert (scene.blur_px, scene.noise_levels, disc.radius_mm) == (0.7, 2.0, 60.0)
        rim = circle_contour(camera, disc.center_mm, disc.normal, disc.radius_mm, 720)
        assert rim.min() >= 11.5
        assert np.all(rim <= np.array(size) - 12.5)
        distances.append(float(np.linalg.norm(disc.center_mm)))
        tilts.append(float(np.degrees(np.arccos(-disc.normal @ disc.center_mm / distances[-1]))))
    assert min(tilts) >= 0.0
    assert max(tilts) <= 75.0 + 1e-9
    assert max(tilts) - min(tilts) > 60.0
    assert min(distances) >= 400.0
    assert max(distances) <= 1500.0
    assert max(distances) - min(distances) > 800.0


def test_a_view_depends_on_its_number_and_the_seed_alone() -> None:
    def poses(number: int, seed: int) -> list[tuple[str, int, tuple[float, ...]]]:
        return [
            (scene.name, scene.noise_seed, (*scene.targets[0].circles[0].center, *scene.targets[0].circles[0].normal))
            for scene in disc_views("lo", number, seed)
        ]

    assert poses(5, 7) == poses(9, 7)[:5]
    assert all(a != b for a, b in zip(poses(5, 7), poses(5, 8), strict=True))
    assert len({seed for _, seed, _ in poses(9, 7)}) == 9


def test_views_come_one_at_a_time() -> None:
    assert len(list(itertools.islice(disc_views("hi", 10**9, 1), 3))) == 3


def test_unknown_set_is_refused() -> None:
    with pytest.raises(ArgumentError, match="lo, hi"):
        next(disc_views("mid", 1, 1))  # type: ignore[arg-type]
