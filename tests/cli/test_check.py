from __future__ import annotations

import csv
import io
import json
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from circlepose.io.tables.paper_layouts import write_results
from circlepose.results import ImageResult, Status
from circlepose_cli.app import main
from tests.support.discs import CENTER_MM, NORMAL, disc_folder, made_circle, made_result

COLUMNS = (
    "image,instance,circle,method,change,tolerances,position_difference_mm,orientation_difference_deg,"
    "status,reference_status"
)
TRUTH = "image,instance,circle,center_x_mm,center_y_mm,center_z_mm,normal_x,normal_y,normal_z\n"


@pytest.fixture
def run(capsys):
    """Run a command line; returns exit code, standard output and standard error."""

    def run_it(*args):
        code = main(["check", *(str(arg) for arg in args)])
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return run_it


def results(shift=0.0, images=("a.png", "b.png")):
    return [made_result(made_circle(center=CENTER_MM + np.array([0.0, 0.0, shift])), image=image) for image in images]


def written(path, made, data_format="csv"):
    with path.open("w") as handle:
        write_results(made, handle, data_format=data_format, layout="poses")
    return path


@pytest.fixture
def baseline(tmp_path):
    return written(tmp_path / "baseline.csv", results())


@pytest.fixture
def truth(tmp_path):
    numbers = ",".join(map(repr, (*CENTER_MM.tolist(), *NORMAL.tolist())))
    path = tmp_path / "truth.csv"
    path.write_text(TRUTH + f"a.png,0,disc,{numbers}\nb.png,0,disc,{numbers}\n")
    return path


def rows_of(text):
    return list(csv.DictReader(io.StringIO(text)))


@pytest.mark.parametrize("data_format", ["csv", "json", "jsonl"])
@pytest.mark.parametrize("reference", ["baseline", "truth"])
def test_poses_that_agree(run, tmp_path, data_format, reference, request):
    poses = written(tmp_path / "poses", results(0.1), data_format)
    code, out, err = run(poses, "--against", request.getfixturevalue(reference))
    assert (code, out) == (0, COLUMNS + "\n")
    summary = "2 circles compared; all within 0.5 mm and 0.1 deg; largest difference 0.1 mm, "
    assert err.startswith(summary)


def test_poses_that_moved_are_rows_with_code_4(run, tmp_path, baseline):
    poses = written(tmp_path / "poses.csv", [*results(1.0, ["b.png"]), *results(0.1, ["a.png"])])
    code, out, err = run(poses, "--against", baseline)
    assert code == 4
    (row,) = rows_of(out)
    assert (row["image"], row["instance"], row["circle"], row["change"]) == ("b.png", "0", "disc", "moved")
    assert float(row["tolerances"]) == pytest.approx(2.0, abs=1e-5)
    assert float(row["position_difference_mm"]) == pytest.approx(1.0, abs=1e-5)
    assert "2 circles compared; outside 0.5 mm and 0.1 deg: 1 moved; largest difference 1 mm" in err


def test_tolerances_are_those_given(run, tmp_path, baseline):
    poses = written(tmp_path / "poses.csv", results(1.0))
    assert run(poses, "--against", baseline, "--position-mm", "1.1")[0] == 0
    assert run(poses, "--against", baseline, "--position-mm", "inf")[0] == 0
    moved = written(tmp_path / "moved.csv", results(0.001))
    assert run(moved, "--against", baseline, "--position-mm", "0")[0] == 4
    assert run(moved, "--against", baseline, "--normal-deg", "0")[0] == 0


def test_missing_extra_and_failed_images_are_told(run, tmp_path, baseline):
    failed = ImageResult("b.png", Status.NO_CIRCLE, "nothing")
    poses = written(tmp_path / "poses.csv", [*results(images=["a.png", "new.png"]), failed])
    code, out, err = run(poses, "--against", baseline)
    assert code == 4
    assert [(row["image"], row["change"], row["status"], row["reference_status"]) for row in rows_of(out)] == [
        ("b.png", "missing", "no_circle", "ok"),
        ("new.png", "extra", "ok", ""),
    ]
    assert "1 missing, 1 extra" in err


def test_a_failure_that_the_baseline_has_is_no_difference(run, tmp_path):
    made = [*results(), ImageResult("c.png", Status.NO_CIRCLE, "nothing")]
    poses, baseline = (written(tmp_path / name, made) for name in ("poses.csv", "baseline.csv"))
    assert run(poses, "--against", baseline)[0] == 0


def test_best_compares_the_nearest_candidate(run, tmp_path, truth):
    text = written(tmp_path / "poses.csv", results()).read_text()
    swapped = text.replace("true", "?").replace("false", "true").replace("?", "false")
    poses = tmp_path / "swapped.csv"
    poses.write_text(swapped)
    code, out, _ = run(poses, "--against", truth)
    assert code == 4
    assert [row["change"] for row in rows_of(out)] == ["flipped", "flipped"]
    assert run(poses, "--against", truth, "--candidate", "best")[0] == 0


def test_poses_on_standard_input(run, baseline, monkeypatch):
    monkeypatch.setattr(sys, "stdin", SimpleNamespace(buffer=io.BytesIO(baseline.read_bytes())))
    assert run("-", "--against", baseline)[0] == 0
    monkeypatch.setattr(sys, "stdin", SimpleNamespace(buffer=io.BytesIO(b"")))
    code, _, err = run("-", "--against", baseline)
    assert (code, err) == (2, "circlepose: standard input: is empty; expected a table of poses.\n")


def test_json_holds_all_that_was_found(run, tmp_path, baseline):
    poses = written(tmp_path / "poses.csv", results(1.0, ["a.png"]))
    code, out, _ = run(poses, "--against", baseline, "--format", "json")
    document = json.loads(out)
    assert code == 4
    assert document["schema"] == "circlepose.check/1"
    assert document["tolerance"] == {"position_mm": 0.5, "normal_deg": 0.1}
    assert document["compared"] == 1
    assert document["largest_position_mm"] == pytest.approx(1.0, abs=1e-5)
    assert [each["change"] for each in document["differences"]] == ["missing", "moved"]
    _, lines, _ = run(poses, "--against", baseline, "--format", "jsonl")
    assert [json.loads(line) for line in lines.splitlines()] == [
        {"schema": "circlepose.check/1", **each} for each in document["differences"]
    ]


def test_a_table_for_people(run, tmp_path, baseline):
    poses = written(tmp_path / "poses.csv", results(1.0, ["a.png", "\x1b[31m.png"]))
    code, out, _ = run(poses, "--against", baseline, "--format", "table")
    assert code == 4
    assert "a.png" in out
    assert "2.00" in out
    assert "\\x1b[31m.png" in out
    assert "\x1b" not in out
    assert run(baseline, "--against", baseline, "--format", "table")[1] == ""


def test_names_that_a_spreadsheet_would_run_get_an_apostrophe(run, tmp_path, baseline):
    poses = written(tmp_path / "poses.csv", results(images=["=1+a.png", "a.png", "b.png"]))
    assert rows_of(run(poses, "--against", baseline)[1])[0]["image"] == "'=1+a.png"


def test_quiet_says_nothing_but_what_moved(run, tmp_path, baseline):
    poses = written(tmp_path / "poses.csv", results(1.0))
    code, out, err = run(poses, "--against", baseline, "-q")
    assert (code, len(rows_of(out)), err) == (4, 2, "")


def test_how_images_were_matched_is_told(run, tmp_path, baseline):
    poses = written(tmp_path / "poses.csv", results(images=["x/a.png", "x/b.png"]))
    code, _, err = run(poses, "--against", baseline)
    assert code == 0
    assert (
        err.splitlines()[0] == "no image has the same path in both; images are matched by file name, without folders"
    )


def test_update_makes_the_poses_the_baseline(run, tmp_path, baseline):
    poses = written(tmp_path / "poses.csv", results(1.0))
    code, out, err = run(poses, "--against", baseline, "--update")
    assert code == 0
    assert len(rows_of(out)) == 2
    assert err.splitlines()[-1] == f"{baseline}: now holds 2 circles of {poses}"
    assert baseline.read_bytes() == poses.read_bytes()
    assert run(poses, "--against", baseline)[0] == 0


def test_update_makes_a_baseline_that_is_not_there(run, tmp_path, baseline):
    new = tmp_path / "new.csv"
    assert run(baseline, "--against", new, "--update")[:2] == (0, "")
    assert new.read_bytes() == baseline.read_bytes()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "truth.csv is a truth, without the columns method and solution, and is never overwritten"),
        (b"", "truth.csv: is empty"),
        (b"my notes", "truth.csv: has no column image"),
    ],
)
def test_update_overwrites_nothing_but_a_baseline(run, truth, baseline, content, message):
    if content is not None:
        truth.write_bytes(content)
    before = truth.read_bytes()
    code, out, err = run(baseline, "--against", truth, "--update")
    assert (code, out) == (2, "")
    assert message in err
    assert truth.read_bytes() == before


def test_update_keeps_the_form_of_the_baseline(run, tmp_path, baseline):
    poses = written(tmp_path / "poses.json", results(), "json")
    before = baseline.read_bytes()
    code, _, err = run(poses, "--against", baseline, "--update")
    assert code == 2
    assert "baseline.csv is csv and" in err
    assert baseline.read_bytes() == before


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (["poses.csv"], "--against"),
        (["gone.csv", "--against", "poses.csv"], "gone.csv: there is no such file; check the path."),
        (["poses.csv", "--against", "gone.csv"], "gone.csv: there is no such file; check the path."),
        (["poses.csv", "--against", "folder"], "folder: is a folder; give the file in it."),
        (["folder/..", "--against", "poses.csv"], "is a folder"),
        (["empty.csv", "--against", "poses.csv"], "empty.csv: is empty"),
        (["poses.csv", "--against", "cut.csv"], "cut.csv: has no column normal_z; expected a table in the layout"),
        (["poses.csv", "--against", "poses.csv", "--position-mm", "-1"], "--position-mm: expected a tolerance"),
        (["poses.csv", "--against", "poses.csv", "--normal-deg", "nan"], "--normal-deg: expected a tolerance"),
        (["poses.csv", "--against", "poses.csv", "--normal-deg", "x"], "--normal-deg"),
        (["poses.csv", "--against", "poses.csv", "--candidate", "worst"], "chosen"),
    ],
)
def test_what_cannot_be_compared_ends_with_code_2(run, tmp_path, monkeypatch, args, message):
    monkeypatch.chdir(tmp_path)
    poses = written(tmp_path / "poses.csv", results())
    (tmp_path / "folder").mkdir()
    (tmp_path / "empty.csv").touch()
    (tmp_path / "cut.csv").write_text(poses.read_text().replace("normal_z", "normal_w"))
    code, out, err = run(*args)
    assert (code, out) == (2, "")
    assert message in err
    assert "Traceback" not in err


def test_what_estimate_writes_agrees_with_itself(run, tmp_path, capsys):
    folder = disc_folder(tmp_path / "imgs")
    poses = tmp_path / "poses.csv"
    assert main(["estimate", str(folder), "-o", str(poses)]) == 0
    capsys.readouterr()
    assert run(poses, "--against", poses, "--position-mm", "0", "--normal-deg", "0")[0] == 0


@pytest.mark.parametrize("name", ["poses.csv.gz", "poses.tsv.gz", "poses.json.gz", "poses.jsonl.gz"])
def test_gzipped_tables_are_read(run, tmp_path, name):
    table = tmp_path / name
    assert main(["estimate", str(disc_folder(tmp_path / "imgs", 1)), "-o", str(table)]) == 0
    assert run(table, "--against", table)[0] == 0
    damaged = tmp_path / "damaged"
    damaged.write_bytes(table.read_bytes()[:-9])
    code, _, err = run(damaged, "--against", table)
    assert code == 2
    assert "is gzipped and" in err


def test_parquet_is_named(run, tmp_path):
    table = tmp_path / "poses.parquet"
    table.write_bytes(b"PAR1\x00\x01PAR1")
    code, _, err = run(table, "--against", table)
    assert code == 2
    assert "is Parquet; expected csv" in err
