"""What is written, and where: the user's own files stay as they are, whatever is typed, planted or interrupted."""

from __future__ import annotations

import csv
import gzip
import json
import os
import signal
import subprocess
import time
from pathlib import Path, PurePath

import cv2
import pytest

from circlepose.errors import UsageError
from circlepose.io.images.reader import read_image
from circlepose.io.marks import bears_mark, is_drawn_file
from circlepose.io.output_conflicts import refuse_one_place
from circlepose.io.remote.images import RemoteFile
from tests.support.processes import COMMAND, SLOW, environment, shell

SCENE = """
camera: {fx: 400, fy: 400, cx: 79.5, cy: 59.5, image_size: [160, 120]}
background: {level: 200}
views:
  - image: a
    targets:
      - {kind: disc, center_mm: [0, 0, 200], normal: [0, 0, -1], radius_mm: 20, level: 40}
"""


def contents(folder):
    return {path: path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


FOREIGN = "exists and does not bear circlepose's mark; give another name, or --overwrite to replace it."


@pytest.mark.parametrize(
    "command",
    [
        ["estimate", "imgs", "-o", "imgs/disc0.png", "--format", "csv"],
        ["estimate", "imgs", "-o", "imgs/camera.yaml", "--format", "csv"],
        ["estimate", "imgs", "-o", "imgs/target.yaml", "--format", "csv"],
        ["estimate", "imgs", "-o", "notes.csv"],
        ["estimate", "imgs", "-o", "link.csv"],
        ["estimate", "imgs", "-o", "hard.csv"],
        ["estimate", "imgs", "--overlay", "pictures"],
        ["explain", "imgs/disc0.png", "--picture", "imgs/disc0.png"],
        ["explain", "imgs/disc0.png", "--picture", "imgs/disc1.png"],
        ["inspect", "imgs/disc0.png", "--picture", "imgs/disc0.png"],
        ["inspect", "imgs/disc0.png", "--picture", "pictures/disc1.png"],
        ["study", "table2", "-o", "notes.csv"],
        ["study", "table2", "-o", "imgs/disc0.png", "--format", "csv"],
    ],
    ids=" ".join,
)
def test_a_file_of_the_user_is_never_replaced(run, folder, tmp_path, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "notes.csv").write_text("precious\n")
    (tmp_path / "link.csv").symlink_to("notes.csv")
    os.link(tmp_path / "notes.csv", tmp_path / "hard.csv")
    (tmp_path / "pictures").mkdir()
    (tmp_path / "pictures" / "disc1.png").write_bytes((folder / "disc1.png").read_bytes())
    before = contents(tmp_path)
    code, out, err = run(*command)
    assert (code, out) == (2, "")
    assert FOREIGN in err or "would be overwritten, but it holds" in err
    assert err.count("circlepose: ") == 1
    assert contents(tmp_path) == before


@pytest.mark.parametrize(
    ("output", "what"),
    [
        ("imgs/disc0.png", "an image to measure"),
        ("imgs/camera.yaml", "the calibration"),
        ("imgs/target.yaml", "the target"),
        ("by_link.csv", "an image to measure"),
        ("by_hard_link.csv", "an image to measure"),
    ],
)
def test_what_is_read_is_not_written_even_with_overwrite(run, folder, tmp_path, monkeypatch, output, what):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "by_link.csv").symlink_to("imgs/disc1.png")
    os.link(folder / "disc1.png", tmp_path / "by_hard_link.csv")
    before = contents(tmp_path)
    code, out, err = run("estimate", "imgs", "-o", output, "--format", "csv", "--overwrite")
    assert (code, out) == (2, "")
    assert f"{output}: would be overwritten, but it holds {what} (" in err
    assert contents(tmp_path) == before


def test_the_list_on_standard_input_is_not_written(folder, tmp_path):
    names = tmp_path / "list.csv"
    names.write_text(f"{folder / 'disc0.png'}\n")
    for more in ([], ["--overwrite"]):
        with names.open() as handle:
            done = subprocess.run(
                [*COMMAND, "estimate", "-", "-o", str(names), *more],
                stdin=handle,
                capture_output=True,
                text=True,
                env=environment(),
                timeout=120,
                check=False,
            )
        assert done.returncode == 2
        assert "holds the list of images (standard input)" in done.stderr
        assert names.read_text() == f"{folder / 'disc0.png'}\n"


def test_overwrite_replaces_what_is_not_read(run, folder, tmp_path):
    (tmp_path / "notes.csv").write_text("precious\n")
    assert run("estimate", folder, "-o", tmp_path / "notes.csv", "--overwrite")[0] == 0
    assert bears_mark(tmp_path / "notes.csv")


@pytest.mark.parametrize("name", ["t.csv", "t.tsv", "t.json", "t.jsonl", "t.csv.gz", "t.json.gz", "T.CSV"])
def test_an_ending_names_the_form_and_the_file_may_be_replaced_by_the_next_run(run, folder, tmp_path, name):
    out = tmp_path / name
    assert run("estimate", folder, "-o", out)[0] == 0
    before = out.read_bytes()
    text = (gzip.decompress(before) if name.endswith(".gz") else before).decode()
    if ".json" in name:
        assert all(json.loads(text if name.startswith("t.json") and "jsonl" not in name else text.splitlines()[0]))
    else:
        rows = list(csv.DictReader(text.splitlines(), delimiter="\t" if "tsv" in name else ","))
        assert [row["image"] for row in rows] == ["disc0.png"] * 2 + ["disc1.png"] * 2
    assert run("estimate", folder, "-o", out)[0] == 0
    assert out.read_bytes() == before
    assert [path.name for path in tmp_path.iterdir() if path.name != "imgs"] == [name]


def test_a_table_of_tabs_is_compared_like_any_other(run, folder, tmp_path):
    for name in ("a.tsv", "a.csv"):
        assert run("estimate", folder, "-o", tmp_path / name)[0] == 0
    assert run("check", tmp_path / "a.tsv", "--against", tmp_path / "a.csv")[0] == 0


@pytest.mark.parametrize(
    ("plot", "output"),
    [
        ("x.svg", "x.svg"),
        ("x.svg", "./a/../x.svg"),
        ("link.svg", "x.svg"),
        ("x.svg", "hard.svg"),
        ("new.svg", "new.svg"),
    ],
)
@pytest.mark.parametrize("study", [["noise", "--repeats", 2], ["gcc", "--scenes", 1]], ids=["noise", "gcc"])
def test_two_outputs_of_one_name_are_refused(run, tmp_path, monkeypatch, study, plot, output):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a").mkdir()
    (tmp_path / "x.svg").write_text("<svg><!-- circlepose --></svg>")
    (tmp_path / "link.svg").symlink_to("x.svg")
    os.link(tmp_path / "x.svg", tmp_path / "hard.svg")
    before = contents(tmp_path)
    code, out, err = run("study", *study, "--plot", plot, "-o", output, "--format", "csv", "--overwrite")
    assert (code, out) == (2, "")
    assert err == f"circlepose: --plot {plot}, -o {PurePath(output)}: are one file; give two names.\n"
    assert contents(tmp_path) == before


def test_a_table_among_the_pictures_is_refused(run, folder, tmp_path):
    code, out, err = run(
        "estimate", folder, "--overlay", tmp_path / "o", "-o", tmp_path / "o" / "disc0.png", "--format", "csv"
    )
    assert (code, out) == (2, "")
    assert f"-o {tmp_path}/o/disc0.png, --overlay {tmp_path}/o: a picture in that folder may get this name" in err
    assert contents(tmp_path / "o") == {}
    assert run("estimate", folder, "--overlay", tmp_path / "o", "-o", tmp_path / "o" / "disc0.csv")[0] == 0
    assert {path.name for path in (tmp_path / "o").iterdir()} == {"disc0.csv", "disc0.png", "disc1.png"}


def test_devices_take_several_outputs():
    refuse_one_place([("--plot", Path("/dev/null")), ("-o", Path("/dev/null"))])
    with pytest.raises(UsageError, match="are one file"):
        refuse_one_place([("--a", RemoteFile("s3://b/x")), ("--b", None), ("--c", RemoteFile("s3a://b//x"))])


def test_parquet_has_typed_columns(run, folder, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    assert run("estimate", folder, "-o", tmp_path / "t.parquet")[0] == 0
    assert run("estimate", folder, "-o", tmp_path / "t.parquet")[0] == 0
    run("estimate", folder, "-o", tmp_path / "t.csv")
    columns = parquet.read_table(tmp_path / "t.parquet").to_pydict()
    rows = list(csv.DictReader((tmp_path / "t.csv").read_text().splitlines()))
    assert list(columns) == list(rows[0])
    assert columns["chosen"] == [row["chosen"] == "true" for row in rows]
    assert columns["generatrix_mm"] == [None] * len(rows)
    assert columns["center_z_mm"] == pytest.approx([float(row["center_z_mm"]) for row in rows], abs=1e-6)


@pytest.mark.parametrize("name", ["t.xlsx", "t.yaml", "t", "t.parquet.gz", "t.gz"])
def test_an_ending_that_names_no_form_is_refused(run, folder, tmp_path, name):
    code, out, err = run("estimate", folder, "-o", tmp_path / name)
    assert (code, out) == (2, "")
    assert "circlepose: -" in err
    assert not (tmp_path / name).exists()
    if "parquet" not in name:
        assert "or give --format." in err
        assert run("estimate", folder, "-o", tmp_path / name, "--format", "csv")[0] == 0


@pytest.mark.parametrize("name", ["-", "/dev/stdout"])
def test_standard_output_by_name(run, folder, name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run("estimate", folder, "-o", name) == run("estimate", folder)
    assert {path.name for path in tmp_path.iterdir()} == {"imgs"}


def test_a_device_is_written_straight(run, folder):
    assert run("estimate", folder, "-o", "/dev/null")[0] == 0


def test_a_pipe_is_written_straight(folder, tmp_path):
    os.mkfifo(tmp_path / "pipe")
    command = [*COMMAND, "estimate", str(folder), "-o", str(tmp_path / "pipe")]
    with subprocess.Popen(command, stderr=subprocess.DEVNULL, env=environment()) as process:
        text = (tmp_path / "pipe").read_text()
        assert process.wait(timeout=120) == 0
    assert text.count("\ndisc") == 4
    assert (tmp_path / "pipe").is_fifo()


def test_files_planted_beside_the_output_are_left_alone(run, folder, tmp_path):
    victim = tmp_path / "victim.txt"
    victim.write_text("precious")
    (tmp_path / "t.csv.part").symlink_to(victim)
    (tmp_path / "t.part").write_text("mine")
    os.mkfifo(tmp_path / "t.csv.journal.part")
    assert run("estimate", folder, "-o", tmp_path / "t.csv")[0] == 0
    assert victim.read_text() == "precious"
    assert (tmp_path / "t.part").read_text() == "mine"
    assert (tmp_path / "t.csv.part").is_symlink()


@pytest.mark.parametrize("plant", ["link", "hard link", "text", "pipe", "folder"])
def test_a_journal_is_never_written_through_what_was_planted(run, folder, tmp_path, plant):
    victim, journal = tmp_path / "victim.txt", tmp_path / "t.csv.journal"
    victim.write_text("" if plant == "hard link" else "precious")
    match plant:
        case "link":
            journal.symlink_to(victim)
        case "hard link":
            os.link(victim, journal)
        case "text":
            journal.write_text("mine")
        case "pipe":
            os.mkfifo(journal)
        case "folder":
            journal.mkdir()
    before = contents(tmp_path)
    code, out, err = run("estimate", folder, "-o", tmp_path / "t.csv")
    assert (code, out) == (2, "")
    assert err.count("circlepose: ") == 1
    assert str(tmp_path / "t.csv") in err
    assert contents(tmp_path) == before


def test_pictures_are_drawn_again_and_never_measured(run, folder, tmp_path):
    command = ("estimate", folder, "-r", "--overlay", folder / "out", "-o", tmp_path / "t.csv")
    assert run(*command)[0] == 0
    before = contents(tmp_path)
    code, _, err = run(*command)
    assert code == 0
    assert "2 measured, 0 failed" in err
    assert contents(tmp_path) == before
    assert is_drawn_file(str(folder / "out" / "disc0.png"))
    _, out, _ = run("estimate", folder / "out" / "disc0.png", "--calib", folder / "camera.yaml", "--radius-mm", 20)
    assert "not_an_image" in out


@pytest.mark.parametrize("suffix", [".png", ".jpg"])
def test_a_picture_of_ours_is_replaced_by_the_next(run, folder, tmp_path, suffix):
    for command in ("explain", "inspect"):
        picture = tmp_path / f"{command}{suffix}"
        assert run(command, folder / "disc0.png", "--picture", picture)[0] == 0
        assert cv2.imread(str(picture)) is not None
        assert run(command, folder / "disc0.png", "--picture", picture)[0] == 0


def test_rendering_replaces_its_own_files_alone(run, tmp_path):
    scene = tmp_path / "scene.yaml"
    scene.write_text(SCENE)
    assert run("render", scene, "-o", tmp_path / "out")[0] == 0
    assert run("render", scene, "-o", tmp_path / "out")[0] == 0
    assert read_image(tmp_path / "out" / "a.png").shape[:2] == (120, 160)
    for name in ("a.png", "camera.yml", "truth.csv"):
        mine = tmp_path / name.replace(".", "_")
        mine.mkdir()
        (mine / name).write_text("precious")
        code, out, err = run("render", scene, "-o", mine)
        assert (code, out) == (2, "")
        assert f"{mine / name}: {FOREIGN}" in err
        assert contents(mine) == {mine / name: b"precious"}


def test_a_scene_is_not_written_over_itself(run, tmp_path):
    scene = tmp_path / "camera.yml"
    scene.write_text("# circlepose\n" + SCENE)
    code, _, err = run("render", scene, "-o", tmp_path, "--overwrite")
    assert code == 2
    assert "holds the scenes" in err
    assert scene.read_text().endswith(SCENE)


def test_a_baseline_is_not_updated_from_itself(run, folder, tmp_path):
    run("estimate", folder, "-o", tmp_path / "t.csv")
    before = (tmp_path / "t.csv").read_bytes()
    code, _, err = run("check", tmp_path / "t.csv", "--against", tmp_path / "t.csv", "--update")
    assert code == 2
    assert "holds the poses" in err
    assert (tmp_path / "t.csv").read_bytes() == before


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_run_leaves_the_complete_table_in_its_place(run, folder, tmp_path, number):
    out = tmp_path / "t.csv"
    run("estimate", folder, "-o", out)
    before = out.read_bytes()
    command = [COMMAND[0], "-c", SLOW, "estimate", str(folder), "-o", str(out)]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=environment()) as process:
        while process.stderr.readline() != "waiting\n":
            assert process.poll() is None
        process.send_signal(number)
        _, err = process.communicate(timeout=120)
    assert process.returncode == 130
    assert out.read_bytes() == before
    assert "1 measured, 0 failed, interrupted: 1 not done" in err
    assert "--resume" in err
    assert {path.name for path in tmp_path.iterdir()} == {"imgs", "t.csv", "t.csv.journal"}
    code, _, err = run("estimate", folder, "-o", out, "--resume")
    assert code == 0
    assert "1 finished before\n" in err
    code, _, err = run("estimate", folder, "-o", out, "--resume")
    assert "there is nothing to resume; all images are measured anew\n" in err
    assert out.read_bytes() == before


FROM_THE_FIRST_LINE = """
import sys
from circlepose_cli.console import interruption
interruption.handle_signals()
print("begun", file=sys.stderr, flush=True)
from circlepose_cli.entry import main
sys.exit(main())
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_at_any_instant_ends_without_a_traceback(folder, tmp_path, number):
    out = tmp_path / "t.csv"
    for delay_s in (0.0, 0.02, 0.05, 0.1, 0.15, 0.25, 0.4, 0.6, 1.0):
        command = [COMMAND[0], "-c", FROM_THE_FIRST_LINE, "estimate", str(folder), "-o", str(out)]
        command += ["--overlay", str(tmp_path / "pictures")]
        with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=environment()) as process:
            assert process.stderr.readline() == "begun\n"
            time.sleep(delay_s)
            process.send_signal(number)
            _, err = process.communicate(timeout=120)
        assert process.returncode in (0, 130), err
        assert "Traceback" not in err
        assert not out.exists() or out.read_text().count("\ndisc") == 4
        left = {path.name for path in tmp_path.iterdir()} - {"imgs", "t.csv", "t.csv.journal", "pictures"}
        assert left == set()


def test_a_way_through_a_folder_that_is_not_there_leads_to_the_same_file(run, folder, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "notes.csv").write_text("precious\n")
    for more in ([], ["--overwrite"]):
        for output in ("gone/../notes.csv", "gone/../imgs/camera.yaml"):
            before = contents(tmp_path)
            code, _, _ = run("estimate", "imgs", "-o", output, "--format", "csv", *more)
            if output.endswith("notes.csv") and more:
                assert code == 0
                continue
            assert code == 2
            assert contents(tmp_path) == before


@pytest.mark.parametrize("more", [[], ["--overwrite"]])
def test_a_picture_is_never_drawn_over_what_is_read(run, folder, tmp_path, monkeypatch, more):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "in").mkdir()
    (tmp_path / "pictures").mkdir()
    (tmp_path / "in" / "disc0.png").symlink_to("../pictures/disc0.png")
    (tmp_path / "pictures" / "disc0.png").write_bytes((folder / "disc0.png").read_bytes())
    # A calibration by the name of a picture, with our mark.
    calibration = tmp_path / "pictures" / "disc1.png"
    calibration.write_bytes(b"# Written by circlepose\n" + (folder / "camera.yaml").read_bytes())
    before = contents(tmp_path)
    options = ["--radius-mm", "20", "--overlay", "pictures", *more]
    assert run("estimate", "in", "--calib", "imgs/camera.yaml", *options)[0] == 2
    assert run("estimate", "imgs/disc1.png", "--calib", calibration, *options)[0] == 2
    assert contents(tmp_path) == before


def test_a_pipe_in_the_folder_of_pictures_is_left_alone(run, folder, tmp_path):
    (tmp_path / "pictures").mkdir()
    os.mkfifo(tmp_path / "pictures" / "disc0.png")
    assert run("estimate", folder, "--overlay", tmp_path / "pictures")[0] == 0
    assert (tmp_path / "pictures" / "disc0.png").is_fifo()


def test_poses_on_standard_input_are_not_updated_from_themselves(run, folder, tmp_path):
    run("estimate", folder, "-o", tmp_path / "t.csv")
    before = (tmp_path / "t.csv").read_bytes()
    done = shell('$circlepose check - --against "$1" --update < "$1"', tmp_path / "t.csv")
    assert done.returncode == 2
    assert (tmp_path / "t.csv").read_bytes() == before


def test_rows_do_not_follow_the_list_that_they_are_of(folder, tmp_path):
    names = tmp_path / "list.txt"
    names.write_text(f"{folder / 'disc0.png'}\n")
    done = shell('$circlepose estimate - < "$1" >> "$1"', names)
    assert done.returncode == 2
    assert "standard output: would be overwritten, but it holds the list of images" in done.stderr
    assert names.read_text() == f"{folder / 'disc0.png'}\n"


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("t.csv", "Scene,Source,Budget\nkitchen,film,100\n"),
        ("t.csv", "# circlepose notes\n"),
        ("t.csv", "#!/bin/sh\n# circlepose runs here\n"),
    ],
)
def test_what_only_looks_like_ours_is_left_alone(run, folder, tmp_path, name, content):
    (tmp_path / name).write_text(content)
    code, _, err = run("estimate", folder, "-o", tmp_path / name)
    assert code == 2
    assert FOREIGN in err
    assert (tmp_path / name).read_text() == content


def test_a_signal_ends_the_wait_for_the_reader_of_a_pipe(folder, tmp_path):
    os.mkfifo(tmp_path / "pipe")
    command = [COMMAND[0], "-c", FROM_THE_FIRST_LINE, "estimate", str(folder), "-o", str(tmp_path / "pipe")]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=environment()) as process:
        while "target.yaml" not in process.stderr.readline():
            assert process.poll() is None
        time.sleep(0.5)
        process.send_signal(signal.SIGTERM)
        assert process.wait(timeout=60) == 130
