"""Laws of what is predicted of a view."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from circlepose.camera.camera import Camera, CameraSigma
from circlepose.pipeline import estimate
from circlepose.planning import views
from circlepose.planning.predict import PosePrediction, _expected, predict
from circlepose.planning.views import USUAL, Look, View, picture_of, placed
from circlepose.results import Flag
from circlepose.synthesis.render import render
from circlepose.synthesis.scene import Scene
from circlepose.targets.target import Target
from tests.planning.test_views import CAMERA, TARGETS

MIDDLE = (159.5, 119.5)
VIEW = View(500.0, 35.0, MIDDLE)
DISC = TARGETS["disc"]


def position(*, view=VIEW, look=USUAL, radius_mm=20.0):
    return predict(CAMERA, Target.circle(radius_mm), view, look).position_mm


def test_it_is_worse_farther_away_in_noise_with_less_contrast_and_for_smaller_targets():
    usual = position()
    assert position(view=replace(VIEW, distance_mm=650.0)) > 1.5 * usual
    assert position(look=Look(noise_levels=4.0)) == pytest.approx(2.0 * usual, rel=0.1)
    assert position(look=Look(contrast_levels=75.0)) == pytest.approx(2.0 * usual, rel=0.1)
    assert position(look=Look(blur_px=1.5)) > 1.1 * usual
    assert position(radius_mm=15.0) > 1.5 * usual


@pytest.mark.parametrize("name", ["disc", "rings", "board"])
def test_a_part_of_a_picture_is_measured_as_the_whole(name):
    place = placed(TARGETS[name], CAMERA, View(700.0, 35.0, (130.0, 100.0)), USUAL)
    part = picture_of(place, CAMERA, USUAL).camera
    width, height = part.image_size
    u, v = np.rint(CAMERA.camera_matrix[:2, 2] - part.camera_matrix[:2, 2]).astype(int)
    assert (u > 0, v > 0, width < 320, height < 240) == (True,) * 4
    picture = render(Scene(CAMERA, (place.part,), place.ground, blur_px=0.7, noise_levels=2.0, noise_seed=5))
    whole = estimate(picture, CAMERA, TARGETS[name], force_calibration=True)
    window = np.ascontiguousarray(picture[v : v + height, u : u + width])
    cropped = estimate(window, part, TARGETS[name], force_calibration=True)
    if name == "board":
        first, other = whole.boards[0].candidates[0], cropped.boards[0].candidates[0]
        assert other.translation == pytest.approx(first.translation, abs=1e-3)
    else:
        first, other = whole.circles[0].candidates[0], cropped.circles[0].candidates[0]
        assert other.center == pytest.approx(first.center, abs=0.01 * np.sqrt(first.covariance[2, 2]))
    assert other.covariance.diagonal() == pytest.approx(first.covariance.diagonal(), rel=1e-3)


def test_where_a_crop_begins_does_not_matter(monkeypatch):
    view = View(700.0, 35.0, (130.0, 100.0))
    cropped = predict(CAMERA, DISC, view)
    monkeypatch.setattr(views, "_MARGIN_PX", 1000.0)
    whole = predict(CAMERA, DISC, view)
    assert picture_of(placed(DISC, CAMERA, view, USUAL), CAMERA, USUAL).camera.image_size == (320, 240)
    # The noise is another.
    assert whole.sigma_mm == pytest.approx(cropped.sigma_mm, rel=0.1)
    assert whole.major_px == cropped.major_px


@pytest.mark.parametrize("name", ["disc", "board"])
def test_it_is_what_estimate_reports_of_another_picture_of_the_view(name):
    place = placed(TARGETS[name], CAMERA, VIEW, USUAL)
    scene = replace(picture_of(place, CAMERA, USUAL), noise_levels=USUAL.noise_levels, noise_seed=99)
    result = estimate(render(scene), scene.camera, TARGETS[name], force_calibration=True)
    found = predict(CAMERA, TARGETS[name], VIEW)
    assert found.found == 1.0
    assert found.reason == ""
    if name == "disc":
        reported = result.circles[0].candidates[0].covariance
        assert found.sigma_roll_deg is None
        assert found.sigma_mm == pytest.approx(np.sqrt(np.diag(reported)[:3]), rel=0.1)
        assert found.sigma_normal_deg == pytest.approx(np.degrees(np.sqrt(reported[3, 3] + reported[4, 4])), rel=0.1)
    else:
        best = result.boards[0].candidates[0]
        rotations = np.degrees(np.sqrt(np.trace(best.covariance[3:, 3:])))
        assert np.hypot(found.sigma_normal_deg, found.sigma_roll_deg) == pytest.approx(rotations, rel=0.1)
        # The middle is as well known as any point of the board, its first circle less.
        assert found.position_mm < np.sqrt(np.trace(best.covariance[:3, :3]))


def test_position_is_that_of_all_axes_and_major_that_of_the_image():
    found = predict(CAMERA, DISC, VIEW)
    assert found.position_mm == pytest.approx(np.linalg.norm(found.sigma_mm))
    assert found.major_px == pytest.approx(2.0 * 500.0 * 20.0 / 500.0, rel=0.01)
    assert found.apart_deg == pytest.approx(70.0, abs=2.0)


def test_a_lone_disc_is_a_toss_and_rings_close_by_are_not():
    disc, rings = (predict(CAMERA, TARGETS[name], VIEW) for name in ("disc", "rings"))
    assert disc.wrong == pytest.approx(0.5, abs=0.01)
    assert Flag.AMBIGUOUS in disc.flags
    assert rings.wrong < 1e-9
    assert Flag.AMBIGUOUS not in rings.flags


def test_rings_far_away_are_between():
    far = predict(CAMERA, TARGETS["rings"], View(1300.0, 12.0, MIDDLE), Look(noise_levels=6.0))
    assert 0.01 < far.wrong <= 0.5


def test_shares_are_of_what_is_not_known():
    exact = predict(CAMERA, DISC, VIEW)
    assert (exact.camera_share, exact.radius_share) == (0.0, 0.0)
    camera = replace(CAMERA, sigma=CameraSigma(1.0, 1.0))
    known = predict(camera, replace(DISC, radius_sigma_mm=0.05), VIEW)
    assert known.position_mm > 2.0 * exact.position_mm
    image = exact.position_mm**2 / known.position_mm**2
    assert known.camera_share + known.radius_share + image == pytest.approx(1.0, abs=0.02)
    # The distance is off by as much as the radius is: 0.05 of 20 mm.
    assert known.radius_share == pytest.approx((500.0 * 0.05 / 20.0) ** 2 / known.position_mm**2, rel=0.05)


@pytest.mark.parametrize(
    ("camera", "view", "reason"),
    [
        (CAMERA, replace(VIEW, place_px=(600.0, 119.5)), "nothing of the target is in the image"),
        (
            Camera.create(CAMERA.camera_matrix, (-0.9, 0.0, 0.0, 0.0), (1600, 1200)),
            replace(VIEW, place_px=(1500.0, 1100.0)),
            "the lens model does not reach px (1500, 1100)",
        ),
        (CAMERA, replace(VIEW, distance_mm=30.0), "no contour is the target's image"),
        (CAMERA, replace(VIEW, distance_mm=1e7), "no contour is the target's image"),
    ],
)
def test_a_view_in_which_nothing_is_measured_has_a_reason_and_no_numbers(camera, view, reason):
    found = predict(camera, DISC, view)
    assert found.found == 0.0
    assert reason in found.reason
    numbers = (
        found.sigma_mm,
        found.position_mm,
        found.sigma_normal_deg,
        found.sigma_roll_deg,
        found.camera_share,
        found.radius_share,
        found.wrong,
        found.apart_deg,
    )
    assert numbers == (None,) * len(numbers)
    assert found.flags == ()


def test_what_is_measured_from_edges_alone_has_no_accuracy_but_a_reason():
    pose = PosePrediction(None, None, None, None, 40.0, (Flag.EDGES_ONLY,))
    found = _expected(VIEW, [pose] * 4, 4, "", 60.0)
    assert (found.found, found.position_mm, found.camera_share, found.wrong) == (1.0, None, None, None)
    assert found.reason == "measured from edges alone, which say nothing of its accuracy"
    assert (found.apart_deg, found.flags) == (40.0, (Flag.EDGES_ONLY,))


def test_one_is_measured_whatever_the_count():
    one = predict(CAMERA, DISC, VIEW)
    assert predict(CAMERA, replace(DISC, count="all"), VIEW).position_mm == one.position_mm
    several = replace(DISC, count=3, same_plane="yes")
    assert predict(CAMERA, several, VIEW).position_mm == one.position_mm
