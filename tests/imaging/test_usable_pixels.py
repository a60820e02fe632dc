"""Wide ranges, odd pixels and images that are no plain grid of samples: the same circles are measured as without."""

from __future__ import annotations

import numpy as np
import pytest

import circlepose
from circlepose import Camera, Target
from circlepose.imaging.odd_pixels import odd_lines, odd_pixels
from circlepose.imaging.sampling_pattern import sampling_pattern
from circlepose.imaging.stretch import in_edge_levels
from circlepose.imaging.usable_pixels import usable_pixels
from circlepose.photometry.initialization import level_limits
from circlepose.results import Candidate, ImageResult
from circlepose.synthesis.render import render_float
from circlepose.synthesis.scene import Disc, Paint, Scene

SIZE = WIDTH, HEIGHT = 320, 240
LENS = (-0.1, 0.03, 0.0, 0.0)
CAMERA = Camera.create([[500.0, 0, 159.5], [0, 500.0, 119.5], [0, 0, 1]], LENS, SIZE)
CENTER, RADIUS = np.array([15.0, -6.0, 480.0]), 40.0
NORMAL = np.array([0.45, -0.3, -0.84]) / np.linalg.norm([0.45, -0.3, -0.84])
TARGET = Target.circle(RADIUS)
COVERED = render_float(Scene(CAMERA, (Disc(CENTER, NORMAL, RADIUS, Paint(255.0)),), Paint(0.0), blur_px=0.7)) / 255.0
"""(h, w) the share of each pixel that the disc covers, with blur"""


def noisy(levels: np.ndarray, sigma: float, seed: int = 0) -> np.ndarray:
    return np.rint(levels + np.random.default_rng(seed).normal(0.0, sigma, levels.shape))


def photograph(seed: int = 0) -> np.ndarray:
    """Return a disc of 50 levels on a ground of 200, with noise, (h, w) uint8."""
    return noisy(200.0 - 150.0 * COVERED, 2.0, seed).clip(0, 255).astype(np.uint8)


def thermal(seed: int = 0) -> np.ndarray:
    """Return a disc of 400 counts of 65535 over its ground, with a noise of 20, (h, w) uint16."""
    return noisy(30_000.0 + 400.0 * COVERED, 20.0, seed).astype(np.uint16)


def nearest(result: ImageResult) -> Candidate:
    (circle,) = result.circles
    return min(circle.candidates, key=lambda each: float(np.linalg.norm(each.normal - NORMAL)))


def sigmas_off(result: ImageResult) -> float:
    """Return the distance of the measured center from the true one, in its own standard deviations."""
    pose = nearest(result)
    assert pose.covariance is not None
    off = pose.center - CENTER
    return float(np.sqrt(off @ np.linalg.solve(pose.covariance[:3, :3], off)))


def on_the_rim() -> tuple[np.ndarray, np.ndarray]:
    """Return rows and columns of pixels on the rim."""
    y, x = np.nonzero((COVERED > 0.3) & (COVERED < 0.7))
    return y[::9], x[::9]


def hot_pixel(image: np.ndarray) -> None:
    image[10, 300] = 65_535


def dead_pixels(image: np.ndarray) -> None:
    image[5:7, 7:9] = 0
    image[on_the_rim()] = 0


def dead_lines(image: np.ndarray) -> None:
    image[118:120] = 0
    image[:, 170] = 65_535


def telemetry(image: np.ndarray) -> None:
    image[-2:] = np.random.default_rng(1).integers(0, 65_536, (2, WIDTH))


def hot_object(image: np.ndarray) -> None:
    y, x = np.mgrid[:50, :50]
    image[:50, :50] = 65_000 - 600 * np.hypot(y, x)


@pytest.mark.parametrize("spoil", [hot_pixel, dead_pixels, dead_lines, telemetry, hot_object])
@pytest.mark.parametrize("kind", [np.uint16, np.float32])
def test_what_widens_the_range_of_a_thermal_image_hides_no_disc(spoil, kind):
    image = thermal()
    spoil(image)
    result = circlepose.estimate(image.astype(kind), CAMERA, TARGET)
    assert sigmas_off(result) < 4.0
    plain = nearest(circlepose.estimate(thermal(), CAMERA, TARGET))
    assert np.all(np.abs(nearest(result).center - plain.center) < plain.sigma_mm)


def test_a_small_disc_that_is_all_there_is_of_the_upper_range_is_found():
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    dots = sum(np.clip(6.0 - np.hypot(y - 60.3, x - at), 0.0, 1.0) for at in (70.4, 160.0, 250.7))
    image = noisy(30_000.0 + 2000.0 * dots, 20.0).astype(np.uint16)
    image[200, 10] = 0
    result = circlepose.estimate(image, CAMERA, Target("circle", (RADIUS,), count=None))
    assert len(result.circles) == 3


def test_levels_of_the_edge_image_are_those_of_the_noise_where_8_bits_do_not_hold_it():
    image = thermal()
    hot_pixel(image)
    levels, size = in_edge_levels(image)
    assert levels.dtype == np.float32
    assert size == pytest.approx(20.0, rel=0.1)


def test_a_camera_of_12_bits_clips_below_the_end_of_its_16():
    image = noisy(3000.0 + 3000.0 * COVERED, 30.0).clip(0, 4095).astype(np.uint16)
    assert level_limits(image) == (0.0, 4095.0)
    assert level_limits(thermal()) == (0.0, 65_535.0)


@pytest.mark.parametrize("value", [0, 255])
@pytest.mark.parametrize(
    "group", [((0, 0),), ((0, 0), (0, 1)), ((0, 0), (1, 0), (1, 1)), ((0, 0), (0, 1), (1, 0), (1, 1))]
)
def test_groups_of_up_to_four_odd_pixels_are_seen_and_no_others(group, value):
    image = noisy(120.0 - 50.0 * COVERED, 2.0).astype(np.uint8)
    odd = np.zeros(image.shape, np.bool_)
    for y, x in ((20, 30), (100, 40), (200, 290), (120, 172)):
        for down, right in group:
            odd[y + down, x + right] = True
    image[odd] = value
    np.testing.assert_array_equal(odd_pixels(image), odd)


@pytest.mark.parametrize("blur_px", [0.4, 0.7, 1.0])
@pytest.mark.parametrize("radius_px", [0.3, 1.0, 2.5])
def test_small_bright_dots_are_not_odd_pixels(radius_px, blur_px):
    distance = 500.0
    parts = tuple(
        Disc(np.array([x, y, distance]), np.array([0.0, 0.0, -1.0]), radius_px, Paint(250.0))
        for x, y in ((-100.0, -50.0), (0.3, 0.4), (60.25, 30.5))
    )
    image = render_float(Scene(CAMERA, parts, Paint(30.0), blur_px=blur_px))
    assert odd_pixels(noisy(image, 1.5).astype(np.uint8)) is None


def test_a_photograph_has_no_odd_pixels_and_is_used_as_it_is():
    for seed in range(20):
        image = photograph(seed)
        assert odd_pixels(image) is None
        pixels = usable_pixels(image)
        assert pixels.own is image
        assert pixels.whole is image
        assert pixels.remark == ""


def test_odd_pixels_of_8_bits_near_the_rim_have_no_part_in_the_pose():
    image, spoiled = photograph(), photograph()
    spoiled[on_the_rim()] = 255
    pose, other = (nearest(circlepose.estimate(each, CAMERA, TARGET)) for each in (image, spoiled))
    assert np.all(np.abs(pose.center - other.center) < 0.5 * pose.sigma_mm)


def test_a_line_of_the_scene_is_not_an_odd_row():
    image = np.full((HEIGHT, WIDTH), 40.0)
    # Of a width of 1 px under the sharpest lens: blur of 0.4 px and the pixel's own box.
    image[99], image[100], image[101] = 61.0, 198.0, 61.0
    assert odd_lines(noisy(image, 1.0).astype(np.uint8)) is None
    image[99] = image[101] = 40.0
    found = odd_lines(noisy(image, 1.0).astype(np.uint8))
    assert found is not None
    assert np.flatnonzero(found.all(axis=1)).tolist() == [100]


def mosaic(ground: tuple[float, float, float], disc: tuple[float, float, float], seed: int = 0) -> np.ndarray:
    """Return a disc through a Bayer filter, RGGB, (h, w) uint8."""
    red, green, blue = (back + (front - back) * COVERED for back, front in zip(ground, disc, strict=True))
    levels = green.copy()
    levels[0::2, 0::2], levels[1::2, 1::2] = red[0::2, 0::2], blue[1::2, 1::2]
    return noisy(levels, 2.0, seed).clip(0, 255).astype(np.uint8)


@pytest.mark.parametrize(
    ("ground", "disc"),
    [((50, 170, 60), (180, 40, 40)), ((120, 200, 150), (20, 20, 20)), ((120, 200, 150), (30, 60, 180))],
)
def test_a_raw_mosaic_is_named_and_measured_in_one_color(ground, disc):
    result = circlepose.estimate(mosaic(ground, disc), CAMERA, TARGET)
    assert "mosaic" in result.remark
    assert sigmas_off(result) < 4.0


@pytest.mark.parametrize("shift", [-7, 2, 5])
def test_of_interlaced_fields_the_even_rows_are_measured(shift):
    image = photograph()
    image[1::2] = np.roll(photograph(1), shift, axis=1)[1::2]
    result = circlepose.estimate(image, CAMERA, TARGET)
    assert f"interlaced: odd rows are {abs(shift)} px" in result.remark
    assert sigmas_off(result) < 4.0


@pytest.mark.parametrize(("across", "down"), [(2, 2), (1, 2), (3, 3)])
def test_repeated_pixels_are_named_and_measured_without_a_shift(across, down):
    matrix = [[500.0 * across, 0, 160.0 * across - 0.5], [0, 500.0 * down, 120.0 * down - 0.5], [0, 0, 1]]
    camera = Camera.create(matrix, LENS, (WIDTH * across, HEIGHT * down))
    image = photograph().repeat(down, axis=0).repeat(across, axis=1)
    result = circlepose.estimate(image, camera, TARGET)
    assert "enlarged without interpolation" in result.remark
    assert sigmas_off(result) < 4.0


def ordinary_images() -> dict[str, np.ndarray]:
    generator = np.random.default_rng(3)
    y, x = np.mgrid[:200, :260]
    ramp = (x / 260.0 * 255.0).astype(np.uint8)
    ordered = np.array([[0, 8, 2, 10], [12, 4, 14, 6], [3, 11, 1, 9], [15, 7, 13, 5]]) * 16 + 8
    screen = 127.5 * (1.0 + np.cos(x * 1.3 + y * 0.4) * np.cos(y * 1.3 - x * 0.4))
    return {
        "flat": np.full((200, 260), 90, np.uint8),
        "noise": generator.integers(0, 256, (200, 260), np.uint8),
        "chessboard": noisy(60.0 + 120.0 * ((x // 20 + y // 20) % 2), 1.0).astype(np.uint8),
        "clean chessboard": (60 + 120 * ((x // 20 + y // 20) % 2)).astype(np.uint8),
        "stripes": noisy(60.0 + 120.0 * ((y // 3) % 2), 1.0).astype(np.uint8),
        "rows alternate": noisy(60.0 + 120.0 * (y % 2), 1.0).astype(np.uint8),
        "ordered dithering": ((ramp > np.tile(ordered, (50, 65))) * 255).astype(np.uint8),
        "random dithering": ((ramp > generator.integers(0, 256, ramp.shape)) * 255).astype(np.uint8),
        "halftone": ((screen > ramp) * 255).astype(np.uint8),
        "printed halftone": noisy(screen, 2.0).clip(0, 255).astype(np.uint8),
        "smooth": ramp,
        "tiny": generator.integers(0, 256, (9, 7), np.uint8),
    }


@pytest.mark.parametrize("name", ordinary_images())
def test_ordinary_images_have_no_sampling_pattern(name):
    assert sampling_pattern(ordinary_images()[name]) is None
