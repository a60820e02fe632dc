from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given

from circlepose.camera.camera import circle_points
from circlepose.geometry.cone import (
    cone_from_circle,
    cone_kinds,
    dual_cone,
    factor_from_circle,
    factor_from_cone,
    plane_basis,
    principal_frame,
)
from circlepose.geometry.conic import dual
from tests.support.cases import circle_case, circle_cases


@given(circle_cases())
def test_rim_points_lie_on_the_cone(case):
    points = circle_points(case.center, case.normal, case.radius, 12)
    cone = cone_from_circle(case.center, case.normal, case.radius)
    value = np.einsum("ni,ij,nj->n", points, cone, points)
    assert np.abs(value).max() <= 1e-9 * np.linalg.norm(case.center) ** 4


def test_the_cone_is_negative_inside():
    cone = cone_from_circle(np.array([0.0, 10.0, 100.0]), np.array([0.0, 0.0, -1.0]), 5.0)
    inside, outside = np.array([0.0, 10.0, 100.0]), np.array([0.0, 20.0, 100.0])
    assert inside @ cone @ inside < 0.0 < outside @ cone @ outside


@given(circle_cases())
def test_dual_of_the_cone_is_the_product_of_the_factor(case):
    cone = cone_from_circle(case.center, case.normal, case.radius)
    factor = factor_from_circle(case.center, case.normal, case.radius)
    expected = dual_cone(factor)
    product = cone @ expected
    # Both are scaled differently: Q Q* is a multiple of the identity, zero for a degenerate cone.
    np.testing.assert_allclose(
        product, product[0, 0] * np.eye(3), atol=1e-9 * np.abs(cone).max() * np.abs(expected).max()
    )
    closed_form = case.radius**2 * (np.eye(3) - np.outer(case.normal, case.normal)) - np.outer(
        case.center, case.center
    )
    np.testing.assert_allclose(expected, closed_form, atol=1e-12 * np.abs(closed_form).max())


@given(circle_cases())
def test_frame_is_right_handed_and_its_axes_bound_the_apex_angles(case):
    frame = principal_frame(factor_from_circle(case.center, case.normal, case.radius))
    np.testing.assert_allclose(frame.rotation.T @ frame.rotation, np.eye(3), atol=1e-12)
    assert np.linalg.det(frame.rotation) == pytest.approx(1.0)
    assert 0.0 <= frame.tan_half_minor <= frame.tan_half_major
    local = circle_points(case.center, case.normal, case.radius, 90) @ frame.rotation
    value = (local[:, 0] / frame.tan_half_major) ** 2 / local[:, 2] ** 2 - 1.0
    assert value.max() <= 1e-9
    if not frame.is_degenerate:
        rim = value + (local[:, 1] / frame.tan_half_minor / local[:, 2]) ** 2
        # A sliver's minor axis magnifies rounding.
        assert np.abs(rim).max() <= 1e-9 * max(1.0, 1e-3 * frame.tan_half_major / frame.tan_half_minor) ** 2 + (
            16.0 * np.finfo(np.float64).eps / frame.tan_half_minor
        )


@given(circle_cases(tilts=None))
def test_factor_from_the_matrix_gives_the_same_frame(case):
    if case.tilt_deg > 89.0 or case.tilt_deg < 1.0:
        return
    direct = principal_frame(factor_from_circle(case.center, case.normal, case.radius))
    cone = cone_from_circle(case.center, case.normal, case.radius)
    for sign in (1.0, -1.0):
        frame = principal_frame(factor_from_cone(sign * cone))
        np.testing.assert_allclose(frame.tan_half_major, direct.tan_half_major, rtol=1e-4)
        np.testing.assert_allclose(frame.tan_half_minor, direct.tan_half_minor, rtol=1e-3)


def test_batches_give_what_single_cones_give():
    cases = [circle_case(60.0, 900.0, 20.0, 70.0, tilt, 40.0) for tilt in (0.0, 30.0, 90.0)]
    centers = np.stack([c.center for c in cases])
    normals = np.stack([c.normal for c in cases])
    frame = principal_frame(factor_from_circle(centers, normals, 60.0))
    assert list(cone_kinds(frame)) == ["right", "elliptical", "degenerate"]
    for i, case in enumerate(cases):
        one = principal_frame(factor_from_circle(case.center, case.normal, case.radius))
        np.testing.assert_allclose(one.tan_half_major, frame.tan_half_major[i], rtol=1e-12)
        np.testing.assert_allclose(one.tan_half_minor, frame.tan_half_minor[i], rtol=1e-7, atol=1e-12)


@given(circle_cases())
def test_plane_basis_is_a_right_handed_frame(case):
    e1, e2 = plane_basis(case.normal)
    matrix = np.stack([e1, e2, case.normal])
    np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(matrix) > 0.0


def test_dual_is_the_adjugate():
    matrix = np.array([[2.0, 0.3, 1.0], [0.3, 1.0, -0.5], [1.0, -0.5, -3.0]])
    np.testing.assert_allclose(dual(matrix) @ matrix, np.linalg.det(matrix) * np.eye(3), atol=1e-12)
