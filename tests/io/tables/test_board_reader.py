"""Tables of boards read back, and compared."""

from __future__ import annotations

import io
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from circlepose.board_result import quaternion_of
from circlepose.boards.pose import rotation_of
from circlepose.errors import ArgumentError, UsageError
from circlepose.evaluation.compare import Tolerance, compare
from circlepose.evaluation.matching import PoseTable, TabledCircle, TabledPose
from circlepose.io.tables.paper_layouts import write_results
from circlepose.io.tables.reader import read_pose_file
from circlepose.io.tables.reference import read_reference
from circlepose.results import ImageResult, Status
from tests.support.board_results import made_board, made_board_result
from tests.support.discs import made_result

FAILED = ImageResult("bad.png", Status.LAYOUT_MISMATCH, "another spacing?")
RESULTS = [made_board_result(made_board(), made_board(1, (), 1)), FAILED]
HEADER = "image,x_mm,y_mm,z_mm,qw,qx,qy,qz\n"


def table(results=RESULTS, data_format="csv", layout="boards"):
    handle = io.StringIO()
    write_results(results, handle, data_format=data_format, layout=layout)
    return handle.getvalue()


def read(text, **options):
    return read_pose_file(text.encode(), "t", **options).table


@pytest.mark.parametrize("data_format", ["csv", "tsv", "json", "jsonl"])
def test_a_table_is_read_as_it_was_written(data_format):
    found = read(table(data_format=data_format))
    assert found.of_boards
    assert not found.is_truth
    assert found.image_status == {"bad.png": "layout_mismatch"}
    boards = RESULTS[0].boards
    assert [(each.image, each.instance, len(each.poses), each.chosen) for each in found.circles] == [
        ("a.png", 0, 2, 0),
        ("a.png", 1, 1, 0),
    ]
    for each, board in zip(found.circles, boards, strict=True):
        for pose, candidate in zip(each.poses, board.candidates, strict=True):
            np.testing.assert_allclose(pose.center_mm, candidate.translation, atol=1e-6)
            np.testing.assert_allclose(pose.rotation, candidate.quaternion, atol=1e-8)
    assert compare(found, read(table()), Tolerance(1e-5, 1e-5)).differences == ()


def test_too_few_boards_are_a_status_of_the_image_in_all_forms():
    few = [replace(made_board_result(), status=Status.TOO_FEW_CIRCLES)]
    for data_format in ("csv", "json"):
        assert read(table(few, data_format)).image_status == {"a.png": "too_few_circles"}


def test_a_truth_has_a_row_per_board():
    found = read(HEADER + "a.png,-80,-60,600,1,0,0,0\n", truth_allowed=True)
    assert (found.is_truth, found.of_boards, found.circles[0].instance) == (True, True, None)
    with pytest.raises(UsageError, match="has no column instance; expected a table in the layout boards"):
        read(HEADER + "a.png,-80,-60,600,1,0,0,0\n")


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("a.png,1,2,3,0.9,0,0,0", "qw: expected the first of the four numbers of a unit quaternion"),
        ("a.png,1,2,3,1,,0,0", "qx: is empty, though there is a board"),
        ("a.png,1,,3,1,0,0,0", "y_mm: is empty, though status is ok"),
        ("a.png,1,far,3,1,0,0,0", "y_mm: expected a number or an empty cell, got 'far'"),
        (",1,2,3,1,0,0,0", "image: is empty"),
    ],
)
def test_cells_that_cannot_be_meant(row, message):
    with pytest.raises(UsageError, match=message):
        read(HEADER + row + "\n", truth_allowed=True)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("instance,", "odd,", "has no column instance"),
        (",0,0,true,ok", ",,0,true,ok", "instance: is empty, though status is ok"),
        (",1,false,", ",0,false,", "has number 0 twice"),
        (",0,true,", ",0,false,", "has 0 chosen candidates"),
    ],
)
def test_tables_that_cannot_be_meant(old, new, message):
    with pytest.raises(UsageError, match=message):
        read(table().replace(old, new, 1))


@pytest.mark.parametrize("data_format", ["csv", "json", "jsonl"])
def test_pairs_are_no_poses(data_format):
    with pytest.raises(
        UsageError, match="is of the layout pairs, without poses; expected the layout poses or boards"
    ):
        read(table(data_format=data_format, layout="pairs"))


def test_a_reference_of_table2_is_of_circles(tmp_path):
    (tmp_path / "b.csv").write_text(table())
    with pytest.raises(UsageError, match="is a table of boards; expected one of circles"):
        read_reference(tmp_path / "b.csv")


def board(place=(0.0, 0.0, 600.0), turn_deg=0.0, sign=1.0):
    half = math.radians(0.5 * turn_deg)
    rotation = (sign * math.cos(half), 0.0, 0.0, sign * math.sin(half))
    pose = TabledPose(place, None, rotation)
    return PoseTable((TabledCircle("a.png", 0, None, None, poses=(pose,)),), {}, of_boards=True)


@pytest.mark.parametrize(("turn_deg", "sign"), [(0.0, -1.0), (1e-5, 1.0), (0.3, -1.0), (179.9, 1.0), (180.0, 1.0)])
def test_rotations_are_compared_by_the_angle_between_them(turn_deg, sign):
    found = compare(board(turn_deg=turn_deg, sign=sign), board(), Tolerance(0.5, 0.1))
    assert found.largest_normal_deg == pytest.approx(turn_deg, abs=1e-12, rel=1e-9)
    assert [each.change for each in found.differences] == (["moved"] if turn_deg > 0.1 else [])


def test_origins_are_compared_and_kinds_are_not_mixed():
    found = compare(board((0.0, 3.0, 604.0)), board(), Tolerance(0.5, 0.1))
    assert found.largest_position_mm == 5.0
    with pytest.raises(ArgumentError, match="one table is of boards, the other of circles"):
        compare(board(), read(table([made_result()], layout="poses")), Tolerance())


def posed(rotation, translation, is_roll_open):
    w, x, y, z = quaternion_of(rotation).tolist()
    pose = TabledPose(tuple(translation.tolist()), None, (w, x, y, z))
    circle = TabledCircle("a.png", 0, None, None, poses=(pose,), is_roll_open=is_roll_open)
    return PoseTable((circle,), {}, of_boards=True)


def turn(x_deg, y_deg, z_deg):
    return rotation_of(np.radians([x_deg, y_deg, 0.0])) @ rotation_of(np.radians([0.0, 0.0, z_deg]))


ORIGIN = np.array([-30.0, 20.0, 600.0])
angles = st.floats(-60.0, 60.0)
places = st.floats(-200.0, 200.0)


@given(angles, angles, st.sampled_from([60.0, 90.0, 120.0, 180.0, -90.0]), places, places, st.booleans())
def test_a_turn_that_the_layout_leaves_open_is_no_difference(x_deg, y_deg, z_deg, x_mm, y_mm, first):
    rotation, center = turn(x_deg, y_deg, 20.0), np.array([x_mm, y_mm, 0.0])
    about = turn(0.0, 0.0, z_deg)
    turned = rotation @ about, ORIGIN + rotation @ (center - about @ center)
    pair = posed(*turned, first), posed(rotation, ORIGIN, not first)
    found = compare(*pair, Tolerance(1e-9, 1e-6))
    assert found.differences == ()
    (note,) = found.notes
    assert note.startswith("1 board with the flag roll_ambiguous is turned about the z axis: ")
    closed = compare(posed(*turned, False), posed(rotation, ORIGIN, False), Tolerance())
    assert [each.change for each in closed.differences] == ["moved"]
    assert closed.notes == ()


@given(angles, angles, st.floats(0.2, 3.0), places, st.floats(0.6, 5.0))
def test_tilt_and_distance_count_where_the_roll_is_open(x_deg, y_deg, tilt_deg, x_mm, away_mm):
    rotation, center = turn(x_deg, y_deg, 20.0), np.array([x_mm, 10.0, 0.0])
    half = rotation @ turn(0.0, 0.0, 180.0)
    at = ORIGIN + 2.0 * rotation @ center
    reference = posed(rotation, ORIGIN, True)
    moved = compare(posed(half, at + away_mm * rotation[:, 2], True), reference, Tolerance())
    assert moved.differences[0].position_difference_mm == pytest.approx(away_mm)
    assert moved.largest_normal_deg == pytest.approx(0.0, abs=1e-5)
    # About the middle of the board.
    tilt = rotation @ turn(tilt_deg, 0.0, 0.0)
    middle = ORIGIN + rotation @ center
    tilted = compare(posed(tilt @ turn(0.0, 0.0, 180.0), middle + tilt @ center, True), reference, Tolerance())
    assert tilted.differences[0].orientation_difference_deg == pytest.approx(tilt_deg)
    assert tilted.largest_position_mm == pytest.approx(0.0, abs=1e-6)


def test_a_small_turn_is_a_difference_also_where_the_roll_is_open():
    rotation = turn(20.0, -10.0, 20.0)
    found = compare(posed(rotation @ turn(0.0, 0.0, 0.3), ORIGIN, True), posed(rotation, ORIGIN, True), Tolerance())
    assert found.differences[0].orientation_difference_deg == pytest.approx(0.3)
    assert found.notes == ()


@pytest.mark.parametrize("data_format", ["csv", "tsv", "json", "jsonl"])
def test_whether_the_roll_is_open_is_read(data_format):
    found = read(table(data_format=data_format))
    assert [each.is_roll_open for each in found.circles] == [True, False]
