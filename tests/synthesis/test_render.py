from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import erf

from circlepose._typing import FloatArray
from circlepose.camera.camera import Camera, circle_contour
from circlepose.errors import SceneError
from circlepose.geometry.cone import cone_from_circle
from circlepose.geometry.conic import ellipse_from_conic
from circlepose.synthesis.render import render, render_float, truth_rows
from circlepose.synthesis.scene import Box, CoaxialPart, Disc, Paint, Patch, Rings, Scene, Shading, Texture
from circlepose.synthesis.texture import add_noise, mottle

WHITE, BLACK = Paint(200.0), Paint(40.0)
MOTTLE = (-12.46448029712558, -3.347987134204284, 6.3728873851673065)
NOISE = (
    (0.637782270296595, 2.531668679065534, 1.515406611704528),
    (-1.5094487434868067, -1.0478446400200883, 2.286700934668402),
)


def make_camera(focal: float, size: tuple[int, int], dist_coeffs: tuple[float, ...] = (), model: str = "pinhole"):
    matrix = [[focal, 0.0, (size[0] - 1) / 2], [0.0, focal, (size[1] - 1) / 2], [0.0, 0.0, 1.0]]
    return Camera.create(matrix, dist_coeffs, size, model)


CAMERAS = {
    "pinhole": make_camera(600.0, (320, 240)),
    "distorted": make_camera(300.0, (320, 240), (-0.3, 0.1, 0.002, -0.001, 0.0)),
    "fisheye": make_camera(150.0, (320, 240), (-0.05, 0.01, 0.0, 0.0), "fisheye"),
}


def polygon_moments(points: FloatArray) -> tuple[float, FloatArray]:
    """Area and centroid inside a closed, finely sampled line."""
    x, y = points.T
    right, down = np.roll(x, -1), np.roll(y, -1)
    cross = x * down - right * y
    area = cross.sum() / 2.0
    return abs(area), np.array([((x + right) * cross).sum(), ((y + down) * cross).sum()]) / (6.0 * area)


def grey_moments(image: FloatArray, outside: float = 200.0, inside: float = 40.0) -> tuple[float, FloatArray]:
    weight = (outside - image) / (outside - inside)
    y, x = np.mgrid[: image.shape[0], : image.shape[1]]
    area = weight.sum()
    return area, np.array([(weight * x).sum(), (weight * y).sum()]) / area


@pytest.mark.parametrize("lens", CAMERAS)
@pytest.mark.parametrize("tilt_deg", [0.0, 40.0, 75.0])
@pytest.mark.parametrize(("blur_px", "tolerance_px"), [(0.0, 6e-4), (0.7, 5e-5)])
def test_area_and_centroid_are_those_of_the_projected_rim(
    lens: str, tilt_deg: float, blur_px: float, tolerance_px: float
) -> None:
    camera = CAMERAS[lens]
    depth = 0.55 * float(camera.camera_matrix[0, 0])
    tilt = math.radians(tilt_deg)
    disc = Disc((20.0, -13.0, depth), (math.sin(tilt), 0.3 * math.sin(tilt), -math.cos(tilt)), 30.0, BLACK)
    image = render_float(Scene(camera, (disc,), blur_px=blur_px))
    area, centroid = polygon_moments(circle_contour(camera, disc.center_mm, disc.normal, 30.0, 20_000))
    found_area, found_centroid = grey_moments(image)
    assert found_area == pytest.approx(area, rel=3e-6)
    np.testing.assert_allclose(found_centroid, centroid, rtol=0.0, atol=tolerance_px)


def test_area_is_that_of_the_ellipse() -> None:
    camera = CAMERAS["pinhole"]
    disc = Disc((10.0, 5.0, 400.0), (0.5, -0.4, -1.0), 25.0, BLACK)
    inverse = np.linalg.inv(camera.camera_matrix)
    ellipse = ellipse_from_conic(inverse.T @ cone_from_circle(disc.center_mm, disc.normal, 25.0) @ inverse)
    area, centroid = grey_moments(render_float(Scene(camera, (disc,), blur_px=0.0)))
    assert area == pytest.approx(math.pi * float(ellipse.semi_major * ellipse.semi_minor), rel=1e-6)
    np.testing.assert_allclose(centroid, ellipse.center, rtol=0.0, atol=2e-4)


@pytest.mark.parametrize("minor_px", [3.0, 1.0, 0.3, 0.05])
def test_sliver_keeps_its_area(minor_px: float) -> None:
    camera = CAMERAS["pinhole"]
    # Seen from the plane's side by such an angle that the ellipse's full minor axis is minor_px.
    sine = minor_px / (2.0 * 30.0 * 600.0 / 500.0)
    disc = Disc((0.0, 0.0, 500.0), (0.1, -math.sqrt(1.0 - sine**2) * 0.995, -sine), 30.0, BLACK)
    area, _ = polygon_moments(circle_contour(camera, disc.center_mm, disc.normal, 30.0, 20_000))
    found, _ = grey_moments(render_float(Scene(camera, (disc,))))
    assert found == pytest.approx(area, rel=2e-3)


def test_edge_on_disc_is_not_seen() -> None:
    disc = Disc((0.0, 0.0, 500.0), (0.0, 1.0, 0.0), 30.0, BLACK)
    np.testing.assert_allclose(render_float(Scene(CAMERAS["pinhole"], (disc,))), 200.0, atol=1e-4)


@pytest.mark.parametrize(("blur_px", "tolerance"), [(0.0, 1e-3), (0.5, 2e-2), (0.7, 1e-2), (1.2, 3e-3)])
@pytest.mark.parametrize("offset", [0.0, 0.13, 0.5])
def test_straight_edge_is_blurred_by_lens_and_pixel(blur_px: float, tolerance: float, offset: float) -> None:
    """The profile of an edge along the columns: a step, a Gaussian and a box of one pixel, in closed form."""
    camera = make_camera(100.0, (40, 30))
    edge = 20.0 + offset
    half = Patch(Box((100.0, 200.0), (edge - 50.0, 15.0)), BLACK)
    row = render_float(Scene(camera, occluders=(half,), blur_px=blur_px))[15]
    x = np.arange(40) - edge
    if blur_px == 0.0:
        covered = np.clip(0.5 - x, 0.0, 1.0)
    else:

        def integral(t: FloatArray) -> FloatArray:
            z = t / blur_px
            return blur_px * (z * 0.5 * (1 + erf(z / math.sqrt(2))) + np.exp(-z * z / 2) / math.sqrt(2 * math.pi))

        covered = 1.0 - (integral(x + 0.5) - integral(x - 0.5))
    np.testing.assert_allclose(row, 200.0 - 160.0 * covered, rtol=0.0, atol=tolerance)


def test_converges_with_the_number_of_cells() -> None:
    scene = Scene(CAMERAS["distorted"], (Disc((12.0, -7.0, 260.0), (0.4, 0.2, -1.0), 25.0, BLACK),))
    exact = render_float(scene, 30)
    errors = [float(np.abs(render_float(scene, cells) - exact).max()) for cells in (2, 4, 6, 12)]
    assert errors[0] > errors[1] > errors[2] > errors[3]
    assert errors[2] < 0.01
    assert errors[3] < 0.001


def test_is_smooth_in_the_pose() -> None:
    camera = CAMERAS["distorted"]

    def image(pose: FloatArray) -> FloatArray:
        return render_float(Scene(camera, (Disc(pose[:3], (pose[3], pose[4], -1.0), 25.0, BLACK),)))

    pose = np.array([12.0, -7.0, 260.0, 0.4, 0.2])
    for index, scale in enumerate((1.0, 1.0, 1.0, 0.01, 0.01)):
        fine, coarse = (
            (image(pose + step) - image(pose - step)) / (2.0 * step[index])
            for step in (1e-3 * scale * np.eye(5)[index], 1e-2 * scale * np.eye(5)[index])
        )
        size = float(np.abs(coarse).max())
        assert size > 1.0
        assert float(np.abs(fine - coarse).max()) < 2e-3 * size
        assert float(np.sqrt(np.mean((fine - coarse) ** 2))) < 1e-4 * size


def test_the_image_border_changes_nothing() -> None:
    """A cut-out of a larger image is the image of the smaller sensor."""
    wide = make_camera(300.0, (200, 160), (-0.2, 0.05, 0.0, 0.0))
    matrix = wide.camera_matrix.copy()
    matrix[0, 2] -= 57.0
    matrix[1, 2] -= 41.0
    cut = Camera.create(matrix, wide.dist_coeffs, (60, 50))
    part = CoaxialPart((-5.0, 3.0, 300.0), (0.5, 0.2, -1.0), (30.0, 20.0), 20.0, "boss", Paint(90.0), WHITE)
    scene = Scene(wide, (part,), Paint(120.0, Texture(8.0, 12.0, 3)))
    np.testing.assert_allclose(
        # The background's texture is fixed to the pixels, so it is left out of the comparison.
        render_float(replace(scene, background=Paint(120.0)))[41:91, 57:117],
        render_float(replace(scene, camera=cut, background=Paint(120.0))),
        atol=1e-9,
    )


@pytest.mark.parametrize(
    "disc",
    [
        Disc((0.0, 0.0, -500.0), (0.0, 0.0, 1.0), 30.0, BLACK),
        Disc((0.0, 5000.0, 400.0), (0.0, 1.0, -1.0), 30.0, BLACK),
    ],
    ids=["behind", "beside"],
)
def test_what_is_not_in_view_leaves_the_background(disc: Disc) -> None:
    np.testing.assert_array_equal(render_float(Scene(CAMERAS["distorted"], (disc,))), 200.0)


@pytest.mark.parametrize("model", ["pinhole", "fisheye"])
def test_pixels_beyond_the_lens_model_show_the_background(model: str) -> None:
    # Strong barrel: the corners of the image have no ray.
    camera = make_camera(60.0, (160, 120), (-0.3, 0.0, 0.0, 0.0), model)
    corner = camera.rays(np.array([0.0, 0.0]))
    assert np.all(np.isnan(corner))
    wall = Disc((0.0, 0.0, 50.0), (0.1, 0.0, -1.0), 400.0, BLACK)
    image = render_float(Scene(camera, (wall,)))
    assert np.all(np.isfinite(image))
    assert image[0, 0] == pytest.approx(200.0)
    assert image[60, 80] == pytest.approx(40.0)


def test_a_plane_that_passes_under_the_camera_ends_at_its_horizon() -> None:
    camera = make_camera(100.0, (80, 61))
    floor = Disc((0.0, 100.0, 0.0), (0.0, -1.0, 0.0), 1e6, BLACK)
    image = render_float(Scene(camera, (floor,), blur_px=0.0))
    np.testing.assert_allclose(image[:30], 200.0, atol=1e-6)
    np.testing.assert_allclose(image[31:], 40.0, atol=1e-6)


def test_ring_target_and_marks_are_nested_discs() -> None:
    camera = CAMERAS["pinhole"]
    pose = ((5.0, 4.0, 300.0), (0.3, 0.2, -1.0))
    rings = Scene(camera, (Rings(*pose, (25.0, 15.0), (BLACK, WHITE)),))
    marked = Scene(camera, (Disc(*pose, 25.0, BLACK, ((15.0, WHITE),)),))
    np.testing.assert_array_equal(render_float(rings), render_float(marked))
    whole, hole = (grey_moments(render_float(Scene(camera, (Disc(*pose, r, BLACK),))))[0] for r in (25.0, 15.0))
    assert grey_moments(render_float(rings))[0] == pytest.approx(whole - hole, rel=1e-6)


def test_occluders_cover_targets_and_targets_cover_shapes() -> None:
    camera = CAMERAS["pinhole"]
    disc = Disc((0.0, 0.0, 300.0), (0.0, 0.0, -1.0), 25.0, BLACK)
    box = Patch(Box((40.0, 40.0), (159.5, 119.5)), Paint(120.0))
    assert render_float(Scene(camera, (disc,), shapes=(box,)))[120, 160] == pytest.approx(40.0)
    assert render_float(Scene(camera, (disc,), occluders=(box,)))[120, 160] == pytest.approx(120.0)


def test_noise_is_the_seed_s_and_of_the_size_asked() -> None:
    scene = Scene(make_camera(300.0, (320, 240)), background=Paint(120.0), noise_levels=2.0, noise_seed=5)
    image = render(scene)
    assert image.dtype == np.uint8
    np.testing.assert_array_equal(image, render(scene))
    assert np.any(image != render(replace(scene, noise_seed=6)))
    deviation = image - 120.0
    assert float(deviation.mean()) == pytest.approx(0.0, abs=0.05)
    # Rounding adds its 1/12.
    assert float(deviation.std()) == pytest.approx(math.sqrt(4.0 + 1.0 / 12.0), rel=0.02)


def test_bit_depths_differ_in_rounding_alone() -> None:
    scene = Scene(CAMERAS["pinhole"], (Disc((0.0, 0.0, 300.0), (0.2, 0.0, -1.0), 25.0, BLACK),), noise_levels=1.5)
    deep = render(replace(scene, bit_depth=16))
    assert deep.dtype == np.uint16
    assert float(np.abs(deep / 257.0 - render(scene)).max()) <= 0.5 + 1.0 / 257.0


def test_levels_beyond_the_scale_are_clipped() -> None:
    scene = Scene(make_camera(100.0, (60, 40)), background=Paint(250.0), shading=Shading(right=0.4), noise_levels=3.0)
    image = render(scene)
    assert image[:, -5:].min() == 255
    assert 190 < image[:, :5].mean() < 215


def test_texture_has_the_amplitude_asked() -> None:
    plain = render_float(Scene(make_camera(600.0, (640, 480)), background=Paint(120.0, Texture(10.0, 8.0, seed=2))))
    assert float(plain.std()) == pytest.approx(10.0, rel=0.15)
    assert float(plain.mean()) == pytest.approx(120.0, abs=1.0)


def test_patterns_depend_on_the_seed_alone() -> None:
    """Stored samples and their truth must be made again, bit by bit but for rounding, on any machine."""
    points = np.array([[0.0, 0.0], [3.5, -7.25], [1e4, 123.4]])
    np.testing.assert_allclose(mottle(Texture(10.0, 8.0, seed=2), points), MOTTLE, rtol=1e-9)
    noise = np.zeros((2, 3))
    add_noise(noise, 2.0, 7)
    np.testing.assert_allclose(noise, NOISE, rtol=1e-9)


def test_truth_is_towards_the_camera_and_in_the_targets_order() -> None:
    camera = CAMERAS["pinhole"]
    part = CoaxialPart((0.0, 0.0, 300.0), (0.0, 0.0, 2.0), (30.0, 20.0), 12.0, "boss", BLACK, WHITE)
    recess = replace(part, form="recess")
    rows = truth_rows(Scene(camera, (part, recess), name="x"))
    assert [(row.image, row.instance, row.circle.name) for row in rows] == [
        ("x", 0, "big"),
        ("x", 0, "small"),
        ("x", 1, "big"),
        ("x", 1, "small"),
    ]
    assert [float(row.circle.center[2]) for row in rows] == [300.0, 288.0, 300.0, 312.0]
    assert all(row.circle.normal[2] == -1.0 for row in rows)
    assert part.generatrix_mm == pytest.approx(math.hypot(12.0, 10.0))


@pytest.mark.parametrize(
    "build",
    [
        lambda: Scene(Camera.create(np.diag([100.0, 100.0, 1.0]))),
        lambda: Scene(CAMERAS["pinhole"], blur_px=-1.0),
        lambda: Scene(CAMERAS["pinhole"], noise_levels=math.nan),
        lambda: Scene(CAMERAS["pinhole"], bit_depth=12),  # type: ignore[arg-type]
        lambda: Disc((0.0, 0.0, 300.0), (0.0, 0.0, 0.0), 25.0, BLACK),
        lambda: Disc((0.0, 0.0, math.nan), (0.0, 0.0, 1.0), 25.0, BLACK),
        lambda: Disc((0.0, 0.0, 300.0), (0.0, 0.0, 1.0), -25.0, BLACK),
        lambda: Disc((0.0, 0.0, 300.0), (0.0, 0.0, 1.0), 25.0, BLACK, ((30.0, WHITE),)),
        lambda: Rings((0.0, 0.0, 300.0), (0.0, 0.0, 1.0), (30.0, 20.0), (BLACK,)),
        lambda: CoaxialPart((0, 0, 300), (0, 0, 1), (30.0, 20.0), 400.0, "boss", BLACK, WHITE),
    ],
)
def test_what_cannot_be_meant_is_refused(build) -> None:
    with pytest.raises(SceneError):
        build()
