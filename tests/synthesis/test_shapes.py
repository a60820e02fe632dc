from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circlepose.camera.camera import Camera
from circlepose.errors import SceneError
from circlepose.synthesis.coverage import Cells, blur_weights, half_plane_coverage, quadratic_coverage
from circlepose.synthesis.distance import outline, signed_distance
from circlepose.synthesis.render import render_float
from circlepose.synthesis.scene import Box, Paint, Patch, Plane, Polygon, Round, Scene

SHAPES = {
    "box": Box((40.0, 22.0), (3.0, -2.0), 0.4),
    "rounded": Box((40.0, 22.0), (3.0, -2.0), 0.4, 7.0),
    "polygon": Polygon(((0.0, 0.0), (25.0, 3.0), (10.0, 9.0), (15.0, 25.0), (-15.0, 10.0))),
    "turned polygon": Polygon(((0.0, 0.0), (-15.0, 10.0), (15.0, 25.0), (10.0, 9.0), (25.0, 3.0))),
    "disc": Round(14.0, (2.0, 1.0)),
}


def one_cell(size: float, tent: bool) -> Cells:
    return Cells(np.zeros((1, 2)), np.zeros((1, 3)), np.zeros((1, 3, 2)), size, tent)


@given(st.floats(-2.0, 2.0), st.floats(0.0, 2.0 * math.pi), st.booleans())
@settings(deadline=None)
def test_half_planes_share_a_cell(distance: float, angle: float, tent: bool) -> None:
    cells = one_cell(0.25, tent)
    direction = np.array([[math.cos(angle), math.sin(angle)]])
    one = half_plane_coverage(np.array([distance]), direction, cells)
    other = half_plane_coverage(np.array([-distance]), -direction, cells)
    more = half_plane_coverage(np.array([distance + 0.01]), direction, cells)
    assert 0.0 <= one[0] <= 1.0
    assert one[0] + other[0] == pytest.approx(1.0, abs=1e-8)
    assert more[0] >= one[0] - 1e-8


@pytest.mark.parametrize("tent", [False, True])
@pytest.mark.parametrize("angle", [0.0, 0.3, math.pi / 4, 2.5])
@pytest.mark.parametrize("distance", [-0.3, -0.05, 0.0, 0.11, 0.4])
def test_half_plane_coverage_is_the_area(tent: bool, angle: float, distance: float) -> None:
    side = (np.arange(800) + 0.5) / 800 - 0.5
    x = np.stack(np.meshgrid(2.0 * side, 2.0 * side), axis=-1)
    weight = np.prod(1.0 - np.abs(x), axis=-1) if tent else np.prod(np.abs(x) < 0.5, axis=-1)
    direction = np.array([math.cos(angle), math.sin(angle)])
    expected = weight[x @ direction < distance].sum() / weight.sum()
    found = half_plane_coverage(np.array([0.5 * distance]), direction[None], one_cell(0.5, tent))
    assert found[0] == pytest.approx(expected, abs=4e-3)


def test_sliver_within_a_cell_is_weighed_by_its_width() -> None:
    """F = y^2 - w^2: a strip of width 2 w through the cell, of which one crossing alone would tell nothing."""
    cells = one_cell(0.2, False)
    for y in (-0.03, 0.01, 0.04):
        found = quadratic_coverage(
            np.array([y**2 - 0.02**2]), np.array([[0.0, 2.0 * y]]), np.array([[[0.0, 0.0], [0.0, 2.0]]]), cells
        )
        assert found[0] == pytest.approx(0.04 / 0.2, rel=1e-9)


@pytest.mark.parametrize("blur_px", [0.0, 0.05, 0.3, 0.7, 2.0])
def test_blur_loses_no_light(blur_px: float) -> None:
    weights = blur_weights(blur_px, 6)
    # A column of cells is a sixth of its pixel.
    np.testing.assert_allclose(weights.sum(axis=0), 1.0 / 6.0, rtol=1e-12)
    np.testing.assert_allclose(weights, weights[::-1, ::-1], atol=1e-15)


@pytest.mark.parametrize("name", SHAPES)
def test_distance_is_zero_on_the_outline_and_grows_at_unit_rate(name: str) -> None:
    shape = SHAPES[name]
    rim = outline(shape, 2000)
    np.testing.assert_allclose(signed_distance(shape, rim)[0], 0.0, atol=0.01 if name == "rounded" else 1e-9)
    points = np.random.default_rng(3).uniform(-40.0, 40.0, (400, 2))
    distance, gradient = signed_distance(shape, points)
    nearest = np.min(np.linalg.norm(points[:, None] - outline(shape, 8000), axis=-1), axis=-1)
    np.testing.assert_allclose(np.abs(distance), nearest, atol=0.03)
    np.testing.assert_allclose(np.linalg.norm(gradient, axis=-1), 1.0, rtol=1e-9)
    # Down the gradient by the distance lies the rim.
    np.testing.assert_allclose(signed_distance(shape, points - distance[:, None] * gradient)[0], 0.0, atol=1e-7)


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("on_plane", [False, True])
def test_shapes_cover_their_area(name: str, on_plane: bool) -> None:
    camera = Camera.create([[150.0, 0.0, 59.5], [0.0, 150.0, 49.5], [0.0, 0.0, 1.0]], (-0.2, 0.05, 0, 0), (120, 100))
    shape = SHAPES[name]
    rim = outline(shape, 20_000)
    if on_plane:
        plane = Plane.create((4.0, -3.0, 150.0), (0.4, 0.3, -1.0), (1.0, 0.2, 0.0))
        rim = camera.project(plane.center + rim @ np.stack([plane.right, plane.down]))
    else:
        plane = None
        shape = {
            "box": Box((40.0, 22.0), (60.3, 50.2), 0.4),
            "rounded": Box((40.0, 22.0), (60.3, 50.2), 0.4, 7.0),
            "disc": Round(14.0, (60.3, 50.2)),
        }.get(name) or Polygon(tuple((x + 57.3, y + 40.2) for x, y in shape.points))
        rim = outline(shape, 20_000)
    x, y = rim.T
    area = abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))) / 2.0
    for patches in (
        {"shapes": (Patch(shape, Paint(40.0), plane),)},
        {"occluders": (Patch(shape, Paint(40.0), plane),)},
    ):
        image = render_float(Scene(camera, **patches))
        assert float((200.0 - image).sum()) / 160.0 == pytest.approx(area, rel=1e-4)


def test_plane_s_axes_lie_right_and_down_in_the_image() -> None:
    plane = Plane.create((0.0, 0.0, 100.0), (0.0, 0.0, 3.0))
    np.testing.assert_allclose(plane.normal, [0.0, 0.0, -1.0])
    np.testing.assert_allclose(plane.point((2.0, 5.0)), [2.0, 5.0, 100.0])
    # A wish along the normal leaves the choice to the plane.
    upright = Plane.create((0.0, 0.0, 100.0), (0.0, 0.0, -1.0), (0.0, 0.0, 1.0))
    assert abs(float(upright.right @ upright.normal)) < 1e-12


@pytest.mark.parametrize(
    "build",
    [
        lambda: Box((0.0, 3.0)),
        lambda: Box((4.0, 3.0), corner_radius=2.0),
        lambda: Polygon(((0.0, 0.0), (1.0, 1.0))),
        lambda: Round(0.0),
        lambda: Plane.create((0.0, 0.0), (0.0, 0.0, 1.0)),
        lambda: Paint(math.inf),
    ],
)
def test_shapes_that_cannot_be_are_refused(build) -> None:
    with pytest.raises(SceneError):
        build()
