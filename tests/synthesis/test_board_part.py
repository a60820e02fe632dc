from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from circlepose import Target, estimate
from circlepose._typing import FloatArray
from circlepose.camera.camera import Camera
from circlepose.errors import SceneError, TargetError
from circlepose.io.scenes.produce import BOARD_TRUTH_COLUMNS, render_to_folder
from circlepose.io.scenes.reader import read_scenes
from circlepose.io.tables.board_rows import BOARD_COLUMNS
from circlepose.io.tables.columns import QUATERNION
from circlepose.synthesis.render import render, render_float, truth_rows
from circlepose.synthesis.scene import BoardPart, Disc, Paint, Rings, Scene
from circlepose.targets.board import BoardCircle, BoardLayout, Grid
from circlepose_cli.app import main

ORIGIN = (-80.0, -60.0, 650.0)
GRID = BoardLayout.on_grid(20.0, Grid("symmetric", 4, 3, 60.0))
DARK = (Paint(40.0),)


def turn(x_deg: float, y_deg: float, z_deg: float) -> FloatArray:
    (a, b, c), (p, q, r) = (f(np.radians([x_deg, y_deg, z_deg])) for f in (np.cos, np.sin))
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, a, -p], [0.0, p, a]])
    about_y = np.array([[b, 0.0, q], [0.0, 1.0, 0.0], [-q, 0.0, b]])
    about_z = np.array([[c, -r, 0.0], [r, c, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(about_z @ about_y @ about_x)


ROTATION = turn(22.0, -14.0, 20.0)


def camera(size: tuple[int, int] = (640, 480), focal: float = 900.0) -> Camera:
    matrix = [[focal, 0.0, (size[0] - 1) / 2], [0.0, focal, (size[1] - 1) / 2], [0.0, 0.0, 1.0]]
    return Camera.create(matrix, (-0.2, 0.05, 0.0, 0.0), size)


@pytest.mark.parametrize("noise_levels", [0.0, 2.0])
def test_a_rendered_board_is_found_where_it_is(noise_levels: float) -> None:
    # So near that 0.01 mm is several standard deviations also with noise.
    part = BoardPart((-55.0, -75.0, 450.0), ROTATION, GRID, DARK)
    scene = Scene(camera((1280, 960), 1800.0), (part,), noise_levels=noise_levels, noise_seed=3)
    (board,) = estimate(render(scene), scene.camera, Target.board(GRID, polarity="dark")).boards
    assert board.circles_used == len(GRID)
    assert float(np.linalg.norm(board.pose.sigma_mm)) < 0.01 / 3.0
    assert float(np.linalg.norm(board.pose.translation - part.translation)) < 0.01
    cosine = (np.trace(board.pose.rotation.T @ part.rotation) - 1.0) / 2.0
    assert float(np.degrees(np.arccos(min(1.0, cosine)))) < 0.01


def test_a_board_looks_like_its_discs_and_rings() -> None:
    layout = BoardLayout.on_grid(20.0, Grid("symmetric", 2, 2, 60.0), {(0, 0): [25.0, 15.0]}, [(1, 1)])
    part = BoardPart((-30.0, -30.0, 400.0), ROTATION, layout, (Paint(40.0), Paint(220.0)))
    ring, *others = part.circles
    alone = (
        Rings(ring.center, ring.normal, (25.0, 15.0), part.paints),
        *(Disc(each.center, each.normal, each.radius, part.paints[0]) for each in others),
    )
    own = camera((160, 120), 200.0)
    assert np.allclose(render_float(Scene(own, (part,))), render_float(Scene(own, alone)), atol=1e-9)


def test_the_truth_names_each_circle_of_the_layout() -> None:
    part = BoardPart(ORIGIN, ROTATION, GRID, DARK)
    rows = truth_rows(Scene(camera(), (part,), name="a"))
    assert tuple(row.circle.name for row in rows) == GRID.names
    assert {row.instance for row in rows} == {0}
    assert np.allclose(rows[0].circle.center, ORIGIN)
    assert all(float(row.circle.normal @ row.circle.center) < 0.0 for row in rows)
    assert np.allclose(rows[1].circle.center, np.array(ORIGIN) + 60.0 * ROTATION[:, 0])


def test_circles_that_face_away_are_not_painted() -> None:
    circles = (
        BoardCircle("front", (0.0, 0.0, 0.0), (20.0,)),
        BoardCircle("back", (60.0, 0.0, 0.0), (20.0,), (0.0, 0.0, 1.0)),
    )
    part = BoardPart((0.0, 0.0, 400.0), np.eye(3), BoardLayout(circles), DARK)
    assert [rims[0].name for rims in part.seen_rims] == ["front"]
    assert len(part.circles) == 2


def test_a_planar_list_is_seen_from_either_side_and_a_grid_from_its_front() -> None:
    around = np.diag([1.0, -1.0, -1.0])
    planar = BoardLayout(tuple(BoardCircle(c.name, c.center_mm, c.radii_mm) for c in GRID.circles))
    assert len(BoardPart(ORIGIN, around, planar, DARK).seen_rims) == len(GRID)
    with pytest.raises(SceneError, match="face away"):
        BoardPart(ORIGIN, around, GRID, DARK)


@pytest.mark.parametrize(
    ("rotation", "paints", "words"),
    [
        (np.diag([1.0, 1.0, -1.0]), DARK, "a rotation, got a matrix"),
        (2.0 * np.eye(3), DARK, "a rotation, got a matrix"),
        (np.eye(2), DARK, "3 x 3"),
        (np.eye(3), (), "expected 1, a circle has as many radii; got 0"),
    ],
)
def test_what_is_no_board_is_refused(rotation: FloatArray, paints: tuple[Paint, ...], words: str) -> None:
    with pytest.raises(SceneError, match=words):
        BoardPart(ORIGIN, rotation, GRID, paints)


SCENE = """
camera: {fx: 450, fy: 450, cx: 159.5, cy: 119.5, image_size: [320, 240]}
target: {polarity: dark, radius_mm: 20, grid: {pattern: symmetric, rows: 4, columns: 3, spacing_mm: 60}}
planes:
  plate: {center_mm: [0, 0, 700], normal: [0.3, -0.2, -1]}
views:
  - image: on_plane
    targets: [{kind: board, plane: plate, at_mm: [-60, -90], level: 40}]
  - image: posed
    targets: [{kind: board, translation_mm: [-60, -90, 680], rotation: [0.98, 0.15, -0.1, 0.05], level: 40}]
"""


def test_estimate_agrees_with_the_truth_of_a_scene_file(tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE, encoding="utf-8")
    render_to_folder(path, tmp_path / "out")
    described = read_scenes(path)
    assert described.target is not None
    assert described.target.layout == GRID
    for scene in described.scenes:
        result = estimate(render(scene), described.camera, described.target, name=scene.name)
        truth = {row.circle.name: row.circle for row in truth_rows(scene)}
        assert {circle.circle for circle in result.circles} == set(truth)
        for circle in result.circles:
            assert circle.pose is not None
            assert float(np.linalg.norm(circle.pose.center - truth[circle.circle].center)) < 0.05


def test_check_compares_boards_with_the_truth(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, out = tmp_path / "scene.yaml", tmp_path / "out"
    marked = SCENE.replace("spacing_mm: 60}}", "spacing_mm: 60}, marks: [{at: [0, 2], radius_mm: 12}]}")
    path.write_text(marked, encoding="utf-8")
    for _ in range(2):  # the second time it replaces files of its own
        assert main(["render", str(path), "-o", str(out)]) == 0
    assert capsys.readouterr().out.split()[-1] == str(out / "truth_boards.csv")
    with (out / "truth_boards.csv").open(newline="") as handle:
        rows = list(csv.DictReader(handle))
    assert tuple(rows[0]) == BOARD_TRUTH_COLUMNS
    assert set(BOARD_TRUTH_COLUMNS) < set(BOARD_COLUMNS)
    assert [row["image"] for row in rows] == ["on_plane.png", "posed.png"]
    assert [rows[1][name] for name in ("instance", "x_mm", "y_mm", "z_mm")] == [
        "0",
        "-60.000000",
        "-90.000000",
        "680.000000",
    ]
    given = np.array([0.98, 0.15, -0.1, 0.05])
    assert np.allclose([float(rows[1][name]) for name in QUATERNION], given / np.linalg.norm(given), atol=1e-8)
    assert main(["estimate", "-q", str(out), "-o", str(tmp_path / "poses.csv")]) == 0
    truth = str(out / "truth_boards.csv")
    assert main(["check", str(tmp_path / "poses.csv"), "--against", truth]) == 0
    assert "2 boards compared; all within 0.5 mm and 0.1 deg" in capsys.readouterr().err
    assert main(["check", str(tmp_path / "poses.csv"), "--against", truth, "--update"]) == 2


def test_check_says_that_a_roll_is_not_settled(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, out = tmp_path / "scene.yaml", tmp_path / "out"
    turned = SCENE.replace("at_mm: [-60, -90], ", "at_mm: [60, 90], angle_deg: 180, ")
    path.write_text(turned, encoding="utf-8")
    render_to_folder(path, out)
    assert main(["estimate", "-q", str(out), "-o", str(tmp_path / "poses.csv")]) == 0
    assert "roll_ambiguous" in (tmp_path / "poses.csv").read_text()
    assert main(["check", str(tmp_path / "poses.csv"), "--against", str(out / "truth_boards.csv")]) == 0
    note, outcome = capsys.readouterr().err.splitlines()
    assert note.startswith("1 board with the flag roll_ambiguous is turned about the z axis: the roll is not settled")
    assert outcome.startswith("2 boards compared; all within 0.5 mm and 0.1 deg; largest difference 0.0")


def test_without_boards_there_is_no_truth_of_boards(tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text("camera: {fx: 450, fy: 450, cx: 159.5, cy: 119.5, image_size: [320, 240]}\n", encoding="utf-8")
    assert "truth_boards.csv" not in [each.name for each in render_to_folder(path, tmp_path / "out")]


def test_a_board_on_a_plane_has_the_axes_of_the_plane(tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE.replace("level: 40}", "level: 40, angle_deg: 90}", 1), encoding="utf-8")
    part = read_scenes(path).scenes[0].targets[0]
    assert isinstance(part, BoardPart)
    normal = np.array([0.3, -0.2, -1.0])
    assert np.allclose(part.rotation[:, 2], -normal / np.linalg.norm(normal))
    # Turned by 90 deg the board's x axis points down.
    assert part.rotation[1, 0] > 0.9


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("level: 40}", "level: 40, levels: [40]}", "level, levels: expected one of the two"),
        ("at_mm: [-60, -90], ", "", "expected either translation_mm and rotation, or plane and at_mm"),
        ("level: 40}", "level: 40, rotation: [1, 0, 0, 0]}", "expected either translation_mm and rotation"),
        ("[0.98, 0.15, -0.1, 0.05]", "[0, 0, 0, 0]", "rotation: expected a quaternion"),
        ("[0.98, 0.15, -0.1, 0.05]", "[0, 1, 0, 0]", r"targets\[0\]: board: all of its circles face away"),
        ("polarity: dark", "kind: coaxial", "target.kind: expected board"),
        ("polarity: dark", "spacing_mm: 3", "target.spacing_mm: is no known key"),
        ("radius_mm: 20", "radius_mm: -20", "radius_mm: expected a positive radius"),
    ],
)
def test_mistakes_name_file_key_and_expectation(tmp_path: Path, old: str, new: str, words: str) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE.replace(old, new, 1), encoding="utf-8")
    with pytest.raises((SceneError, TargetError), match=words) as caught:
        read_scenes(path)
    assert "scene.yaml" in str(caught.value)
