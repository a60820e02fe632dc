from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from circlepose.camera.camera import Camera, circle_contour
from circlepose.fitting.cone_fit import fit_cone
from circlepose.fitting.direct import Contours, fit_ellipse, fit_ellipses
from circlepose.geometry.cone import principal_frame
from circlepose.geometry.ellipse import Ellipse
from circlepose.solvers.chen_huang import poses_from_frame
from tests.support.cases import circle_case, nearest_candidate

CAMERA = Camera.create([[1200.0, 0, 640], [0, 1200.0, 480], [0, 0, 1]])
BARREL = Camera.create([[1200.0, 0, 640], [0, 1200.0, 480], [0, 0, 1]], [-0.3, 0.1, 0.001, 0.002])
FISHEYE = Camera.create([[400.0, 0, 640], [0, 400.0, 480], [0, 0, 1]], [0.05, -0.01, 0.002, -0.0005], model="fisheye")


@pytest.mark.parametrize("angle_deg", range(-90, 91, 15))
@pytest.mark.parametrize("ratio", [1.0, 0.999, 0.5, 0.02])
@pytest.mark.parametrize("shift", [0.0, 1e4])
def test_exact_points_give_the_exact_ellipse_anywhere(angle_deg, ratio, shift):
    """Also on circles and far from the origin, where some direct fits switch method without a word."""
    truth = Ellipse.from_axes([shift + 3.0, shift - 7.0], [40.0, 40.0 * ratio], np.radians(angle_deg))
    found = fit_ellipse(truth.points(40))
    assert found is not None
    np.testing.assert_allclose(found.center, truth.center, atol=1e-6)
    np.testing.assert_allclose(found.semi_major, truth.semi_major, rtol=1e-6)
    np.testing.assert_allclose(found.semi_minor, truth.semi_minor, rtol=1e-6)
    if ratio < 0.9:
        turn = found.angle - truth.angle
        assert abs(np.sin(turn)) < 1e-6


@given(st.integers(0, 10**6), st.floats(0.1, 1e3), st.floats(-1e3, 1e3))
def test_the_fit_moves_and_scales_with_the_points(seed, scale, shift):
    rng = np.random.default_rng(seed)
    points = Ellipse.from_axes([1.0, 2.0], [5.0, 3.0], 0.4).points(30) + 0.05 * rng.normal(size=(30, 2))
    first, second = fit_ellipse(points), fit_ellipse(scale * points + shift)
    assert first is not None
    assert second is not None
    np.testing.assert_allclose(second.center, scale * first.center + shift, atol=1e-6 * scale + 1e-9 * abs(shift))
    np.testing.assert_allclose(second.semi_major, scale * first.semi_major, rtol=1e-6)


@pytest.mark.parametrize(
    "points",
    [
        np.zeros((0, 2)),
        np.ones((5, 2)),
        np.ones((50, 2)),
        np.stack([np.linspace(0, 9, 50), np.linspace(1, 4, 50)], axis=1),
    ],
    ids=["none", "five", "equal", "line"],
)
def test_points_without_an_ellipse(points):
    assert fit_ellipse(points) is None


def test_a_hyperbola_is_never_returned():
    t = np.linspace(-1.5, 1.5, 60)
    found = fit_ellipse(np.stack([np.cosh(t), np.sinh(t)], axis=1))
    # The constraint admits ellipses only: either none or a bad ellipse, whose residual tells.
    assert found is None or found.semi_minor > 0.0


def test_many_contours_at_once_are_fitted_as_one_by_one():
    rng = np.random.default_rng(0)
    shapes = [Ellipse.from_axes(rng.uniform(0, 900, 2), rng.uniform(3, 90, 2), rng.uniform(-1, 1)) for _ in range(20)]
    contours = [s.points(int(rng.integers(8, 60))) + 0.1 * rng.normal(size=2) for s in shapes]
    contours.insert(7, np.ones((9, 2)))
    ellipses, found = fit_ellipses(Contours.of(contours))
    assert found.sum() == 20
    assert not found[7]
    for i, contour in enumerate(contours):
        alone = fit_ellipse(contour)
        if alone is not None:
            np.testing.assert_allclose(ellipses[i].center, alone.center, atol=1e-8)


def test_weights_leave_points_out():
    truth = Ellipse.from_axes([100.0, 50.0], [30.0, 20.0], 0.3)
    points = truth.points(60)
    points[:10] += 15.0
    weights = np.ones(60)
    weights[:10] = 0.0
    found = fit_ellipse(points, weights)
    assert found is not None
    np.testing.assert_allclose(found.center, truth.center, atol=1e-9)


@pytest.mark.parametrize("camera", [CAMERA, BARREL, FISHEYE], ids=["plain", "barrel", "fisheye"])
@pytest.mark.parametrize("tilt_deg", [3.0, 40.0, 75.0])
def test_an_exact_contour_gives_the_exact_pose_through_any_lens(camera, tilt_deg):
    case = circle_case(60.0, 800.0, 15.0, 30.0, tilt_deg, 50.0)
    fit = fit_cone(camera, circle_contour(camera, case.center, case.normal, case.radius, 120))
    assert fit is not None
    assert fit.rms_px < 1e-9
    poses = poses_from_frame(principal_frame(fit.factor), case.radius)
    position, angle = nearest_candidate(*poses, case.center, case.normal)
    assert position < 1e-9
    assert angle < 1e-8


def test_the_contour_of_a_barrel_lens_is_no_ellipse_but_its_cone_is_one():
    case = circle_case(200.0, 700.0, 15.0, 30.0, 20.0, 50.0)
    contour = circle_contour(BARREL, case.center, case.normal, case.radius, 120)
    ignoring_the_lens = fit_cone(CAMERA, contour)
    assert ignoring_the_lens is not None
    assert ignoring_the_lens.rms_px > 0.05


def test_residuals_are_in_pixels():
    case = circle_case(60.0, 800.0, 15.0, 30.0, 40.0, 50.0)
    contour = circle_contour(BARREL, case.center, case.normal, case.radius, 400)
    noise = 0.2 * np.random.default_rng(0).normal(size=contour.shape)
    fit = fit_cone(BARREL, contour + noise)
    assert fit is not None
    assert fit.rms_px == pytest.approx(0.2, rel=0.1)


def test_no_cone_outside_the_lens_model():
    folding = Camera.create([[800.0, 0, 640], [0, 800.0, 480], [0, 0, 1]], [-0.5, 0.0, 0.0, 0.0])
    contour = Ellipse.from_axes([1200.0, 480.0], [80.0, 60.0], 0.0).points(40)
    assert fit_cone(folding, contour) is None
