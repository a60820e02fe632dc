"""One plane for circles that are declared to share it, on simulated circles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.support.plane_scenes import simulated
from circlepose.camera.camera import Camera
from circlepose.disambiguation.joint_plane import on_joint_plane
from circlepose.disambiguation.settle import settled
from circlepose.pipeline import estimate
from circlepose.results import Flag
from circlepose.synthesis.render import render
from circlepose.synthesis.scene import Disc, Paint, Plane, Scene
from circlepose.targets.target import Target
from tests.support.discs import CAMERA

TARGET = Target.circle(20.0, count="all", same_plane="yes")


def scene(seed, number, strays=0, **setup):
    return simulated(np.random.default_rng(seed), (number,), strays, **setup)


def with_truth(circles):
    """The circles of a scene with the right candidate chosen."""
    return [
        replace(circle, candidates=circle.candidates if right == 0 else circle.candidates[::-1])
        for circle, right in zip(circles.circles, circles.right, strict=True)
    ]


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("number", [2, 3, 8])
def test_circles_in_the_plane_get_its_normal_and_lie_in_it(seed, number):
    made = scene(seed, number)
    circles = with_truth(made)
    joint = on_joint_plane(circles, CAMERA, 4)
    assert joint.plane is not None
    assert joint.plane.circles == len(circles)
    for before, after in zip(circles, joint.circles, strict=True):
        first = after.candidates[0]
        np.testing.assert_array_equal(first.normal, joint.plane.normal)
        # As far as noise lets one see that they do.
        height, spread = first.normal @ first.center - joint.plane.offset_mm, before.candidates[0].covariance
        loose = 1.0 if spread is None else np.sqrt(first.normal @ spread[:3, :3] @ first.normal)
        assert abs(height) < 2.0 * loose
        np.testing.assert_allclose(first.imaged_center, CAMERA.project(first.center[None])[0])
        assert after.candidates[1] is before.candidates[1]
        assert after.plane == 4
        assert Flag.OFF_PLANE not in after.flags


def test_the_poses_are_better_and_their_covariance_says_by_how_much():
    """Errors of normals in standard deviations are those of a chi-square of two degrees of freedom."""
    tilts, gains = [], []
    for seed in range(120):
        made = scene(seed, 6)
        if len(made.circles) < 3:
            continue
        circles = with_truth(made)
        joint = on_joint_plane(circles, CAMERA, 0).circles
        pose = joint[0].candidates[0]
        assert pose.covariance is not None
        np.testing.assert_allclose(pose.covariance, pose.covariance.T)
        assert np.linalg.eigvalsh(pose.covariance).min() > -1e-9
        off = pose.tilt_axes @ made.normals[0]
        tilts.append(off @ np.linalg.solve(pose.covariance[3:, 3:], off))
        before = circles[0].candidates[0].covariance
        if before is not None:
            gains.append(np.sqrt(np.trace(pose.covariance[3:, 3:]) / np.trace(before[3:, 3:])))
    assert np.mean(tilts) == pytest.approx(2.0, abs=0.7)
    assert np.quantile(tilts, 0.95) < 12.0
    assert np.median(gains) < 0.6


@pytest.mark.parametrize("height_mm", [0.5, 2.0, 8.0])
def test_a_disc_above_the_plane_is_not_pulled_into_it(height_mm):
    """Six rendered discs in an exact plane, and one above it: all errors are those that the covariance states."""
    camera = Camera.create([[1200.0, 0, 639.5], [0, 1200.0, 479.5], [0, 0, 1]], (), (1280, 960))
    squares = []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        normal = rng.normal(size=3) * [0.4, 0.4, 0.0] - [0.0, 0.0, 1.0]
        plane = Plane.create((0.0, 0.0, rng.uniform(500.0, 800.0)), normal)
        places = [(x, y) for x in (-110.0, 0.0, 110.0) for y in (-70.0, 70.0)] + [(60.0, 0.0)]
        raised = [height_mm if i == 6 else 0.0 for i in range(7)]
        centers = [plane.point(at) + up * plane.normal for at, up in zip(places, raised, strict=True)]
        discs = tuple(Disc(center, plane.normal, 15.0, Paint(40.0)) for center in centers)
        image = render(Scene(camera, discs, Paint(200.0), noise_levels=2.0, noise_seed=seed))
        result = estimate(image, camera, Target.circle(15.0, count="all", same_plane="yes"))
        assert len(result.circles) == 7
        for circle in result.circles:
            # One that is off the plane may be either.
            own = circle.candidates if Flag.OFF_PLANE in circle.flags else (circle.pose,)
            misfits = []
            for pose in own:
                assert pose.covariance is not None
                error = min((pose.center - center for center in centers), key=np.linalg.norm)
                misfits.append(error @ np.linalg.solve(pose.covariance[:3, :3], error))
            squares.append(min(misfits))
    assert np.median(squares) < 4.0
    assert np.max(squares) < 30.0


def test_without_a_covariance_a_circle_moves_along_its_line_of_sight():
    circles = with_truth(scene(1, 5))
    bare = replace(circles[2], candidates=tuple(replace(c, covariance=None) for c in circles[2].candidates))
    joint = on_joint_plane([*circles[:2], bare, *circles[3:]], CAMERA, 0)
    before, after = bare.candidates[0], joint.circles[2].candidates[0]
    assert joint.plane is not None
    np.testing.assert_allclose(np.cross(before.center, after.center), 0.0, atol=1e-6)
    assert after.center @ joint.plane.normal == pytest.approx(joint.plane.offset_mm)
    assert after.covariance is None


@pytest.mark.parametrize("seed", range(8))
def test_a_circle_off_the_plane_keeps_its_pose_and_is_flagged(seed):
    made = scene(seed, 7, 2)
    for before, after, own in zip(
        made.circles, settled(made.circles, TARGET, CAMERA).circles, made.planes, strict=True
    ):
        assert (Flag.OFF_PLANE in after.flags) == (own < 0)
        if own < 0:
            assert {id(candidate) for candidate in after.candidates} == {id(c) for c in before.candidates}
            assert after.plane is None
            assert after.ambiguity > 0.45


def test_off_plane_needs_a_declared_plane():
    made = scene(0, 7, 2)
    for mode in ("auto", "no"):
        circles = settled(made.circles, replace(TARGET, same_plane=mode), CAMERA).circles
        assert all(Flag.OFF_PLANE not in circle.flags for circle in circles)


def test_circles_that_share_no_plane_are_all_off_it():
    made = simulated(np.random.default_rng(5), (), 2, noise_px=0.05)
    result = settled(made.circles, TARGET, CAMERA)
    assert result.planes == ()
    assert all(Flag.OFF_PLANE in circle.flags for circle in result.circles)


def test_a_circle_with_one_candidate_takes_the_plane():
    made = scene(2, 6)
    circles = with_truth(made)
    one = replace(circles[0], candidates=circles[0].candidates[:1], ambiguity=0.0, flags=(Flag.NEAR_RIGHT,))
    result = settled([one, *circles[1:]], TARGET, CAMERA)
    (plane,) = result.planes
    assert plane.circles == 6
    np.testing.assert_array_equal(result.circles[0].candidates[0].normal, plane.normal)
    assert result.circles[0].flags == (Flag.NEAR_RIGHT,)


def test_each_method_has_its_plane():
    circles = with_truth(scene(2, 5))
    others = [replace(circle, method="kanatani-liu") for circle in circles]
    for mode in ("auto", "yes"):
        result = settled([*circles, *others], replace(TARGET, same_plane=mode), CAMERA)
        assert [plane.method for plane in result.planes] == ["chen-huang", "kanatani-liu"]
        assert [circle.plane for circle in result.circles] == [0] * 5 + [1] * 5
