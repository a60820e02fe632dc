from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from cases import circle_case, circle_cases, nearest_candidate, random_rotation, same_solution_set
from circlepose.camera import circle_points
from circlepose.cone import cone_from_circle, factor_from_circle, principal_frame
from circlepose.errors import ArgumentError
from circlepose.solvers import CIRCLE_METHODS, chen_huang, kabuka_arenas, kanatani_liu
from circlepose.solvers.chords import Chords, chords_from_contour
from circlepose.solvers.solve import Solutions, solve


def chen_huang_poses(case):
    return chen_huang.poses_from_frame(
        principal_frame(factor_from_circle(case.center, case.normal, case.radius)), case.radius
    )


def rim_rays(case, number):
    points = circle_points(case.center, case.normal, case.radius, number)
    return points / np.linalg.norm(points, axis=-1, keepdims=True)


def tilt_tolerance(case) -> float:
    """Rounding of s^2 - t^2 becomes its root in the tilt, so near frontal views 1e-9 is out of float64's reach."""
    rounding = 16.0 * np.finfo(np.float64).eps
    return 1e-9 + rounding / max(np.sin(np.radians(case.tilt_deg)), np.sqrt(rounding))


@given(circle_cases())
def test_one_candidate_is_the_truth(case):
    centers, normals = chen_huang_poses(case)
    position, angle = nearest_candidate(centers, normals, case.center, case.normal)
    assert position <= 1e-9 + case.radius / np.linalg.norm(case.center) * tilt_tolerance(case)
    assert angle <= tilt_tolerance(case)


@given(circle_cases())
def test_both_candidates_have_the_cone_and_face_the_camera(case):
    centers, normals = chen_huang_poses(case)
    assert np.all(np.sum(centers * normals, axis=-1) <= 1e-9 * np.linalg.norm(case.center))
    np.testing.assert_allclose(np.linalg.norm(normals, axis=-1), 1.0, rtol=1e-12)
    expected = principal_frame(factor_from_circle(case.center, case.normal, case.radius))
    for center, normal in zip(centers, normals, strict=True):
        frame = principal_frame(factor_from_circle(center, normal, case.radius))
        np.testing.assert_allclose(frame.tan_half_major, expected.tan_half_major, rtol=1e-9)
        np.testing.assert_allclose(frame.tan_half_minor, expected.tan_half_minor, rtol=1e-7, atol=1e-9)


@given(circle_cases(), st.integers(0, 10**6))
def test_turning_the_camera_turns_the_poses(case, seed):
    turn = random_rotation(seed)
    factor = factor_from_circle(case.center, case.normal, case.radius)
    first = chen_huang.poses_from_frame(principal_frame(factor), case.radius)
    second = chen_huang.poses_from_frame(principal_frame(turn @ factor), case.radius)
    turned = (first[0] @ turn.T, first[1] @ turn.T)
    assert same_solution_set(turned, second, 1e-9 + 4.0 * tilt_tolerance(case))


@given(circle_cases(), st.floats(1e-3, 1e3))
def test_scaling_the_radius_scales_the_centers(case, scale):
    frame = principal_frame(factor_from_circle(case.center, case.normal, case.radius))
    centers, normals = chen_huang.poses_from_frame(frame, case.radius)
    scaled, same_normals = chen_huang.poses_from_frame(frame, case.radius * scale)
    np.testing.assert_allclose(scaled, centers * scale, atol=1e-12 * np.abs(scaled).max())
    np.testing.assert_array_equal(same_normals, normals)


@given(circle_cases(tilts=st.floats(1.0, 88.0)))
def test_kanatani_liu_gives_the_same_two_poses(case):
    cone = cone_from_circle(case.center, case.normal, case.radius)
    assert same_solution_set(chen_huang_poses(case), kanatani_liu.poses_from_cone(cone, case.radius), 1e-5)


@given(circle_cases(tilts=st.floats(0.0, 90.0)))
def test_the_contour_route_is_exact_up_to_its_sampling(case):
    distance = float(np.linalg.norm(case.center))
    # Close by, nearly edge-on, places that are even on the circle leave gaps like hidden arcs on its near side.
    assume(case.radius < 0.7 * distance or case.tilt_deg < 80.0)
    chords = chords_from_contour(rim_rays(case, 720))
    assert isinstance(chords, Chords)
    centers, normals = chen_huang.poses_from_frame(chords.frame, case.radius)
    exact = chen_huang_poses(case)
    position, angle = nearest_candidate(*exact, centers[0], normals[0])
    # The polynomials leave about 1e-4 of the chords' lengths, and tilts near frontal take the root of that. A tilt
    # moves the centre by as much of the radius, at most.
    assert angle <= 2e-2
    assert position <= 1e-4 + 8.8e-3 * case.radius / distance


def test_the_misprinted_formulas_of_the_paper():
    """alpha - beta with u^2 - v^2 and gamma = 2 alpha beta/(alpha + beta) put P, Q, B and C on the circle."""
    case = circle_case(60.0, 900.0, 10.0, 30.0, 50.0, 20.0)
    frame = principal_frame(factor_from_circle(case.center, case.normal, case.radius))
    r, s, t = case.radius, float(frame.tan_half_major), float(frame.tan_half_minor)
    total = 2.0 * r / s * np.sqrt((1.0 + s**2) / (1.0 + t**2))
    difference = 2.0 * r / s * np.sqrt((s**2 - t**2) / (1.0 + t**2))
    alpha, beta = (total + difference) / 2.0, (total - difference) / 2.0
    gamma = 2.0 * alpha * beta / total
    assert gamma == pytest.approx(r / s * np.sqrt((1.0 + t**2) / (1.0 + s**2)))
    b, c = alpha * np.array([0.0, t, 1.0]), beta * np.array([0.0, -t, 1.0])
    p, q = gamma * np.array([s, 0.0, 1.0]), gamma * np.array([-s, 0.0, 1.0])
    center = (b + c) / 2.0
    for point in (b, c, p, q):
        assert np.linalg.norm(point - center) == pytest.approx(r, rel=1e-12)
    # As printed, gamma = (alpha + beta)/2, P is off the circle.
    assert abs(np.linalg.norm(total / 2.0 * np.array([s, 0.0, 1.0]) - center) - r) > 1e-2
    poses = chen_huang.poses_from_frame(frame, r)[0] @ frame.rotation
    assert min(np.linalg.norm(poses - center, axis=-1)) < 1e-9


def test_edge_on_gives_one_center_and_opposite_normals():
    case = circle_case(60.0, 900.0, 10.0, 30.0, 90.0, 20.0)
    centers, normals = chen_huang_poses(case)
    np.testing.assert_allclose(centers[0], centers[1], atol=1e-9)
    np.testing.assert_allclose(normals[0], -normals[1], atol=1e-12)


def test_a_right_cone_is_said_once():
    case = circle_case(60.0, 900.0, 0.0, 0.0, 0.0, 0.0)
    factor = factor_from_circle(case.center, case.normal, case.radius)
    solutions = solve("chen-huang", factor, rim_rays(case, 90), case.radius)
    assert isinstance(solutions, Solutions)
    assert solutions.cone == "right"
    assert len(solutions.centers) == 1
    np.testing.assert_allclose(solutions.centers[0], case.center, atol=1e-6)


@pytest.mark.parametrize("method", CIRCLE_METHODS)
def test_every_method_answers_an_oblique_view(method):
    case = circle_case(60.0, 900.0, 5.0, 30.0, 40.0, 20.0)
    factor = factor_from_circle(case.center, case.normal, case.radius)
    solutions = solve(method, factor, rim_rays(case, 720), case.radius)
    assert isinstance(solutions, Solutions)
    position, angle = nearest_candidate(solutions.centers, solutions.normals, case.center, case.normal)
    exact = method != "kabuka-arenas"
    assert position < (1e-4 if exact else 0.01)
    assert np.degrees(angle) < (0.1 if exact else 5.0)


@pytest.mark.parametrize("method", ["kanatani-liu", "kabuka-arenas"])
def test_methods_that_need_an_ellipse_say_so_edge_on(method):
    case = circle_case(60.0, 900.0, 10.0, 30.0, 90.0, 20.0)
    factor = factor_from_circle(case.center, case.normal, case.radius)
    assert "edge-on" in solve(method, factor, rim_rays(case, 90), case.radius)


def test_kanatani_liu_refuses_a_singular_cone():
    with pytest.raises(ArgumentError, match="singular"):
        kanatani_liu.poses_from_cone(np.diag([0.0, 1.0, 0.0]), 1.0)


def test_the_approximation_is_exact_in_the_limit_of_a_small_frontal_circle():
    case = circle_case(1.0, 20000.0, 0.0, 0.0, 0.0, 0.0)
    poses = kabuka_arenas.poses_from_factor(factor_from_circle(case.center, case.normal, 1.0), 1.0)
    assert poses is not None
    np.testing.assert_allclose(poses[0][0], case.center, rtol=1e-6)


def test_unknown_method():
    with pytest.raises(ArgumentError, match="chen-huang"):
        solve("magic", np.eye(3), np.eye(3), 1.0)


@pytest.mark.parametrize("rays", [np.zeros((0, 3)), np.tile([0.0, 0.0, 1.0], (9, 1)), np.eye(3)[:2]])
def test_a_contour_without_chords(rays):
    assert isinstance(chords_from_contour(rays), str)
