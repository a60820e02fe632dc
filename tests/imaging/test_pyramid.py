"""An image at halved sizes: how far it is reduced."""

from __future__ import annotations

import numpy as np
import pytest

from circlepose.imaging.pyramid import pyramid, to_full_size, to_reduced


@pytest.mark.parametrize(
    ("shape", "smallest"),
    [
        ((240, 320), (30, 40)),
        ((480, 640), (60, 80)),
        ((960, 1280), (120, 160)),
        ((50, 50), (50, 50)),
    ],
)
def test_an_image_is_reduced_until_large_circles_cost_little_or_wide_blur_is_sharp(shape, smallest):
    images = pyramid(np.zeros(shape, np.uint8))
    assert images[0].shape == shape
    assert images[-1].shape == smallest


@pytest.mark.parametrize("scale", [1.0, 2.0, 8.0])
def test_positions_of_reduced_images_go_back_and_forth(scale):
    points = np.array([[0.0, 0.0], [10.5, 3.25]])
    np.testing.assert_allclose(to_reduced(to_full_size(points, scale), scale), points)
