"""Marks: the roll of every grid is settled by one circle, and rendered boards show it."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import circlepose
from circlepose.boards.options import BoardOptions
from circlepose.results import Flag
from circlepose.sheets.marking import MARK_RATIO, is_roll_ambiguous, with_roll_settled
from circlepose.targets.board import BoardCircle, BoardLayout
from circlepose.targets.target import Target
from tests.support.boards import CAMERA, apart, grid, picture, posed


@settings(max_examples=60, deadline=None)
@given(
    st.sampled_from(["symmetric", "asymmetric", "hexagonal"]),
    st.integers(1, 8),
    st.integers(1, 8),
    st.floats(3.0, 12.0),
)
def test_no_turn_maps_a_marked_grid_on_itself(pattern, rows, columns, radius):
    if rows * columns < 2:
        return
    layout = grid(pattern, rows, columns, 30.0, radius)
    marked = with_roll_settled(layout)
    assert not is_roll_ambiguous(marked)
    changed = [i for i in range(len(layout)) if marked.circles[i] != layout.circles[i]]
    assert len(changed) == int(is_roll_ambiguous(layout))
    for i in changed:
        assert marked.circles[i].radii_mm[0] == pytest.approx(MARK_RATIO * radius, rel=1e-5)


def test_a_layout_that_is_settled_or_marked_stays_as_it_is():
    for layout in (
        grid("asymmetric", 11, 4, 18.0, 7.0),
        grid("symmetric", 4, 4, 30.0, 8.0, omit=[(0, 0)]),
        grid("symmetric", 3, 3, 30.0, 8.0, marks={(1, 1): (5.0,)}),
        grid("symmetric", 3, 3, 30.0, 8.0, marks={(1, 1): (8.0, 4.0)}),
    ):
        assert with_roll_settled(layout) is layout


def test_a_list_is_marked_as_a_grid_is():
    square = tuple(BoardCircle(f"h{i}{j}", (40.0 * i, 40.0 * j, 0.0), (9.0,)) for i in range(5) for j in range(5))
    marked = with_roll_settled(BoardLayout(square))
    assert not is_roll_ambiguous(marked)
    # The middle one stays in its place when the board is turned.
    assert marked.circles[12].radii_mm == (9.0,)


def test_the_size_is_clear_to_the_placement():
    options = BoardOptions()
    assert options.alike_ratio > 1.0 / MARK_RATIO


@pytest.mark.parametrize("roll", [7.0, 95.0, -170.0])
@pytest.mark.parametrize(
    "layout", [grid("symmetric", 4, 5, 30.0, 9.0), grid("hexagonal", 5, 5, 26.0, 9.0, omit=[(1, 4), (3, 4)])], ids=str
)
def test_a_marked_board_has_its_roll_and_a_plain_one_has_not(layout, roll):
    marked = with_roll_settled(layout)
    pose = posed(layout, roll_deg=roll, distance_mm=600.0)
    for each, is_settled in ((marked, True), (layout, False)):
        result = circlepose.estimate(picture([(each, pose)], noise=3.0), CAMERA, Target.board(each))
        (board,) = result.boards
        assert (Flag.ROLL_AMBIGUOUS in board.flags) is not is_settled
        if is_settled:
            assert apart(pose, board.pose.rotation, board.pose.translation)[1] < 0.5
