"""Which ellipses lie on one lattice, and where on the board it is: laws on exact ellipses."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circlepose._batching import joined
from circlepose.boards.lattice import lattices, turned
from circlepose.boards.placement import Placement, neighbor_radii, place
from circlepose.boards.symmetry import symmetries
from circlepose.camera.camera import Camera
from circlepose.geometry.ellipse import Ellipse
from circlepose.targets.board import BoardLayout
from tests.support.boards import CAMERA, ellipses, grid, plate, posed

LAYOUTS = {
    "symmetric": grid("symmetric", 5, 7, 30.0, 9.0),
    "asymmetric": grid("asymmetric", 7, 4, 18.0, 7.0),
    "hexagonal": grid("hexagonal", 6, 7, 30.0, 13.0),
}
ROUGH = Camera.create([[1020.0, 0, 300.0], [0, 1020.0, 260.0], [0, 0, 1]], (), (640, 480))
"""Another camera: 28 % off, without distortion."""


def placed(ellipse: Ellipse, layout: BoardLayout) -> Placement | str:
    assert layout.grid is not None
    patches = lattices(ellipse, neighbor_radii(layout.grid, layout), layout.grid.order)
    return place(patches[0], ellipse, layout, (640, 480)) if patches else "no lattice"


def is_right(found: Placement, layout: BoardLayout, true: np.ndarray) -> bool:
    """Whether the circles are the true ones, (m,) of each ellipse, but for a symmetry of the layout."""
    return any(np.array_equal(same[found.circles], true[found.members]) for same in symmetries(layout))


@pytest.mark.parametrize("name", LAYOUTS)
@settings(max_examples=25, deadline=None)
@given(
    tilt=st.floats(0.0, 65.0),
    azimuth=st.floats(0.0, 360.0),
    roll=st.floats(0.0, 360.0),
    seed=st.integers(0, 10_000),
)
def test_every_circle_is_placed_in_any_view_and_order(name, tilt, azimuth, roll, seed):
    layout = LAYOUTS[name]
    order = np.random.default_rng(seed).permutation(len(layout))
    found = placed(ellipses(layout, posed(layout, tilt, azimuth, roll, 700.0))[order], layout)
    assert isinstance(found, Placement)
    assert len(found.members) == len(layout)
    assert is_right(found, layout, order)


@pytest.mark.parametrize("name", LAYOUTS)
@pytest.mark.parametrize("missing", [2, 5])
@pytest.mark.parametrize("seed", range(6))
def test_missing_and_foreign_circles_do_not_move_the_others(name, missing, seed):
    layout = LAYOUTS[name]
    generator = np.random.default_rng(seed)
    every = ellipses(layout, posed(layout, 40.0, 60.0 * seed, 10.0, 600.0))
    kept = np.sort(generator.permutation(len(layout))[: len(layout) - missing])
    strangers = Ellipse.from_axes(
        generator.uniform([20.0, 20.0], [620.0, 460.0], (6, 2)),
        generator.uniform(4.0, 12.0, (6, 2)),
        generator.uniform(0.0, 3.0, 6),
    )
    found = placed(joined([every[kept], strangers]), layout)
    if missing > 2 and isinstance(found, str):
        # Most of a row may be among them.
        return
    assert isinstance(found, Placement)
    own = found.members < len(kept)
    # A corner whose neighbors are missing is found later, by the pose.
    assert np.count_nonzero(own) >= len(kept) - 3
    assert is_right(Placement(found.members[own], found.circles[own]), layout, kept)


def test_a_hidden_row_leaves_two_places_and_is_refused():
    layout = LAYOUTS["symmetric"]
    every = ellipses(layout, posed(layout, distance_mm=800.0))
    found = placed(every[np.arange(7, 35)], layout)
    assert isinstance(found, str)
    assert "more than one place; more of its circles are needed in the image, or a mark" in found


@pytest.mark.parametrize("radii", [(4.5,), (9.0, 4.5)])
def test_marks_that_are_not_seen_are_asked_for_not_a_new_one(radii):
    layout = grid("symmetric", 5, 7, 30.0, 9.0, marks={(0, 3): radii})
    found = placed(ellipses(layout, posed(layout, distance_mm=800.0))[np.arange(7, 35)], layout)
    assert isinstance(found, str)
    assert "more than one place; its marks were not seen, or not distinguished from its other circles;" in found
    assert "or a mark" not in found


def test_a_row_that_is_not_seen_may_be_beyond_the_border_or_hidden_and_a_mark_says_which():
    plain = LAYOUTS["symmetric"]
    marked = grid("symmetric", 5, 7, 30.0, 9.0, marks={(3, 5): (6.0,)})
    for layout in (plain, marked):
        every = ellipses(layout, posed(layout, 10.0, 0.0, 0.0, 500.0, at=(0.0, -95.0)))
        inside = np.flatnonzero(every.center[:, 1] - every.semi_major > 0.0)
        assert len(inside) == 28
        found = placed(every[inside], layout)
        if layout is plain:
            assert isinstance(found, str)
        else:
            assert isinstance(found, Placement)
            assert np.array_equal(found.circles[np.argsort(found.members)], inside)


def test_a_hidden_mark_is_known_by_the_others():
    layout = grid("symmetric", 4, 5, 30.0, 9.0, marks={(0, 4): (4.5,)})
    every = ellipses(layout, posed(layout, 35.0, 20.0, 90.0, 700.0))
    kept = np.setdiff1d(np.arange(20), [4])
    found = placed(every[kept], layout)
    assert isinstance(found, Placement)
    assert np.array_equal(kept[found.members], found.circles)


def test_a_size_between_that_of_a_disc_and_a_mark_tells_nothing():
    layout = grid("symmetric", 4, 5, 30.0, 9.0, marks={(0, 4): (4.5,)})
    every = ellipses(layout, posed(layout, 35.0, 20.0, 10.0, 700.0))
    shrunk = np.ones(20)
    # Covered in part, and measured too small.
    shrunk[15] = 0.7
    found = placed(Ellipse(every.center, every.semi_major * shrunk, every.semi_minor * shrunk, every.angle), layout)
    assert isinstance(found, Placement)
    assert np.array_equal(found.circles[np.argsort(found.members)], np.arange(20))


def test_a_wrong_mark_is_named():
    layout = grid("symmetric", 4, 5, 30.0, 9.0, marks={(0, 4): (4.5,)})
    stated = grid("symmetric", 4, 5, 30.0, 9.0, marks={(1, 1): (4.5,)})
    found = placed(ellipses(layout, posed(layout, 35.0, 20.0, 10.0, 700.0)), stated)
    assert isinstance(found, str)
    assert "marks" in found


@pytest.mark.parametrize(("rows", "columns"), [(3, 4), (2, 4)])
def test_a_coarser_grid_is_not_put_on_every_second_circle(rows, columns):
    fine = LAYOUTS["symmetric"]
    coarse = grid("symmetric", rows, columns, 60.0, 9.0)
    found = placed(ellipses(fine, posed(fine, 30.0, 10.0, 0.0, 700.0)), coarse)
    assert isinstance(found, str)


def test_a_mark_settles_the_roll():
    layout = grid("symmetric", 4, 5, 30.0, 9.0, marks={(0, 4): (4.5,)})
    assert len(symmetries(layout)) == 1
    for roll in (0.0, 90.0, 180.0, 270.0):
        found = placed(ellipses(layout, posed(layout, 35.0, 20.0, roll, 700.0)), layout)
        assert isinstance(found, Placement)
        assert np.array_equal(found.circles[np.argsort(found.members)], np.arange(20))


def test_the_turns_of_a_lattice_come_back():
    nodes = np.array([[3, -2], [0, 5]])
    for order in (4, 6):
        assert np.array_equal(turned(nodes, order, order), nodes)
        basis = LAYOUTS["hexagonal" if order == 6 else "symmetric"].grid.basis_mm
        lengths = [np.linalg.norm(turned(nodes, turn, order) @ basis, axis=1) for turn in range(order)]
        assert np.allclose(lengths, lengths[0])


@pytest.mark.parametrize(
    ("layout", "number"),
    [
        (grid("symmetric", 4, 4, 30.0, 9.0), 4),
        (grid("symmetric", 4, 3, 30.0, 9.0), 2),
        (grid("symmetric", 4, 4, 30.0, 9.0, omit=[(0, 0)]), 1),
        (grid("asymmetric", 7, 4, 18.0, 7.0), 1),
        (grid("hexagonal", 4, 4, 30.0, 13.0), 2),
        (plate([(0.0, 0.0), (40.0, 0.0), (40.0, 40.0), (0.0, 40.0)]), 4),
        (plate([(0.0, 0.0), (40.0, 0.0), (40.0, 30.0), (0.0, 31.0)]), 1),
        (plate([(0.0, 0.0), (40.0, 0.0)]), 2),
    ],
)
def test_the_symmetries_of_layouts(layout, number):
    found = symmetries(layout)
    assert len(found) == number
    assert np.array_equal(found[0], np.arange(len(layout)))
    distances = np.linalg.norm(layout.centers_mm[:, None] - layout.centers_mm, axis=2)
    for permutation in found:
        assert np.allclose(distances[permutation][:, permutation], distances)


def test_the_camera_does_not_matter():
    layout = LAYOUTS["asymmetric"]
    found = placed(ellipses(layout, posed(layout, 50.0, 100.0, 30.0, 600.0), CAMERA), layout)
    again = placed(ellipses(layout, posed(layout, 50.0, 100.0, 30.0, 600.0), ROUGH), layout)
    assert isinstance(found, Placement)
    assert isinstance(again, Placement)
    assert len(found.members) == len(again.members) == len(layout)
