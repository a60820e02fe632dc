"""Target files of boards: read, written, and what is refused."""

from __future__ import annotations

import json

import numpy as np
import pytest

from circlepose.errors import TargetError
from circlepose.io.target_file import read_target, target_from_mapping, target_to_mapping
from circlepose.targets.target import Target
from tests.support.boards import grid

GRID = "kind: board\nradius_mm: 8\ngrid: {pattern: symmetric, rows: 3, columns: 4, spacing_mm: 30}\n"
LIST = (
    "kind: board\ncircles:\n- {name: a, x_mm: 0, y_mm: 0, radius_mm: 10}\n"
    "- {name: b, x_mm: 60, y_mm: 0, z_mm: 5, radii_mm: [9, 4], normal: [0, 3, -4]}\n"
)


def test_a_grid_is_read():
    text = GRID + "marks: [{at: [0, 3], radius_mm: 4}, {at: [2, 0], radii_mm: [8, 5]}]\nomit: [[1, 1]]\ncount: all\n"
    target = read_target(text.encode())
    assert target.kind == "board"
    assert target.count is None
    assert target.layout == grid(
        "symmetric", 3, 4, 30.0, 8.0, marks={(0, 3): (4.0,), (2, 0): (8.0, 5.0)}, omit=[(1, 1)]
    )


def test_the_kind_follows_from_the_grid():
    assert read_target(GRID.replace("kind: board\n", "").encode()).kind == "board"


def test_a_list_is_read():
    target = read_target(LIST.encode())
    assert target.layout.names == ("a", "b")
    assert target.layout.circles[1].center_mm == (60.0, 0.0, 5.0)
    assert target.layout.circles[1].normal == pytest.approx((0.0, 0.6, -0.8))
    assert target.layout.circles[1].radii_mm == (9.0, 4.0)


def test_a_list_may_be_a_csv_file_beside_the_target(tmp_path):
    (tmp_path / "holes.csv").write_text("name,x_mm,y_mm,radius_mm\na,0,0,10\nb,60,0,9\n", encoding="utf-8")
    (tmp_path / "target.yaml").write_text("kind: board\ncircles: holes.csv\n", encoding="utf-8")
    layout = read_target(tmp_path / "target.yaml").layout
    assert layout.names == ("a", "b")
    assert layout.radius_mm.tolist() == [10.0, 9.0]


@pytest.mark.parametrize("separator", [",", ";", "\t", " ; "])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_the_columns_of_a_list_are_separated_by_commas_semicolons_or_tabs(tmp_path, separator, end):
    rows = (
        ("name", "x_mm", "y_mm", "z_mm", "radius_mm", "comment", "note"),
        ("a", "0", "0.5", "", "10", "bored, then reamed" if separator.strip() == ";" else "bored; reamed", ""),
        ("", "", "", "", "", "", ""),
        ("b", "-60", "1e1", "5", "9", "", "cast"),
    )
    (tmp_path / "holes.csv").write_bytes(end.join(["", *(separator.join(row) for row in rows), ""]).encode())
    (tmp_path / "target.yaml").write_text("kind: board\ncircles: holes.csv\n", encoding="utf-8")
    layout = read_target(tmp_path / "target.yaml").layout
    assert layout.names == ("a", "b")
    assert layout.centers_mm.tolist() == [[0.0, 0.5, 0.0], [-60.0, 10.0, 5.0]]
    assert layout.radius_mm.tolist() == [10.0, 9.0]


def test_a_list_in_quotes_is_read(tmp_path):
    text = '"name";"x_mm";"y_mm";"radius_mm"\n"a; b";"0";"0";"3"\n"c";"20";"0";"3"\n'
    (tmp_path / "holes.csv").write_text(text, encoding="utf-8")
    (tmp_path / "target.yaml").write_text("kind: board\ncircles: holes.csv\n", encoding="utf-8")
    assert read_target(tmp_path / "target.yaml").layout.names == ("a; b", "c")


@pytest.mark.parametrize("text", [GRID, GRID + "marks: [{at: [0, 3], radii_mm: [8, 5]}]\nomit: [[1, 1]]\n", LIST])
def test_what_is_written_is_read_back_equal(text):
    target = read_target(text.encode())
    assert target_from_mapping(target_to_mapping(target), "again") == target


def test_the_shape_that_a_calibration_found(tmp_path):
    shape = {
        "schema": "circlepose.calibration/1",
        "board": {
            "shape": "free",
            "radius_scale": 1.01,
            "offsets_mm": [{"name": "r0c1", "x": 0.1, "y": 0.0, "z": -0.3}],
        },
    }
    (tmp_path / "shape.json").write_text(json.dumps(shape), encoding="utf-8")
    (tmp_path / "target.yaml").write_text(GRID + "shape_file: shape.json\n", encoding="utf-8")
    target = read_target(tmp_path / "target.yaml")
    plain = read_target(GRID.encode())
    assert np.allclose(target.layout.centers_mm[1] - plain.layout.centers_mm[1], [0.1, 0.0, -0.3])
    assert np.allclose(target.layout.radius_mm, 8.08)
    assert target.layout.grid == plain.layout.grid
    assert isinstance(target, Target)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("kind: board\nradius_mm: 8\n", "grid, circles: both are missing; a board needs one of them"),
        (
            GRID + "circles: [{x_mm: 0, y_mm: 0}]\n",
            "grid, circles: both are given; a board has either a grid or a list of its circles: remove one.",
        ),
        (GRID.replace("radius_mm: 8\n", ""), "radius_mm: is missing"),
        (
            GRID.replace("symmetric", "square"),
            "grid.pattern: expected one of symmetric, asymmetric, hexagonal, got 'square'",
        ),
        (
            GRID.replace("pattern: symmetric, ", ""),
            "<bytes>: grid.pattern: is missing; expected one of symmetric, asymmetric, hexagonal.",
        ),
        (
            GRID.replace("symmetric", ""),
            "grid.pattern: has no value; expected one of symmetric, asymmetric, hexagonal.",
        ),
        (GRID.replace("rows: 3, ", ""), "grid.rows: is missing; expected a whole number of at least 1."),
        (GRID.replace("columns: 4, ", ""), "grid.columns: is missing; expected a whole number of at least 1."),
        (GRID.replace(", spacing_mm: 30", ""), "grid.spacing_mm: is missing; expected one number, the distance"),
        (GRID + "marks: [{radius_mm: 4}]\n", "marks[0].at: is missing; expected [row, column]"),
        (LIST.replace("y_mm: 0, r", "r"), "circles[0].y_mm: is missing; expected one number, in mm."),
        (
            LIST.replace("radius_mm: 10", "diameter_mm: 20"),
            "<bytes>: circles[0].diameter_mm: the file takes a radius in mm; write radius_mm: 10.",
        ),
        (
            GRID + "marks: [{at: [0, 3], diameter_mm: 5}]\n",
            "marks[0].diameter_mm: the file takes a radius in mm; write radius_mm: 2.5.",
        ),
        (LIST.replace("radius_mm: 10", "radius: 10"), "circles[0].radius: does not say its unit; write radius_mm"),
        (GRID.replace("rows: 3", "row: 3"), "grid.row: is no known key; did you mean rows?"),
        (GRID.replace("spacing_mm: 30", "spacing_mm: 12"), "overlap"),
        (GRID + "marks: [{at: [0, 9], radius_mm: 4}]\n", "marks: expected [row, column]"),
        (
            GRID + "marks: [{at: [0, 3], radius_mm: 8}]\n",
            "<bytes>: marks: circle [0, 3] has the grid's own radius of 8 mm and so marks nothing; give",
        ),
        (GRID + "radii_mm: [8, 5]\n", "radius_mm, radii_mm"),
        (GRID + "side: back\n", "side: is of a list"),
        (GRID + "depth_range_mm: [100, 200]\n", "depth_range_mm"),
        (GRID + "facing: up\n", "facing: is a hint for lone circles"),
        (GRID.replace("kind: board", "kind: circle"), "grid: goes with kind: board"),
        (LIST.replace("radius_mm: 10", "radius_mm: 0"), "positive radius"),
        (LIST.replace(", radius_mm: 10", ""), "radius_mm: is missing"),
        (
            LIST.replace("x_mm: 60", "x_mm: .nan"),
            "circles[1].x_mm: expected one number, in mm; .nan is not a finite number.",
        ),
        (
            LIST.replace("y_mm: 0, r", "y_mm: -.inf, r"),
            "circles[0].y_mm: expected one number, in mm; -.inf is not a finite number.",
        ),
        (
            LIST.replace("radius_mm: 10", "radius_mm: .inf"),
            "circles[0].radius_mm: expected one number, its radius in mm; .inf is not a finite number.",
        ),
        (LIST.replace("[9, 4]", "[9, .nan]"), "such as [35, 20]; .nan is not a finite number."),
        (LIST.replace("[0, 3, -4]", "[0, .inf, 1]"), "it is seen; .inf is not a finite number."),
        (LIST.replace("x_mm: 60", "x_mm: far"), "circles[1].x_mm: expected one number, in mm, got 'far'"),
        (LIST.replace("x_mm: 60", "x: 60"), "circles[1].x: is no known key; the keys are name, x_mm,"),
        (
            GRID + "marks: [{at: [0, 3], radius_mm: .nan}]\n",
            "marks[0].radius_mm: expected one number, its radius in mm; .nan is",
        ),
        (LIST.replace("[0, 3, -4]", "[0, 0, 0]"), "normal: expected a direction"),
        (LIST.replace("name: b", "name: a"), "named 'a'"),
        (LIST + "omit: [[0, 0]]\n", "go with a grid"),
        ("kind: board\ncircles: none.csv\n", "none.csv"),
        (GRID + "shape_file: none.json\n", "none.json"),
    ],
)
def test_what_is_refused_names_the_key(text, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(TargetError) as caught:
        read_target(text.encode())
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("name,x,y_mm\na,0,0\n", "column 'x' is not known"),
        ("name,y_mm\na,0\n", "column x_mm is missing"),
        ("name,x_mm,y_mm,radius_mm\na,0,zero,3\n", "line 2: y_mm: expected a number"),
        ("name,x_mm,y_mm,radius_mm\na,nan,0,3\n", "line 2: x_mm: expected a number; nan is not a finite number."),
        (
            "name,x_mm,y_mm,radius_mm\na,0,0,1e999\n",
            "line 2: radius_mm: expected a number; 1e999 is not a finite number",
        ),
        (
            "name,x_mm,y_mm,diameter_mm\na,0,0,8\n",
            "the file takes a radius in mm; name the column radius_mm and write half",
        ),
        ("name,x_mm,y_mm,radius_cm\na,0,0,8\n", "name the column radius_mm and write 10 times each value."),
        ("name,x_mm,y_mm,radius\na,0,0,8\n", "column 'radius' does not say its unit; name it radius_mm"),
        ("name,x_mm,y_mm,Z_mm\na,0,0,8\n", "column 'Z_mm' is not known; did you mean z_mm?"),
        (
            "name,x_mm,y_mm,color\na,0,0,8\n",
            "ny, nz, and comment and note for people; commas, semicolons or tabs separate",
        ),
        ("name x_mm y_mm\na 0 0\n", "column 'name x_mm y_mm' is not known; the columns are name, x_mm,"),
        ("x_mm,y_mm,x_mm\n0,0,1\n", "column 'x_mm' is there twice"),
        ("name,x_mm,y_mm,radius_mm\na,1,5,0,3\n", "line 2: has 5 values for 4 columns; numbers have a decimal point"),
        ("name;x_mm;y_mm;radius_mm\na;1,5;0;3\n", "line 2: x_mm: expected a number with a decimal point, got '1,5'."),
        ("x_mm,y_mm,radius_mm\n0,0,3\n\n5,,3\n", "line 4: y_mm: is missing; expected one number, in mm."),
        (f"x_mm,y_mm,comment\n0,0,{'a' * 140_000}\n", "line 2: is no CSV (field larger than field limit"),
        ("name,x_mm,y_mm,radius_mm,nx\na,0,0,3,-inf\n", "line 2: nx: expected a number; -inf is not a finite number"),
    ],
)
def test_a_csv_file_that_is_none_of_circles(text, words, tmp_path):
    (tmp_path / "holes.csv").write_text(text, encoding="utf-8")
    (tmp_path / "target.yaml").write_text("kind: board\ncircles: holes.csv\n", encoding="utf-8")
    with pytest.raises(TargetError) as caught:
        read_target(tmp_path / "target.yaml")
    assert words in str(caught.value)
    assert str(caught.value).count("target.yaml") == 1


@pytest.mark.parametrize(
    "text", ["[]", "{", '{"schema": "circlepose.poses/1"}', '{"schema": "circlepose.calibration/1"}']
)
def test_a_shape_file_that_is_none(text, tmp_path):
    (tmp_path / "shape.json").write_text(text, encoding="utf-8")
    (tmp_path / "target.yaml").write_text(GRID + "shape_file: shape.json\n", encoding="utf-8")
    with pytest.raises(TargetError, match=r"shape\.json"):
        read_target(tmp_path / "target.yaml")
