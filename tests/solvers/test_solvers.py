from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from circlepose.camera.camera import circle_points
from circlepose.errors import ArgumentError
from circlepose.geometry.cone import cone_from_circle, factor_from_circle, principal_frame
from circlepose.solvers import CIRCLE_METHODS, chen_huang, kabuka_arenas, kanatani_liu
from circlepose.solvers.chords import Chords, chords_from_contour
from circlepose.solvers.registry import Solutions, solve
from tests.support.cases import circle_case, circle_cases, nearest_candidate, random_rotation, same_solution_set


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
    # Of smaller cones the matrix has no such digits.
    assume(case.radius * np.cos(np.radians(case.tilt_deg)) > 1e-5 * np.linalg.norm(case.center))
    cone = cone_from_circle(case.center, case.normal, case.radius)
    assert same_solution_set(chen_huang_poses(case), kanatani_liu.poses_from_cone(cone, case.radius), 1e-5)


@given(circle_cases(tilts=st.floats(0.0, 89.99)), st.integers(16, 720))
def test_the_contour_route_is_exact(case, number):
    distance = float(np.linalg.norm(case.center))
    # Close by, nearly edge-on, places that are even on the circle leave gaps like hidden arcs on its near side.
    assume(case.radius < 0.4 * distance or (case.tilt_deg < 70.0 and number > 60))
    assume(case.radius < 0.7 * distance)
    chords = chords_from_contour(rim_rays(case, number))
    assert isinstance(chords, Chords)
    position, angle = nearest_candidate(
        *chen_huang.poses_from_frame(chords.frame, case.radius), case.center, case.normal
    )
    # Rounding of the rays, 1e-16, in units of the apex angle; tilts near frontal take its root.
    rounding = 1e-13 * distance / case.radius
    tilt = 1e-9 + min(rounding / np.sin(np.radians(max(case.tilt_deg, 1e-9))), np.sqrt(rounding))
    assert angle <= tilt
    assert position <= 1e-9 + rounding + tilt * case.radius / distance


@given(circle_cases(tilts=st.floats(0.0, 90.0)), st.integers(40, 400))
def test_the_contour_route_as_printed_is_off_by_the_spacing_of_points(case, number):
    distance = float(np.linalg.norm(case.center))
    assume(case.radius < 0.4 * distance)
    chords = chords_from_contour(rim_rays(case, number), sub_pixel=False)
    assert isinstance(chords, Chords)
    position, angle = nearest_candidate(
        *chen_huang.poses_from_frame(chords.frame, case.radius), case.center, case.normal
    )
    assert angle <= 2.0 * np.pi / number
    assert position <= 0.5 * np.pi / number


EDGE_ON_RAD = st.one_of(st.floats(0.0, 1e-9), st.floats(0.0, 1e-3), st.sampled_from([1e-6, 1e-9, 1e-12]))


@given(circle_cases(tilts=EDGE_ON_RAD.map(lambda off: 90.0 - np.degrees(off))))
def test_solvers_edge_on_are_exact_or_say_that_they_have_none(case):
    factor = factor_from_circle(case.center, case.normal, case.radius)
    with np.errstate(all="raise", under="ignore"):
        exact = chen_huang_poses(case)
        assert nearest_candidate(*exact, case.center, case.normal) < (1e-12, 1e-12)
        algebraic = kanatani_liu.poses_from_factor(factor, case.radius)
        approximate = kabuka_arenas.poses_from_factor(factor, case.radius)
    degenerate = bool(principal_frame(factor).is_degenerate)
    assert (algebraic is None) == (approximate is None) == degenerate
    if algebraic is not None and approximate is not None:
        assert same_solution_set(exact, algebraic, 1e-12)
        # The approximation leaves out perspective, but not the tilt.
        assert np.all(np.isfinite(approximate[0]))
        assert nearest_candidate(*approximate, case.center, case.normal)[0] < case.radius / np.linalg.norm(
            case.center
        )


@given(circle_cases(tilts=st.one_of(st.floats(0.0, 1e-7), st.floats(0.0, 0.05))))
def test_solvers_frontal_are_exact_to_the_root_of_rounding(case):
    factor = factor_from_circle(case.center, case.normal, case.radius)
    with np.errstate(all="raise", under="ignore"):
        poses = [
            chen_huang_poses(case),
            kanatani_liu.poses_from_factor(factor, case.radius),
            kabuka_arenas.poses_from_factor(factor, case.radius),
        ]
    for pose, share in zip(poses, (0.0, 0.0, 1.0), strict=True):
        assert pose is not None
        position, angle = nearest_candidate(*pose, case.center, case.normal)
        tolerance = tilt_tolerance(case) + share * 2.0 * np.radians(case.tilt_deg)
        assert angle <= tolerance
        assert position <= 1e-9 + case.radius / np.linalg.norm(case.center) * tolerance


@given(circle_cases(tilts=EDGE_ON_RAD.map(lambda off: 90.0 - np.degrees(off))))
def test_a_flat_matrix_has_poses_or_is_refused(case):
    """Q loses the apex angle where it flattens: three digits of its eigenvalues are left, or it is misuse."""
    cone = cone_from_circle(case.center, case.normal, case.radius)
    try:
        with np.errstate(all="raise", under="ignore"):
            centers, normals = kanatani_liu.poses_from_cone(cone / np.abs(cone).max(), case.radius)
    except ArgumentError:
        return
    assert nearest_candidate(centers, normals, case.center, case.normal)[0] < 0.1


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
    assert position < (1e-12 if exact else 0.01)
    assert np.degrees(angle) < (1e-9 if exact else 5.0)


@pytest.mark.parametrize("method", ["kanatani-liu", "kabuka-arenas"])
def test_methods_that_need_an_ellipse_say_so_edge_on(method):
    case = circle_case(60.0, 900.0, 10.0, 30.0, 90.0, 20.0)
    factor = factor_from_circle(case.center, case.normal, case.radius)
    assert "edge-on" in solve(method, factor, rim_rays(case, 90), case.radius).reason


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
