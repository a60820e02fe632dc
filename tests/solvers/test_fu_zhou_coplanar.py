from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from circlepose.camera.camera import circle_points
from circlepose.fitting.sampson import fit_guaranteed
from circlepose.geometry.cone import cone_from_circle, factor_from_circle, plane_basis, principal_frame
from circlepose.geometry.conic import conic_from_ellipse
from circlepose.geometry.ellipse import Ellipse
from circlepose.solvers.chen_huang import poses_from_frame
from circlepose.solvers.fu_zhou_coplanar import (
    concentricity,
    imaged_center,
    imaged_circular_points,
    log_odds,
    normal_from_imaged_center,
    pose_from_coplanar_circles,
    pose_with_covariance,
    radius_ratio,
    rotation_from_circular_points,
    translation,
    vanishing_line,
)
from tests.support.cases import circle_case, circle_cases, nearest_candidate, random_rotation

RINGS = circle_cases(tilts=st.floats(0.0, 85.0))
RATIOS = st.floats(0.2, 0.9)


def rings(case, ratio):
    """The conics of a case's circle and of one `ratio` as large around its centre, of different scale and sign."""
    return (
        cone_from_circle(case.center, case.normal, case.radius),
        -0.37 * cone_from_circle(case.center, case.normal, ratio * case.radius),
    )


def tolerance(case) -> float:
    """A conic's matrix holds the angular size r of the circle to eps/r^2."""
    size = case.radius / np.linalg.norm(case.center)
    return 1e-10 + 100.0 * np.finfo(np.float64).eps / size**2


def sight(case):
    return case.center / np.linalg.norm(case.center)


@given(RINGS, RATIOS)
def test_exact_conics_give_the_exact_pose(case, ratio):
    center, normal = pose_from_coplanar_circles(*rings(case, ratio), case.radius)
    assert np.linalg.norm(center - case.center) <= 10.0 * tolerance(case) * np.linalg.norm(case.center)
    assert np.linalg.norm(normal - case.normal) <= tolerance(case)


@pytest.mark.parametrize("tilt_deg", [0.0, 1e-6, 1e-3, 0.1, 1.0, 5.0, 30.0, 60.0, 80.0, 85.0])
@pytest.mark.parametrize("off_axis_deg", [0.0, 20.0, 50.0])
def test_a_ring_target_of_usual_size_to_ten_digits(tilt_deg, off_axis_deg):
    """Frontal views are nothing special: the tilt is linear in the imaged centre, not a root as for a lone circle."""
    case = circle_case(50.0, 700.0, off_axis_deg, 40.0, tilt_deg, 70.0)
    center, normal = pose_from_coplanar_circles(*rings(case, 0.6), case.radius)
    np.testing.assert_allclose(center, case.center, atol=1e-9 * 700.0)
    np.testing.assert_allclose(normal, case.normal, atol=1e-11)


@given(RINGS, RATIOS)
def test_the_imaged_center_is_on_the_ray_of_the_center_whichever_circle_comes_first(case, ratio):
    outer, inner = rings(case, ratio)
    for first, second in ((outer, inner), (inner, outer)):
        np.testing.assert_allclose(imaged_center(first, second), sight(case), atol=10.0 * tolerance(case))


@given(circle_cases(max_off_axis_deg=25.0, tilts=st.floats(0.0, 85.0)), RATIOS, st.integers(0, 10**6))
def test_turning_the_camera_turns_the_pose(case, ratio, seed):
    turn = random_rotation(seed)
    outer, inner = rings(case, ratio)
    center, normal = pose_from_coplanar_circles(turn @ outer @ turn.T, turn @ inner @ turn.T, case.radius)
    # A cone has two halves; the one on the side of z > 0 is meant.
    side = np.sign(center @ turn @ case.center)
    assert np.linalg.norm(side * center - turn @ case.center) <= 20.0 * tolerance(case) * np.linalg.norm(case.center)
    assert np.linalg.norm(side * normal - turn @ case.normal) <= 2.0 * tolerance(case)


@given(RINGS, RATIOS, st.floats(1e-3, 1e3))
def test_scaling_the_radius_scales_the_center(case, ratio, scale):
    conics = rings(case, ratio)
    center, normal = pose_from_coplanar_circles(*conics, case.radius)
    scaled, same = pose_from_coplanar_circles(*conics, case.radius * scale)
    np.testing.assert_allclose(scaled, center * scale, rtol=1e-12, atol=1e-12 * np.abs(scaled).max())
    np.testing.assert_array_equal(same, normal)


@pytest.mark.parametrize("shape", [(), (1,), (3, 2)])
def test_batch_axes(shape):
    rng = np.random.default_rng(0)
    cases = [circle_case(50.0, 700.0, 20.0, *rng.uniform([0.0, 0.0, 0.0], [360.0, 80.0, 360.0])) for _ in range(6)]
    number = int(np.prod(shape, dtype=int))
    conics = [np.stack(c).reshape(*shape, 3, 3) for c in zip(*[rings(c, 0.5) for c in cases[:number]], strict=True)]
    centers, normals = pose_from_coplanar_circles(conics[0], conics[1], np.full(shape, 50.0))
    assert centers.shape == normals.shape == (*shape, 3)
    np.testing.assert_allclose(centers.reshape(-1, 3), [c.center for c in cases[:number]], atol=1e-8)
    np.testing.assert_allclose(normals.reshape(-1, 3), [c.normal for c in cases[:number]], atol=1e-10)
    np.testing.assert_allclose(radius_ratio(*conics), np.full(shape, 0.5), rtol=1e-9)
    assert concentricity(*conics).shape == shape


@given(RINGS, RATIOS)
def test_the_vanishing_line_is_the_plane_normal(case, ratio):
    line = vanishing_line(rings(case, ratio)[0], sight(case))
    np.testing.assert_allclose(line / np.linalg.norm(line), case.normal, atol=tolerance(case))


@given(RINGS, RATIOS)
def test_the_imaged_circular_points_are_on_the_absolute_conic_and_on_both_circles(case, ratio):
    outer, inner = rings(case, ratio)
    points = imaged_circular_points(vanishing_line(outer, imaged_center(outer, inner)), outer)
    np.testing.assert_array_equal(points[0], np.conj(points[1]))
    point = points[0] / np.linalg.norm(points[0])
    assert abs(point @ point) <= 1e-6 + 10.0 * tolerance(case)
    for conic in (outer, inner):
        assert abs(point @ conic @ point) <= 1e-6 * np.abs(conic).max() + 10.0 * tolerance(case)


def noisy_rings(seed, tilt_deg=35.0, noise=2e-3):
    rng = np.random.default_rng(seed)
    case = circle_case(50.0, 700.0, 15.0, 40.0, tilt_deg, 70.0)
    conics = []
    for conic in rings(case, 0.6):
        error = rng.normal(size=(3, 3))
        conics.append(conic + noise * (error + error.T) * np.abs(np.linalg.eigvalsh(conic)).min())
    return case, conics


@pytest.mark.parametrize("seed", range(8))
def test_with_noise_equations_8_and_10_give_one_normal_and_the_rotation_stays_proper(seed):
    _, (outer, inner) = noisy_rings(seed)
    point = imaged_center(outer, inner)
    points = imaged_circular_points(vanishing_line(outer, point), outer)
    assert abs(points[0] @ points[0]) > 1e-5 * np.linalg.norm(points[0]) ** 2
    rotation = rotation_from_circular_points(points)
    np.testing.assert_allclose(rotation.T @ rotation, np.eye(3), atol=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    np.testing.assert_allclose(rotation[:, 2], normal_from_imaged_center(outer, point), atol=1e-10)
    assert rotation[:, 2] @ point < 0.0


def test_the_phase_of_the_circular_points_is_a_roll_only():
    _, (outer, inner) = noisy_rings(1)
    points = imaged_circular_points(vanishing_line(outer, imaged_center(outer, inner)), outer)
    phase = np.exp(0.7j)
    turned = rotation_from_circular_points(np.stack([phase * points[0], np.conj(phase * points[0])]))
    rotation = rotation_from_circular_points(points)
    np.testing.assert_allclose(turned[:, 2], rotation[:, 2], atol=1e-12)
    assert (turned[:, 0] @ rotation[:, 0]) == pytest.approx(np.cos(0.7))


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("tilt_deg", [0.0, 2.0, 70.0])
def test_with_noise_the_imaged_center_stays_put_though_the_double_eigenvalue_splits(seed, tilt_deg):
    case, conics = noisy_rings(seed, tilt_deg)
    assert np.linalg.norm(imaged_center(*conics) - sight(case)) < 0.02 * 50.0 / 700.0
    assert concentricity(*conics) > 1e-7


@given(circle_cases(tilts=st.floats(2.0, 85.0)), RATIOS)
def test_the_right_one_of_the_lone_circles_candidates_agrees(case, ratio):
    center, normal = pose_from_coplanar_circles(*rings(case, ratio), case.radius)
    candidates = poses_from_frame(
        principal_frame(factor_from_circle(case.center, case.normal, case.radius)), case.radius
    )
    position, angle = nearest_candidate(*candidates, center, normal)
    assert position <= 1e-8 + 10.0 * tolerance(case)
    assert angle <= 1e-8 + 2.0 * tolerance(case)


@given(RINGS, RATIOS)
def test_the_ratio_of_the_radii(case, ratio):
    outer, inner = rings(case, ratio)
    assert radius_ratio(outer, inner) == pytest.approx(ratio, rel=1e-6 + 100.0 * tolerance(case))
    assert radius_ratio(inner, outer) == pytest.approx(1.0 / ratio, rel=1e-6 + 100.0 * tolerance(case))


@given(RINGS, RATIOS)
def test_concentric_circles_have_a_double_eigenvalue(case, ratio):
    assert concentricity(*rings(case, ratio)) <= 1e-9 + tolerance(case)


@pytest.mark.parametrize("share", [0.01, 0.05, 0.2])
@pytest.mark.parametrize("tilt_deg", [0.0, 40.0, 75.0])
def test_circles_beside_each_others_centers_are_said_not_to_be_concentric(share, tilt_deg):
    case = circle_case(50.0, 700.0, 10.0, 40.0, tilt_deg, 70.0)
    across = np.cross(case.normal, [0.6, 0.0, 0.8])
    outer = cone_from_circle(case.center, case.normal, 50.0)
    apart = share * 50.0
    inner = cone_from_circle(case.center + apart * across / np.linalg.norm(across), case.normal, 30.0)
    expected = apart**2 / (50.0**2 - 30.0**2)
    assert concentricity(outer, inner) == pytest.approx(expected, rel=0.1 + expected)


@pytest.mark.parametrize("shift", [30.0, 100.0], ids=["crossing", "beside"])
def test_what_cannot_be_concentric_has_no_center(shift):
    first = conic_from_ellipse(Ellipse.from_axes([0.0, 0.0], [0.04, 0.02], 0.3))
    second = conic_from_ellipse(Ellipse.from_axes([shift * 1e-3, 0.0], [0.03, 0.02], -0.3))
    assert np.all(np.isnan(imaged_center(first, second)))
    assert np.isnan(radius_ratio(first, second))
    assert concentricity(first, second) == np.inf
    center, normal = pose_from_coplanar_circles(first, second, 50.0)
    assert np.all(np.isnan(center))
    assert np.all(np.isnan(normal))


def test_one_bad_pair_does_not_spoil_a_batch():
    case = circle_case(50.0, 700.0, 10.0, 40.0, 30.0, 70.0)
    outer, inner = rings(case, 0.6)
    beside = cone_from_circle(case.center + np.array([90.0, 0.0, 0.0]), case.normal, 20.0)
    centers, _ = pose_from_coplanar_circles(np.stack([outer, outer]), np.stack([beside, inner]), 50.0)
    assert np.all(np.isnan(centers[0]))
    np.testing.assert_allclose(centers[1], case.center, atol=1e-8)


def test_a_line_through_the_conic_is_no_vanishing_line():
    conic = conic_from_ellipse(Ellipse.from_axes([0.1, 0.0], [0.04, 0.02], 0.3))
    points = imaged_circular_points(np.array([1.0, 0.0, -0.1]), conic)
    assert np.all(np.isnan(points.real))


def test_the_range_does_not_feel_a_small_error_of_the_imaged_center():
    case = circle_case(50.0, 700.0, 0.0, 0.0, 60.0, 90.0)
    conic = rings(case, 0.6)[0]
    moved = sight(case) + np.array([1e-4, 1e-4, 0.0])
    turned = np.degrees(np.arccos(normal_from_imaged_center(conic, moved) @ case.normal))
    assert turned > 0.05
    assert translation(moved, 50.0, conic)[2] == pytest.approx(700.0, rel=2e-3)


def fitted_rings(tilt_deg, rng, noise_px=0.05, focal_px=1200.0):
    """Both circles fitted to noisy edges, and their truth."""
    off_axis, azimuth, lean = rng.uniform(0.0, [20.0, 360.0, 360.0])
    case = circle_case(60.0, 900.0, off_axis, azimuth, tilt_deg, lean)
    fits = []
    for radius, number in ((60.0, 120), (36.0, 80)):
        points = circle_points(case.center, case.normal, radius, number)
        noise = noise_px / focal_px * rng.normal(size=(number, 2))
        fits.append(fit_guaranteed(points[:, :2] / points[:, 2:] + noise))
    assert all(fit is not None for fit in fits)
    return case, fits


def modes_covariances(fits):
    """Of the latent parameters (t_x, t_y, e0, e1, e2), which are the modes in another order."""
    order = [2, 0, 1, 3, 4]
    return np.stack([fit.latent_covariance[np.ix_(order, order)] for fit in fits])


def test_the_covariance_of_the_pose_is_that_of_its_errors():
    rng = np.random.default_rng(5)
    squared = []
    for _ in range(150):
        case, fits = fitted_rings(25.0, rng)
        factors = np.stack([f.ellipse.factor for f in fits])
        center, normal, covariance = pose_with_covariance(factors, modes_covariances(fits), case.radius)
        tilts = np.stack(plane_basis(normal)) @ case.normal
        away = case.center - center
        squared.append(
            (
                tilts @ np.linalg.solve(covariance[3:, 3:], tilts),
                away @ np.linalg.solve(covariance[:3, :3], away),
            )
        )
    # Two and three degrees of freedom; the means of 150 have standard errors of 0.16 and 0.2.
    np.testing.assert_allclose(np.mean(squared, axis=0), [2.0, 3.0], atol=0.6)


@pytest.mark.parametrize("tilt_deg", [2.0, 4.0, 10.0, 60.0])
def test_a_tilt_of_a_few_degrees_is_told_from_its_mirror_image(tilt_deg):
    rng = np.random.default_rng(6)
    for _ in range(25):
        case, fits = fitted_rings(tilt_deg, rng)
        factors = np.stack([f.ellipse.factor for f in fits])
        _, normal, covariance = pose_with_covariance(factors, modes_covariances(fits), case.radius)
        _, candidates = poses_from_frame(principal_frame(factors[0]), 60.0)
        right = int(np.argmax(candidates @ case.normal))
        odds = log_odds(candidates, np.radians(0.3), normal, covariance[3:, 3:])
        assert (odds > 0.0) == (right == 0)
        assert abs(odds) > 5.0


def test_log_odds_when_nothing_tells():
    normal, covariance = np.array([0.0, 0.0, -1.0]), 1e-6 * np.eye(2)
    same = np.stack([normal, normal])
    assert log_odds(same, 0.01, normal, covariance) == 0.0
    mirrored = np.array([[0.1, 0.0, -1.0], [-0.1, 0.0, -1.0]]) / np.sqrt(1.01)
    assert log_odds(mirrored, 0.01, normal, covariance) == pytest.approx(0.0, abs=1e-12)
    assert log_odds(mirrored, 0.01, mirrored[0], covariance) > 10.0
    # The candidates' own error takes confidence away.
    assert 0.0 < log_odds(mirrored, 0.5, mirrored[0], covariance) < 0.2
