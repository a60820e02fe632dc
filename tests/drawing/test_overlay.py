from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from circlepose.camera.camera import Camera
from circlepose.drawing import overlay
from circlepose.drawing.display import SMALLEST_PICTURE
from circlepose.drawing.overlay import MOST_CAPTIONS, MOST_ROWS, draw_overlay
from circlepose.drawing.style import AMBIGUOUS, CHOSEN, OTHER, REJECTED, UNUSED
from circlepose.errors import ArgumentError
from circlepose.results import CircleResult, Flag, ImageResult, Status
from tests.support.discs import CAMERA, CENTER_MM, disc_image, made_circle, made_result

GREY = np.full((240, 320), 128, np.uint8)
NO_POSE = CircleResult(0, "disc", "chen-huang", 20.0, status=Status.NO_POSE, reason="edge-on")
LARGE = Camera.create([[3240.0, 0.0, 1295.5], [0.0, 3240.0, 971.5], [0.0, 0.0, 1.0]], (), (2592, 1944))


def colored(picture) -> np.ndarray:
    """Where a picture of a gray image is not gray."""
    return np.ptp(picture.astype(int), axis=2) > 60


def body_of(picture, image=GREY) -> np.ndarray:
    """The image within its picture, whose factor is that of the heights."""
    factor = picture.shape[1] // image.shape[1]
    return picture[-factor * image.shape[0] :, : factor * image.shape[1]]


def has(picture, color) -> bool:
    return bool(np.all(picture == color, axis=-1).any())


@pytest.mark.parametrize(
    "image",
    [
        GREY,
        GREY > 100,
        GREY[..., None],
        np.dstack([GREY] * 2),
        np.dstack([GREY] * 3),
        np.dstack([GREY] * 4),
        GREY.astype(np.uint16) * 200,
        GREY.astype(np.float32) / 255.0,
        GREY.astype(np.float16),
        np.where(np.arange(320) < 9, np.nan, GREY * 1e300),
    ],
)
def test_any_image_becomes_a_color_picture_large_enough_for_text(image):
    before = image.copy()
    picture = draw_overlay(image, made_result(), CAMERA)
    assert picture.dtype == np.uint8
    assert picture.ndim == 3
    assert picture.shape[1] == 1280 >= SMALLEST_PICTURE
    assert picture.shape[0] > 960
    np.testing.assert_array_equal(image, before)


def test_large_images_keep_their_size():
    image = np.full((1500, 2000), 90, np.uint8)
    picture = draw_overlay(image, ImageResult("a.png"), CAMERA)
    assert picture.shape[1] == 2000
    assert picture.shape[0] > 1500


@pytest.mark.parametrize(("camera", "height", "width"), [(CAMERA, 240, 320), (LARGE, 1944, 2592)])
def test_the_rim_is_drawn_where_the_camera_sees_it_and_is_thin(camera, height, width):
    circle = made_circle(camera=camera)
    bare = replace(circle, candidates=circle.candidates[:1], flags=())
    image = np.full((height, width), 128, np.uint8)
    body = body_of(draw_overlay(image, replace(made_result(bare), image_size=(width, height)), camera), image)
    factor = body.shape[0] // height
    rim = (circle.contour + 0.5) * factor - 0.5
    at = np.round(rim).astype(int)
    assert colored(body[None, at[:, 1], at[:, 0]]).mean() > 0.9
    # Two image px beside the rim nothing of it is seen; the arrow and the label are elsewhere.
    middle = rim.mean(axis=0)
    outward = (rim - middle) / np.linalg.norm(rim - middle, axis=1, keepdims=True)
    for side in (-2.0, 2.0):
        beside = np.round(rim + side * max(factor, 1) * outward).astype(int)
        assert colored(body[None, beside[:, 1], beside[:, 0]]).mean() < 0.05


def test_the_chosen_normal_is_drawn_bold_towards_its_side():
    circle = replace(made_circle(), contour=None, ellipse=None)
    picture = body_of(draw_overlay(GREY, made_result(circle), CAMERA))
    chosen = circle.candidates[0]
    tip = CAMERA.project(chosen.center + 0.7 * circle.radius_mm * chosen.normal)
    u, v = np.round((tip + 0.5) * 4 - 0.5).astype(int)
    assert colored(picture[v - 3 : v + 4, u - 3 : u + 4]).sum() > 6


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
def test_failures_are_said_in_the_heading(result, monkeypatch):
    said = []
    kind = overlay.Heading
    monkeypatch.setattr(overlay, "Heading", lambda *args: said.append(args) or kind(*args))
    heading = draw_overlay(GREY, result, CAMERA)[:-960]
    assert (heading > 200).any()
    ((title, sentences, *_),) = said
    assert title == result.image
    if result.status is not Status.OK:
        assert f"{result.status}: {result.reason}" in sentences


@pytest.mark.parametrize("name", ["перо.png", "图像.png", "ภาพ.png", "é" * 300, "x" * 3000, "\n\t\x00", "🙂.png", ""])
def test_names_in_any_script_have_room(name):
    picture = draw_overlay(disc_image(), made_result(image=name), CAMERA)
    assert picture.shape[1] == 1280
    # Nothing of the heading runs into its right edge.
    assert np.ptp(picture[:-960, -4:].astype(int), axis=(0, 1)).max() == 0


def test_a_pose_that_the_lens_cannot_see_is_left_out():
    behind = made_circle()
    candidates = tuple(replace(c, center=-c.center, imaged_center=np.full(2, np.nan)) for c in behind.candidates)
    lost = replace(behind, candidates=candidates, contour=None, ellipse=None)
    assert not colored(body_of(draw_overlay(GREY, made_result(lost), CAMERA))).any()


def test_a_rim_that_passes_out_of_a_strong_lens_is_drawn_as_far_as_it_goes():
    camera = Camera.create(CAMERA.camera_matrix, [-0.6, 0.0, 0.0, 0.0], (320, 240))
    near = made_circle(center=np.array([60.0, 0.0, 90.0]))
    seen = tuple(replace(c, imaged_center=camera.project(c.center)) for c in near.candidates)
    circle = replace(near, candidates=seen, contour=None, ellipse=None)
    assert not np.all(np.isfinite(camera.project(circle.candidates[0].center + 20.0 * np.eye(3))))
    draw_overlay(GREY, made_result(circle), camera)


def test_an_arc_that_was_not_used_is_not_bridged():
    circle = made_circle()
    half = replace(circle, contour=circle.contour[:180], candidates=(), ellipse=None, status=Status.NO_POSE)
    body = body_of(draw_overlay(GREY, made_result(half), CAMERA))
    ends = (circle.contour[179] + circle.contour[0]) / 2.0
    u, v = np.round(ends * 4).astype(int)
    assert not colored(body[v - 8 : v + 8, u - 8 : u + 8]).any()


def test_only_one_of_several_methods_is_drawn():
    other = made_circle(method="kabuka-arenas", center=CENTER_MM + np.array([0.0, 40.0, 0.0]))
    one = draw_overlay(GREY, made_result(made_circle()), CAMERA)
    both = draw_overlay(GREY, made_result(made_circle(), other), CAMERA)
    np.testing.assert_array_equal(body_of(one), body_of(both))


def many(number: int) -> ImageResult:
    places = np.linspace(-60.0, 60.0, number)
    return made_result(*(made_circle(i, np.array([x, 40.0 * (-1) ** i, 200.0])) for i, x in enumerate(places)))


@pytest.mark.parametrize("number", [1, MOST_CAPTIONS + 1, MOST_ROWS + 1])
def test_every_target_gets_its_number_of_the_table(number, monkeypatch):
    plans = []
    planned = overlay.plan_labels
    monkeypatch.setattr(overlay, "plan_labels", lambda *args: plans.append(planned(*args)) or plans[-1])
    draw_overlay(GREY, many(number), CAMERA)
    (plan,) = plans
    assert plan.left_out == 0
    numbers = [each.lines[0].removeprefix("instance ").split(":")[0] for each in plan.placed]
    assert sorted(numbers, key=int) == [str(n) for n in range(number)]


def legend_colors(result, image=GREY):
    """The colors in heading and body of a picture."""
    picture = draw_overlay(image, result, CAMERA)
    return picture[:-960], body_of(picture)


MADE = replace(made_circle(), ambiguity=0.01)
AMBIGUOUS_ONE = replace(MADE, flags=(Flag.AMBIGUOUS,), ambiguity=0.5)
HALF_SEEN = replace(MADE, contour=MADE.contour[:180])
WITHOUT_POSE = replace(MADE, candidates=(), status=Status.NO_POSE)


@pytest.mark.parametrize(
    "circle", [MADE, AMBIGUOUS_ONE, HALF_SEEN, WITHOUT_POSE, replace(MADE, candidates=MADE.candidates[:1])]
)
def test_the_legend_has_the_colors_that_are_drawn_and_no_others(circle):
    heading, body = legend_colors(made_result(circle))
    for color in (CHOSEN, AMBIGUOUS, OTHER, UNUSED, REJECTED):
        assert has(heading, color) == has(body, color), color


def test_what_is_settled_ambiguous_and_failed_differs_in_color():
    for circle, color in ((MADE, CHOSEN), (AMBIGUOUS_ONE, AMBIGUOUS), (WITHOUT_POSE, REJECTED), (HALF_SEEN, UNUSED)):
        assert has(legend_colors(made_result(circle))[1], color)
    assert not has(legend_colors(made_result(MADE))[1], UNUSED)


def test_a_dark_image_is_brightened_and_a_normal_one_is_not():
    normal = disc_image()
    plain = replace(made_result(), circles=())
    large = cv2.resize(normal, None, fx=4, fy=4, interpolation=cv2.INTER_CUBIC)
    np.testing.assert_array_equal(body_of(draw_overlay(normal, plain, CAMERA))[..., 0], large)
    dark = (normal // 8).astype(np.uint8)
    assert np.percentile(body_of(draw_overlay(dark, plain, CAMERA)), 95) > 150
    assert np.percentile(dark, 95) < 30


def test_an_image_of_another_size_is_refused():
    with pytest.raises(ArgumentError, match=r"^image: .*320 x 240 px, got 319 x 240\.$"):
        draw_overlay(GREY[:, :-1], made_result(), CAMERA)


def test_a_camera_of_another_image_is_refused():
    wrong = replace(CAMERA, camera_matrix=np.array([[420.0, 0, 159.5], [0, 420.0, 119.5], [0, 0, 1]]))
    with pytest.raises(ArgumentError, match=r"^camera: .* px from where `result` has it\.$"):
        draw_overlay(GREY, made_result(), wrong)
    # The camera of the full size, of which the image is a resized copy, is the right one.
    draw_overlay(GREY, made_result(), CAMERA.scaled_to((640, 480)))


@pytest.mark.parametrize("shape", [(3, 3), (2, 900), (900, 2), (40, 3000), (1500, 30)])
def test_text_has_room_in_images_of_any_shape(shape):
    picture = draw_overlay(
        np.full(shape, 120, np.uint8), ImageResult("name.png", Status.NO_CIRCLE, "why " * 40), CAMERA
    )
    factor = max(1, -(-SMALLEST_PICTURE // max(shape)))
    heading = picture[: -factor * shape[0]]
    assert np.ptp(heading[:, -4:].astype(int), axis=(0, 1)).max() == 0
    assert (heading > 200).any()
    assert picture.shape[0] < 2 * factor * shape[0] + 900
