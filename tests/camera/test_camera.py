from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from circlepose.camera.camera import Camera, circle_contour
from circlepose.errors import CalibrationError
from circlepose.geometry.cone import cone_from_circle
from circlepose.geometry.conic import ellipse_from_conic, sampson_distance, transform_conic

MATRIX = [[800.0, 0.0, 640.0], [0.0, 810.0, 480.0], [0.0, 0.0, 1.0]]
COEFFICIENTS = {
    0: [],
    4: [-0.3, 0.1, 0.001, -0.002],
    5: [-0.43, 0.19, 0.001, 0.002, -0.045],
    8: [0.1, -0.05, 0.001, 0.002, 0.01, 0.02, 0.03, 0.004],
    12: [0.1, -0.05, 0.001, 0.002, 0.01, 0.02, 0.03, 0.004, 0.01, 0.002, -0.01, 0.003],
    14: [0.1, -0.05, 0.001, 0.002, 0.01, 0.02, 0.03, 0.004, 0.01, 0.002, -0.01, 0.003, 0.02, -0.03],
}
FISHEYE = Camera.create([[300.0, 0, 640], [0, 310.0, 480], [0, 0, 1]], [0.05, -0.01, 0.002, -0.0005], model="fisheye")
CAMERAS = [Camera.create(MATRIX, k) for k in COEFFICIENTS.values()] + [FISHEYE]
every_camera = pytest.mark.parametrize("camera", CAMERAS, ids=[*map(str, COEFFICIENTS), "fisheye"])


def points_in_view(number: int = 200) -> np.ndarray:
    rng = np.random.default_rng(3)
    return rng.uniform([-0.45, -0.35, 1.0], [0.45, 0.35, 1.0], (number, 3)) * rng.uniform(100, 3000, (number, 1))


@pytest.mark.parametrize("count", COEFFICIENTS)
def test_pinhole_projection_is_opencvs(count):
    camera = Camera.create(MATRIX, COEFFICIENTS[count])
    points = points_in_view()
    coefficients = np.array(COEFFICIENTS[count]) if count else None
    expected = cv2.projectPoints(points, np.zeros(3), np.zeros(3), camera.camera_matrix, coefficients)[0][:, 0]
    np.testing.assert_allclose(camera.project(points), expected, atol=1e-9)


def test_fisheye_projection_is_opencvs():
    points = points_in_view()
    expected = cv2.fisheye.projectPoints(
        points[:, None], np.zeros(3), np.zeros(3), FISHEYE.camera_matrix, FISHEYE.dist_coeffs
    )[0][:, 0]
    np.testing.assert_allclose(FISHEYE.project(points), expected, atol=1e-9)


@every_camera
def test_pixel_to_ray_to_pixel(camera):
    x, y = np.meshgrid(np.linspace(160, 1120, 33), np.linspace(150, 810, 27))
    pixels = np.stack([x, y], axis=-1)
    rays = camera.rays(pixels)
    assert rays.shape == (27, 33, 3)
    np.testing.assert_allclose(np.linalg.norm(rays, axis=-1), 1.0, rtol=1e-12)
    np.testing.assert_allclose(camera.project(rays), pixels, atol=1e-9)


@every_camera
def test_point_to_pixel_to_ray(camera):
    points = points_in_view()
    rays = camera.rays(camera.project(points))
    np.testing.assert_allclose(rays, points / np.linalg.norm(points, axis=-1, keepdims=True), atol=1e-12)


@every_camera
def test_derivatives_are_those_of_the_functions(camera):
    points = points_in_view(40)
    pixels, jacobian = camera.project_with_jacobian(points)
    step = 1e-4 * np.linalg.norm(points, axis=-1)[:, None]
    numeric = np.stack(
        [(camera.project(points + step * e) - camera.project(points - step * e)) / (2 * step) for e in np.eye(3)],
        axis=-1,
    )
    assert np.abs(numeric - jacobian).max() < 1e-5 * np.abs(jacobian).max()
    _, per_pixel = camera.rays_with_jacobian(pixels)
    numeric = np.stack(
        [(camera.rays(pixels + 0.01 * e) - camera.rays(pixels - 0.01 * e)) / 0.02 for e in np.eye(2)], axis=-1
    )
    np.testing.assert_allclose(per_pixel, numeric, atol=1e-8)


@pytest.mark.parametrize("batch", [(), (1,), (3, 1, 2)])
@pytest.mark.parametrize("camera", [CAMERAS[2], FISHEYE], ids=["pinhole", "fisheye"])
def test_leading_axes(camera, batch):
    pixels = np.broadcast_to(np.array([600.0, 500.0]), (*batch, 2))
    rays, jacobian = camera.rays_with_jacobian(pixels)
    assert rays.shape == (*batch, 3)
    assert jacobian.shape == (*batch, 3, 2)
    assert camera.project(rays).shape == (*batch, 2)


def test_fisheye_sees_behind_and_straight_ahead():
    behind = np.array([np.sin(np.radians(100.0)), 0.0, np.cos(np.radians(100.0))])
    np.testing.assert_allclose(FISHEYE.rays(FISHEYE.project(behind)), behind, atol=1e-12)
    ahead = np.array([0.0, 0.0, 5.0])
    np.testing.assert_allclose(FISHEYE.project(ahead), [640.0, 480.0], atol=1e-12)


def test_what_the_pinhole_cannot_see_is_nan():
    camera = Camera.create(MATRIX, COEFFICIENTS[5])
    assert np.all(np.isnan(camera.project(np.array([0.0, 0.0, -1.0]))))
    assert np.all(np.isnan(camera.project(np.array([0.0, 0.0, 0.0]))))


def test_a_folding_lens_model_gives_nan_beyond_the_fold():
    """k1 = -0.5 alone turns back at r = sqrt(2/3): farther points would land on wrong pixels."""
    camera = Camera.create(MATRIX, [-0.5, 0.0, 0.0, 0.0])
    fold = np.sqrt(2.0 / 3.0)
    assert np.all(np.isfinite(camera.project(np.array([fold * 0.99, 0.0, 1.0]))))
    assert np.all(np.isnan(camera.project(np.array([fold * 1.01, 0.0, 1.0]))))
    beyond = 640.0 + 800.0 * (fold * (1.0 - 0.5 * fold**2)) + 5.0
    assert np.all(np.isnan(camera.rays(np.array([beyond, 480.0]))))


@given(st.floats(50.0, 3000.0), st.floats(50.0, 3000.0), st.floats(0.0, 70.0), st.floats(-3.0, 3.0))
def test_without_distortion_a_circle_is_seen_as_the_conic_of_its_cone(fx, fy, tilt_deg, lean):
    camera = Camera.create([[fx, 0.0, 320.0], [0.0, fy, 240.0], [0.0, 0.0, 1.0]])
    tilt = np.radians(tilt_deg)
    normal = np.array([np.sin(tilt) * np.cos(lean), np.sin(tilt) * np.sin(lean), -np.cos(tilt)])
    center = np.array([30.0, -20.0, 500.0])
    contour = circle_contour(camera, center, normal, 40.0, 48)
    conic = transform_conic(cone_from_circle(center, normal, 40.0), camera.camera_matrix)
    assert np.abs(sampson_distance(conic, contour)).max() < 1e-7
    # The circle's centre is not seen at the ellipse's centre, unless it faces the image plane.
    apart = np.linalg.norm(ellipse_from_conic(conic).center - camera.project(center))
    assert apart < 1e-6 * max(fx, fy) or tilt_deg > 1e-3


def test_the_imaged_center_is_the_pole_of_the_planes_vanishing_line():
    camera = Camera.create(MATRIX)
    center, normal = np.array([30.0, -20.0, 500.0]), np.array([0.6, 0.0, -0.8])
    conic = transform_conic(cone_from_circle(center, normal, 40.0), camera.camera_matrix)
    vanishing_line = np.linalg.inv(camera.camera_matrix).T @ normal
    pole = np.linalg.solve(conic, vanishing_line)
    np.testing.assert_allclose(pole[:2] / pole[2], camera.project(center), atol=1e-8)


def test_scaling_keeps_the_rays():
    camera = Camera.create(MATRIX, COEFFICIENTS[5], (1280, 960))
    half = camera.scaled_to((640, 480))
    assert half.image_size == (640, 480)
    pixel = np.array([100.0, 700.0])
    np.testing.assert_allclose(half.rays((pixel + 0.5) / 2.0 - 0.5), camera.rays(pixel), atol=1e-12)


def test_scaling_needs_a_size():
    with pytest.raises(CalibrationError, match="image_size"):
        Camera.create(MATRIX).scaled_to((640, 480))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"camera_matrix": np.eye(2)}, "3 x 3"),
        ({"camera_matrix": np.full((3, 3), np.nan)}, "finite"),
        ({"camera_matrix": np.zeros((3, 3))}, "camera_matrix"),
        ({"camera_matrix": np.diag([-800.0, 800.0, 1.0])}, "positive"),
        ({"camera_matrix": np.diag([0.0, 800.0, 1.0])}, "singular"),
        ({"camera_matrix": np.ones((3, 3))}, "camera_matrix"),
        ({"camera_matrix": "abc"}, "numbers"),
        ({"camera_matrix": MATRIX, "dist_coeffs": [0.1, 0.2, 0.3]}, "0, 4, 5, 8, 12, 14"),
        ({"camera_matrix": MATRIX, "dist_coeffs": [0.1, np.inf, 0.3, 0.0]}, "finite"),
        ({"camera_matrix": MATRIX, "dist_coeffs": [0.1], "model": "fisheye"}, "fisheye"),
        ({"camera_matrix": MATRIX, "model": "omni"}, "pinhole"),
        ({"camera_matrix": MATRIX, "image_size": (0, 3)}, "image_size"),
    ],
)
def test_what_is_no_camera_is_refused(arguments, message):
    with pytest.raises(CalibrationError, match=message):
        Camera.create(**arguments)


def test_a_camera_cannot_be_changed():
    camera = Camera.create(MATRIX)
    with pytest.raises(ValueError, match="read-only"):
        camera.camera_matrix[0, 0] = 1.0
