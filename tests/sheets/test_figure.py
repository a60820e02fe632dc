"""Targets as they are drawn: where each circle is, and what a flat sheet cannot show."""

from __future__ import annotations

import numpy as np
import pytest

from circlepose.errors import TargetError
from circlepose.sheets.figure import figure_of
from circlepose.targets.board import BoardCircle, BoardLayout
from circlepose.targets.target import Target
from tests.support.boards import grid

TRIANGLE = [("a", (0.0, 0.0, 0.0)), ("b", (80.0, 15.0, 0.0)), ("c", (20.0, 60.0, 0.0))]


def board(places, normal=(0.0, 0.0, -1.0), side="auto"):
    circles = tuple(BoardCircle(name, place, (6.0,), normal) for name, place in places)
    return Target.board(BoardLayout(circles, side=side))


def offsets(figure):
    """Where the circles are from the first."""
    first = figure.rings[0]
    return {each.name: (each.x_mm - first.x_mm, each.y_mm - first.y_mm) for each in figure.rings}


def test_a_grid_has_x_to_the_right_and_y_down():
    found = offsets(figure_of(Target.board(grid("symmetric", 3, 4, 30.0, 8.0))))
    assert found["r0c3"] == pytest.approx((90.0, 0.0))
    assert found["r2c0"] == pytest.approx((0.0, 60.0))


@pytest.mark.parametrize(
    ("normal", "side", "b"),
    [
        ((0.0, 0.0, -1.0), "auto", (80.0, 15.0)),
        ((0.0, 0.0, 1.0), "auto", (80.0, -15.0)),
        ((0.0, 0.0, 1.0), "back", (80.0, 15.0)),
        ((0.0, 0.0, -1.0), "back", (80.0, -15.0)),
    ],
)
def test_a_list_is_seen_from_the_side_that_it_faces(normal, side, b):
    assert offsets(figure_of(board(TRIANGLE, normal, side)))["b"] == pytest.approx(b)


def test_a_list_in_a_tilted_plane_is_drawn_in_its_plane():
    tilt = np.radians(35.0)
    rotation = np.array([[1, 0, 0], [0, np.cos(tilt), -np.sin(tilt)], [0, np.sin(tilt), np.cos(tilt)]])
    places = [(name, tuple((rotation @ np.array(place)).tolist())) for name, place in TRIANGLE]
    found = offsets(figure_of(board(places, tuple((rotation @ [0.0, 0.0, -1.0]).tolist()))))
    for name, (x, y, _) in TRIANGLE:
        assert found[name] == pytest.approx((x, y))


def test_discs_and_rings_stand_side_by_side():
    figure = figure_of(Target.rings((50.0, 30.0), count=5))
    assert [each.radii_mm for each in figure.rings] == [(50.0, 30.0)] * 5
    places = np.array([(each.x_mm, each.y_mm) for each in figure.rings])
    apart = np.linalg.norm(places[:, None] - places[None], axis=2)[np.triu_indices(5, 1)]
    assert apart.min() == pytest.approx(150.0)


def test_all_has_one_disc_unless_a_number_is_given():
    assert len(figure_of(Target.circle(5.0, count="all")).rings) == 1
    assert len(figure_of(Target.circle(5.0, count="all"), 7).rings) == 7


@pytest.mark.parametrize(
    ("target", "said"),
    [
        (Target.coaxial((45.0, 30.0), height_mm=24.0), "at different heights, 24 mm apart, and a sheet is flat"),
        (Target.coaxial((45.0, 30.0)), "at different heights, and a sheet is flat"),
        (board([*TRIANGLE, ("pin", (90.0, 60.0, -20.0))]), "pin lies 20 mm off the plane of a"),
        (Target.circle(5.0, count=2000), "at most 1000 targets, got 2000"),
    ],
)
def test_what_no_sheet_can_show_is_refused(target, said):
    with pytest.raises(TargetError, match=said):
        figure_of(target)


def test_circles_that_face_another_way_are_refused():
    circles = (
        BoardCircle("a", (0.0, 0.0, 0.0), (6.0,)),
        BoardCircle("b", (50.0, 0.0, 0.0), (6.0,)),
        BoardCircle("slot", (0.0, 50.0, 0.0), (6.0,), (0.0, 0.5, -np.sqrt(0.75))),
    )
    with pytest.raises(TargetError, match="slot faces 30 deg away from a, and a sheet is flat"):
        figure_of(Target.board(BoardLayout(circles)))
