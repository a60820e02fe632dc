"""Floating images: neither gain nor offset counts, and pixels without a level are left out."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import circlepose
from circlepose import Camera, Target
from circlepose.errors import ArgumentError
from circlepose.imaging.float_levels import in_steps, without_gaps
from circlepose.imaging.gray import to_grey
from circlepose.photometry.initialization import level_limits
from circlepose.results import ImageResult
from circlepose.synthesis.render import render
from circlepose.synthesis.scene import Disc, Paint, Scene

CAMERA = Camera.create([[500.0, 0, 149.5], [0, 500.0, 99.5], [0, 0, 1]], (), (300, 200))
CENTER, NORMAL, RADIUS = np.array([15.0, -6.0, 420.0]), np.array([0.45, -0.3, -0.84]), 40.0
TARGET = Target.circle(RADIUS)


def photograph(*, bright: float = 190.0, noise: float = 1.5, seed: int = 0) -> np.ndarray:
    """Return an 8 bit image (h, w) of a disc of 60 levels on a ground that is `bright`, clipped at 255."""
    part = Disc(CENTER, NORMAL / np.linalg.norm(NORMAL), RADIUS, Paint(255.0))
    disc = render(Scene(CAMERA, (part,), Paint(0.0), blur_px=0.8, bit_depth=16)) / 65535.0
    levels = bright + (60.0 - bright) * disc + np.random.default_rng(seed).normal(0.0, noise, disc.shape)
    levels[:25] = levels[:25] * 0.5
    return np.clip(np.rint(levels), 0, 255).astype(np.uint8)


def position_error(result: ImageResult) -> float:
    (circle,) = result.circles
    return float(min(np.linalg.norm(each.center - CENTER) for each in circle.candidates))


def assert_alike(result: ImageResult, other: ImageResult, sigmas: float) -> None:
    (first,), (second,) = result.circles, other.circles
    for a, b in zip(first.candidates, second.candidates, strict=True):
        assert a.covariance is not None
        assert b.covariance is not None
        sigma = np.sqrt(np.diag(a.covariance))[:3]
        assert np.all(np.abs(a.center - b.center) < sigmas * sigma)
        np.testing.assert_allclose(b.covariance, a.covariance, rtol=0.01, atol=1e-3 * np.trace(a.covariance[:3, :3]))


PHOTOGRAPH = photograph()
AS_FLOAT = circlepose.estimate(PHOTOGRAPH.astype(np.float64), CAMERA, TARGET)


@pytest.mark.parametrize(("kind", "scale"), [(np.float16, 1), (np.float32, 1), (np.float32, 255), (np.float64, 255)])
def test_a_floating_copy_is_measured_as_the_image_of_8_bit_is(kind: type, scale: int) -> None:
    image = PHOTOGRAPH.astype(kind) / kind(scale)
    assert_alike(circlepose.estimate(PHOTOGRAPH, CAMERA, TARGET), circlepose.estimate(image, CAMERA, TARGET), 0.1)


@settings(max_examples=15, deadline=None)
@given(st.floats(-280.0, 280.0), st.floats(-1e3, 1e3), st.sampled_from([-1.0, 1.0]))
def test_neither_gain_nor_offset_counts(exponent: float, offset: float, sign: float) -> None:
    gain = sign * 10.0**exponent
    image = gain * PHOTOGRAPH + gain * offset
    assert_alike(AS_FLOAT, circlepose.estimate(image, CAMERA, TARGET), 0.02)


def test_nor_do_they_for_levels_that_no_8_bit_image_has() -> None:
    rng = np.random.default_rng(1)
    image = PHOTOGRAPH + rng.normal(0.0, 0.5, PHOTOGRAPH.shape)
    whole = circlepose.estimate(image, CAMERA, TARGET)
    assert_alike(whole, circlepose.estimate(image * 3e-5 + 0.1, CAMERA, TARGET), 0.02)
    assert position_error(whole) < 4.0 * np.sqrt(np.trace(whole.circles[0].candidates[0].covariance[:3, :3]))


def test_colored_floating_images() -> None:
    image = cv2.cvtColor(PHOTOGRAPH, cv2.COLOR_GRAY2BGR) / 255.0
    assert_alike(AS_FLOAT, circlepose.estimate(image, CAMERA, TARGET), 0.05)


@pytest.mark.parametrize("dead", [np.nan, np.inf, -np.inf])
def test_dead_pixels_are_left_out(dead: float) -> None:
    ellipse = AS_FLOAT.circles[0].ellipse
    assert ellipse is not None
    x, y = np.rint(ellipse.points(24)).astype(int).T
    image = PHOTOGRAPH / 255.0
    image[y, x] = dead
    image[100, 155] = dead
    image[5:40, 3:9] = dead
    result = circlepose.estimate(image, CAMERA, TARGET)
    (circle,), (whole,) = result.circles, AS_FLOAT.circles
    sigma = np.sqrt(np.trace(whole.candidates[0].covariance[:3, :3]))
    assert np.linalg.norm(circle.candidates[0].center - whole.candidates[0].center) < sigma
    # What is left of the rim says a little less.
    assert 0.99 < np.sqrt(np.trace(circle.candidates[0].covariance[:3, :3])) / sigma < 1.3


def test_what_dead_pixels_hold_does_not_count() -> None:
    image = PHOTOGRAPH.astype(float)
    image[100:104, 150:153] = np.nan
    other = image.copy()
    other[100:104, 150:153] = [[np.inf, -np.inf, np.nan]] * 4
    first, second = (circlepose.estimate(each, CAMERA, TARGET).circles[0] for each in (image, other))
    assert np.array_equal(first.candidates[0].center, second.candidates[0].center)
    assert np.array_equal(first.candidates[0].covariance, second.candidates[0].covariance)


def test_a_hot_pixel_does_not_stretch_the_levels() -> None:
    image = PHOTOGRAPH / 255.0
    image[2, 2], image[199, 7] = 1e30, -1e300
    levels, expected = to_grey(image), to_grey(PHOTOGRAPH / 255.0)
    np.testing.assert_allclose(np.delete(levels, [2, 199], axis=0), np.delete(expected, [2, 199], axis=0), atol=1e-3)


def test_an_image_without_a_level_is_refused() -> None:
    with pytest.raises(ArgumentError, match="image: none of its levels is a finite number"):
        circlepose.estimate(np.full((20, 30), np.nan), CAMERA, TARGET)


@given(st.floats(-300.0, 300.0), st.integers(1, 400))
def test_levels_are_counted_in_their_steps(exponent: float, most: int) -> None:
    levels = np.random.default_rng(most).permutation(np.arange(most + 1)).astype(float)
    found = in_steps(levels * 10.0**exponent - 10.0**exponent)
    np.testing.assert_allclose(found - found.min(), levels, atol=1e-3)


def test_gaps_are_filled_from_the_nearest_pixel() -> None:
    levels = np.tile(np.arange(9.0, dtype=np.float32), (7, 1))
    gappy = levels.copy()
    gappy[2:5, 3] = np.nan
    gappy[:, 8] = np.nan
    filled = without_gaps(gappy)
    assert np.all(np.abs(filled - levels) <= 1.0)
    assert np.array_equal(filled[~np.isnan(gappy)], levels[~np.isnan(gappy)])
    assert without_gaps(levels) is levels


def test_a_floating_copy_of_a_clipped_image_is_clipped() -> None:
    errors: dict[str, list[float]] = {"8 bit": [], "floating": []}
    for seed in range(5):
        image = photograph(bright=400.0, seed=seed)
        for name, each in (("8 bit", image), ("floating", image / 255.0)):
            errors[name].append(position_error(circlepose.estimate(each, CAMERA, TARGET)))
    np.testing.assert_allclose(errors["floating"], errors["8 bit"], rtol=0.1, atol=0.02)


def test_levels_that_do_not_pile_up_are_not_clipped() -> None:
    assert level_limits(to_grey(PHOTOGRAPH / 255.0)) == (-np.inf, np.inf)
    assert level_limits(to_grey(PHOTOGRAPH)) == (0.0, 255.0)
    low, high = level_limits(to_grey(photograph(bright=400.0) / 255.0))
    assert low == -np.inf
    assert high < np.inf


def test_a_mask_is_not_passed_over():
    image = np.ma.masked_array(np.zeros((20, 20), np.uint8), mask=np.eye(20, dtype=bool))
    with pytest.raises(ArgumentError, match="without a mask"):
        to_grey(image)
