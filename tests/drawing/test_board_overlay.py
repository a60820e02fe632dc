from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from circlepose import Target, draw_overlay, estimate
from circlepose._typing import Image
from circlepose.camera.camera import Camera
from circlepose.diagnostics.boards import board_views
from circlepose.drawing import board_overlay, board_words
from circlepose.drawing.board_explanation import draw_board_explanation
from circlepose.drawing.board_overlay import MOST_NAMES, DrawnBoards, draw_boards, plan_names
from circlepose.drawing.canvas import Pen
from circlepose.drawing.labels import Room
from circlepose.drawing.style import AMBIGUOUS, AXES, CHOSEN, MISFIT, OTHER, UNUSED, Color, Font, unit_of
from circlepose.results import Flag, ImageResult
from circlepose.synthesis.render import render
from circlepose.synthesis.scene import BoardPart, Box, Paint, Patch, Scene
from circlepose.targets.board import BoardLayout, Grid
from tests.support.board_results import made_board

SIZE = (1000, 800)
CAMERA = Camera.create([[1000.0, 0.0, 499.5], [0.0, 1000.0, 399.5], [0.0, 0.0, 1.0]], (-0.1, 0.02, 0.0, 0.0), SIZE)
TURN = np.array([[0.96, 0.0, 0.28], [0.0, 1.0, 0.0], [-0.28, 0.0, 0.96]])


def measured(rows: int = 4, columns: int = 3, *, hidden: bool = False) -> tuple[Image, ImageResult]:
    spacing = 60.0 * 4.0 / rows
    layout = BoardLayout.on_grid(spacing / 3.0, Grid("symmetric", rows, columns, spacing))
    part = BoardPart((-spacing * (columns - 1) / 2.0, -90.0, 500.0), TURN, layout, (Paint(40.0),))
    covers = (Patch(Box((150.0, 150.0), (500.0, 340.0)), Paint(120.0)),) if hidden else ()
    image = render(Scene(CAMERA, (part,), Paint(200.0), occluders=covers))
    return image, estimate(image, CAMERA, Target.board(layout))


def drawn_of(result: ImageResult) -> tuple[DrawnBoards, Pen, Room]:
    canvas = np.full((SIZE[1], SIZE[0], 3), 128, np.uint8)
    pen, room = Pen(canvas, 1, unit_of(canvas)), Room.of(canvas, unit_of(canvas))
    return draw_boards(pen, room, board_views(result), CAMERA), pen, room


def has(picture: Image, color: Color) -> bool:
    """Whether some pixel has nearly this color: thin slanted lines are blended with what is under them."""
    return bool((np.abs(picture.astype(int) - color).max(axis=-1) <= 60).any())


@pytest.fixture(scope="module")
def full() -> tuple[Image, ImageResult]:
    return measured()


@pytest.fixture(scope="module")
def covered() -> tuple[Image, ImageResult]:
    return measured(hidden=True)


def test_a_board_has_its_axes_at_its_origin_and_no_normals(full: tuple[Image, ImageResult]) -> None:
    _, result = full
    _, pen, _ = drawn_of(result)
    pose = result.boards[0].pose
    for axis, color in enumerate(AXES):
        middle = CAMERA.project(pose.translation + 0.5 * 60.0 * pose.rotation[:, axis]).round().astype(int)
        around = pen.canvas[middle[1] - 1 : middle[1] + 2, middle[0] - 1 : middle[0] + 2]
        assert has(around, color)
    # A normal would leave the disc's center towards its rim; the last circle has none, nor an axis.
    center = result.circles[-1].candidates[0].imaged_center.round().astype(int)
    assert not (pen.canvas[center[1] - 12 : center[1] + 13, center[0] - 12 : center[0] + 13] != 128).any()


def test_few_circles_are_all_named_and_of_many_the_corners(full: tuple[Image, ImageResult]) -> None:
    drawn, pen, room = drawn_of(full[1])
    tips, names = plan_names(pen, room, drawn)
    assert {each.lines[0] for each in names.placed} == {circle.circle for circle in full[1].circles}
    assert {each.lines[0] for each in tips.placed} <= {"x", "y", "z"}
    _, many = measured(7, 7)
    assert len(many.circles) > MOST_NAMES
    drawn, pen, room = drawn_of(many)
    names = plan_names(pen, room, drawn)[1]
    assert {each.lines[0] for each in names.placed} == {"r0c0", "r0c6", "r6c0", "r6c6"}


def test_circles_not_seen_are_dashed_and_those_that_misfit_are_named(covered: tuple[Image, ImageResult]) -> None:
    _, result = covered
    drawn, pen, _ = drawn_of(result)
    assert UNUSED in drawn.colors
    assert has(pen.canvas, UNUSED)
    assert MISFIT not in drawn.colors
    board = result.boards[0]
    circles = (replace(board.circles[0], is_used=False), *board.circles[1:])
    drawn, pen, _ = drawn_of(replace(result, boards=(replace(board, circles=circles),)))
    assert MISFIT in drawn.colors
    said = [item.words for item in board_overlay.legend(drawn)]
    assert said[:3] == ["rim by the board's pose", "seen, but does not count in the pose", "not seen"]


def test_the_legend_says_what_is_drawn_and_nothing_else(full: tuple[Image, ImageResult]) -> None:
    drawn, _, _ = drawn_of(full[1])
    said = [item.words for item in board_overlay.legend(drawn)]
    assert said == ["rim by the board's pose", "x axis", "y axis", "z axis, away from the viewer; axes 60 mm long"]
    towards = board_overlay.legend(replace(drawn, is_z_away=False))
    assert towards[-1].words == "z axis; axes 60 mm long"


def test_an_ambiguous_board_shows_the_other_pose(full: tuple[Image, ImageResult]) -> None:
    _, result = full
    board = result.boards[0]
    other = replace(board.pose, rotation=board.pose.rotation @ np.diag([1.0, -1.0, -1.0]))
    doubtful = replace(board, candidates=(board.pose, other), ambiguity=0.4, flags=(Flag.AMBIGUOUS,))
    drawn, pen, _ = drawn_of(replace(result, boards=(doubtful,)))
    assert drawn.has_other
    assert AMBIGUOUS in drawn.colors
    assert CHOSEN not in drawn.colors
    assert has(pen.canvas, OTHER)
    assert "40 % chance of the other pose" in board_words.sentences([doubtful])[0]


def test_the_heading_says_circles_rms_origin_and_sigma(full: tuple[Image, ImageResult]) -> None:
    board = full[1].boards[0]
    first, second = board_words.sentences([board])
    assert first.startswith("1 board, 12 of 12 circles, rms 0.")
    assert second.startswith("origin (-60.0")
    assert "sigma" in second
    several = [board, replace(board, instance=1)]
    assert board_words.sentences(several) == ("2 boards, 24 of 24 circles",)
    assert [row[:2] for row in board_words.rows(several)[1:]] == [("0", "12 of 12"), ("1", "12 of 12")]


def test_residuals_have_a_yardstick_in_standard_deviations_of_the_circles_that_count() -> None:
    first, second = made_board().circles
    assert board_words.misfit(made_board()).startswith("the rims are 0.9 standard deviations off, noise alone")
    both = replace(made_board(), circles=(first, replace(second, is_used=True, sigmas=17.0)))
    assert board_words.misfit(both).startswith("the rims are 12 standard deviations off,")


def test_the_picture_of_residuals_has_the_yardstick(
    full: tuple[Image, ImageResult], monkeypatch: pytest.MonkeyPatch
) -> None:
    written: list[str] = []
    write = Font.write

    def record(font: Font, canvas: Image, lines: Sequence[str], *others: Any) -> Any:
        written.extend(lines)
        return write(font, canvas, lines, *others)

    monkeypatch.setattr(Font, "write", record)
    draw_board_explanation(full[1], CAMERA)
    (line,) = (each for each in written if each.startswith("board 0: 12 of 12 circles, rms 0."))
    assert board_words.misfit(full[1].boards[0]) in line


def test_the_picture_of_a_board_is_that_of_the_image_below_a_heading(covered: tuple[Image, ImageResult]) -> None:
    image, result = covered
    before = image.copy()
    picture = draw_overlay(image, result, CAMERA)
    assert picture.shape[1] == SIZE[0]
    assert picture.shape[0] > SIZE[1]
    assert all(has(picture[-SIZE[1] :], color) for color in (*AXES, UNUSED))
    np.testing.assert_array_equal(image, before)


def test_the_views_of_a_board_have_its_layout(full: tuple[Image, ImageResult]) -> None:
    (view,) = board_views(full[1])
    assert view.spacing_mm == pytest.approx(60.0, abs=1e-6)
    assert np.allclose(view.centers_mm[0], 0.0, atol=1e-9)
    assert np.allclose(view.centers_mm[-1], [120.0, 180.0, 0.0], atol=1e-9)
    assert view.extreme([]) == []
    # Two of the three are as far to one side, but for rounding.
    assert {view.circles[i].circle for i in view.extreme([0, 3, 4])} == {"r0c0", "r1c0", "r1c1"}
