"""Layouts of boards: where each circle is, and what is refused."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from circlepose.errors import TargetError
from circlepose.targets.board import BoardCircle, BoardLayout, Grid
from circlepose.targets.target import Target
from tests.support.boards import grid, plate


def test_circles_lie_where_the_patterns_say():
    s = 10.0
    for pattern, place in (
        ("symmetric", lambda r, c: (c * s, r * s)),
        ("asymmetric", lambda r, c: ((2 * c + r % 2) * s, r * s)),
        ("hexagonal", lambda r, c: ((c + (r % 2) / 2.0) * s, r * s * np.sqrt(3.0) / 2.0)),
    ):
        layout = grid(pattern, 5, 4, s, 2.0)
        for row in range(5):
            for column in range(4):
                center = layout.circles[layout.names.index(f"r{row}c{column}")].center_mm
                assert center == pytest.approx((*place(row, column), 0.0))


@pytest.mark.parametrize("pattern", ["symmetric", "asymmetric", "hexagonal"])
def test_nodes_and_basis_give_the_places_and_neighbors_are_nearest(pattern):
    layout = grid(pattern, 6, 5, 10.0, 2.0)
    assert np.allclose(layout.node_of @ layout.grid.basis_mm, layout.centers_mm[:, :2])
    distances = np.linalg.norm(layout.centers_mm[:, None] - layout.centers_mm, axis=2)
    np.fill_diagonal(distances, np.inf)
    assert distances.min() == pytest.approx(layout.grid.neighbor_mm)
    first, second = layout.grid.basis_mm
    angle = 2.0 * np.pi / layout.grid.order
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    assert np.allclose(turn @ first, second)


def test_marks_and_omitted_circles():
    layout = grid("symmetric", 3, 3, 10.0, 3.0, marks={(0, 2): (4.0, 2.0)}, omit=[(1, 1)])
    assert len(layout) == 8
    assert "r1c1" not in layout.names
    assert layout.circles[layout.names.index("r0c2")].radii_mm == (4.0, 2.0)
    assert layout.radii_mm == (4.0, 3.0, 2.0)
    assert layout.usual_radius_mm == 3.0
    assert layout.is_ring.sum() == 1


def test_a_ring_of_the_usual_radius_is_a_mark():
    layout = grid("symmetric", 3, 4, 10.0, 3.0, marks={(0, 0): (3.0, 2.0)})
    assert layout.circles[0].radii_mm == (3.0, 2.0)


def test_marks_may_be_alike_after_a_turn():
    # They settle which part of the board is seen, if not the roll.
    assert len(grid("symmetric", 3, 4, 10.0, 3.0, marks={(0, 0): (2.0,), (2, 3): (2.0,)})) == 12


def test_a_layout_is_a_value():
    first, second = grid("symmetric", 3, 4, 10.0, 3.0), grid("symmetric", 3, 4, 10.0, 3.0)
    assert first == second
    assert hash(first) == hash(second)
    assert pickle.loads(pickle.dumps(first)) == first
    assert Target.board(first) == Target.board(second)
    assert Target.board(first).circle_names == first.names


def test_planes():
    assert grid("hexagonal", 3, 4, 10.0, 3.0).is_planar
    assert plate([(0.0, 0.0), (50.0, 10.0)]).is_planar
    low, high = BoardCircle("a", (0.0, 0.0, 0.0), (3.0,)), BoardCircle("b", (20.0, 0.0, 5.0), (3.0,))
    assert not BoardLayout((low, high)).is_planar


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: grid("symmetric", 3, 4, 10.0, 6.0), "overlap"),
        (lambda: plate([(0.0, 0.0), (0.0, 0.0)]), "overlap"),
        (lambda: plate([(0.0, 0.0)]), "2 to"),
        (lambda: grid("square", 3, 4, 10.0, 2.0), "grid.pattern"),
        (lambda: grid("symmetric", 0, 4, 10.0, 2.0), "grid.rows"),
        (lambda: grid("symmetric", 1, 1, 10.0, 2.0), "two circles"),
        (lambda: grid("symmetric", 200, 200, 10.0, 2.0), "at most"),
        (lambda: grid("symmetric", 3, 4, -1.0, 2.0), "grid.spacing_mm"),
        (lambda: grid("symmetric", 3, 4, 10.0, 2.0, omit=[(3, 0)]), "omit"),
        (lambda: grid("symmetric", 3, 4, 10.0, 2.0, marks={(0, 4): (1.0,)}), "marks"),
        (lambda: grid("symmetric", 3, 4, 10.0, 2.0, marks={(0, 0): (1.0, 2.0)}), "largest first"),
        (lambda: grid("symmetric", 3, 4, 10.0, 2.0, marks={(0, 0): (1.0,)}, omit=[(0, 0)]), "in both"),
        (
            lambda: grid("symmetric", 3, 4, 10.0, 2.0, marks={(0, 0): (1.0,), (1, 2): (2.0,)}),
            r"^marks: circle \[1, 2\] has the grid's own radius of 2 mm and so marks nothing; give the radius that",
        ),
        (
            lambda: BoardLayout(tuple(BoardCircle("a", (20.0 * i, 0.0, 0.0), (3.0,)) for i in range(2))),
            "named 'a'",
        ),
        (lambda: Target(kind="board", radii_mm=(3.0,)), "layout"),
        (lambda: Target(kind="circle", radii_mm=(3.0,), layout=grid("symmetric", 2, 2, 10.0, 2.0)), "layout"),
        (lambda: Target.board("a.yaml"), "layout"),
        (lambda: Grid("symmetric", 2.5, 2, 10.0), "grid.rows"),
    ],
)
def test_what_is_no_board_is_refused_in_one_sentence(make, words):
    with pytest.raises(TargetError, match=words):
        make()
