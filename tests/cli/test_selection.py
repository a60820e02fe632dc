"""--chosen-only and --columns: which rows and columns are written, and what reads them again."""

from __future__ import annotations

import csv
import io
import json

import pytest

from circlepose.batch import measure
from circlepose.errors import OutputError
from circlepose.io.tables.columns import COLUMNS

CHOSEN = "image,instance,circle,method,solution,chosen,status,center_x_mm,center_y_mm,center_z_mm"


def rows(text, delimiter=","):
    return list(csv.DictReader(io.StringIO(text), delimiter=delimiter))


def test_only_the_chosen_candidates_are_written(run, folder):
    (folder / "zzz.png").write_bytes(b"junk")
    whole = rows(run("estimate", folder)[1])
    code, out, _ = run("estimate", folder, "--chosen-only")
    assert code == 3
    assert rows(out) == [row for row in whole if row["chosen"] != "false"]
    assert len(whole) == 5
    assert rows(run("estimate", folder, "--chosen-only", "--format", "tsv")[1], "\t") == rows(out)
    table = run("estimate", folder, "--chosen-only", "--format", "table")[1]
    assert "other" not in table
    assert "not_an_image" in table


@pytest.mark.parametrize("output_format", ["json", "jsonl"])
def test_json_has_the_chosen_solution_under_its_number(run, folder, output_format):
    def circles(*args):
        out = run("estimate", folder, "--format", output_format, *args)[1]
        images = json.loads(out)["images"] if output_format == "json" else map(json.loads, out.splitlines())
        return [circle for image in images for circle in image["circles"]]

    few, whole = circles("--chosen-only"), circles()
    assert [circle["solutions"] for circle in few] == [
        [solution for solution in circle["solutions"] if solution["chosen"]] for circle in whole
    ]
    assert {len(circle["solutions"]) for circle in whole} == {2}


def test_parquet_has_the_columns_and_rows_asked_for(run, folder, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    names = ["center_z_mm", "image", "instance"]
    for _ in range(2):  # the second time it replaces a file of its own
        code, _, _ = run(
            "estimate", folder, "--chosen-only", "--columns", ",".join(names), "-o", tmp_path / "t.parquet"
        )
        assert code == 0
    table = parquet.read_table(tmp_path / "t.parquet")
    assert table.column_names == names
    assert table.column("image").to_pylist() == ["disc0.png", "disc1.png"]


def test_columns_are_those_named_in_their_order(run, folder):
    whole = run("estimate", folder)[1]
    _, out, _ = run("estimate", folder, "--columns", "normal_z, image,chosen")
    assert out.splitlines()[0] == "normal_z,image,chosen"
    assert rows(out) == [{name: row[name] for name in ("normal_z", "image", "chosen")} for row in rows(whole)]
    assert run("estimate", folder, "--columns", ",".join(COLUMNS))[1] == whole
    table = run("estimate", folder, "--columns", "settled_by,center_z_mm", "--format", "table")[1]
    assert table.splitlines()[0].split() == ["settled_by", "center_z_mm"]


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (["center_z"], "--columns: there is no column 'center_z'; did you mean center_z_mm"),
        (["image,,chosen"], "--columns: there is no column ''; the columns are: image, instance,"),
        (["zzzzzz"], "settled_by; of boards also: x_mm,"),
        (["image,center_z,zzz"], "--columns: there are no columns 'center_z', 'zzz'; did you mean center_z_mm? the"),
        (["image,chosen,image"], "--columns: image is there twice."),
        (["image", "--format", "json"], "--columns: goes with csv, tsv, parquet and table; json always has all keys"),
        (["image", "--format", "jsonl"], "jsonl always has all keys"),
        (
            ["image", "--layout", "table1"],
            "--columns: goes with --layout poses, boards or pairs; table1 has the columns of its paper.",
        ),
    ],
)
def test_columns_that_cannot_be_written_are_refused_in_a_sentence(run, folder, args, message):
    code, out, err = run("estimate", folder, "--columns", *args)
    assert (code, out) == (2, "")
    assert message in err
    assert len(err.splitlines()) == 1


def test_an_interrupted_run_is_resumed_with_the_columns_of_now(run, folder, tmp_path, monkeypatch):
    file = tmp_path / "out.csv"

    def second_fails(item, options):
        if item.name == "disc1.png":
            raise OutputError("out.csv: cannot be written (No space left on device).")
        return measure_file(item, options)

    measure_file = measure.measure_file
    with monkeypatch.context() as patch:
        patch.setattr(measure, "measure_file", second_fails)
        assert run("estimate", folder, "-o", file)[0] == 2
    selection = ("--chosen-only", "--columns", "image,solution,center_x_mm")
    code, _, err = run("estimate", folder, "-o", file, "--resume", *selection)
    assert code == 0
    assert "1 finished before\n" in err
    assert file.read_text() == run("estimate", folder, *selection)[1]


def test_a_table_of_chosen_columns_is_ours_unless_it_may_be_a_truth(run, folder, tmp_path):
    file = tmp_path / "out.csv"
    args = ("estimate", folder, "-o", file, "--columns")
    assert [run(*args, "image,sigma_x_mm")[0] for _ in range(2)] == [0, 0]
    file.write_text("image,instance,center_x_mm,center_y_mm,center_z_mm\na.png,0,1,2,3\n")
    assert run(*args, "image,sigma_x_mm")[0] == 2
    file.write_text("image,sigma_x_mm,note\na.png,0.1,mine\n")
    assert run(*args, "image,sigma_x_mm")[0] == 2


def test_check_reads_the_chosen_candidates_alone(run, folder, tmp_path):
    whole, few = tmp_path / "whole.csv", tmp_path / "few.csv"
    run("estimate", folder, "-o", whole)
    run("estimate", folder, "--chosen-only", "-o", few)
    for poses, against in ((few, whole), (whole, few), (few, few)):
        assert run("check", poses, "--against", against)[0] == 0
    run(
        "estimate",
        folder,
        "--chosen-only",
        "--columns",
        f"{CHOSEN},normal_x,normal_y,normal_z",
        "-o",
        few,
        "--overwrite",
    )
    assert run("check", few, "--against", whole)[0] == 0


def test_check_says_which_columns_it_needs(run, folder, tmp_path):
    whole, few = tmp_path / "whole.csv", tmp_path / "few.csv"
    run("estimate", folder, "-o", whole)
    run("estimate", folder, "--columns", CHOSEN, "-o", few)
    code, _, err = run("check", few, "--against", whole)
    assert code == 2
    assert "If it was made with --columns, name these too: normal_x, normal_y, normal_z." in err
    few.write_text("image,chosen,center_x_mm\na.png,true,1\n")
    for poses, against in ((few, whole), (whole, few)):
        code, _, err = run("check", poses, "--against", against)
        assert code == 2
        assert "without --columns" in err


@pytest.mark.parametrize("header", ["image,chosen", "chosen", "image,circle,chosen", "score,chosen", "solution"])
def test_labels_of_the_user_are_kept(run, folder, tmp_path, header):
    labels = tmp_path / "labels.csv"
    labels.write_text(f"{header}\nmine\n")
    assert run("estimate", folder, "-o", labels)[0] == 2
    assert labels.read_text() == f"{header}\nmine\n"
