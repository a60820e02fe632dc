"""What `explain` says of boards: the text, the picture, the JSON."""

from __future__ import annotations

import copy
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from circlepose import Target, explain
from circlepose._typing import Image
from circlepose.board_result import BoardPose
from circlepose.camera.camera import Camera
from circlepose.diagnostics.boards import BoardView, Unseen, board_views, front_mm, residuals_mm, unseen
from circlepose.diagnostics.explain import Explanation
from circlepose.drawing.board_explanation import draw_board_explanation
from circlepose.drawing.explanation import draw_explanation
from circlepose.drawing.style import MISFIT, UNUSED
from circlepose.io.scenes.produce import render_to_folder
from circlepose.results import ImageResult, SettledBy
from circlepose.synthesis.render import render
from circlepose.synthesis.scene import BoardPart, Paint, Scene
from circlepose.targets.board import BoardLayout, Grid
from circlepose_cli.app import main
from circlepose_cli.reports.explain.boards import listed
from circlepose_cli.reports.explain.text import report_text
from tests.support.json_outputs import faults

SIZE = (640, 480)
CAMERA = Camera.create([[700.0, 0.0, 319.5], [0.0, 700.0, 239.5], [0.0, 0.0, 1.0]], (-0.1, 0.02, 0.0, 0.0), SIZE)
TURN = np.array([[0.96, 0.0, 0.28], [0.0, 1.0, 0.0], [-0.28, 0.0, 0.96]])
SCENE = """
camera: {fx: 700, fy: 700, cx: 319.5, cy: 239.5, image_size: [640, 480], dist_coeffs: [-0.1, 0.02, 0, 0]}
target: {polarity: dark, radius_mm: 18, grid: {pattern: symmetric, rows: 4, columns: 4, spacing_mm: 55}}
targets: [{kind: board, translation_mm: [-80, -85, 480], rotation: [0.99, 0, 0.14, 0], level: 40}]
occluders: [{kind: box, at_px: [395, 220], size_px: [130, 130], level: 120}]
noise_levels: 1
"""


@pytest.fixture(scope="module")
def explained() -> tuple[Image, Explanation]:
    layout = BoardLayout.on_grid(18.0, Grid("symmetric", 4, 3, 60.0))
    part = BoardPart((-60.0, -90.0, 480.0), TURN, layout, (Paint(40.0),))
    image = render(Scene(CAMERA, (part,), noise_levels=1.0))
    return image, explain(image, CAMERA, Target.board(layout), name="a.png")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A photograph of a board some of whose circles are hidden."""
    made = tmp_path_factory.mktemp("boards")
    (made / "view.yaml").write_text(SCENE, encoding="utf-8")
    render_to_folder(made / "view.yaml", made / "out")
    return made / "out"


def with_residual(view: BoardView, name: str, residual_px: tuple[float, float], *, is_used: bool = True) -> BoardView:
    fits = tuple(
        replace(fit, residual_px=np.array(residual_px), sigmas=99.0, is_used=is_used) if fit.name == name else fit
        for fit in view.board.circles
    )
    return replace(view, board=replace(view.board, circles=fits))


def with_board(result: ImageResult, view: BoardView) -> ImageResult:
    return replace(result, boards=(view.board,))


def test_a_residual_on_the_board_is_the_move_that_makes_it(explained: tuple[Image, Explanation]) -> None:
    (view,) = board_views(explained[1].result)
    pose = view.board.pose
    move = np.array([0.02, -0.01])
    center = pose.translation + pose.rotation @ view.centers_mm[5]
    moved = center + pose.rotation[:, :2] @ move
    offset = CAMERA.project(moved) - CAMERA.project(center)
    residuals, px_per_mm = residuals_mm(with_residual(view, view.circles[5].circle, tuple(offset)), CAMERA)
    assert np.allclose(residuals[5], move, atol=1e-5)
    assert np.allclose(px_per_mm, 700.0 / 480.0, rtol=0.3)
    assert np.allclose(front_mm(view), view.centers_mm[:, :2])


def test_a_board_whose_z_axis_points_to_the_viewer_is_shown_as_it_is_seen(
    explained: tuple[Image, Explanation],
) -> None:
    (view,) = board_views(explained[1].result)
    pose = view.board.pose
    flip = np.diag([-1.0, 1.0, -1.0])
    other = BoardPose(pose.rotation @ flip, pose.translation, pose.covariance, pose.terms, pose.rms_px)
    behind = BoardView(replace(view.board, candidates=(other,)), view.circles, view.centers_mm @ flip)
    assert (view.side, behind.side) == (1.0, -1.0)
    assert np.allclose(front_mm(behind), front_mm(view))
    assert np.allclose(residuals_mm(behind, CAMERA)[0], residuals_mm(view, CAMERA)[0])


def test_the_text_has_the_board_and_a_line_for_each_circle(explained: tuple[Image, Explanation]) -> None:
    text = report_text(explained[1], "camera.yml", "target.yaml")
    lines = text.splitlines()
    assert "#0 board    12 of 12 circles used, 12 seen" in lines
    for start in ("pose 0      origin (-60.0", "ambiguity ", "roll        open", "radii       ", "flags  "):
        assert any(line.startswith(start) for line in lines), start
    table = [line.split() for line in lines if " yes " in line]
    assert [row[0] for row in table] == [circle.circle for circle in explained[1].result.circles]
    assert "the worst" not in text
    assert "levels      blur" not in text
    assert "--circle NAME, such as r0c0" in lines[-1]


def test_of_more_than_twelve_circles_the_five_worst_are_first(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    picture = folder / "explained.png"
    assert main(["explain", "-q", str(folder / "view.png"), "--picture", str(picture)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert picture.is_file()
    assert any(line.startswith("not seen    ") for line in lines)
    first = next(i for i, line in enumerate(lines) if line.startswith("the worst"))
    rest = next(i for i, line in enumerate(lines) if line.startswith("the others"))
    assert rest == first + 5
    sigmas = [float(line.split()[-1]) for line in lines[first:-2]]
    assert sigmas[:5] == sorted(sigmas, reverse=True)[:5]
    names = [line[12:].split()[0] for line in lines[first:-2]]
    assert names[5:] == sorted(names[5:])
    assert len(set(names)) == len(names)


def test_why_fewer_circles_are_used_than_the_layout_has(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    # The upper row lies above the image, the next is cut by its border, and one circle is hidden.
    moved = SCENE.replace("[-80, -85, 480]", "[-80, -221, 480]").replace("size_px: [130, 130]", "size_px: [80, 80]")
    moved = moved.replace("at_px: [395, 220]", "at_px: [360, 67]").replace(
        "55}", "55}, marks: [{at: [2, 3], radius_mm: 12}]"
    )
    (tmp_path / "view.yaml").write_text(moved, encoding="utf-8")
    render_to_folder(tmp_path / "view.yaml", tmp_path)
    lines = _text(tmp_path, capsys).splitlines()
    assert "#0 board    8 of 16 circles used, 8 seen" in lines
    at = lines.index("not seen    8: r0c0, r0c1 ... r2c2")
    places = "4 are outside the image, 3 are cut by its border, 1 is within the image, so hidden or not found"
    assert lines[at + 1] == f"            by the pose {places}"


def test_what_else_there_is_to_say_of_the_image_is_said(explained: tuple[Image, Explanation]) -> None:
    remarked = replace(explained[1], result=replace(explained[1].result, remark="9 more circles"))
    assert report_text(remarked, "camera.yml", "target.yaml").splitlines()[1] == "            9 more circles"


def test_where_the_circles_are_that_were_not_seen(explained: tuple[Image, Explanation]) -> None:
    (view,) = board_views(explained[1].result)
    assert unseen(view, CAMERA, SIZE) == Unseen((), (), ())
    bare = replace(view, board=replace(view.board, circles=()))
    assert unseen(bare, CAMERA, SIZE) == Unseen((), (), tuple(range(12)))
    places = unseen(bare, CAMERA, (320, SIZE[1]))
    assert sorted((*places.outside, *places.cut, *places.within)) == list(range(12))
    assert [view.circles[i].circle[2:] for i in places.within] == ["c0"] * 4
    assert [view.circles[i].circle[2:] for i in places.cut] == ["c1"] * 4


def test_the_columns_of_circles_are_explained(explained: tuple[Image, Explanation]) -> None:
    text = report_text(explained[1], "camera.yml", "target.yaml")
    assert "sigmas: by how much the whole rim, its size and shape too, misfits the pose" in text
    assert "not seen" not in text


def test_one_circle_is_written_and_drawn_by_its_name(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    image, picture = str(folder / "view.png"), folder / "one.png"
    assert main(["explain", "-q", image, "--circle", "r0c1", "--picture", str(picture)]) == 0
    out = capsys.readouterr().out
    assert "#0 board" in out
    assert out.count("levels      blur") == 1
    assert "#0 r0c1     radius 18 mm" in out
    assert "residual x, y px" not in out
    assert picture.is_file()
    unseen = next(line for line in _text(folder, capsys).splitlines() if line.startswith("not seen"))
    name = unseen.split(": ")[1].split(",")[0]
    assert main(["explain", "-q", image, "--circle", name]) == 0
    assert f"{name:<12}was not seen" in capsys.readouterr().out
    assert main(["explain", "-q", image, "--circle", "r9c9"]) == 2
    assert "--circle: expected a circle of the target (r0c0, r0c1 ... r3c3), got 'r9c9'" in capsys.readouterr().err


def test_a_circle_of_a_board_says_how_its_pose_is_settled(explained: tuple[Image, Explanation]) -> None:
    explanation = explained[1]
    (circle,) = explanation.named("r0c1")
    for settled_by, number, line in (
        (SettledBy.NONE, 1, "ambiguity   none: one pose is possible"),
        (SettledBy.JOINT_FIT, 2, "settled by  joint_fit: one pose fitted to all rims of the board"),
    ):
        result = replace(circle.result, candidates=circle.result.candidates[:1] * number, settled_by=settled_by)
        circles = tuple(replace(each, result=result) if each is circle else each for each in explanation.circles)
        text = report_text(replace(explanation, circles=circles), "c", "t", "r0c1")
        assert line in text.splitlines()
        assert ("settled by" in text) == (number == 2)


def _text(folder: Path, capsys: pytest.CaptureFixture[str]) -> str:
    assert main(["explain", "-q", str(folder / "view.png")]) == 0
    return capsys.readouterr().out


def test_json_has_the_boards_as_the_schema_says(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    args = ["explain", "-q", str(folder / "view.png"), "--camera-sigma", "1,1", "--format", "json"]
    assert main(args) == 0
    document = json.loads(capsys.readouterr().out)
    assert faults(document) == []
    (board,) = document["boards"]
    assert board["circles_in_layout"] == 16
    assert len(board["circles"]) == len(document["stages"])
    (pose,) = (each for each in board["solutions"] if each["chosen"])
    assert [pose["x_mm"], pose["y_mm"], pose["z_mm"]] == pytest.approx([-80.0, -85.0, 480.0], abs=0.1)
    assert pose["sigma_x_mm"] ** 2 == pytest.approx(pose["covariance"][0][0])
    for part in (board, pose, board["circles"][0]):
        for key in part:
            changed = copy.deepcopy(document)
            found = changed["boards"][0]
            found = found if part is board else found["solutions"][0] if part is pose else found["circles"][0]
            del found[key]
            assert faults(changed), key
    assert faults({**document, "boards": []})
    del document["boards"]
    assert faults(document) == []


def test_the_picture_shows_what_counts_and_what_was_not_seen(explained: tuple[Image, Explanation]) -> None:
    image, explanation = explained
    plain = draw_explanation(image, explanation, CAMERA)
    assert plain.shape[1] == 1560
    assert not (plain[200:] == MISFIT).all(axis=-1).any()
    (view,) = board_views(explanation.result)
    misfit = with_board(explanation.result, with_residual(view, "r1c1", (0.4, 0.1), is_used=False))
    assert (draw_board_explanation(misfit, CAMERA)[200:] == MISFIT).all(axis=-1).any()
    fewer = replace(view.board, circles=view.board.circles[1:])
    unseen = draw_board_explanation(replace(explanation.result, boards=(fewer,)), CAMERA)
    assert (unseen[200:] == UNUSED).all(axis=-1).any()


def test_a_board_without_residuals_is_drawn(explained: tuple[Image, Explanation]) -> None:
    _, explanation = explained
    (view,) = board_views(explanation.result)
    for circle in view.circles:
        view = with_residual(view, circle.circle, (0.0, 0.0))
    assert draw_board_explanation(with_board(explanation.result, view), CAMERA).shape[1] == 1560


def test_names_are_listed_shortly() -> None:
    assert listed(["a", "b"]) == "a, b"
    assert listed(["a", "b", "c", "d", "e"]) == "a, b ... e"
