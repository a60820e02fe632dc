"""The layout `boards`: columns, rows and JSON, and what a run leaves for another."""

from __future__ import annotations

import csv
import io
import json
import math
from dataclasses import replace

import numpy as np
import pytest

import circlepose
from circlepose.errors import ArgumentError, UsageError
from circlepose.io.tables import LAYOUTS
from circlepose.io.tables.board_rows import BOARD_COLUMNS, board_rows
from circlepose.io.tables.lossless import plain_result, restored_result
from circlepose.io.tables.paper_layouts import write_results
from circlepose.io.tables.parquet import write_parquet
from circlepose.io.tables.selection import Selection, read_columns
from circlepose.io.target_file import read_target, target_from_mapping
from circlepose.results import Flag, ImageResult, Status
from tests.support.board_results import (
    BOARD_YAML,
    POINTS_MM,
    ROTATION,
    TRANSLATION,
    board_image,
    made_board,
    made_board_result,
)
from tests.support.discs import CAMERA, RADIUS_MM, discs_image

FAILED = ImageResult("bad.png", Status.LAYOUT_MISMATCH, "another spacing?", image_size=(320, 240))
TWO = made_board_result(made_board(0, (Flag.AMBIGUOUS, Flag.ROLL_AMBIGUOUS)), made_board(1, (), 1, growth=-0.02))


def text_of(results, data_format="csv", selection=None, layout="boards"):
    handle = io.StringIO()
    write_results(results, handle, data_format=data_format, layout=layout, selection=selection or Selection())
    return handle.getvalue()


def rows_of(results, **options):
    return list(csv.DictReader(io.StringIO(text_of(results, **options))))


def test_columns_are_those_agreed_on_in_their_order():
    assert ", ".join(BOARD_COLUMNS) == (
        "image, instance, solution, chosen, status, x_mm, y_mm, z_mm, qw, qx, qy, qz, circles_used, "
        "circles_in_layout, rms_px, sigma_x_mm, sigma_y_mm, sigma_z_mm, sigma_rx_deg, sigma_ry_deg, sigma_rz_deg, "
        "ambiguity, flags"
    )
    for row in board_rows(TWO):
        assert set(row) == set(BOARD_COLUMNS)


def test_a_row_per_candidate_and_one_for_what_failed():
    rows = rows_of([TWO, FAILED])
    assert [(row["image"], row["instance"], row["solution"], row["chosen"], row["status"]) for row in rows] == [
        ("a.png", "0", "0", "true", "ok"),
        ("a.png", "0", "1", "false", "ok"),
        ("a.png", "1", "0", "true", "ok"),
        ("bad.png", "", "", "", "layout_mismatch"),
    ]
    assert {key for key, value in rows[-1].items() if value} == {"image", "status"}
    assert (rows[0]["circles_used"], rows[0]["circles_in_layout"], rows[0]["flags"]) == (
        "1",
        "12",
        "ambiguous;roll_ambiguous",
    )


def test_an_image_of_too_few_boards_has_a_row_after_those_found():
    few = replace(TWO, status=Status.TOO_FEW_CIRCLES, reason="2 of 3 boards found")
    assert [row["status"] for row in rows_of([few])] == ["ok", "ok", "ok", "too_few_circles"]


def test_the_quaternion_is_the_rotation_and_its_first_part_is_not_negative():
    for candidate, row in zip(TWO.boards[0].candidates, rows_of([TWO]), strict=False):
        w, x, y, z = (float(row[name]) for name in ("qw", "qx", "qy", "qz"))
        assert w >= 0.0
        assert math.hypot(w, x, y, z) == pytest.approx(1.0, abs=1e-8)
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        np.testing.assert_allclose(np.eye(3) + 2.0 * w * cross + 2.0 * cross @ cross, candidate.rotation, atol=1e-7)


def test_sigmas_are_roots_of_the_covariance():
    row, pose = rows_of([TWO])[0], TWO.boards[0].pose
    roots = np.sqrt(pose.covariance.diagonal())
    found = [float(row[f"sigma_{axis}_mm"]) for axis in "xyz"]
    found += [math.radians(float(row[f"sigma_r{axis}_deg"])) for axis in "xyz"]
    np.testing.assert_allclose(found, roots, atol=1e-6)


def test_chosen_rows_and_columns_alone():
    chosen = Selection(read_columns("--columns", "qw, image,rms_px", BOARD_COLUMNS), chosen_only=True)
    assert text_of([TWO, FAILED], "tsv", chosen).splitlines()[0] == "qw\timage\trms_px"
    assert [row["image"] for row in rows_of([TWO, FAILED], selection=chosen)] == ["a.png", "a.png", "bad.png"]
    with pytest.raises(UsageError, match="there is no column 'center_x_mm'; did you mean"):
        read_columns("--columns", "center_x_mm", BOARD_COLUMNS)
    few = json.loads(text_of([TWO], "json", chosen))["images"][0]["boards"]
    assert [[solution["solution"] for solution in board["solutions"]] for board in few] == [[0], [0]]


def test_json_has_the_covariance_its_terms_and_the_fit_of_each_circle():
    document = json.loads(text_of([TWO, FAILED], "json"))
    assert document["schema"] == "circlepose.boards/1"
    first, failed = document["images"]
    assert (failed["boards"], failed["status"], failed["reason"]) == ([], "layout_mismatch", "another spacing?")
    board, pose = first["boards"][0], TWO.boards[0].candidates[1]
    assert board["circles"][1] == {"name": "r0c1", "is_used": False, "residual_px": [1.5, 2.5], "sigmas": 12.0}
    assert first["boards"][1]["growth"] == -0.02
    solution = board["solutions"][1]
    assert np.array_equal(solution["covariance"], pose.covariance)
    assert np.array_equal(solution["covariance_terms"]["image"], pose.terms.image)
    assert solution["covariance_terms"]["radius"] is None
    # All digits, unlike in CSV.
    assert [solution["x_mm"], solution["y_mm"], solution["z_mm"]] == pose.translation.tolist()
    lines = [json.loads(line) for line in text_of([TWO, FAILED], "jsonl").splitlines()]
    assert lines == [{"schema": "circlepose.boards/1"} | image for image in document["images"]]


@pytest.fixture(scope="module")
def measured():
    camera = replace(CAMERA, sigma=circlepose.CameraSigma(0.4, 0.3))
    target = replace(read_target(BOARD_YAML.encode()), radius_sigma_mm=0.02)
    return circlepose.estimate(board_image(), camera, target, name="a.png")


def test_a_measured_board_is_where_it_is(measured):
    (row,) = rows_of([measured])
    place = np.array([float(row[name]) for name in ("x_mm", "y_mm", "z_mm")])
    np.testing.assert_allclose(place, TRANSLATION, atol=0.2)
    assert (row["circles_used"], row["circles_in_layout"], row["flags"]) == ("12", "12", "roll_ambiguous")
    pose = measured.boards[0].pose
    np.testing.assert_allclose(pose.rotation, ROTATION, atol=1e-3)
    moves = pose.terms.camera_moves
    np.testing.assert_allclose(moves @ moves.T, pose.terms.camera)
    assert np.array_equal(pose.covariance, pose.covariance.T)
    # Each circle's pose moves by the board's: a larger layout is farther away, along each line of sight.
    for circle in measured.circles:
        terms = circle.candidates[0].covariance_terms
        np.testing.assert_allclose(terms.camera_moves @ terms.camera_moves.T, terms.camera)
        center = circle.candidates[0].center
        np.testing.assert_allclose(terms.radius[:3, :3], np.outer(center, center) * 1e-6, rtol=1e-9)


def stored(result: ImageResult) -> ImageResult:
    return restored_result(json.loads(json.dumps(plain_result(result))))


def test_what_a_run_leaves_is_the_same_to_the_last_bit(measured):
    for result in (measured, TWO):
        after = stored(result)
        assert plain_result(after) == plain_result(result)
        for layout in LAYOUTS:
            for data_format in ("csv", "json"):
                assert text_of([after], data_format, layout=layout) == text_of([result], data_format, layout=layout)
        for board, other in zip(result.boards, after.boards, strict=True):
            assert type(other) is type(board)
            assert other.flags == board.flags
            assert all(type(flag) is Flag for flag in other.flags)
            for pose, again in zip(board.candidates, other.candidates, strict=True):
                assert np.array_equal(pose.rotation, again.rotation)
                assert np.array_equal(pose.covariance, again.covariance)
                assert np.array_equal(pose.terms.image, again.terms.image)
            assert [fit.sigmas for fit in board.circles] == [fit.sigmas for fit in other.circles]


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("chosen", 3),
        ("instance", -1),
        ("ambiguity", 2.0),
        ("growth", math.nan),
        ("flags", ["odd"]),
        ("circles_in_layout", "12"),
        ("candidates", []),
        ("candidates.0.rotation", [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]]),
        ("candidates.0.rotation", [[2.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
        ("candidates.0.translation", [1.0, 2.0]),
        ("candidates.0.covariance", [[1.0]]),
        ("candidates.0.terms.image", [[1.0]]),
        ("candidates.0.odd", 1),
        ("circles.0.residual_px", [1.0]),
        ("circles.0.is_used", 1),
    ],
)
def test_values_of_a_board_that_cannot_be_are_refused(path, value):
    plain = json.loads(json.dumps(plain_result(TWO)))
    *way, last = path.split(".")
    place = plain["boards"][0]
    for key in way:
        place = place[int(key) if key.isdigit() else key]
    place[last] = value
    with pytest.raises(ValueError, match=r".*"):
        restored_result(plain)


def test_parquet_has_the_columns_with_types(tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    with (tmp_path / "t.parquet").open("wb") as handle:
        write_parquet([TWO, FAILED], handle, layout="boards")
    table = parquet.read_table(tmp_path / "t.parquet")
    assert table.column_names == list(BOARD_COLUMNS)
    assert table.schema.metadata[b"schema"] == b"circlepose.boards/1"
    types = {name: str(table.schema.field(name).type) for name in BOARD_COLUMNS}
    assert (types["circles_used"], types["qw"], types["flags"], types["chosen"]) == (
        "int32",
        "double",
        "string",
        "bool",
    )
    assert table.column("x_mm").to_pylist() == [*[-80.0, -80.0, -79.0], None]


def test_rows_and_data_frames_have_the_layout_asked_for():
    rows = circlepose.to_rows([TWO, FAILED], layout="boards")
    assert all(tuple(row) == BOARD_COLUMNS for row in rows)
    assert rows[0]["x_mm"] == -80.0
    assert rows[-1] == dict.fromkeys(BOARD_COLUMNS) | {"image": "bad.png", "status": "layout_mismatch"}
    with pytest.raises(ArgumentError, match=r"^layout: expected"):
        circlepose.to_rows(TWO, layout="table1")  # type: ignore[arg-type]
    pytest.importorskip("pandas")
    frame = circlepose.to_dataframe([TWO, FAILED], layout="boards")
    assert tuple(frame.columns) == BOARD_COLUMNS
    assert str(frame.circles_used.dtype) == "Int64"


def test_a_circle_that_faces_away_has_the_covariance_of_the_normal_that_is_written():
    """Its normal is turned towards the camera, and so are the vectors that its tilts turn it to."""
    seen = POINTS_MM[[0, 1, 2, 3, 4, 5, 6, 8]]
    image = discs_image(seen @ ROTATION.T + TRANSLATION, -ROTATION[:, 2], CAMERA)
    circles = [
        {"name": f"c{number}", "x_mm": x, "y_mm": y, "z_mm": z, "radius_mm": RADIUS_MM, "normal": [0, 0, -1]}
        for number, (x, y, z) in enumerate(seen.tolist())
    ]
    away = {"name": "back", "x_mm": 90, "y_mm": 60, "z_mm": 20, "radius_mm": RADIUS_MM, "normal": [0, 0.6, 0.8]}
    circles.append(away)
    target = target_from_mapping({"kind": "board", "circles": circles}, "t")
    result = circlepose.estimate(image, CAMERA, target, name="a.png")
    pose = result.boards[0].pose
    back = next(circle for circle in result.circles if circle.circle == "back").candidates[0]
    assert back.normal @ back.center < 0.0
    arm = pose.rotation @ [90.0, 60.0, 20.0]
    np.testing.assert_allclose(back.center, arm + pose.translation)
    turns = np.eye(3)
    moves = np.zeros((5, 6))
    moves[:3, :3] = np.eye(3)
    moves[:3, 3:] = np.cross(turns, arm).T
    moves[3:, 3:] = back.tilt_axes @ np.cross(turns, back.normal).T
    np.testing.assert_allclose(back.covariance, moves @ pose.covariance @ moves.T, rtol=1e-6, atol=1e-15)
