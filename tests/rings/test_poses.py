"""Rendered ring targets: one pose for all circles, its covariance, and when each circle keeps its own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import circlepose
from circlepose.camera.camera import Camera
from circlepose.geometry.cone import plane_basis
from circlepose.results import Flag, Status
from circlepose.synthesis.render import render
from circlepose.synthesis.scene import CoaxialPart, Paint, Rings, Scene
from circlepose.targets.target import Target

CAMERA = Camera.create([[900.0, 0, 399.5], [0, 900.0, 299.5], [0, 0, 1]], (-0.15, 0.03, 0.0, 0.0), (800, 600))
COPLANAR = Target("coplanar", (50.0, 35.0, 20.0))
COAXIAL = Target("coaxial", (45.0, 30.0), generatrix_mm=45.21)
HEIGHT_MM = float(np.sqrt(45.21**2 - 15.0**2))
PAINTS = (Paint(40.0), Paint(200.0), Paint(60.0))


def scene(target, seed, distance=(450.0, 800.0), noise=2.0, tilts=(5.0, 60.0)):
    generator = np.random.default_rng(seed)
    ray = CAMERA.rays(np.array([399.5, 299.5]) + generator.uniform(-100.0, 100.0, 2))
    center = generator.uniform(*distance) * ray
    first, second = plane_basis(ray)
    tilt, lean = np.radians(generator.uniform(*tilts)), generator.uniform(0.0, 2.0 * np.pi)
    normal = -np.cos(tilt) * ray + np.sin(tilt) * (np.cos(lean) * first + np.sin(lean) * second)
    if target.kind == "coplanar":
        part = Rings(center, normal, target.radii_mm, PAINTS[: len(target.radii_mm)])
    else:
        form = "boss" if seed % 2 else "recess"
        part = CoaxialPart(center, normal, (45.0, 30.0), HEIGHT_MM, form, Paint(80.0), Paint(230.0))
    return Scene(CAMERA, (part,), Paint(170.0), noise_levels=noise, noise_seed=seed), center, normal


def measured(target, seed, **options):
    picture, center, normal = scene(target, seed)
    return circlepose.estimate(render(picture), CAMERA, target, **options), center, normal


@pytest.mark.parametrize("target", [COPLANAR, COAXIAL], ids=lambda target: target.kind)
@pytest.mark.parametrize("refine", [True, False])
def test_all_circles_have_one_pose(target, refine):
    result, _, normal = measured(target, 1, refine=refine)
    assert result.status is Status.OK
    assert [circle.circle for circle in result.circles] == list(target.circle_names)
    for which in (0, 1):
        largest, *others = (circle.candidates[which] for circle in result.circles)
        for other in others:
            np.testing.assert_allclose(other.normal, largest.normal, atol=1e-12)
            apart = other.center - largest.center
            np.testing.assert_allclose(apart, (apart @ largest.normal) * largest.normal, atol=1e-9)
            if target.kind == "coplanar" or which == 0:
                expected = 0.0 if target.kind == "coplanar" else HEIGHT_MM
                assert apart @ largest.normal == pytest.approx(expected, abs=0.5)
    assert result.circles[0].candidates[0].normal @ normal > 0.9999
    assert len({circle.ambiguity for circle in result.circles}) == 1
    # Of a contour's own points nobody knows how far they are off in common.
    assert all((c.covariance is not None) is refine for circle in result.circles for c in circle.candidates)


@pytest.mark.parametrize("target", [COPLANAR, COAXIAL], ids=lambda target: target.kind)
def test_the_covariance_holds(target):
    """Squared errors relative to it are about 1 per degree of freedom; where a rim is hidden it may be larger."""
    centers, normals = [], []
    for seed in range(8):
        result, center, normal = measured(target, seed)
        assert result.status is Status.OK
        best = result.circles[0].candidates[0]
        assert best.covariance is not None
        away, tilts = center - best.center, np.stack(plane_basis(best.normal)) @ normal
        centers.append(away @ np.linalg.solve(best.covariance[:3, :3], away) / 3.0)
        normals.append(tilts @ np.linalg.solve(best.covariance[3:, 3:], tilts) / 2.0)
        if target.kind == "coplanar":
            assert np.linalg.norm(away) < 0.1
    # Of 8 views, 24 and 16 squares: 2.5 times the expectation is four standard deviations away.
    assert np.mean(centers) < 2.5
    assert np.mean(normals) < 2.5
    if target.kind == "coplanar":
        assert np.mean(centers) > 0.4
        assert np.mean(normals) > 0.3


def test_together_they_do_better_than_the_largest_alone():
    joint, own = [], []
    for seed in range(6):
        picture, _, normal = scene(COPLANAR, seed, tilts=(5.0, 20.0))
        image = render(picture)
        together = circlepose.estimate(image, CAMERA, COPLANAR).circles[0]
        alone = circlepose.estimate(image, CAMERA, COPLANAR, method="all").circles[0]
        assert alone.method == "chen-huang"
        joint.append(np.linalg.norm(together.candidates[0].normal - normal))
        own.append(np.linalg.norm(alone.candidates[0].normal - normal))
    assert np.sqrt(np.mean(np.square(joint))) < np.sqrt(np.mean(np.square(own)))


def test_where_methods_are_compared_each_circle_is_told_by_its_own_rim():
    result, _, normal = measured(COPLANAR, 3, method="all")
    outer = {circle.method: circle for circle in result.circles if circle.circle == "outer"}
    np.testing.assert_allclose(
        outer["chen-huang"].candidates[0].center, outer["kanatani-liu"].candidates[0].center, atol=1e-6
    )
    assert outer["kanatani-liu"].candidates[0].position_difference_mm == pytest.approx(0.0, abs=1e-6)
    assert all(circle.candidates[0].normal @ normal > 0.99 for circle in outer.values())


def test_radii_that_contradict_each_other_leave_each_circle_its_own_pose():
    picture, center, _ = scene(COPLANAR, 4)
    wrong = replace(COPLANAR, radii_mm=(50.0, 35.0, 21.2))
    result = circlepose.estimate(render(picture), CAMERA, wrong)
    assert result.status is Status.OK
    ranges = [float(np.linalg.norm(circle.candidates[0].center)) for circle in result.circles]
    assert all(Flag.RING_MISFIT in circle.flags for circle in result.circles)
    # The innermost seems farther by as much as its radius is too large: the three together hide nothing.
    assert ranges[2] / ranges[0] == pytest.approx(21.2 / 20.0, abs=0.005)
    assert np.linalg.norm(result.circles[0].candidates[0].center - center) < 0.2


@pytest.mark.parametrize("target", [Target("coplanar", (50.0, 35.0)), COAXIAL], ids=lambda target: target.kind)
def test_far_away_in_noise_the_choice_is_open_and_said_to_be(target):
    """Rims of 10 px in noise: the candidates are told apart seldom, and with the certainty that there is."""
    told, right = [], []
    for seed in range(36):
        picture, _, normal = scene(target, seed, distance=(3500.0, 5000.0), noise=8.0, tilts=(20.0, 50.0))
        result = circlepose.estimate(render(picture), CAMERA, target)
        if result.status is not Status.OK or len(result.circles[0].candidates) < 2:
            continue
        first, second = result.circles[0].candidates
        told.append(result.circles[0].ambiguity)
        right.append(first.normal @ normal > second.normal @ normal)
        assert (Flag.AMBIGUOUS in result.circles[0].flags) is (told[-1] >= 0.45)
    assert len(told) >= 8
    assert np.mean(told) > 0.15
    spread = np.sqrt(np.sum(np.array(told) * (1.0 - np.array(told))))
    assert abs(len(told) - np.sum(right) - np.sum(told)) < 3.0 * spread + 1.0


@pytest.mark.parametrize("tilt_deg", [0.5, 2.0, 4.0, 8.0])
def test_where_the_circles_leave_one_optimum_there_is_no_doubt(tilt_deg):
    """A part near the camera, looked at along its axis: both candidates of its big circle lead to one pose."""
    ray = CAMERA.rays(np.array([380.0, 310.0]))
    first, _ = plane_basis(ray)
    tilt = np.radians(tilt_deg)
    normal = -np.cos(tilt) * ray + np.sin(tilt) * first
    part = CoaxialPart(500.0 * ray, normal, (45.0, 30.0), HEIGHT_MM, "boss", Paint(80.0), Paint(230.0))
    image = render(Scene(CAMERA, (part,), Paint(170.0), noise_levels=2.0, noise_seed=5))
    big, small = circlepose.estimate(image, CAMERA, COAXIAL).circles
    assert big.candidates[0].normal @ normal > np.cos(np.radians(0.05))
    assert big.ambiguity < 1e-6
    assert Flag.AMBIGUOUS not in (*big.flags, *small.flags)
