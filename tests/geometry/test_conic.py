from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from circlepose.errors import ArgumentError
from circlepose.geometry import conic as cn
from circlepose.geometry.ellipse import Ellipse, signed_distance

shapes = pytest.mark.parametrize("batch", [(), (1,), (3, 1, 2)])
ellipses = st.builds(
    lambda x, y, a, ratio, angle: Ellipse.from_axes([x, y], [a, a * ratio], angle),
    st.floats(-1e3, 1e3),
    st.floats(-1e3, 1e3),
    st.floats(1.0, 500.0),
    st.floats(0.02, 1.0),
    st.floats(-np.pi, np.pi),
)


def random_ellipses(batch: tuple[int, ...]) -> Ellipse:
    rng = np.random.default_rng(5)
    return Ellipse.from_axes(
        rng.uniform(-50, 50, (*batch, 2)), rng.uniform(1, 30, (*batch, 2)), rng.uniform(-2, 2, batch)
    )


@shapes
def test_ellipse_to_matrix_and_back_is_the_identity(batch):
    ellipse = random_ellipses(batch)
    back = cn.ellipse_from_conic(cn.conic_from_ellipse(ellipse))
    for name in ("center", "semi_major", "semi_minor", "angle"):
        assert getattr(back, name).shape == getattr(ellipse, name).shape
        np.testing.assert_allclose(getattr(back, name), getattr(ellipse, name), rtol=1e-9, atol=1e-9)


@given(ellipses, st.floats(-10.0, 10.0).filter(lambda s: abs(s) > 1e-3))
def test_a_conic_has_no_scale(ellipse, scale):
    back = cn.ellipse_from_conic(scale * cn.conic_from_ellipse(ellipse))
    # Far from the origin a matrix loses the square of distance over size in digits.
    rounding = 1e-13 * (1.0 + np.linalg.norm(ellipse.center) / ellipse.semi_minor) ** 2
    np.testing.assert_allclose(back.semi_major, ellipse.semi_major, rtol=1e-9 + rounding)
    np.testing.assert_allclose(back.semi_minor, ellipse.semi_minor, rtol=1e-9 + rounding)


@given(ellipses)
def test_rim_points_lie_on_the_conic_and_at_distance_zero(ellipse):
    points = ellipse.points(24)
    conic = cn.conic_from_ellipse(ellipse)
    tolerance = (
        1e-8 * (np.linalg.norm(ellipse.center) + ellipse.semi_major) / (ellipse.semi_minor / ellipse.semi_major)
    )
    assert np.abs(cn.sampson_distance(conic, points)).max() < tolerance
    assert np.abs(signed_distance(ellipse, points)).max() < tolerance


@given(ellipses, st.floats(0.0, 2.0 * np.pi), st.floats(0.0, 300.0))
def test_a_point_moved_out_along_the_normal_is_that_far_away(ellipse, eccentric, distance):
    c, s = np.cos(ellipse.angle), np.sin(ellipse.angle)
    turn = np.array([[c, -s], [s, c]])
    a, b = float(ellipse.semi_major), float(ellipse.semi_minor)
    rim = turn @ [a * np.cos(eccentric), b * np.sin(eccentric)] + ellipse.center
    normal = turn @ [b * np.cos(eccentric), a * np.sin(eccentric)]
    point = rim + distance * normal / np.linalg.norm(normal)
    np.testing.assert_allclose(signed_distance(ellipse, point[None]), distance, atol=1e-7 * (1.0 + a))


def test_distance_inside_is_negative_also_on_the_axes_and_at_the_center():
    ellipse = Ellipse.from_axes([10.0, -3.0], [5.0, 2.0], 0.0)
    points = np.array([[10.0, -3.0], [14.9, -3.0], [10.0, -1.5], [11.0, -3.0]])
    distance = signed_distance(ellipse, points)
    np.testing.assert_allclose(distance[:3], [-2.0, -0.1, -0.5], atol=1e-9)
    # On the major axis near the centre the nearest rim point is beside it, not at the vertex.
    x = np.linspace(-np.pi, np.pi, 200001)
    brute = -np.hypot(5.0 * np.cos(x) - 1.0, 2.0 * np.sin(x)).min()
    np.testing.assert_allclose(distance[3], brute, atol=1e-8)


def test_distance_to_a_segment():
    segment = Ellipse.from_axes([0.0, 0.0], [3.0, 0.0], 0.0)
    np.testing.assert_allclose(signed_distance(segment, np.array([[1.0, 2.0], [5.0, 0.0]])), [2.0, 2.0], atol=1e-9)


@shapes
def test_pole_and_polar_are_inverse(batch):
    conic = cn.conic_from_ellipse(random_ellipses(batch))
    point = np.random.default_rng(1).normal(size=(*batch, 3))
    back = cn.pole(conic, cn.polar(conic, point))
    assert np.abs(np.cross(back, point)).max() < 1e-9 * np.abs(back).max()


def test_polar_of_the_center_is_the_line_at_infinity():
    conic = cn.conic_from_ellipse(Ellipse.from_axes([3.0, 4.0], [7.0, 2.0], 0.3))
    line = cn.polar(conic, np.array([3.0, 4.0, 1.0]))
    np.testing.assert_allclose(line[:2] / line[2], 0.0, atol=1e-12)


def test_tangents_satisfy_the_dual():
    ellipse = Ellipse.from_axes([3.0, 4.0], [7.0, 2.0], 0.3)
    conic = cn.conic_from_ellipse(ellipse)
    rim = np.concatenate([ellipse.points(9), np.ones((9, 1))], axis=1)
    tangents = rim @ conic
    dual = cn.dual(conic)
    np.testing.assert_allclose(np.einsum("ni,ij,nj->n", tangents, dual, tangents), 0.0, atol=1e-12)


@given(ellipses, st.integers(0, 1000))
def test_transforming_the_conic_transforms_its_points(ellipse, seed):
    homography = np.eye(3) + 1e-4 * np.random.default_rng(seed).normal(size=(3, 3))
    moved = cn.transform_conic(cn.conic_from_ellipse(ellipse), homography)
    rim = np.concatenate([ellipse.points(7), np.ones((7, 1))], axis=1) @ homography.T
    assert np.abs(cn.sampson_distance(moved, rim[:, :2] / rim[:, 2:])).max() < 1e-5


@pytest.mark.parametrize(
    "matrix",
    [
        np.diag([1.0, 1.0, 1.0]),
        np.diag([1.0, -1.0, -1.0]),
        np.diag([1.0, 0.0, -1.0]),
        np.zeros((3, 3)),
    ],
    ids=["imaginary", "hyperbola", "lines", "zero"],
)
def test_what_is_no_ellipse_is_said_to_be_none(matrix):
    assert not cn.is_ellipse(matrix)
    with pytest.raises(ArgumentError, match="real ellipse"):
        cn.ellipse_from_conic(matrix)


def test_axes_in_either_order_mean_the_same_ellipse():
    first = Ellipse.from_axes([0.0, 0.0], [2.0, 5.0], 0.2)
    second = Ellipse.from_axes([0.0, 0.0], [5.0, 2.0], 0.2 + np.pi / 2.0)
    assert first.semi_major == second.semi_major == 5.0
    np.testing.assert_allclose(first.angle, second.angle)


def test_a_negative_axis_is_refused():
    with pytest.raises(ArgumentError, match="semi_axes"):
        Ellipse.from_axes([0.0, 0.0], [2.0, -5.0], 0.2)
