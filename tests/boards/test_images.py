"""Boards in rendered images: found, placed and posed; what does not fit is refused with its reason."""

from __future__ import annotations

import numpy as np
import pytest

import circlepose
from circlepose.boards.diagnosis import why_misfit
from circlepose.results import Flag, Status
from circlepose.targets.board import BoardCircle, BoardLayout
from circlepose.targets.target import Target
from tests.support.boards import CAMERA, apart, grid, picture, plate, posed

GRID = grid("symmetric", 4, 5, 30.0, 9.0)


def measured(image, layout, **others):
    return circlepose.estimate(image, CAMERA, Target.board(layout, **others))


def pose_of(result, number=0):
    board = result.boards[number]
    return board.pose.rotation, board.pose.translation


@pytest.mark.parametrize(
    "layout",
    [GRID, grid("asymmetric", 7, 3, 18.0, 7.0), grid("hexagonal", 5, 5, 26.0, 11.0)],
    ids=["symmetric", "asymmetric", "hexagonal"],
)
def test_a_grid_has_one_pose_from_all_its_circles(layout):
    pose = posed(layout)
    result = measured(picture([(layout, pose)]), layout)
    assert result.status is Status.OK
    (board,) = result.boards
    assert board.circles_used == len(layout)
    millimeters, degrees = apart(pose, *pose_of(result))
    assert millimeters < 0.05
    assert degrees < 0.03
    assert board.pose.rms_px < 0.05
    # Each circle is where the board puts it, those named as in the layout.
    assert [circle.circle for circle in result.circles] == list(layout.names)
    for circle, place in zip(result.circles, layout.centers_mm, strict=True):
        assert np.allclose(circle.pose.center, pose.rotation @ place + pose.translation, atol=0.1)
        assert np.all(circle.pose.sigma_mm < 0.1)


def test_the_covariance_of_a_circle_is_that_of_its_board_there():
    result = measured(picture([(GRID, posed(GRID))]), GRID)
    first = result.circles[0].pose
    assert np.allclose(first.covariance[:3, :3], result.boards[0].pose.covariance[:3, :3])


def test_hidden_circles_have_the_pose_of_their_board():
    pose = posed(GRID, at=(10.0, 5.0))
    result = measured(picture([(GRID, pose)], hidden=(0, 7, 13)), GRID)
    (board,) = result.boards
    assert board.circles_used == 17
    unseen = [circle.circle for circle in result.circles if Flag.NOT_IN_POSE in circle.flags]
    assert unseen == ["r0c0", "r1c2", "r2c3"]
    assert np.allclose(result.circles[7].pose.center, pose.rotation @ GRID.centers_mm[7] + pose.translation, atol=0.1)


def test_two_boards_in_one_image():
    small = grid("symmetric", 3, 3, 24.0, 8.0, marks={(0, 0): (4.0,)})
    poses = [
        posed(small, 20.0, 10.0, 3.0, 520.0, (-80.0, -20.0)),
        posed(small, 35.0, 200.0, -4.0, 560.0, (90.0, 25.0)),
    ]
    result = measured(picture([(small, pose) for pose in poses]), small, count="all")
    assert len(result.boards) == 2
    found = [pose_of(result, number) for number in range(2)]
    assert all(min(apart(pose, *each)[0] for each in found) < 0.05 for pose in poses)
    assert {circle.instance for circle in result.circles} == {0, 1}
    assert result.remark == ""
    one = measured(picture([(small, pose) for pose in poses]), small)
    assert len(one.boards) == 1
    assert one.remark == (
        "9 more circles lie on a lattice like the layout's; one board was asked for: if they are another one, give "
        "count: 2, or all"
    )


def test_a_few_circles_beside_a_board_are_no_board():
    few = grid("symmetric", 2, 4, 30.0, 9.0)
    scene = [
        (GRID, posed(GRID, 20.0, 10.0, 3.0, 560.0, (-80.0, 0.0))),
        (few, posed(few, 0.0, 0.0, 0.0, 560.0, (110.0, 0.0))),
    ]
    result = measured(picture(scene), GRID)
    assert result.boards[0].circles_used == len(GRID)
    assert result.remark == ""


@pytest.mark.parametrize(
    "places",
    [
        [(0.0, 0.0), (60.0, 0.0)],
        [(0.0, 0.0), (70.0, 5.0), (20.0, 50.0)],
        [(0.0, 0.0), (80.0, 0.0), (80.0, 60.0), (0.0, 62.0), (30.0, 25.0)],
    ],
    ids=["two", "three", "five"],
)
def test_a_plate_with_holes(places):
    layout = plate(places)
    pose = posed(layout, 30.0, 70.0, 12.0, 450.0, (15.0, -10.0))
    result = measured(picture([(layout, pose)]), layout)
    assert result.status is Status.OK, result.reason
    millimeters, degrees = apart(pose, *pose_of(result))
    assert millimeters < 0.2
    assert degrees < 0.2


def test_a_list_that_maps_on_itself_leaves_the_roll_open():
    layout = plate([(40.0 * column, 40.0 * row) for row in range(2) for column in range(3)])
    pose = posed(layout, 30.0, 70.0, 5.0, 450.0)
    result = measured(picture([(layout, pose)]), layout)
    assert result.status is Status.OK, result.reason
    assert Flag.ROLL_AMBIGUOUS in result.boards[0].flags
    assert apart(pose, *pose_of(result))[0] < 0.1


def test_circles_in_several_planes():
    circles = [
        BoardCircle("low", (0.0, 0.0, 0.0), (10.0,)),
        BoardCircle("high", (55.0, 0.0, -20.0), (8.0,)),
        BoardCircle("far", (0.0, 50.0, 15.0), (12.0,)),
        BoardCircle("tilted", (60.0, 50.0, 0.0), (9.0,), (0.0, 0.5, -np.sqrt(0.75))),
    ]
    layout = BoardLayout(tuple(circles))
    pose = posed(layout, 20.0, 30.0, 8.0, 400.0)
    result = measured(picture([(layout, pose)]), layout)
    assert result.status is Status.OK, result.reason
    millimeters, degrees = apart(pose, *pose_of(result))
    assert millimeters < 0.1
    assert degrees < 0.1
    assert result.boards[0].circles_used == 4


def test_a_planar_list_whose_axes_run_the_other_way_is_fitted_from_behind():
    layout = plate([(0.0, 0.0), (80.0, 0.0), (80.0, 60.0), (0.0, 62.0), (30.0, 25.0)])
    mirrored_list = plate([(-circle.center_mm[0], circle.center_mm[1]) for circle in layout.circles])
    pose = posed(layout, 30.0, 70.0, 12.0, 450.0)
    image = picture([(layout, pose)])
    result = measured(image, mirrored_list)
    assert result.status is Status.OK
    assert all(circle.pose.normal @ circle.pose.center < 0.0 for circle in result.circles)
    (board,) = result.boards
    # Its z axis points to the camera.
    assert board.pose.rotation[:, 2] @ board.pose.translation < 0.0
    for circle, own in zip(result.circles, layout.centers_mm, strict=True):
        assert np.allclose(circle.pose.center, pose.rotation @ own + pose.translation, atol=0.2)


@pytest.mark.parametrize("layout", [grid("asymmetric", 7, 4, 18.0, 7.0), GRID], ids=["asymmetric", "symmetric"])
def test_a_hidden_row_of_a_board_at_the_border_is_never_guessed(layout):
    # Shifted by a row, the missing one would lie beyond the border.
    pose = posed(layout, 15.0, 90.0, 0.0, 420.0, at=(0.0, 82.0))
    first = tuple(np.flatnonzero(layout.centers_mm[:, 1] == 0.0).tolist())
    assert len(first) > 2
    hidden = measured(picture([(layout, pose)], hidden=first), layout)
    assert hidden.status is Status.LAYOUT_MISMATCH


def test_a_list_that_runs_the_other_way_is_refused_where_the_side_is_known():
    places = [(0.0, 0.0), (80.0, 0.0), (80.0, 60.0), (0.0, 62.0), (30.0, 25.0)]
    mirrored_list = BoardLayout(plate([(-x, y) for x, y in places]).circles, side="front")
    result = measured(picture([(plate(places), posed(plate(places), 30.0, 70.0, 12.0, 450.0))]), mirrored_list)
    assert result.status is Status.LAYOUT_MISMATCH


def test_a_board_larger_than_the_image_is_placed_by_its_marks():
    layout = grid("symmetric", 9, 12, 30.0, 9.0, marks=dict.fromkeys(((4, 5), (4, 6), (3, 5)), (9.0, 5.0)))
    pose = posed(layout, 25.0, 30.0, 10.0, 380.0)
    result = measured(picture([(layout, pose)]), layout)
    (board,) = result.boards
    assert 60 < board.circles_used < 100
    assert apart(pose, *pose_of(result))[0] < 0.05


def test_a_ring_is_a_mark():
    layout = grid("symmetric", 4, 5, 30.0, 9.0, marks={(1, 3): (9.0, 5.0)})
    pose = posed(layout, 25.0, 40.0, 160.0)
    result = measured(picture([(layout, pose)]), layout)
    assert result.status is Status.OK, result.reason
    assert Flag.ROLL_AMBIGUOUS not in result.boards[0].flags
    assert apart(pose, *pose_of(result))[1] < 0.05


@pytest.mark.parametrize("radius", [10.0, 5.6, 4.4])
def test_a_mark_is_known_by_its_size_on_a_board_of_small_dots(radius):
    layout = grid("symmetric", 6, 6, 25.0, 5.0, marks={(0, 5): (radius,)})
    pose = posed(layout, 25.0, 40.0, 100.0, 800.0)
    result = measured(picture([(layout, pose)]), layout)
    assert result.status is Status.OK, result.reason
    assert apart(pose, *pose_of(result))[1] < 0.2


def test_of_the_rolls_that_are_open_x_is_nearest_the_image():
    for roll in (-100.0, 20.0, 80.0, 175.0):
        result = measured(picture([(GRID, posed(GRID, 20.0, 50.0, roll))]), GRID)
        (board,) = result.boards
        assert Flag.ROLL_AMBIGUOUS in board.flags
        assert board.pose.rotation[0, 0] > 0.0


@pytest.mark.parametrize(("shift", "radius"), [(10.0, 8.0), (2.0, 8.0), (0.0, 9.6)])
def test_a_circle_that_is_not_as_stated_is_left_out_and_flagged(shift, radius):
    places = [(0.0, 0.0), (80.0, 0.0), (80.0, 60.0), (5.0, 62.0), (30.0, 25.0)]
    drawn = plate(places)
    pose = posed(drawn, 30.0, 70.0, 12.0, 450.0)
    circles = list(drawn.circles)
    circles[4] = BoardCircle("h4", (30.0 + shift, 25.0, 0.0), (radius,))
    result = measured(picture([(drawn, pose)]), BoardLayout(tuple(circles)))
    (board,) = result.boards
    assert board.circles_used == 4
    assert Flag.CIRCLES_MISFIT in board.flags
    assert apart(pose, *pose_of(result))[0] < 0.2
    right = measured(picture([(drawn, pose)]), drawn)
    assert Flag.CIRCLES_MISFIT not in right.boards[0].flags


def test_larger_discs_than_stated_are_flagged_and_the_distances_believed():
    drawn = grid("symmetric", 4, 5, 30.0, 9.36)
    pose = posed(GRID)
    result = measured(picture([(drawn, pose)]), GRID)
    (board,) = result.boards
    assert Flag.RADIUS_MISFIT in board.flags
    assert board.growth == pytest.approx(0.04, abs=0.003)
    assert apart(pose, *pose_of(result))[0] < 0.1


def test_a_board_from_afar_has_two_poses():
    small = grid("symmetric", 2, 2, 12.0, 4.0)
    far = circlepose.camera.camera.Camera.create([[8000.0, 0, 319.5], [0, 8000.0, 239.5], [0, 0, 1]], (), (640, 480))
    pose = posed(small, 12.0, 30.0, 0.0, 5000.0)
    result = circlepose.estimate(picture([(small, pose)], far, noise=3.0), far, Target.board(small))
    (board,) = result.boards
    assert len(board.candidates) == 2
    assert min(apart(pose, each.rotation, each.translation)[1] for each in board.candidates) < 2.0
    assert board.ambiguity > 1e-6


@pytest.mark.parametrize(
    ("stated", "word"),
    [
        (grid("symmetric", 4, 5, 45.0, 9.0), "spacing"),
        (grid("symmetric", 4, 5, 60.0, 9.0), "spacing"),
        (grid("symmetric", 4, 5, 30.0, 4.5), "diameter"),
        (grid("hexagonal", 4, 5, 30.0, 9.0), "square lattice"),
        (grid("symmetric", 2, 3, 30.0, 9.0), "more rows or columns"),
        (grid("symmetric", 3, 5, 30.0, 9.0), "more rows or columns"),
        (grid("symmetric", 5, 5, 30.0, 9.0), "more than one place"),
        (plate([(0.0, 0.0), (30.0, 0.0)], 9.0), "more than one way"),
        (plate([(0.0, 0.0), (30.0, 0.0), (0.0, 30.0)], 9.0), "more than one way"),
        (plate([(0.0, 0.0), (47.0, 0.0), (11.0, 33.0), (71.0, 52.0)], 9.0), "fit the layout"),
    ],
    ids=[
        "spacing",
        "twice",
        "diameter",
        "pattern",
        "rows",
        "a row less",
        "a row more",
        "two",
        "three",
        "other places",
    ],
)
def test_another_layout_is_refused_with_the_likely_cause(stated, word):
    result = measured(picture([(GRID, posed(GRID))]), stated)
    assert result.status is Status.LAYOUT_MISMATCH
    assert word in result.reason
    assert not result.boards
    # What was found has its lone poses.
    assert len(result.circles) == 20
    assert {circle.circle for circle in result.circles} == {"disc"}


@pytest.mark.parametrize(
    ("layout", "words"), [(GRID, "another spacing?"), (plate([(0.0, 0.0), (50.0, 0.0)]), "radii?")]
)
def test_of_a_list_no_spacing_is_blamed(layout, words):
    found = why_misfit(layout, np.arange(2), 0.25, 3.0, np.ones(2, np.bool_))
    assert "the distances are 0.800 of those stated" in found
    assert found.endswith(words)
    assert ("spacing" in found) == (layout.grid is not None)


def test_of_a_list_no_mark_is_asked_for():
    layout = plate([(40.0 * i, 0.0) for i in range(5)])
    hidden = measured(picture([(layout, posed(layout, 30.0, 50.0, 5.0, 450.0))], hidden=(0,)), layout)
    assert hidden.status is Status.LAYOUT_MISMATCH
    assert hidden.reason.endswith("in more than one way; more of its circles are needed, or one of another size")


def test_a_spacing_that_is_a_little_off_shows_as_another_size():
    result = measured(picture([(GRID, posed(GRID))]), grid("symmetric", 4, 5, 31.5, 9.0))
    (board,) = result.boards
    assert Flag.RADIUS_MISFIT in board.flags


def test_fewer_than_two_circles():
    lone = measured(picture([(GRID, posed(GRID))], hidden=tuple(range(1, 20))), GRID)
    assert lone.status is Status.TOO_FEW_CIRCLES
    assert len(lone.circles) == 1
    none = measured(picture([(GRID, posed(GRID))], hidden=tuple(range(20))), GRID)
    assert none.status is Status.NO_CIRCLE
    assert none.circles == ()


def test_the_camera_and_the_scale_are_terms_of_the_covariance():
    pose = posed(GRID)
    image = picture([(GRID, pose)])
    sigma = circlepose.camera.camera.CameraSigma(focal_px=4.0, center_px=1.0)
    camera = circlepose.camera.camera.Camera.create(
        CAMERA.camera_matrix, CAMERA.dist_coeffs, CAMERA.image_size, sigma=sigma
    )
    result = circlepose.estimate(image, camera, Target.board(GRID, radius_sigma_mm=0.09))
    terms = result.boards[0].pose.terms
    # 0.5 % of the focal length is 0.5 % of the distance, 1 % of the scale is 1 %.
    assert terms.camera[2, 2] ** 0.5 == pytest.approx(0.005 * pose.translation[2], rel=0.2)
    assert terms.radius[2, 2] ** 0.5 == pytest.approx(0.01 * pose.translation[2], rel=0.01)
    assert np.allclose(terms.total, result.boards[0].pose.covariance)


def test_where_no_board_is_asked_for_there_is_none():
    result = circlepose.estimate(picture([(GRID, posed(GRID))]), CAMERA, Target.circle(9.0, count="all"))
    assert result.boards == ()
    assert len(result.circles) == 20


HOLES = [(0.0, 0.0), (80.0, 0.0), (30.0, 50.0)]


@pytest.mark.parametrize("azimuth_deg", [20.0, 140.0, 260.0])
@pytest.mark.parametrize("behind", [False, True])
def test_three_equal_holes_are_told_from_their_mirror_image(behind, azimuth_deg):
    layout = plate(HOLES)
    seen = layout.seen_from_behind if behind else layout
    pose = posed(seen, azimuth_deg=azimuth_deg, roll_deg=70.0)
    # As calipers would have them.
    stated = plate([(0.0, 0.0), (80.1, 0.0), (30.0, 50.15)])
    for each in (layout, stated):
        result = measured(picture([(seen, pose)]), each)
        assert result.status is Status.OK
        for circle, place in zip(result.circles, seen.centers_mm, strict=True):
            assert np.linalg.norm(circle.pose.center - (pose.rotation @ place + pose.translation)) < 3.0


@pytest.mark.parametrize("wrong", [[(0.0, 0.0), (70.0, 0.0), (30.0, 50.0)], [(0.0, 0.0), (80.0, 0.0), (30.0, 60.0)]])
def test_a_list_that_is_wrong_by_millimeters_is_never_quiet(wrong):
    layout = plate(HOLES)
    result = measured(picture([(layout, posed(layout))]), plate(wrong))
    assert result.status is not Status.OK or Flag.CIRCLES_MISFIT in result.boards[0].flags


def test_a_list_that_does_not_fit_says_how_far():
    layout = plate([*HOLES, (70.0, 60.0)])
    result = measured(
        picture([(layout, posed(layout))]), plate([(0.0, 0.0), (95.0, 0.0), (30.0, 42.0), (70.0, 71.0)])
    )
    assert result.status is Status.LAYOUT_MISMATCH
    assert "circles" in result.reason
    assert "none of" not in result.reason


def test_a_hexagonal_grid_whose_odd_rows_go_the_other_way_is_refused():
    # As a grid that begins with the next row.
    printed = grid("hexagonal", 9, 6, 26.0, 11.0, omit=[(0, column) for column in range(6)])
    stated = grid("hexagonal", 8, 6, 26.0, 11.0)
    for azimuth_deg in (20.0, 200.0):
        result = measured(picture([(printed, posed(printed, azimuth_deg=azimuth_deg))]), stated)
        assert result.status is Status.LAYOUT_MISMATCH
