from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import circlepose
from benchmarks.support.scoring import TrueCircle, error
from circlepose.camera.camera import Camera
from circlepose.errors import ArgumentError
from circlepose.geometry.cone import plane_basis
from circlepose.results import FLAG_MEANING, STATUS_MEANING, Flag, Status
from circlepose.solvers import CIRCLE_METHODS
from circlepose.synthesis.render import render
from circlepose.synthesis.scene import Disc, Paint, Rings, Scene
from circlepose.targets.target import AxisIntervals, Target
from tests.support.cases import circle_case

CAMERA = Camera.create([[600.0, 0, 319.5], [0, 600.0, 239.5], [0, 0, 1]], (), (640, 480))
BARREL = Camera.create([[600.0, 0, 319.5], [0, 600.0, 239.5], [0, 0, 1]], (-0.3, 0.1, 0.001, 0.001), (640, 480))
FISHEYE = Camera.create(
    [[300.0, 0, 319.5], [0, 300.0, 239.5], [0, 0, 1]], (0.05, -0.01, 0.0, 0.0), (640, 480), "fisheye"
)


def disc(center=(30.0, -20.0, 500.0), normal=(0.5, 0.3, -0.8), radius=60.0) -> Disc:
    normal = np.array(normal)
    return Disc(np.array(center), normal / np.linalg.norm(normal), radius, Paint(40.0))


def scene(*targets, camera=CAMERA, **options) -> Scene:
    return Scene(camera=camera, targets=targets, noise_levels=1.0, noise_seed=3, **options)


def truth(part: Disc) -> TrueCircle:
    return TrueCircle(part.center_mm, part.normal, None, None, "disc")


@pytest.mark.parametrize("camera", [CAMERA, BARREL, FISHEYE], ids=["plain", "barrel", "fisheye"])
def test_a_disc_is_measured_through_any_lens(camera):
    part = disc()
    result = circlepose.estimate(render(scene(part, camera=camera)), camera, Target.circle(60.0), name="x")
    assert (result.image, result.status, result.image_size) == ("x", Status.OK, (640, 480))
    assert len(result.circles) == 1
    measured = error(result.circles[0], truth(part))
    assert measured.position_mm < 0.3
    assert measured.normal_deg < 0.1


def test_what_a_lone_circle_says_of_itself():
    part = disc()
    circle = circlepose.estimate(render(scene(part)), CAMERA, Target.circle(60.0)).circles[0]
    assert (circle.circle, circle.instance, circle.method, circle.radius_mm) == ("disc", 0, "chen-huang", 60.0)
    assert circle.cone_kind == "elliptical"
    assert len(circle.candidates) == 2
    assert circle.ambiguity == 0.5
    assert Flag.AMBIGUOUS in circle.flags
    assert circle.residual_px < 0.2
    for candidate in circle.candidates:
        assert candidate.normal @ candidate.center < 0.0
        np.testing.assert_allclose(candidate.imaged_center, CAMERA.project(candidate.center))
    assert np.linalg.norm(circle.candidates[0].imaged_center - circle.candidates[1].imaged_center) > 0.1


def test_the_imaged_center_is_not_the_ellipses():
    part = disc(center=(0.0, 0.0, 300.0), normal=(0.7, 0.0, -0.7))
    circle = circlepose.estimate(render(scene(part)), CAMERA, Target.circle(60.0)).circles[0]
    imaged = min(
        (c.imaged_center for c in circle.candidates), key=lambda p: np.linalg.norm(p - CAMERA.project(part.center_mm))
    )
    np.testing.assert_allclose(imaged, CAMERA.project(part.center_mm), atol=0.1)
    assert np.linalg.norm(circle.ellipse.center - imaged) > 5.0


def test_a_frontal_circle_is_said_to_be_nearly_so():
    # Towards the camera, not along its axis: off the axis a frontal plane is seen obliquely.
    part = disc(center=(33.3, -22.7, 500.0), normal=(-33.3, 22.7, -500.0))
    circle = circlepose.estimate(render(scene(part)), CAMERA, Target.circle(60.0)).circles[0]
    assert Flag.NEAR_RIGHT in circle.flags
    assert error(circle, truth(part)).position_mm < 0.2
    # One pose, said once, and nothing ambiguous about it.
    assert circle.cone_kind == "right"
    assert len(circle.candidates) == 1
    assert circle.ambiguity == 0.0
    assert Flag.AMBIGUOUS not in circle.flags


@pytest.mark.parametrize("tilt_deg", [86.0, 88.0, 89.5, 89.95])
def test_circles_seen_edge_on(tilt_deg):
    """A disc of 60 mm at 920 mm: from 12 px thick to a third of a pixel."""
    camera = Camera.create([[2607.0, 0, 255.5], [0, 2607.0, 239.5], [0, 0, 1]], (), (512, 480))
    case = circle_case(60.0, 920.0, 1.5, 80.0, tilt_deg, 20.0)
    part = Disc(case.center, case.normal, 60.0, Paint(200.0))
    picture = scene(part, camera=camera, background=Paint(40.0))
    target = Target.circle(60.0, axis_intervals=AxisIntervals(major_px=(200.0, 400.0), minor_px=(0.0, 100.0)))
    circle = circlepose.estimate(render(picture), camera, target).circles[0]
    measured = error(circle, truth(part))
    # At 89.95 deg the line is 0.3 px wide and where it ends is a matter of a few grey levels.
    assert measured.position_mm < (4.0 if tilt_deg > 89.9 else 1.5)
    assert measured.normal_deg < 0.2
    assert len(circle.candidates) == 2
    if tilt_deg > 89.9:
        assert circle.cone_kind == "degenerate"
        np.testing.assert_allclose(circle.candidates[0].normal, -circle.candidates[1].normal, atol=1e-9)
    needs_ellipse = circlepose.estimate(render(picture), camera, target, method="kanatani-liu").circles[0]
    assert (needs_ellipse.status is Status.NO_POSE) == (circle.cone_kind == "degenerate")


def test_tilts_in_fine_steps_have_no_jump():
    """From frontal to nearly edge-on no view is lost, and the error stays small."""
    for tilt_deg in np.arange(0.0, 85.0, 2.5):
        case = circle_case(60.0, 500.0, 5.0, 30.0, float(tilt_deg), 70.0)
        part = Disc(case.center, case.normal, 60.0, Paint(40.0))
        circle = circlepose.estimate(render(scene(part)), CAMERA, Target.circle(60.0)).circles[0]
        measured = error(circle, truth(part))
        assert measured.position_mm < 0.6, tilt_deg
        assert measured.normal_deg < (2.5 if tilt_deg < 5.0 else 0.4), tilt_deg


@pytest.mark.parametrize("method", CIRCLE_METHODS)
def test_each_method(method):
    part = disc()
    circle = circlepose.estimate(render(scene(part)), CAMERA, Target.circle(60.0), method=method).circles[0]
    assert circle.method == method
    measured = error(circle, truth(part))
    limit = {"kabuka-arenas": (15.0, 6.0), "chen-huang-contour": (3.0, 3.0)}.get(method, (0.3, 0.1))
    assert measured.position_mm < limit[0]
    assert measured.normal_deg < limit[1]


def test_all_methods_are_compared_with_chen_huang():
    results = circlepose.estimate(render(scene(disc())), CAMERA, Target.circle(60.0), method="all").circles
    assert [c.method for c in results] == list(CIRCLE_METHODS)
    reference, *others = results
    assert all(c.position_difference_mm is None for c in reference.candidates)
    for result in others:
        for candidate in result.candidates:
            nearest = max(reference.candidates, key=lambda c, n=candidate.normal: float(c.normal @ n))
            distance = np.linalg.norm(nearest.center - candidate.center)
            assert candidate.position_difference_mm == pytest.approx(distance)
            angle = np.degrees(np.arccos(min(1.0, nearest.normal @ candidate.normal)))
            assert candidate.orientation_difference_deg == pytest.approx(angle, abs=1e-4)


def test_refinement_can_be_left_out():
    image = render(scene(disc()))
    plain = circlepose.estimate(image, CAMERA, Target.circle(60.0), refine=False).circles[0]
    refined = circlepose.estimate(image, CAMERA, Target.circle(60.0)).circles[0]
    assert error(plain, truth(disc())).position_mm < 0.5
    assert plain.residual_px != refined.residual_px


@pytest.fixture(scope="module")
def three_discs() -> np.ndarray:
    # Near, middle and far: 72, 48 and 36 px in radius; the last is bright.
    return render(
        scene(
            disc(center=(-120.0, 0.0, 500.0)),
            disc(center=(60.0, 0.0, 750.0)),
            replace(disc(center=(300.0, 0.0, 1000.0)), paint=Paint(250.0)),
            background=Paint(150.0),
        )
    )


def test_count_takes_the_most_evident(three_discs):
    result = circlepose.estimate(three_discs, CAMERA, Target.circle(60.0, count=2))
    assert [c.instance for c in result.circles] == [0, 1]
    assert result.status is Status.OK
    assert sum(result.rejected.values()) >= 1


def test_count_all(three_discs):
    assert len(circlepose.estimate(three_discs, CAMERA, Target.circle(60.0, count=None)).circles) == 3


def test_fewer_than_count_is_a_status_and_keeps_what_was_found(three_discs):
    result = circlepose.estimate(three_discs, CAMERA, Target.circle(60.0, count=5))
    assert result.status is Status.TOO_FEW_CIRCLES
    assert "3 of 5" in result.reason
    assert len(result.circles) == 3


def test_polarity(three_discs):
    result = circlepose.estimate(three_discs, CAMERA, Target.circle(60.0, count=None, polarity="bright"))
    assert len(result.circles) == 1


def test_depth_range(three_discs):
    target = Target.circle(60.0, count=None, depth_range_mm=(700.0, 800.0))
    result = circlepose.estimate(three_discs, CAMERA, target)
    assert len(result.circles) == 1
    assert result.circles[0].candidates[0].center[2] == pytest.approx(750.0, abs=5.0)


@pytest.mark.parametrize("level", [0, 128, 255])
def test_an_image_without_a_circle(level):
    result = circlepose.estimate(np.full((480, 640), level, np.uint8), CAMERA, Target.circle(60.0))
    assert result.status is Status.NO_CIRCLE
    assert result.reason
    assert result.circles == ()


def test_an_image_of_noise_is_no_crash():
    noise = np.random.default_rng(0).integers(0, 255, (480, 640)).astype(np.uint8)
    assert circlepose.estimate(noise, CAMERA, Target.circle(60.0)).status in (Status.OK, Status.NO_CIRCLE)


def test_an_image_of_another_size_is_refused_unless_it_was_resized():
    part = disc()
    double = Camera.create([[1200.0, 0, 639.5], [0, 1200.0, 479.5], [0, 0, 1]], (), (1280, 960))
    image = render(scene(part))
    refused = circlepose.estimate(image, double, Target.circle(60.0))
    assert refused.status is Status.SIZE_MISMATCH
    assert "640 x 480" in refused.reason
    assert "1280 x 960" in refused.reason
    scaled = circlepose.estimate(image, double, Target.circle(60.0), scale_calibration=True)
    assert error(scaled.circles[0], truth(part)).position_mm < 0.3


@pytest.mark.parametrize("channels", [3, 4])
def test_colour_images(channels):
    image = np.repeat(render(scene(disc()))[:, :, None], channels, axis=2)
    assert circlepose.estimate(image, CAMERA, Target.circle(60.0)).status is Status.OK


def test_sixteen_bit_images():
    part = disc()
    image = render(scene(part, bit_depth=16))
    assert image.dtype == np.uint16
    result = circlepose.estimate(image, CAMERA, Target.circle(60.0))
    assert error(result.circles[0], truth(part)).position_mm < 0.3


def rings(normal=(0.5, 0.3, -0.8)) -> Rings:
    normal = np.array(normal)
    return Rings(
        np.array([30.0, -20.0, 500.0]), normal / np.linalg.norm(normal), (50.0, 30.0), (Paint(30.0), Paint(220.0))
    )


def test_a_second_ring_settles_which_candidate_is_right():
    part = rings()
    result = circlepose.estimate(render(scene(part)), CAMERA, Target("coplanar", (50.0, 30.0)))
    assert [c.circle for c in result.circles] == ["outer", "inner"]
    for circle in result.circles:
        measured = error(circle, TrueCircle(part.center_mm, part.normal, None, None, circle.circle))
        assert measured.chosen
        assert measured.position_mm < 0.4
        assert circle.chosen == 0
        assert circle.ambiguity < 0.01
        assert Flag.AMBIGUOUS not in circle.flags


def test_a_ring_target_of_other_radii_is_not_found_in_silence():
    """Radii 50 and 20 do not fit rings of 50 and 30: no complete target, and the result says so."""
    result = circlepose.estimate(render(scene(rings())), CAMERA, Target("coplanar", (50.0, 20.0)))
    assert all(Flag.LONE_CIRCLE in c.flags for c in result.circles)
    assert result.status is not Status.OK


def test_circles_in_one_plane_settle_each_others_ambiguity():
    normal = np.array([0.5, 0.3, -0.8]) / np.linalg.norm([0.5, 0.3, -0.8])
    first, second = plane_basis(normal)
    centers = [np.array([0.0, 0.0, 600.0]) + x * first + y * second for x, y in ((-70, -50), (75, -45), (0, 80))]
    picture = scene(*(disc(center, normal, 30.0) for center in centers))
    target = Target.circle(30.0, count=3)
    image = render(picture)
    alone = circlepose.estimate(image, CAMERA, replace(target, same_plane="no"))
    assert all(c.ambiguity == 0.5 and Flag.AMBIGUOUS in c.flags and c.plane is None for c in alone.circles)
    assert alone.planes == ()
    for mode in ("auto", "yes"):
        together = circlepose.estimate(image, CAMERA, replace(target, same_plane=mode))
        (plane,) = together.planes
        assert plane.circles == len(together.circles) == 3
        assert plane.normal @ normal > 0.999999
        assert plane.offset_mm == pytest.approx(600.0 * normal[2], abs=0.5)
        for circle in together.circles:
            pose = circle.pose
            assert pose is not None
            assert pose.normal @ normal > 0.999
            assert circle.ambiguity < 0.05
            assert circle.plane == 0
            assert Flag.AMBIGUOUS not in circle.flags
            if mode == "yes":
                np.testing.assert_array_equal(pose.normal, plane.normal)
                assert pose.center @ pose.normal == pytest.approx(plane.offset_mm, abs=1e-9)
                assert circle.ellipse is not None
                np.testing.assert_allclose(pose.imaged_center, CAMERA.project(pose.center[None])[0])


def test_misuse_raises():
    with pytest.raises(ArgumentError, match="method"):
        circlepose.estimate(np.zeros((9, 9), np.uint8), CAMERA, Target.circle(1.0), method="magic")
    with pytest.raises(ArgumentError, match="image"):
        circlepose.estimate(np.zeros(9), CAMERA, Target.circle(1.0))


def test_the_same_image_gives_the_same_numbers():
    image = render(scene(disc()))
    first, second = (circlepose.estimate(image, CAMERA, Target.circle(60.0)).circles[0] for _ in range(2))
    for a, b in zip(first.candidates, second.candidates, strict=True):
        np.testing.assert_array_equal(a.center, b.center)
        np.testing.assert_array_equal(a.normal, b.normal)


def test_every_status_and_flag_has_a_meaning():
    assert set(STATUS_MEANING) == set(Status)
    assert set(FLAG_MEANING) == set(Flag)


@pytest.mark.parametrize("tilt_deg", [0.0, 5.0, 30.0, 60.0, 80.0, 84.0])
def test_tilts(tilt_deg):
    case = circle_case(60.0, 500.0, 5.0, 30.0, tilt_deg, 70.0)
    part = Disc(case.center, case.normal, 60.0, Paint(40.0))
    result = circlepose.estimate(render(scene(part)), CAMERA, Target.circle(60.0))
    measured = error(result.circles[0], truth(part))
    assert measured.position_mm < 0.6
    # A tilt is seen in the cosine of itself, which hardly changes near 0.
    assert measured.normal_deg < (2.5 if tilt_deg < 2.0 else 0.3)


def test_the_search_goes_on_where_the_most_evident_circle_is_too_near():
    """A large disc in front is found first, in a reduced image; the one in the depth range is small."""
    camera = Camera.create([[1200.0, 0, 639.5], [0, 1200.0, 479.5], [0, 0, 1]], (), (1280, 960))
    near = Disc(np.array([-60.0, 0.0, 420.0]), np.array([0.3, 0.0, -0.954]), 60.0, Paint(40.0))
    far = Disc(np.array([700.0, 300.0, 2600.0]), np.array([0.0, 0.3, -0.954]), 60.0, Paint(40.0))
    image = render(Scene(camera, (near, far), Paint(200.0), noise_levels=2.0, noise_seed=3))
    result = circlepose.estimate(image, camera, Target.circle(60.0, depth_range_mm=(400.0, 3000.0)))
    assert result.circles[0].candidates[0].center[2] == pytest.approx(420.0, rel=0.01)
    result = circlepose.estimate(image, camera, Target.circle(60.0, depth_range_mm=(470.0, 3000.0)))
    assert result.circles[0].candidates[0].center[2] == pytest.approx(2600.0, rel=0.02)
