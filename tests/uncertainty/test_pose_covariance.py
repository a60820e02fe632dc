"""The covariance of a pose measured by one rim."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from circlepose.geometry.cone import factor_from_circle, plane_basis, principal_frame
from circlepose.geometry.cone_perturbation import grown, mode_shapes
from circlepose.solvers.chen_huang import poses_from_frame
from circlepose.uncertainty.pose_covariance import pose_covariance
from tests.support.cases import circle_case, circle_cases, random_rotation

PLACES = np.linspace(0.0, 2.0 * np.pi, 200, endpoint=False)


def modes_covariance(sigma, seen=PLACES):
    """Of a rim whose edge is placed with errors `sigma`, a share of the radius, at angles `seen`."""
    shapes = mode_shapes(seen)
    return sigma**2 * np.linalg.inv(shapes.T @ shapes)


def candidates(factors, radius):
    """Centres and normals (..., 2, 3)."""
    return poses_from_frame(principal_frame(factors), radius)


def errors(centers, normals, center, normal):
    """Errors (k, 5) of the candidates (k, 2, 3) nearest to a pose."""
    nearest = np.argmax(normals @ normal, axis=-1)[:, None, None]
    centers, normals = (np.take_along_axis(each, nearest, axis=1)[:, 0] for each in (centers, normals))
    return np.concatenate([centers - center, normals @ np.stack(plane_basis(normal), axis=-1)], axis=-1)


@pytest.mark.parametrize(("tilt_deg", "off_deg"), [(12.0, 0.0), (30.0, 25.0), (60.0, 10.0), (80.0, 40.0)])
@pytest.mark.parametrize("seen", [PLACES, PLACES[:130]], ids=["whole", "part"])
@pytest.mark.parametrize("which", [0, 1])
def test_errors_of_measured_poses_have_the_covariance_that_is_told(tilt_deg, off_deg, seen, which):
    case = circle_case(40.0, 700.0, off_deg, 110.0, tilt_deg, 250.0)
    factor = factor_from_circle(case.center, case.normal, case.radius)
    centers, normals = candidates(factor, case.radius)
    center, normal = centers[which], normals[which]
    modes = modes_covariance(2e-4, seen)
    told = pose_covariance(factor, modes, center, normal, case.radius)
    assert told is not None
    drawn = np.random.default_rng(7).multivariate_normal(np.zeros(5), modes, 4000)
    found = errors(*candidates(grown(factor, drawn), case.radius), center, normal)
    root = np.linalg.cholesky(told)
    white = np.linalg.solve(root, found.T)
    # Of 4000 draws in 5 dimensions the eigenvalues of the sample covariance lie within 7 % of 1.
    eigenvalues = np.linalg.eigvalsh(white @ white.T / len(drawn))
    assert np.all(np.abs(eigenvalues - 1.0) < 0.12), eigenvalues
    assert np.all(np.abs(white.mean(axis=1)) < 0.1)


@given(circle_cases(50.0, st.floats(5.0, 85.0)), st.floats(0.1, 10.0), st.floats(0.1, 3.0))
def test_it_scales_with_the_length_and_the_error(case, longer, noisier):
    factor = factor_from_circle(case.center, case.normal, case.radius)
    told = pose_covariance(factor, modes_covariance(1e-5), case.center, case.normal, case.radius)
    scaled = pose_covariance(
        factor, modes_covariance(noisier * 1e-5), longer * case.center, case.normal, longer * case.radius
    )
    assert told is not None
    assert scaled is not None
    units = np.array([longer] * 3 + [1.0] * 2)
    expected = noisier**2 * told * np.outer(units, units)
    size = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(scaled / np.outer(size, size), expected / np.outer(size, size), atol=1e-5)


@given(circle_cases(30.0, st.floats(5.0, 80.0)), st.integers(0, 1000))
def test_it_turns_with_the_camera_and_not_with_the_factor(case, seed):
    """A factor may be turned about its own axis, with its modes, and mean the same cone."""
    factor = factor_from_circle(case.center, case.normal, case.radius)
    told = pose_covariance(factor, modes_covariance(1e-5), case.center, case.normal, case.radius)
    turn = random_rotation(seed)
    turned = pose_covariance(
        turn @ factor, modes_covariance(1e-5), turn @ case.center, turn @ case.normal, case.radius
    )
    assert told is not None
    assert turned is not None
    before = np.stack(plane_basis(case.normal), axis=-1)
    after = np.stack(plane_basis(turn @ case.normal), axis=-1)
    between = np.zeros((5, 5))
    between[:3, :3] = turn
    between[3:, 3:] = after.T @ turn @ before
    size = np.sqrt(np.abs(np.diag(turned)))
    np.testing.assert_allclose(
        between @ told @ between.T / np.outer(size, size), turned / np.outer(size, size), atol=1e-5
    )


@pytest.mark.parametrize("tilt_deg", [0.0, 1e-3, 0.1, 1.0])
def test_there_is_none_where_the_tilt_is_not_determined(tilt_deg):
    case = circle_case(40.0, 700.0, 0.0, 0.0, tilt_deg, 30.0)
    factor = factor_from_circle(case.center, case.normal, case.radius)
    assert pose_covariance(factor, modes_covariance(5e-3), case.center, case.normal, case.radius) is None


def test_edge_on_there_is_none():
    case = circle_case(40.0, 700.0, 10.0, 0.0, 90.0, 30.0)
    factor = factor_from_circle(case.center, case.normal, case.radius)
    assert pose_covariance(factor, modes_covariance(1e-4), case.center, case.normal, case.radius) is None


@pytest.mark.parametrize("tilt_deg", [0.0, 2.0, 5.0, 30.0])
def test_an_unknown_rim_gives_none(tilt_deg):
    case = circle_case(40.0, 700.0, 10.0, 0.0, tilt_deg, 30.0)
    factor = factor_from_circle(case.center, case.normal, case.radius)
    assert pose_covariance(factor, np.full((5, 5), np.nan), case.center, case.normal, case.radius) is None
