"""One pose for all circles of a target: exact where rims are, with errors as told, no more certain than it may be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from circlepose.camera.camera import Camera, circle_contour
from circlepose.geometry.cone import factor_from_circle, plane_basis, principal_frame
from circlepose.geometry.cone_perturbation import grown, mode_shapes
from circlepose.results import Failure
from circlepose.rings.evidence import RimEvidence, from_edges, from_levels
from circlepose.rings.joint_pose import (
    AxisPose,
    JointPose,
    RingProblem,
    are_one,
    chance_of_second,
)
from circlepose.rings.options import DEFAULT
from circlepose.solvers.chen_huang import poses_from_frame
from circlepose.uncertainty.pose_covariance import pose_covariance
from tests.support.cases import circle_case, circle_cases

PLACES = np.linspace(0.0, 2.0 * np.pi, 200, endpoint=False)
SHAPES = mode_shapes(PLACES)
CAMERA = Camera.create([[900.0, 0, 639.5], [0, 900.0, 479.5], [0, 0, 1]], (-0.1, 0.02, 0.0, 0.0), (1280, 960))


def modes_covariance(sigma):
    return sigma**2 * np.linalg.inv(SHAPES.T @ SHAPES)


def problem(case, shares=(1.0, 0.6), height=0.0, height_sigma=0.0, sigma=1e-3, factors=None):
    """Concentric circles at `case`, or one in front by `height`, whose rims have edges with errors `sigma`."""
    pose = AxisPose(case.center, case.normal, height)
    rims = []
    for number, share in enumerate(shares):
        radius = share * case.radius
        factor = factor_from_circle(*pose.circle(number), radius) if factors is None else factors[number]
        # Edges are placed to a part of a pixel, whatever the circle's size.
        rims.append(from_levels(factor, radius, modes_covariance(sigma / share)))
    return RingProblem(tuple(rims), height, height_sigma), pose


def drawn(ring, pose, generator):
    """What is measured of these circles, with errors of the rims, radii, places and of the height as told."""
    rims = []
    for number, rim in enumerate(ring.rims):
        (center, normal), radius = pose.circle(number), rim.radius
        if number > 0:
            center = center + DEFAULT.place_share * ring.rims[0].radius * generator.normal(size=3)
            radius = radius * (1.0 + DEFAULT.radius_share * generator.normal())
        noise = np.linalg.cholesky(np.linalg.inv(rim.information)) @ generator.normal(size=5)
        rims.append(replace(rim, factor=grown(factor_from_circle(center, normal, radius), noise)))
    known = ring.height_sigma if np.isfinite(ring.height_sigma) else 0.0
    return replace(ring, rims=tuple(rims), height=ring.height + known * generator.normal())


def disturbed(case, pose):
    first, second = plane_basis(pose.normal)
    normal = pose.normal + 0.02 * first - 0.015 * second
    center = pose.center * 1.005 + 0.02 * case.radius * first
    return AxisPose(center, normal / np.linalg.norm(normal), pose.height)


@given(circle_cases(40.0, st.floats(15.0, 75.0)), st.sampled_from([0.0, 0.8, -0.5]), st.sampled_from([0.5, np.inf]))
def test_from_exact_rims_comes_the_exact_pose(case, height, height_sigma):
    # Farther than a few diameters, as from a part's candidates the way to its pose is short.
    assume(float(np.linalg.norm(case.center)) > 6.0 * case.radius)
    coaxial = height != 0.0
    ring, pose = problem(case, (1.0, 0.7), height * case.radius, height_sigma if coaxial else 0.0)
    start = disturbed(case, pose)
    solved = ring.solve(replace(start, height=1.05 * pose.height) if height_sigma == np.inf else start)
    assert isinstance(solved, JointPose)
    assert solved.misfit < 1e-3
    away = pose.offset(0, solved.pose)
    sigma = np.sqrt(np.diag(solved.covariance_of(0)))
    assert np.all(np.abs(away) < 0.05 * sigma)
    assert solved.freedom == 5 * 2 - 5 - (1 if coaxial and height_sigma == np.inf else 0)


@pytest.mark.parametrize(
    ("tilt_deg", "height", "height_sigma"),
    [(35.0, 0.0, 0.0), (8.0, 0.0, 0.0), (40.0, 30.0, np.inf), (3.0, 30.0, 0.5)],
)
def test_errors_of_joint_poses_have_the_covariance_that_is_told(tilt_deg, height, height_sigma):
    case = circle_case(45.0, 700.0, 15.0, 30.0, tilt_deg, 200.0)
    ring, pose = problem(case, (1.0, 0.65), height, height_sigma)
    exact = ring.solve(pose)
    assert isinstance(exact, JointPose)
    generator = np.random.default_rng(3)
    found, misfits = [], []
    for _ in range(250):
        solved = drawn(ring, pose, generator).solve(pose)
        assert isinstance(solved, JointPose)
        found.append([pose.offset(number, solved.pose) for number in (0, 1)])
        misfits.append(solved.misfit)
    assert np.mean(misfits) == pytest.approx(exact.freedom, rel=0.2)
    for number in (0, 1):
        white = np.linalg.solve(np.linalg.cholesky(exact.covariance_of(number)), np.array(found)[:, number].T)
        eigenvalues = np.linalg.eigvalsh(white @ white.T / white.shape[1])
        # 250 draws in 5 dimensions: within 30 %.
        assert np.all(np.abs(eigenvalues - 1.0) < 0.4), eigenvalues


@given(circle_cases(40.0, st.floats(10.0, 75.0)))
def test_a_second_circle_never_makes_the_pose_less_certain(case):
    ring, pose = problem(case, sigma=1e-4)
    joint = ring.at(pose)
    rim = ring.rims[0]
    lone = pose_covariance(rim.factor, np.linalg.inv(rim.information), case.center, case.normal, case.radius)
    assert isinstance(joint, JointPose)
    assert lone is not None
    units = np.array([case.radius] * 3 + [1.0] * 2)
    gained = (lone - joint.covariance_of(0)) / np.outer(units, units)
    assert np.linalg.eigvalsh(gained)[0] > -1e-6 * np.linalg.eigvalsh(gained)[-1]


@pytest.mark.parametrize("excess", [1.03, 0.97])
def test_a_wrong_radius_is_not_absorbed(excess):
    """The largest circle stays the yardstick, and the covariance grows by what does not fit."""
    case = circle_case(50.0, 700.0, 15.0, 30.0, 35.0, 200.0)
    ring, pose = problem(case, (1.0, 0.6), sigma=1e-4)
    wrong = replace(ring, rims=(ring.rims[0], replace(ring.rims[1], radius=30.0 * excess)))
    solved = wrong.solve(pose)
    assert isinstance(solved, JointPose)
    assert np.linalg.norm(solved.pose.center - case.center) < 2e-4 * 700.0
    assert solved.misfit > 100.0
    assert solved.excess > 5.0
    right = ring.solve(pose)
    assert isinstance(right, JointPose)
    assert right.excess == 1.0
    ratio = solved.covariance_of(0)[3, 3] / right.covariance_of(0)[3, 3]
    assert ratio == pytest.approx(solved.excess, rel=0.1)


def candidates(ring, radius):
    centers, normals = poses_from_frame(principal_frame(ring.rims[0].factor), radius)
    return [AxisPose(center, normal, ring.height) for center, normal in zip(centers, normals, strict=True)]


@pytest.mark.parametrize("sigma", [0.015, 0.04])
def test_of_choices_with_an_ambiguity_such_a_share_is_wrong(sigma):
    generator = np.random.default_rng(11)
    told, wrong = [], []
    for _ in range(240):
        case = circle_case(50.0, 4000.0, 10.0, 360.0 * generator.random(), generator.uniform(15.0, 60.0), 20.0)
        ring, pose = problem(case, sigma=sigma)
        ring = drawn(ring, pose, generator)
        solved = [ring.solve(start) for start in candidates(ring, case.radius)]
        if any(isinstance(each, Failure) for each in solved) or are_one(*solved):
            continue
        first, second = sorted(solved, key=lambda joint: -joint.log_weight)
        told.append(chance_of_second(first.log_weight, second.log_weight))
        wrong.append(second.pose.normal @ pose.normal > first.pose.normal @ pose.normal)
    told, wrong = np.array(told), np.array(wrong)
    assert len(told) > 180
    assert told.max() <= 0.5
    assert told.sum() > 5.0
    for low, high in ((0.0, 0.1), (0.1, 0.3), (0.3, 0.51)):
        inside = (told >= low) & (told < high)
        spread = np.sqrt(np.sum(told[inside] * (1.0 - told[inside])))
        assert abs(wrong[inside].sum() - told[inside].sum()) < 3.0 * spread + 0.05 * inside.sum() + 1.0


def test_seen_frontally_nothing_tells():
    """What the candidates differ by shrinks with the tilt, and certainty with it."""
    chances = []
    for tilt_deg in (30.0, 10.0, 5.0, 2.5):
        case = circle_case(50.0, 1500.0, 0.0, 0.0, tilt_deg, 20.0)
        ring, _ = problem(case, sigma=0.03)
        at = sorted((ring.at(pose) for pose in candidates(ring, case.radius)), key=lambda joint: joint.misfit)
        chances.append(chance_of_second(at[0].log_weight, at[1].log_weight))
    assert chances == sorted(chances)
    assert chances[0] < 1e-2
    assert chances[-1] > 0.3


@pytest.mark.parametrize("seen", [1.0, 0.35])
def test_edges_tell_how_a_rim_has_grown(seen):
    case = circle_case(40.0, 600.0, 12.0, 40.0, 35.0, 10.0)
    contour = circle_contour(CAMERA, case.center, case.normal, case.radius, 120)
    rays, jacobians = (each[: int(seen * 120)] for each in CAMERA.rays_with_jacobian(contour))
    factor = factor_from_circle(case.center, case.normal, case.radius)
    coefficients = np.array([0.004, -0.002, 0.001, 0.003, -0.002])
    measured = from_edges(grown(factor, -coefficients), case.radius, rays, jacobians, 0.05, 0.0)
    np.testing.assert_allclose(measured.coefficients, coefficients, atol=1e-4 if seen == 1.0 else 1e-3)
    variances = np.linalg.eigvalsh(measured.information)
    assert variances[0] > 0.0
    common = from_edges(factor, case.radius, rays, jacobians, 0.05, 0.05)
    assert np.all(np.linalg.eigvalsh(measured.information - common.information) > 0.0)


def test_part_of_a_rim_is_enough_beside_a_whole_one():
    """Of the second circle a twentieth is seen: too little for an ellipse, enough to tell the candidates."""
    case = circle_case(40.0, 600.0, 12.0, 40.0, 35.0, 10.0)
    contour = circle_contour(CAMERA, case.center, case.normal, 25.0, 120)[:6]
    rays, jacobians = CAMERA.rays_with_jacobian(contour)
    factor = factor_from_circle(case.center, case.normal, 25.0)
    part = from_edges(factor, 25.0, rays, jacobians, 0.02, 0.0)
    ring, _ = problem(case, (1.0,), sigma=1e-4)
    both = RingProblem((*ring.rims, part))
    right, wrong = sorted(
        (both.solve(start) for start in candidates(ring, case.radius)), key=lambda joint: joint.misfit
    )
    assert right.pose.normal @ case.normal > 1.0 - 1e-9
    assert np.allclose(right.pose.center, case.center, atol=0.01)
    assert chance_of_second(right.log_weight, wrong.log_weight) < 0.01
    assert not are_one(right, wrong)


def test_no_pose_comes_back_that_the_camera_could_not_see():
    case = circle_case(40.0, 600.0, 12.0, 40.0, 35.0, 10.0)
    ring, pose = problem(case)
    assert isinstance(ring.at(replace(pose, normal=-pose.normal)), Failure)
    assert isinstance(ring.at(replace(pose, center=-pose.center)), Failure)
    blind = RimEvidence(ring.rims[0].factor, 40.0, np.zeros(5), np.zeros((5, 5)))
    assert isinstance(RingProblem((blind, blind)).solve(pose), Failure)
