from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from circlepose.camera.camera import Camera
from circlepose.drawing import captions
from circlepose.drawing.captions import Caption
from circlepose.drawing.overlay import MOST_CAPTIONS, SMALLEST_PICTURE, draw_overlay
from circlepose.results import CircleResult, ImageResult, Status
from tests.support.discs import CAMERA, CENTER_MM, disc_image, made_circle, made_result

GREY = np.full((240, 320), 128, np.uint8)
NO_POSE = CircleResult(0, "disc", "chen-huang", 20.0, status=Status.NO_POSE, reason="edge-on")


def coloured(picture) -> np.ndarray:
    """Where a picture of a grey image is not grey."""
    return np.ptp(picture.astype(int), axis=2) > 60


@pytest.mark.parametrize(
    "image",
    [
        GREY,
        GREY[..., None],
        np.dstack([GREY] * 3),
        np.dstack([GREY] * 4),
        GREY.astype(np.uint16) * 200,
        GREY.astype(np.float32) / 255.0,
    ],
)
def test_any_image_becomes_a_colour_picture_large_enough_for_text(image):
    before = image.copy()
    picture = draw_overlay(image, made_result(), CAMERA)
    assert picture.dtype == np.uint8
    assert picture.ndim == 3
    assert picture.shape[1] == 1280 >= SMALLEST_PICTURE
    assert picture.shape[0] > 960
    np.testing.assert_array_equal(image, before)


def test_sixteen_bits_are_stretched():
    image = disc_image().astype(np.uint16) * 16 + 1000
    picture = draw_overlay(image, ImageResult("a.png"), CAMERA)
    assert picture[-900:].min() < 10
    assert picture[-900:].max() == 255


def test_large_images_keep_their_size():
    image = np.zeros((1500, 2000), np.uint8)
    picture = draw_overlay(image, ImageResult("a.png"), CAMERA)
    assert picture.shape[1] == 2000
    assert picture.shape[0] > 1500


def test_the_rim_is_drawn_where_the_camera_sees_it():
    circle = made_circle()
    picture = draw_overlay(GREY, made_result(replace(circle, contour=None)), CAMERA)
    body = picture[-960:]
    rim = np.round((circle.contour + 0.5) * 4 - 0.5).astype(int)
    assert coloured(body)[rim[:, 1], rim[:, 0]].mean() > 0.9


def test_the_chosen_normal_is_drawn_bold_towards_its_side():
    circle = replace(made_circle(), contour=None, ellipse=None)
    picture = draw_overlay(GREY, made_result(circle), CAMERA)[-960:]
    chosen = circle.candidates[0]
    tip = CAMERA.project(chosen.center + 0.7 * circle.radius_mm * chosen.normal)
    u, v = np.round((tip + 0.5) * 4 - 0.5).astype(int)
    assert coloured(picture[v - 3 : v + 4, u - 3 : u + 4]).sum() > 10


@pytest.mark.parametrize(
    "result",
    [
        ImageResult("bad.png", Status.NO_CIRCLE, "nothing there"),
        ImageResult("bad\udcff\x1b.png", Status.SIZE_MISMATCH, "another size " * 60),
        made_result(NO_POSE),
        made_result(replace(NO_POSE, contour=np.array([[10.0, 10.0], [20.0, 10.0], [15.0, 20.0]]))),
        replace(made_result(), status=Status.TOO_FEW_CIRCLES, reason="1 of 2 found"),
    ],
)
def test_failures_are_drawn_too(result):
    picture = draw_overlay(GREY, result, CAMERA)
    heading = picture[:-960]
    assert (heading > 200).any()


def test_a_pose_that_the_lens_cannot_see_is_left_out():
    behind = made_circle()
    candidates = tuple(replace(c, center=-c.center, imaged_center=np.full(2, np.nan)) for c in behind.candidates)
    lost = replace(behind, candidates=candidates, contour=None, ellipse=None)
    assert not coloured(draw_overlay(GREY, made_result(lost), CAMERA)[-960:]).any()


def test_a_rim_that_passes_out_of_a_strong_lens_is_drawn_as_far_as_it_goes():
    camera = Camera.create(CAMERA.camera_matrix, [-0.6, 0.0, 0.0, 0.0], (320, 240))
    near = made_circle(center=np.array([60.0, 0.0, 90.0]))
    circle = replace(near, contour=None, ellipse=None)
    assert not np.all(np.isfinite(camera.project(circle.candidates[0].center + 20.0 * np.eye(3))))
    draw_overlay(GREY, made_result(circle), camera)


def test_an_arc_that_was_not_used_is_not_bridged():
    circle = made_circle()
    half = replace(circle, contour=circle.contour[:180], candidates=(), ellipse=None, status=Status.NO_POSE)
    body = draw_overlay(GREY, made_result(half), CAMERA)[-960:]
    ends = (circle.contour[179] + circle.contour[0]) / 2.0
    u, v = np.round(ends * 4).astype(int)
    assert not coloured(body[v - 8 : v + 8, u - 8 : u + 8]).any()


def test_only_one_of_several_methods_is_drawn():
    other = made_circle(method="kabuka-arenas", center=CENTER_MM + np.array([0.0, 40.0, 0.0]))
    one = draw_overlay(GREY, made_result(made_circle()), CAMERA)
    np.testing.assert_array_equal(one, draw_overlay(GREY, made_result(made_circle(), other), CAMERA))


def many(number: int) -> ImageResult:
    places = np.linspace(-60.0, 60.0, number)
    return made_result(*(made_circle(i, np.array([x, 40.0 * (-1) ** i, 200.0])) for i, x in enumerate(places)))


@pytest.mark.parametrize("number", [5, MOST_CAPTIONS + 1])
def test_many_circles_get_short_captions(number):
    assert draw_overlay(GREY, many(number), CAMERA).shape[1] == 1280


def test_captions_do_not_cover_each_other():
    canvas = np.zeros((600, 800, 3), np.uint8)
    extent = (380.0, 280.0, 420.0, 320.0)
    captions.place(canvas, [Caption(("caption", "text"), (0, 0, 255), extent)] * 8, text_scale=0.5)
    # Each plate has an edge in the caption's colour; 8 whole edges stand side by side.
    edges = np.all(canvas == (0, 0, 255), axis=2)
    one = np.zeros((600, 800, 3), np.uint8)
    captions.place(one, [Caption(("caption", "text"), (0, 0, 255), extent)], text_scale=0.5)
    assert edges.sum() >= 8 * np.all(one == (0, 0, 255), axis=2).sum() > 0
    assert not edges[285:315, 385:415].any()


def test_a_long_heading_is_wrapped():
    one = captions.strip(500, [("short", 0.5)], (0, 0, 0))
    three = captions.strip(500, [("word " * 40, 0.5)], (0, 0, 0))
    assert three.shape[0] > 2 * one.shape[0]
    assert three.shape[1] == 500
