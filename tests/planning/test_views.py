"""A target is where it was asked for, and its picture is the part of the camera's that shows it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from circlepose.camera.camera import Camera
from circlepose.errors import UsageError
from circlepose.pipeline import estimate
from circlepose.planning.views import USUAL, Look, View, picture_of, placed, scaled
from circlepose.synthesis.render import render, render_float
from circlepose.synthesis.scene import Scene
from circlepose.targets.board import BoardLayout, Grid
from circlepose.targets.target import Target

CAMERA = Camera.create(
    [[500.0, 0.0, 159.5], [0.0, 500.0, 119.5], [0.0, 0.0, 1.0]], (-0.1, 0.02, 0.0, 0.0), (320, 240)
)
LAYOUT = BoardLayout.on_grid(8.0, Grid("symmetric", 2, 3, 30.0), marks={(0, 0): (5.0,)})
TARGETS = {
    "disc": Target.circle(20.0),
    "rings": Target.rings((30.0, 20.0)),
    "boss": Target.coaxial((30.0, 20.0), height_mm=12.0),
    "board": Target.board(LAYOUT),
}


@given(
    name=st.sampled_from([*TARGETS]),
    distance=st.floats(500.0, 5000.0),
    tilt=st.floats(0.0, 85.0),
    u=st.floats(0.0, 319.0),
    v=st.floats(0.0, 239.0),
)
def test_place_distance_and_tilt_are_what_was_asked(name, distance, tilt, u, v):
    place = placed(TARGETS[name], CAMERA, View(distance, tilt, (u, v)), USUAL)
    # The top of a boss close by, or a part of a board, may face away.
    assume(not isinstance(place, str))
    assert CAMERA.project(place.middle[None])[0] == pytest.approx([u, v], abs=1e-4)
    assert np.linalg.norm(place.middle) == pytest.approx(distance)
    assert np.linalg.norm(place.normal) == pytest.approx(1.0)
    sight = place.middle / distance
    assert np.degrees(np.arccos(np.clip(-sight @ place.normal, -1.0, 1.0))) == pytest.approx(tilt, abs=1e-5)
    assert all(circle.normal == pytest.approx(place.normal) for circle in place.part.circles)
    if name == "board":
        assert np.mean([circle.center for circle in place.part.circles], axis=0) == pytest.approx(place.middle)


@given(name=st.sampled_from([*TARGETS]), factor=st.floats(0.1, 10.0))
@settings(max_examples=12)
def test_a_target_scaled_with_its_distance_has_the_same_image(name, factor):
    view = View(600.0, 35.0, (170.0, 110.0))
    scenes = [
        picture_of(placed(target, CAMERA, at, USUAL), CAMERA, USUAL)
        for target, at in (
            (TARGETS[name], view),
            (scaled(TARGETS[name], factor), replace(view, distance_mm=factor * view.distance_mm)),
        )
    ]
    assert np.abs(np.subtract(*(render_float(scene, 2) for scene in scenes))).max() < 1e-6


@given(name=st.sampled_from([*TARGETS]), factor=st.floats(0.1, 10.0))
def test_all_lengths_are_scaled_and_what_is_known_of_them_is_not(name, factor):
    target = replace(TARGETS[name], radius_sigma_mm=0.01)
    larger = scaled(target, factor)
    assert larger.radii_mm == pytest.approx([factor * radius for radius in target.radii_mm])
    assert larger.radius_sigma_mm == 0.01
    if name == "boss":
        assert larger.generatrix_mm == pytest.approx(factor * target.generatrix_mm)
    if name == "board":
        assert larger.layout.centers_mm == pytest.approx(factor * LAYOUT.centers_mm)
        assert larger.layout.grid.spacing_mm == pytest.approx(factor * 30.0)
        assert [radius for circle in larger.layout.circles for radius in circle.radii_mm] == pytest.approx(
            [factor * radius for circle in LAYOUT.circles for radius in circle.radii_mm]
        )


@pytest.mark.parametrize("name", TARGETS)
def test_the_picture_is_a_part_of_the_cameras(name):
    place = placed(TARGETS[name], CAMERA, View(900.0, 35.0, (100.0, 80.0)), USUAL)
    part = picture_of(place, CAMERA, USUAL)
    whole = render_float(Scene(CAMERA, (place.part,), place.ground, blur_px=USUAL.blur_px), 2)
    u, v = np.rint(CAMERA.camera_matrix[:2, 2] - part.camera.camera_matrix[:2, 2]).astype(int)
    width, height = part.camera.image_size
    assert width < 320
    assert height < 240
    window = whole[v : v + height, u : u + width]
    # What is farther from the rims than the margin is ground alone.
    assert np.abs(render_float(part, 2) - window).max() < 1e-6
    rest = whole.copy()
    rest[v : v + height, u : u + width] = place.ground.level
    assert np.abs(rest - place.ground.level).max() < 1e-6


@pytest.mark.parametrize("polarity", ["dark", "bright"])
def test_the_contrast_is_as_asked_and_within_255_levels(polarity):
    look = Look(contrast_levels=100.0)
    place = placed(Target.circle(20.0, polarity=polarity), CAMERA, View(300.0, 20.0, (159.5, 119.5)), look)
    scene = picture_of(place, CAMERA, look)
    levels = render_float(scene, 2)
    height, width = levels.shape
    step = levels[0, 0] - levels[height // 2, width // 2]
    assert step == pytest.approx(100.0 if polarity == "dark" else -100.0)
    assert levels.min() == pytest.approx(77.5)
    assert levels.max() == pytest.approx(177.5)
    found = estimate(render(replace(scene, noise_levels=1.0)), scene.camera, Target.circle(20.0, polarity=polarity))
    assert found.circles[0].candidates


def test_a_coaxial_part_needs_its_height():
    target = Target.coaxial((30.0, 20.0))
    with pytest.raises(UsageError, match="give height_mm or generatrix_mm"):
        placed(target, CAMERA, View(500.0, 20.0, (159.5, 119.5)), USUAL)


def test_what_cannot_be_seen_has_a_reason():
    strong = Camera.create(CAMERA.camera_matrix, (-0.9, 0.0, 0.0, 0.0), (1600, 1200))
    assert placed(TARGETS["disc"], strong, View(500.0, 20.0, (1500.0, 1100.0)), USUAL) == (
        "the lens model does not reach px (1500, 1100)"
    )
    outside = placed(TARGETS["disc"], CAMERA, View(500.0, 20.0, (500.0, 119.5)), USUAL)
    assert picture_of(outside, CAMERA, USUAL) == "nothing of the target is in the image"


@pytest.mark.parametrize(
    ("look", "message"),
    [
        ({"noise_levels": -1.0}, "noise: expected gray levels of 0 or more, got -1"),
        ({"noise_levels": float("nan")}, "noise: "),
        ({"blur_px": -0.1}, "blur_px: expected 0 to 30 px, got -0.1"),
        ({"blur_px": 31.0}, "blur_px: expected 0 to 30 px, got 31"),
        ({"contrast_levels": 0.0}, "contrast: expected gray levels above 0 and up to 255, got 0"),
        ({"contrast_levels": 256.0}, "contrast: "),
    ],
)
def test_looks_that_no_picture_has_are_refused(look, message):
    with pytest.raises(UsageError, match=message):
        Look(**look)
