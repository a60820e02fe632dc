"""`--world-board`: poses relative to a board in the same image, by its file or its name."""

from __future__ import annotations

import csv
import io
import json

import cv2
import numpy as np
import pytest

from circlepose.synthesis.render import render
from circlepose.synthesis.scene import Disc, Paint, Scene
from tests.support.boards import CAMERA, grid, posed

GRID = grid("symmetric", 3, 4, 36.0, 9.0, marks={(0, 0): (5.0,)})
WORLD = """\
kind: board
radius_mm: 9
grid: {pattern: symmetric, rows: 3, columns: 4, spacing_mm: 36}
marks: [{at: [0, 0], radius_mm: 5}]
"""
POSE = posed(GRID, at=(-50.0, 0.0))
CENTER, NORMAL = np.array([130.0, 30.0, 520.0]), np.array([0.3, -0.2, -1.0]) / np.linalg.norm([0.3, -0.2, -1.0])


def picture(path, *, with_board=True, more=()):
    discs = [Disc(tuple(CENTER), tuple(NORMAL), 15.0, Paint(40.0)), *more]
    for center, radius in zip(GRID.centers_mm @ POSE.rotation.T + POSE.translation, GRID.radius_mm, strict=True):
        if with_board:
            discs.append(Disc(tuple(center), tuple(-POSE.rotation[:, 2]), radius, Paint(40.0)))
    cv2.imwrite(
        str(path), render(Scene(CAMERA, tuple(discs), Paint(200.0), blur_px=0.7, noise_levels=1.0, noise_seed=2))
    )


@pytest.fixture
def scenes(tmp_path):
    folder = tmp_path / "scenes"
    folder.mkdir()
    (folder / "camera.yaml").write_text(
        "camera_matrix: [[800, 0, 319.5], [0, 800, 239.5], [0, 0, 1]]\n"
        "dist_coeffs: [-0.12, 0.03, 0, 0]\nimage_size: [640, 480]\nfocal_sigma_px: 4\ncenter_sigma_px: 2\n"
    )
    (folder / "target.yaml").write_text("radius_mm: 15\n")
    (folder / "table.yaml").write_text(WORLD)
    picture(folder / "a.png")
    picture(folder / "b.png", with_board=False)
    return folder


def rows(text):
    return list(csv.DictReader(io.StringIO(text)))


def center_of(row):
    return np.array([float(row[f"center_{axis}_mm"]) for axis in "xyz"])


def test_poses_are_in_the_frame_of_a_board_by_its_name_or_its_file(run, scenes):
    code, out, err = run("estimate", scenes / "a.png", "--world-board", "table")
    assert code == 0
    assert f"{scenes / 'table.yaml'}: poses are in the frame of this board\n" in err
    assert run("estimate", scenes / "a.png", "--world-board", scenes / "table.yaml")[1] == out
    expected = POSE.rotation.T @ (CENTER - POSE.translation)
    assert np.linalg.norm(center_of(rows(out)[0]) - expected) < 0.2
    plain = rows(run("estimate", scenes / "a.png", "--count", "all")[1])
    assert len(plain) == 26
    # What the camera may be wrong by moves the disc and the board alike.
    assert float(rows(out)[0]["sigma_z_mm"]) < 0.5 * float(plain[0]["sigma_z_mm"])


def test_the_scene_of_a_board_has_a_disc_beside_it(run, tmp_path, project_root):
    assert run("render", project_root / "configs" / "scenes" / "board.yaml", "-o", tmp_path)[0] == 0
    # It is no target, so it has no truth.
    assert {float(row["radius_mm"]) for row in rows((tmp_path / "truth.csv").read_text())} == {8.0, 4.0}
    code, out, err = run("estimate", tmp_path, "--radius-mm", "15", "--facing", "up", "--world-board", "target")
    assert code == 0, err
    chosen = [row for row in rows(out) if row["chosen"] == "true"]
    assert [row["image"] for row in chosen] == ["a.png", "b.png"]
    for row in chosen:
        assert np.linalg.norm(center_of(row) - [200.0, 60.0, 0.0]) < 0.15
        assert float(row["normal_z"]) < -0.99999


def test_an_image_without_the_board_has_no_poses_and_says_why(run, scenes):
    code, out, err = run("estimate", scenes, "--world-board", "table")
    assert code == 3
    assert [(row["image"], row["status"]) for row in rows(out)] == [
        ("a.png", "ok"),
        ("a.png", "ok"),
        ("b.png", "no_world_board"),
    ]
    assert rows(out)[-1]["center_x_mm"] == ""
    assert "b.png: world board: one circle alone was found; a board's pose needs two or more\n" in err
    assert "1 image no_world_board: have the whole board in view, once; circlepose explain IMAGE" in err


def test_json_has_the_pose_of_the_board(run, scenes):
    images = json.loads(run("estimate", scenes, "--world-board", "table", "--format", "json")[1])["images"]
    world = images[0]["world"]
    assert np.allclose([world[f"{axis}_mm"] for axis in "xyz"], POSE.translation, atol=0.5)
    assert np.sqrt(world["covariance"][2][2]) == pytest.approx(world["sigma_z_mm"])
    assert images[1]["world"] is None
    assert images[1]["circles"] == []
    assert json.loads(run("estimate", scenes / "a.png", "--format", "json")[1])["images"][0]["world"] is None


def test_distances_do_not_depend_on_the_frame(run, scenes):
    picture(scenes / "a.png", more=[Disc((130.0, -80.0, 520.0), (0.1, 0.4, -0.9), 15.0, Paint(40.0))])
    args = ("estimate", scenes / "a.png", "--count", "2", "--layout", "pairs", "--camera-sigma", "0,0")
    (pair,) = rows(run(*args, "--world-board", "table")[1])
    assert float(pair["distance_mm"]) == pytest.approx(110.0, abs=0.5)
    # Without the errors of the board, which they do not have.
    assert float(pair["sigma_mm"]) < 0.1
    every = rows(run(*args[:2], "--count", "all", *args[4:])[1])
    assert [row["distance_mm"] for row in every].count(pair["distance_mm"]) == 1


def test_tables_say_their_frame_and_are_compared_in_it(run, scenes, tmp_path):
    for form in ("csv", "json"):
        world, camera = tmp_path / f"world.{form}", tmp_path / f"camera.{form}"
        assert run("estimate", scenes / "a.png", "--world-board", "table", "-o", world)[0] == 0
        assert run("estimate", scenes / "a.png", "-o", camera)[0] == 0
        assert "relative_to_board" in world.read_text()
        assert "relative_to_board" not in camera.read_text()
        assert run("check", world, "--against", world)[0] == 0
        code, _, err = run("check", world, "--against", camera)
        assert code == 2
        assert "its poses are in the camera's frame, those compared with it in that of a world board" in err
    center = POSE.rotation.T @ (CENTER - POSE.translation)
    numbers = ",".join(f"{value:.6f}" for value in (*center, *(POSE.rotation.T @ NORMAL)))
    truth = tmp_path / "truth.csv"
    truth.write_text(f"image,circle,x,y,z,nx,ny,nz\na.png,disc,{numbers}\n")
    code, _, err = run("check", tmp_path / "world.csv", "--against", truth, "--candidate", "best")
    assert code == 0, err


@pytest.mark.parametrize(
    ("file", "name"), [("table.yaml", "table"), ("plates/table.yaml", "table"), ("b.txt", None), ("b.2.yaml", None)]
)
def test_a_file_that_is_beside_the_images_is_given_by_its_name(run, scenes, file, name):
    (scenes / file.split("/")[-1]).write_text(WORLD)
    code, out, err = run("estimate", scenes / "a.png", "--world-board", file)
    assert (code, out) == (2, "")
    given = name or scenes / file
    said = f"--world-board {file}: there is no such file, but one of this name beside the images; give --world-board "
    assert f"{said}{given}.\n" in err
    assert run("estimate", scenes / "a.png", "--world-board", given)[0] == 0


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (["--world-board", "chair"], "--world-board chair: there is no chair.yaml in "),
        (["--world-board", "none.yaml"], "none.yaml: "),
        (["--world-board", "target"], "target.yaml: expected a target of kind board, got one of kind circle."),
        (
            ["--world-board", "table", "--layout", "table1"],
            "--world-board: goes with --layout poses, boards or pairs.",
        ),
    ],
)
def test_what_cannot_be_is_refused(run, scenes, args, message):
    code, out, err = run("estimate", scenes / "a.png", *args)
    assert (code, out) == (2, "")
    assert message in err


def test_the_target_itself_is_no_world(run, scenes):
    args = ("--target", scenes / "table.yaml", "--world-board", "table")
    code, _, err = run("estimate", scenes / "a.png", *args)
    assert code == 2
    assert "is the target itself, whose pose relative to itself is known." in err


def test_the_boards_file_is_not_written_over(run, scenes):
    code, _, err = run(
        "estimate", scenes, "--world-board", "table", "-o", scenes / "table.yaml", "--format", "csv", "--overwrite"
    )
    assert code == 2
    assert "the world board" in err
    assert (scenes / "table.yaml").read_text() == WORLD


def test_another_board_is_no_run_to_resume(run, scenes, tmp_path, monkeypatch):
    out = tmp_path / "t.csv"
    (scenes / "b.png").unlink()
    # As if the run had been killed at its end.
    monkeypatch.setattr("circlepose.batch.journal.Journal.remove", lambda _: None)
    assert run("estimate", scenes, "--world-board", "table", "-o", out)[0] == 0
    first = out.read_bytes()
    code, _, err = run("estimate", scenes, "--world-board", "table", "-o", out, "--resume")
    assert (code, out.read_bytes()) == (0, first)
    assert "1 finished before" in err
    (scenes / "table.yaml").write_text(WORLD.replace("36", "37"))
    code, _, err = run("estimate", scenes, "--world-board", "table", "-o", out, "--resume")
    assert code == 2
    assert "a.png was measured with another world board." in err
    assert out.read_bytes() == first


def test_the_picture_has_the_axes_of_the_board(run, scenes, tmp_path):
    plain, world = tmp_path / "plain", tmp_path / "world"
    assert run("estimate", scenes / "a.png", "--overlay", plain)[0] == 0
    assert run("estimate", scenes / "a.png", "--overlay", world, "--world-board", "table")[0] == 0
    without, drawn = (cv2.imread(str(folder / "a.png")) for folder in (plain, world))
    at = np.round(2.0 * CAMERA.project(POSE.translation + 10.0 * POSE.rotation[:, 1]) + 0.5).astype(int)
    assert drawn.shape[1] == without.shape[1] == 1280

    def near(picture):
        x, y = at[0], at[1] + picture.shape[0] - 960
        return picture[y - 3 : y + 4, x - 3 : x + 4].reshape(-1, 3).max(axis=0) - picture[
            y - 3 : y + 4, x - 3 : x + 4
        ].reshape(-1, 3).min(axis=0)

    # Green of the y axis, where the ground was gray.
    assert near(drawn).max() > near(without).max() + 40
