"""Boards from the command line: which layout, in which forms, what is refused, and what the closing lines say."""

from __future__ import annotations

import csv
import io
import json

import pytest

from circlepose.io.tables.board_rows import BOARD_COLUMNS
from circlepose.io.tables.columns import COLUMNS
from circlepose.io.tables.pair_rows import PAIR_COLUMNS
from circlepose.results import Flag, ImageResult, Status
from circlepose_cli.console.board_remarks import BoardTally
from circlepose_cli.console.progress import Reporter
from tests.support.board_results import (
    BOARD_YAML,
    POINTS_MM,
    TABLE_HEADER,
    board_folder,
    made_board,
    made_board_result,
)
from tests.support.boards import grid, plate
from tests.support.discs import disc_folder
from tests.support.processes import run as run_process
from tests.support.processes import shell

TURNED = "of 2 boards roll_ambiguous: the layout looks the same when it is turned; if the turn matters, put a circle"


@pytest.fixture
def boards(tmp_path):
    return board_folder(tmp_path / "boards")


def rows(text, delimiter=","):
    return list(csv.DictReader(io.StringIO(text), delimiter=delimiter))


def header(text):
    return tuple(text.splitlines()[0].split(","))


def test_a_board_has_its_own_layout_unless_another_is_asked_for(run, boards):
    code, out, err = run("estimate", boards)
    assert code == 0
    assert header(out) == BOARD_COLUMNS
    assert [(row["image"], row["status"], row["circles_used"]) for row in rows(out)] == [
        ("board0.png", "ok", "12"),
        ("board1.png", "ok", "12"),
    ]
    assert f"2 {TURNED}" in err
    assert err.endswith("2 measured, 2 boards, 0 failed\n")
    assert run("estimate", boards, "--layout", "boards")[1] == out
    code, out, _ = run("estimate", boards, "--layout", "poses")
    assert (code, header(out)) == (0, COLUMNS)
    assert [row["circle"] for row in rows(out)][:5] == ["r0c0", "r0c1", "r0c2", "r0c3", "r1c0"]
    code, out, err = run("estimate", boards, "--layout", "pairs")
    assert "are those of its layout, not measured" in err
    assert (code, header(out), len(rows(out))) == (0, PAIR_COLUMNS, 2 * 66)
    assert rows(out)[0] == {
        "image": "board0.png",
        "first": "r0c0",
        "second": "r0c1",
        "distance_mm": "60.000000",
        "sigma_mm": "0.000000",
        "angle_deg": "0.000000",
        "sigma_deg": "0.000000",
    }


def test_each_form_holds_the_same(run, boards, tmp_path):
    whole = rows(run("estimate", boards)[1])
    assert rows(run("estimate", boards, "--format", "tsv")[1], "\t") == whole
    document = json.loads(run("estimate", boards, "--format", "json")[1])
    assert document["schema"] == "circlepose.boards/1"
    lines = [json.loads(line) for line in run("estimate", boards, "--format", "jsonl")[1].splitlines()]
    assert [line["boards"] for line in lines] == [image["boards"] for image in document["images"]]
    found = document["images"][0]["boards"][0]["solutions"][0]
    assert f"{found['x_mm']:.6f}" == whole[0]["x_mm"]
    table = run("estimate", boards, "--format", "table")[1]
    assert table.splitlines()[0].split() == TABLE_HEADER
    assert "12/12" in table
    parquet = pytest.importorskip("pyarrow.parquet")
    for _ in range(2):  # the second time it replaces a file of its own
        assert run("estimate", boards, "-o", tmp_path / "t.parquet")[0] == 0
    assert tuple(parquet.read_table(tmp_path / "t.parquet").column_names) == BOARD_COLUMNS


@pytest.mark.parametrize("args", [(), ("--layout", "pairs"), ("--columns", "image,qw,sigma_rx_deg")])
def test_a_table_of_ours_is_replaced(run, boards, tmp_path, args):
    for _ in range(2):
        assert run("estimate", boards, "-o", tmp_path / "t.csv", *args)[0] == 0


def test_columns_and_rows_may_be_chosen(run, boards):
    whole = rows(run("estimate", boards)[1])
    out = run("estimate", boards, "--columns", "qz,image", "--chosen-only")[1]
    assert header(out) == ("qz", "image")
    assert rows(out) == [{name: row[name] for name in ("qz", "image")} for row in whole]
    assert header(run("estimate", boards, "--layout", "pairs", "--columns", "distance_mm")[1]) == ("distance_mm",)
    table = run("estimate", boards, "--columns", "image,qw,flags", "--format", "table")[1]
    assert table.splitlines()[0].split() == ["image", "qw", "flags"]


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (["--layout", "table1"], "target.yaml is a board: give --layout boards, poses or pairs."),
        (["--layout", "table2"], "--layout table2: shows lone circles and ring targets;"),
        (["--reference", "camera.yaml"], "--reference: goes with --layout table2; circlepose check compares whole"),
        (
            ["--method", "fu-zhou"],
            "--method: a board's pose is fitted to the rims of all its circles; leave out",
        ),
        (["--layout", "pairs", "--method", "all"], "--layout pairs: goes with one --method, not with all."),
        (["--columns", "center_x_mm"], "--columns: there is no column 'center_x_mm'; did you mean x_mm"),
        (["--columns", "zzz"], "--columns: there is no column 'zzz'; the columns are: image, instance,"),
        (["--columns", "qw,zzz"], "--columns: there is no column 'zzz'; the columns are: image, instance,"),
        (["--columns", "qw,zzz"], "settled_by; of boards also: x_mm, y_mm, z_mm, qw,"),
        (
            ["--columns", "qw,center_x_mm"],
            "--columns: there is no column 'center_x_mm'; did you mean x_mm? the columns are: image,",
        ),
        (
            ["--columns", "zzz,qw,rms,@"],
            "--columns: there are no columns 'zzz', 'rms', '@'; did you mean rms_px? the columns are: image,",
        ),
        (["--columns", "qw", "--format", "json"], "--columns: goes with csv, tsv, parquet and table; json always"),
        (["--layout", "pairs", "--columns", "qw"], "the columns are: image, first, second, distance_mm,"),
    ],
)
def test_what_a_board_cannot_be_asked_for_is_refused_in_a_sentence(run, boards, args, message):
    code, out, err = run("estimate", boards, *args)
    assert (code, out) == (2, "")
    assert message in err.splitlines()[-1]


def test_lone_circles_are_no_boards(run, folder):
    code, out, err = run("estimate", folder, "--layout", "boards")
    assert (code, out) == (2, "")
    assert "--layout boards: needs a target of kind board; " in err
    assert "target.yaml is of kind circle: give --layout poses or pairs." in err


def test_folders_of_boards_and_of_others_have_a_row_per_circle(run, boards, folder):
    code, out, err = run("estimate", boards, folder)
    assert (code, header(out)) == (0, COLUMNS)
    assert {row["circle"] for row in rows(out)} > {"disc", "r0c0"}
    assert "some targets are boards, others not: each circle has a row, as by --layout poses\n" in err


def test_of_a_stream_the_first_target_decides(boards, tmp_path):
    disc_folder(tmp_path / "discs", 1)
    names = [boards / "board0.png", boards / "board1.png", tmp_path / "discs" / "disc0.png"]
    done = run_process("estimate", "-", "-q", input="\n".join(map(str, names[:2])) + "\n")
    assert (done.returncode, header(done.stdout), len(rows(done.stdout))) == (0, BOARD_COLUMNS, 2)
    done = run_process("estimate", "-", "-q", input="\n".join(map(str, names)) + "\n")
    assert done.returncode == 2
    assert "is of kind circle, but the targets before were boards; give --layout poses." in done.stderr
    done = run_process("estimate", "-", "-q", input="\n".join(map(str, reversed(names))) + "\n")
    assert (done.returncode, header(done.stdout)) == (0, COLUMNS)


def test_another_board_is_a_mismatch_and_what_to_do_is_said(run, boards):
    (boards / "target.yaml").write_text(BOARD_YAML.replace("spacing_mm: 60", "spacing_mm: 100"))
    code, out, err = run("estimate", boards)
    assert code == 3
    assert [(row["image"], row["status"], row["x_mm"]) for row in rows(out)] == [
        ("board0.png", "layout_mismatch", ""),
        ("board1.png", "layout_mismatch", ""),
    ]
    assert (
        "2 images layout_mismatch: compare pattern, rows, columns and spacing_mm of the target with the board" in err
    )
    assert err.endswith("0 measured, 2 failed (layout_mismatch 2)\n")
    code, out, err = run("estimate", boards, "-q", "--format", "json")
    assert (code, err) == (3, "")
    assert [image["boards"] for image in json.loads(out)["images"]] == [[], []]


LIST_YAML = "kind: board\ncircles:\n" + "".join(
    f"- {{x_mm: {2.5 * x:g}, y_mm: {2.5 * y:g}, radius_mm: 20}}\n" for x, y, _ in POINTS_MM.tolist()
)


def test_of_a_list_there_are_no_rows_and_no_spacing_to_compare(run, boards):
    (boards / "target.yaml").write_text(LIST_YAML)
    code, _, err = run("estimate", boards)
    assert code == 3
    assert "2 images layout_mismatch: compare places and radii of the target's circles with the board, have" in err
    assert not any(word in err for word in ("spacing", "rows", "columns", "pattern", "mark"))


def test_a_run_is_resumed_with_its_boards(run, boards, tmp_path):
    file = tmp_path / "out.jsonl"
    (boards / "broken.png").write_bytes(b"junk")
    whole = run("estimate", boards, "--format", "jsonl")[1]
    done = shell(
        "$circlepose estimate $1 -o $2 & pid=$!\n"
        "for _ in $(seq 200); do [ -s $2.journal ] && break; sleep 0.05; done; kill -9 $pid; wait $pid\n"
        "$circlepose estimate $1 -o $2 --resume",
        boards,
        file,
    )
    assert done.returncode == 3
    assert file.read_text() == whole


def test_check_compares_boards(run, boards, tmp_path):
    assert run("estimate", boards, "-q", "-o", tmp_path / "a.csv")[0] == 0
    assert run("estimate", boards, "-q", "--format", "json", "-o", tmp_path / "a.json")[0] == 0
    code, out, err = run("check", tmp_path / "a.json", "--against", tmp_path / "a.csv")
    assert (code, len(rows(out))) == (0, 0)
    assert err.startswith("2 boards compared; all within 0.5 mm and 0.1 deg; largest difference ")
    text = (tmp_path / "a.csv").read_text()
    place = rows(text)[1]["z_mm"]
    before, _, after = text.rpartition(place)
    (tmp_path / "b.csv").write_text(f"{before}{float(place) + 2.0:.6f}{after}")
    for output_format in ("csv", "json", "table", "github"):
        code, out, err = run("check", tmp_path / "b.csv", "--against", tmp_path / "a.csv", "--format", output_format)
        assert code == 4
        assert "board1.png" in out
        assert "outside 0.5 mm and 0.1 deg: 1 moved; largest difference 2 mm" in err
    assert run("check", tmp_path / "b.csv", "--against", tmp_path / "a.csv", "--update")[0] == 0
    assert (tmp_path / "b.csv").read_text() == (tmp_path / "a.csv").read_text()
    assert run("estimate", boards, "-q", "--layout", "poses", "-o", tmp_path / "c.csv")[0] == 0
    code, _, err = run("check", tmp_path / "c.csv", "--against", tmp_path / "a.csv")
    assert code == 2
    assert f"--against: {tmp_path}/a.csv is of boards, {tmp_path}/c.csv of circles; make both by one --layout." in err
    assert run("estimate", boards, "-q", "--layout", "pairs", "-o", tmp_path / "d.csv")[0] == 0
    code, _, err = run("check", tmp_path / "d.csv", "--against", tmp_path / "a.csv")
    assert code == 2
    assert "is of the layout pairs, without poses; expected the layout poses or boards." in err


def said(*results, layout=None):
    tally = BoardTally()
    if layout is not None:
        tally.expect(layout)
    for result in results:
        tally.count(result)
    return list(tally.lines())


def test_each_doubt_has_a_sentence():
    plain = made_board_result(made_board(0, ()))
    assert said(plain, ImageResult("a.png", Status.NO_CIRCLE)) == []
    misfit = [made_board_result(made_board(0, (Flag.RADIUS_MISFIT,), growth=growth)) for growth in (0.02, 0.05, 0.03)]
    (line,) = said(plain, *misfit)
    assert line.startswith("3 of 4 boards radius_misfit: the circles are 3 % larger than radius_mm")
    (line,) = said(made_board_result(made_board(0, (Flag.RADIUS_MISFIT,), growth=-0.041)))
    assert line.startswith("1 of 1 board radius_misfit: the circles are 4.1 % smaller than radius_mm")
    (line,) = said(made_board_result(made_board(0, (Flag.AMBIGUOUS,))))
    assert line.startswith("1 of 1 board ambiguous: either tilt may be the right one")
    (line,) = said(ImageResult("a.png", Status.LAYOUT_MISMATCH))
    assert line.startswith("1 image layout_mismatch: ")


def test_of_a_list_each_doubt_speaks_of_what_a_list_has():
    layout = plate([(0.0, 0.0), (50.0, 0.0)])
    (line,) = said(made_board_result(made_board(0, (Flag.ROLL_AMBIGUOUS,))), layout=layout)
    assert line.endswith("put a circle of another size on the board and name it in the target")
    (line,) = said(made_board_result(made_board(0, (Flag.RADIUS_MISFIT,), growth=0.03)), layout=layout)
    assert line.endswith(
        "3 % larger than stated, measured by their distances, which were believed; measure both on the board"
    )
    (line,) = said(
        made_board_result(made_board(0, (Flag.ROLL_AMBIGUOUS,))), layout=grid("symmetric", 2, 2, 50.0, 8.0)
    )
    assert line.endswith("name it in marks of the target")


def test_ambiguous_boards_get_no_hints_of_lone_circles(capsys):
    reporter = Reporter(quiet=False, verbose=False)
    reporter.count(made_board_result(made_board(0, (Flag.AMBIGUOUS,))))
    reporter.summary(1, interrupted=False, resumable=False)
    err = capsys.readouterr().err
    assert "--facing" not in err
    assert err.splitlines()[-1] == "1 measured, 1 board, 0 failed"
    quiet = Reporter(quiet=True, verbose=False)
    quiet.count(made_board_result(made_board(0, (Flag.AMBIGUOUS,))))
    quiet.summary(1, interrupted=False, resumable=False)
    assert capsys.readouterr().err == ""
