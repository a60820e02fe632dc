from __future__ import annotations

import numpy as np
import pytest

from circlepose.drawing.display import displayed, enlarged
from circlepose.errors import ArgumentError
from tests.support.discs import disc_image


def test_a_usual_image_is_shown_as_it_is():
    image = disc_image()
    picture, remark = displayed(image)
    assert remark == ""
    for channel in range(3):
        np.testing.assert_array_equal(picture[..., channel], image)
    color = np.dstack([image, image // 2, image // 4])
    np.testing.assert_array_equal(displayed(color)[0], color)


@pytest.mark.parametrize("divisor", [4, 10, 20])
def test_a_dark_image_is_brightened_by_a_factor_that_is_said(divisor):
    dark = disc_image() // divisor
    picture, remark = displayed(dark)
    assert "times brighter" in remark
    assert 190 < np.percentile(picture, 99) < 230
    gain = float(remark.split()[1])
    assert gain * np.percentile(dark, 99) == pytest.approx(np.percentile(picture, 99), rel=0.05)


def test_what_counts_is_around_the_circles():
    image = disc_image() // 4
    image[:40] = 255
    box = (100.0, 60.0, 260.0, 200.0)
    assert displayed(image)[1] == ""
    assert "brighter" in displayed(image, [box])[1]
    assert displayed(image, [(-500.0, -500.0, -400.0, -400.0)])[1] == ""


def test_a_pale_image_gets_contrast():
    pale = (150 + disc_image() / 16).astype(np.uint8)
    picture, remark = displayed(pale)
    assert "contrast" in remark
    assert np.ptp(np.percentile(picture, [1, 99])) > 3 * np.ptp(np.percentile(pale, [1, 99]))


@pytest.mark.parametrize("level", [0, 1, 90, 255])
def test_a_blank_image_is_left_alone(level):
    picture, remark = displayed(np.full((20, 30), level, np.uint8))
    assert remark == ""
    assert np.all(picture == level)


@pytest.mark.parametrize(
    "image", [disc_image().astype(np.uint16) * 16 + 1000, disc_image() * 1e-3, disc_image() * 1e300]
)
def test_deeper_levels_are_stretched_to_the_range_that_is_there(image):
    picture, remark = displayed(image)
    assert "shown as black to white" in remark
    assert picture.min() < 10
    assert picture.max() > 245
    hot = image.copy()
    hot[0, 0] = hot.max() * 3 if image.dtype.kind == "f" else 65535
    assert np.abs(displayed(hot)[0][1:].astype(int) - picture[1:]).max() <= 3


def test_small_pictures_are_enlarged_more_where_circles_are_small():
    picture = np.zeros((480, 640, 3), np.uint8)
    assert enlarged(picture)[1] == 2
    assert enlarged(picture, 100.0)[1] == 2
    assert enlarged(picture, 10.0)[1] == 3
    assert enlarged(np.zeros((1944, 2592, 3), np.uint8), 10.0)[1] == 1


def test_what_is_no_image_is_refused():
    with pytest.raises(ArgumentError, match=r"^image: "):
        displayed(np.zeros(5))
