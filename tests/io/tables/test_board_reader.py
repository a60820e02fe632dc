"""Tables of boards read back, and compared."""

from __future__ import annotations

import io
import math
from dataclasses import replace

import numpy as np
import pytest

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
