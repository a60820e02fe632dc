from __future__ import annotations

import csv
import shlex
from pathlib import Path

import pytest

import circlepose

FILES = {"photo.png", "camera.yml", "target.yaml", "truth.csv", "overlay"}


@pytest.fixture
def demo(run, tmp_path, monkeypatch):
    """The folder of a demo that has run, and what it printed."""
    monkeypatch.chdir(tmp_path)
    code, out, err = run("demo")
    assert code == 0
    return tmp_path / "circlepose-demo", out, err


def test_the_demo_writes_measures_and_says_what_is_next(demo):
    folder, out, err = demo
    assert {entry.name for entry in folder.iterdir()} == FILES
    assert (folder / "overlay" / "photo.png").stat().st_size > 0
    assert out.count("ambiguous") == 2
    assert "two poses" in err
    assert "circlepose-demo/overlay/photo.png" in err
    assert "circlepose estimate circlepose-demo --coplanar" in err


def test_each_next_command_of_the_demo_works(demo, run):
    _, _, err = demo
    lines = [line.strip() for line in err.splitlines() if line.startswith("  circlepose ")]
    commands = [shlex.split(part)[1:] for line in lines for part in line.split(" | ") if "CAMERA" not in part]
    assert [command[0] for command in commands] == ["estimate", "estimate", "check", "explain"]
    for command in commands:
        if command[0] == "check":
            _, table, _ = run(*commands[0])
            Path("poses.csv").write_text(table, encoding="utf-8")
            command[1] = "poses.csv"
        code, out, err = run(*command)
        assert code == 0, err
        assert "ambiguous" not in out


def test_the_one_plane_of_the_demo_gives_the_true_poses(demo, run):
    folder, _, _ = demo
    with (folder / "truth.csv").open(newline="") as handle:
        truth = list(csv.DictReader(handle))
    camera = circlepose.read_camera(folder / "camera.yml")
    target = circlepose.Target.circle(radius_mm=30.0, count="all", same_plane=True)
    result = circlepose.estimate(circlepose.read_image(folder / "photo.png"), camera, target)
    assert len(result.circles) == len(truth) == 2
    for row in truth:
        center = [float(row[f"center_{axis}_mm"]) for axis in "xyz"]
        normal = [float(row[f"normal_{axis}"]) for axis in "xyz"]
        assert any(
            circle.pose is not None
            and circle.pose.center == pytest.approx(center, abs=0.1)
            and circle.pose.normal == pytest.approx(normal, abs=1e-3)
            for circle in result.circles
        )


def test_a_second_demo_replaces_the_first_and_keeps_what_the_user_added(demo, run):
    folder, _, _ = demo
    (folder / "notes.txt").write_text("mine")
    code, _, _ = run("demo")
    assert code == 0
    assert (folder / "notes.txt").read_text() == "mine"


def test_files_of_the_user_are_not_replaced(run, tmp_path):
    folder = tmp_path / "mine"
    folder.mkdir()
    (folder / "holiday.jpg").write_bytes(b"mine")
    code, out, err = run("demo", folder)
    assert (code, out) == (2, "")
    assert "holiday.jpg" in err
    assert "name another folder" in err
    assert [entry.name for entry in folder.iterdir()] == ["holiday.jpg"]


def test_a_file_of_the_demo_that_the_user_replaced_is_kept(demo, run):
    folder, _, _ = demo
    (folder / "target.yaml").write_text("radius_mm: 12\n")
    code, _, err = run("demo")
    assert code == 2
    assert "target.yaml: is no file of a demo" in err
    assert (folder / "target.yaml").read_text() == "radius_mm: 12\n"


def test_a_file_in_the_way_of_the_demo_is_a_sentence(run, tmp_path):
    (tmp_path / "taken").write_text("mine")
    code, _, err = run("demo", tmp_path / "taken")
    assert code == 2
    assert "cannot be made a folder" in err


@pytest.mark.parametrize("name", ["zwei Wörter", "円の位置", "it's"])
def test_the_demo_quotes_the_names_of_folders(run, tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    code, _, err = run("demo", name)
    assert code == 0
    assert f"circlepose estimate {shlex.quote(name)} --coplanar" in err
    assert (Path(name) / "overlay" / "photo.png").is_file()


@pytest.mark.parametrize("name", ["overlay", "overlay/photo.png", "photo.png", "camera.yml"])
def test_the_demo_writes_through_no_link(demo, run, tmp_path, name):
    folder, _, _ = demo
    path = folder / name
    elsewhere = tmp_path / "elsewhere"
    path.rename(elsewhere)
    path.symlink_to(elsewhere)
    before = elsewhere.read_bytes() if elsewhere.is_file() else {each.name for each in elsewhere.iterdir()}
    code, _, err = run("demo")
    assert code == 2
    assert str(name.rpartition("/")[2]) in err
    assert before == (elsewhere.read_bytes() if elsewhere.is_file() else {each.name for each in elsewhere.iterdir()})


def test_hidden_files_of_the_system_are_not_in_the_way(run, tmp_path):
    folder = tmp_path / "demo"
    folder.mkdir()
    (folder / ".DS_Store").write_bytes(b"mine")
    assert run("demo", folder)[0] == 0


def test_a_folder_named_like_an_option_is_named_in_full(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, _, err = run("demo", "--", "-x")
    assert code == 0
    assert f"estimate {tmp_path / '-x'} --coplanar" in err
