"""Poses relative to a world board: geometry, covariance, and what is found beside it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import circlepose
from circlepose.board_result import BoardPose, BoardResult, BoardTerms
from circlepose.boards.pose import rotation_of
from circlepose.camera.camera import Camera, CameraSigma
from circlepose.errors import ArgumentError
from circlepose.geometry.cone import plane_basis
from circlepose.results import Candidate, CircleResult, CovarianceTerms, Flag, ImageResult, Plane, Status
from circlepose.synthesis.render import render
from circlepose.synthesis.scene import Disc, Paint, Scene
from circlepose.targets.target import Target
from tests.support.boards import CAMERA, grid, picture, posed

GRID = grid("symmetric", 4, 5, 30.0, 9.0, marks={(0, 0): (5.0,)})
PLAIN = grid("symmetric", 4, 5, 30.0, 9.0)
RADIUS_MM = 15.0
TARGET = Target.circle(RADIUS_MM)
vectors = st.tuples(*[st.floats(-2.0, 2.0)] * 3).map(np.array)


def with_terms(size, seed):
    """Return a term of each kind, (size, size), and the camera's moves."""
    rng = np.random.default_rng(seed)
    image, radius = (np.cov(rng.normal(size=(size, 3 * size))) for _ in range(2))
    moves = rng.normal(size=(size, 3))
    return image, moves @ moves.T, radius, moves


def board_at(rotation, translation, instance=0, ambiguity=0.0, flags=()):
    terms = BoardTerms(*with_terms(6, 10 + instance))
    pose = BoardPose(rotation, translation, terms.total, terms, 0.1)
    return BoardResult(instance, (pose,), ambiguity, (), 20, flags)


def candidate_at(center, normal):
    terms = CovarianceTerms(*with_terms(5, 1))
    return Candidate(center, normal, np.zeros(2), covariance=terms.total, covariance_terms=terms)


def result_of(rotation, translation, center, normal, **of_world):
    circle = CircleResult(0, "disc", "chen-huang", 5.0, (candidate_at(center, normal),), ambiguity=0.1)
    return ImageResult(
        "a.png",
        circles=(circle,),
        boards=(board_at(rotation_of(np.array([0.3, 0.2, 0.1])), np.array([5.0, 6.0, 400.0]), instance=1),),
        planes=(Plane("chen-huang", normal, float(normal @ center), 3),),
        world=board_at(rotation, translation, **of_world),
    )


SCENE = (rotation_of(np.array([0.4, -0.3, 0.9])), np.array([30.0, -20.0, 500.0]))
CENTER, NORMAL = np.array([80.0, 40.0, 450.0]), np.array([0.1, -0.3, -1.0]) / np.linalg.norm([0.1, -0.3, -1.0])


@given(vectors, vectors)
def test_moving_the_camera_changes_nothing(turn, step):
    rotation = rotation_of(turn)

    def seen(points):
        return points @ rotation.T + 100.0 * step

    first = circlepose.relative_to_world(result_of(*SCENE, CENTER, NORMAL))
    moved = result_of(rotation @ SCENE[0], seen(SCENE[1]), seen(CENTER), rotation @ NORMAL)
    other = moved.boards[0].candidates[0]
    pose = result_of(*SCENE, CENTER, NORMAL).boards[0].candidates[0]
    other = replace(other, rotation=rotation @ pose.rotation, translation=seen(pose.translation))
    moved = replace(moved, boards=(replace(moved.boards[0], candidates=(other,)),))
    second = circlepose.relative_to_world(moved)
    for name in ("center", "normal"):
        assert np.allclose(getattr(first.circles[0].pose, name), getattr(second.circles[0].pose, name), atol=1e-9)
    assert np.allclose(first.boards[0].pose.transform, second.boards[0].pose.transform, atol=1e-9)
    assert np.allclose(first.planes[0].normal, second.planes[0].normal)
    assert first.planes[0].offset_mm == pytest.approx(second.planes[0].offset_mm, abs=1e-9)


def test_a_circle_of_a_plane_stays_in_it():
    result = circlepose.relative_to_world(result_of(*SCENE, CENTER, NORMAL))
    plane, pose = result.planes[0], result.circles[0].pose
    assert plane.normal @ pose.center == pytest.approx(plane.offset_mm)


def moved_circle(step):
    """Return the scene's relative circle after a small step (11,) of the circle and the board."""
    tilt = NORMAL + np.stack(plane_basis(NORMAL)).T @ step[3:5]
    rotation = rotation_of(step[8:]) @ SCENE[0]
    result = result_of(rotation, SCENE[1] + step[5:8], CENTER + step[:3], tilt / np.linalg.norm(tilt))
    return circlepose.relative_to_world(result).circles[0].pose


def test_the_covariance_is_that_of_small_steps_of_both():
    start = moved_circle(np.zeros(11))
    slopes = []
    for step in 1e-6 * np.eye(11):
        pose = moved_circle(step)
        tilts = np.stack(plane_basis(start.normal)) @ (pose.normal - start.normal)
        slopes.append(np.concatenate([pose.center - start.center, tilts]) / 1e-6)
    by_circle, by_board = np.array(slopes).T[:, :5], np.array(slopes).T[:, 5:]
    circle, board = candidate_at(CENTER, NORMAL).covariance_terms, board_at(*SCENE).pose.terms
    moves = by_circle @ circle.camera_moves + by_board @ board.camera_moves
    expected = {
        "image": by_circle @ circle.image @ by_circle.T + by_board @ board.image @ by_board.T,
        "camera": moves @ moves.T,
        "radius": by_circle @ circle.radius @ by_circle.T + by_board @ board.radius @ by_board.T,
    }
    for name, term in expected.items():
        found = getattr(start.covariance_terms, name)
        assert np.allclose(found, term, rtol=1e-3, atol=1e-3 * np.abs(term).max()), name
    assert np.allclose(start.covariance, start.covariance_terms.total)


def test_the_covariance_of_a_board_is_that_of_small_steps_of_both():
    def relative(step):
        result = result_of(rotation_of(step[9:]) @ SCENE[0], SCENE[1] + step[6:9], CENTER, NORMAL)
        pose = result.boards[0].candidates[0]
        moved = replace(
            pose, rotation=rotation_of(step[3:6]) @ pose.rotation, translation=pose.translation + step[:3]
        )
        result = replace(result, boards=(replace(result.boards[0], candidates=(moved,)),))
        return circlepose.relative_to_world(result).boards[0].pose

    start, slopes = relative(np.zeros(12)), []
    for step in 1e-6 * np.eye(12):
        pose = relative(step)
        turn = pose.rotation @ start.rotation.T
        vector = 0.5 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
        slopes.append(np.concatenate([pose.translation - start.translation, vector]) / 1e-6)
    by_own, by_world = np.array(slopes).T[:, :6], np.array(slopes).T[:, 6:]
    own = result_of(*SCENE, CENTER, NORMAL).boards[0].pose.terms
    world = board_at(*SCENE).pose.terms
    expected = by_own @ own.image @ by_own.T + by_world @ world.image @ by_world.T
    assert np.allclose(start.terms.image, expected, rtol=1e-3, atol=1e-3 * np.abs(expected).max())
    moves = by_own @ own.camera_moves + by_world @ world.camera_moves
    assert np.allclose(start.terms.camera, moves @ moves.T, rtol=1e-3, atol=1e-3 * np.abs(moves @ moves.T).max())


def test_doubts_about_the_board_are_doubts_about_all_that_is_relative_to_it():
    flags = (Flag.AMBIGUOUS, Flag.ROLL_AMBIGUOUS, Flag.POOR_FIT)
    result = circlepose.relative_to_world(result_of(*SCENE, CENTER, NORMAL, ambiguity=0.3, flags=flags))
    assert result.circles[0].ambiguity == pytest.approx(0.1 + 0.9 * 0.3)
    expected = (Flag.AMBIGUOUS, Flag.ROLL_AMBIGUOUS, Flag.RELATIVE_TO_BOARD)
    assert result.circles[0].flags == result.boards[0].flags == expected


def test_a_result_without_a_world_board_is_refused():
    result = replace(result_of(*SCENE, CENTER, NORMAL), world=None)
    with pytest.raises(ArgumentError, match="result: has no world board"):
        circlepose.relative_to_world(result)


def test_a_result_is_made_relative_once_and_drawn_as_it_was():
    result = circlepose.relative_to_world(result_of(*SCENE, CENTER, NORMAL))
    with pytest.raises(ArgumentError, match="result: is relative to its world board already"):
        circlepose.relative_to_world(result)
    with pytest.raises(ArgumentError, match="result: expected that of estimate, in the camera frame"):
        circlepose.draw_overlay(np.zeros((480, 640), np.uint8), result, CAMERA)


def test_a_circle_of_the_board_that_misfits_is_not_the_targets_either():
    # Its first disc is printed larger than its mark says.
    printed = grid("symmetric", 4, 5, 30.0, 9.0, marks={(0, 0): (7.0,)})
    image, *_ = scene(4, np.random.default_rng(4), layouts=((printed, -50.0),))
    target = Target.circle(RADIUS_MM, count="all")
    result = circlepose.estimate(image, CAMERA, target, world_board=Target.board(PLAIN))
    assert result.world is not None
    assert len(result.circles) == 1


def scene(number, rng, camera=CAMERA, layouts=((GRID, -50.0),), noise=2.0):
    """Return a picture of boards with a disc beside them, the pose of the first, and the disc's pose."""
    pose = posed(
        layouts[0][0],
        tilt_deg=rng.uniform(15.0, 45.0),
        azimuth_deg=rng.uniform(0.0, 360.0),
        distance_mm=rng.uniform(450.0, 600.0),
        at=(layouts[0][1], rng.uniform(-20.0, 20.0)),
    )
    center = np.array([130.0, rng.uniform(-80.0, 80.0), pose.translation[2] + rng.uniform(-60.0, 60.0)])
    normal = rotation_of(0.3 * rng.normal(size=3)) @ np.array([0.0, 0.0, -1.0])
    discs = [Disc(tuple(center), tuple(normal), RADIUS_MM, Paint(40.0))]
    for layout, _ in layouts:
        places, normals = layout.centers_mm @ pose.rotation.T + pose.translation, layout.normals @ pose.rotation.T
        discs += [
            Disc(tuple(place), tuple(each), radius, Paint(40.0))
            for place, each, radius in zip(places, normals, layout.radius_mm, strict=True)
        ]
    image = render(Scene(camera, tuple(discs), Paint(200.0), blur_px=0.7, noise_levels=noise, noise_seed=number))
    return image, pose, center, normal


def test_the_errors_of_a_wrong_camera_are_those_stated_and_mostly_cancel():
    rng = np.random.default_rng(5)
    focal_px, center_px = 4.0, 2.0
    nees, relative, in_camera = [], [], []
    for number in range(24):
        image, pose, center, normal = scene(number, rng)
        matrix = CAMERA.camera_matrix.copy()
        matrix[[0, 1], [0, 1]] += focal_px * rng.normal()
        matrix[:2, 2] += center_px * rng.normal(size=2)
        wrong = Camera.create(matrix, CAMERA.dist_coeffs, (640, 480), sigma=CameraSigma(focal_px, center_px))
        measured = circlepose.estimate(image, wrong, TARGET, world_board=Target.board(GRID))
        result = circlepose.relative_to_world(measured)
        (circle,), true_normal = result.circles, pose.rotation.T @ normal
        best = max(circle.candidates, key=lambda candidate: candidate.normal @ true_normal)
        error = np.concatenate(
            [
                best.center - pose.rotation.T @ (center - pose.translation),
                np.stack(plane_basis(best.normal)) @ (true_normal - best.normal) * -1.0,
            ]
        )
        nees.append(error @ np.linalg.solve(best.covariance, error))
        relative.append(error[:3])
        in_camera.append(measured.circles[0].pose.center - center)
    # Of 5 dimensions: 24 means scatter by 0.65.
    assert 3.5 < np.mean(nees) < 6.8
    assert np.linalg.norm(relative) < 0.35 * np.linalg.norm(in_camera)


def test_the_circles_of_the_board_are_not_the_targets():
    image, _, center, _ = scene(1, np.random.default_rng(1))
    # By themselves they would be: most of what is seen is theirs.
    assert len(circlepose.estimate(image, CAMERA, Target.circle(RADIUS_MM, count="all")).circles) == 21
    for count in (1, "all"):
        target = Target.circle(RADIUS_MM, count=count)
        result = circlepose.estimate(image, CAMERA, target, world_board=Target.board(GRID))
        (circle,) = result.circles
        assert result.status is Status.OK
        assert result.rejected["a circle of the world board"] == 20
        assert np.allclose(circle.pose.center, center, atol=0.5)


def test_a_disc_that_is_seen_from_its_edge_is_found_beside_a_board():
    pose = posed(GRID, at=(-50.0, 0.0))
    image = picture([(GRID, pose)])
    disc = Disc((110.0, 0.0, 450.0), (1.0, 0.0, -0.02), RADIUS_MM, Paint(40.0))
    alone = render(Scene(CAMERA, (disc,), Paint(200.0), blur_px=0.7))
    result = circlepose.estimate(np.minimum(image, alone), CAMERA, TARGET, world_board=Target.board(GRID))
    assert [circle.status for circle in result.circles] == [Status.OK]


def test_rings_and_boards_are_measured_relative_to_a_board_too():
    pose = posed(GRID, at=(-60.0, 0.0))
    rings = Target("coplanar", (15.0, 9.0))
    ring = [(15.0, 40.0), (9.0, 200.0)]
    normal = rotation_of(np.array([0.3, -0.4, 0.0])) @ np.array([0.0, 0.0, -1.0])
    center = np.array([120.0, 30.0, 480.0])
    image = picture([(GRID, pose)])
    discs = tuple(Disc(tuple(center), tuple(normal), radius, Paint(level)) for radius, level in ring)
    image = np.minimum(image, render(Scene(CAMERA, discs, Paint(200.0), blur_px=0.7)))
    result = circlepose.relative_to_world(circlepose.estimate(image, CAMERA, rings, world_board=Target.board(GRID)))
    assert [circle.circle for circle in result.circles] == ["outer", "inner"]
    truth = pose.rotation.T @ (center - pose.translation)
    assert np.allclose(result.circles[0].pose.center, truth, atol=0.2)

    plate = grid("hexagonal", 3, 3, 24.0, 7.0)
    other = posed(plate, tilt_deg=20.0, azimuth_deg=200.0, at=(110.0, 0.0))
    image = picture([(GRID, posed(GRID, at=(-70.0, 0.0))), (plate, other)])
    pose = posed(GRID, at=(-70.0, 0.0))
    measured = circlepose.estimate(image, CAMERA, Target.board(plate), world_board=Target.board(GRID))
    result = circlepose.relative_to_world(measured)
    (board,) = result.boards
    assert board.circles_used == 9
    # All circles, wherever the roll of the plate is.
    centers = sorted(np.round(circle.pose.center, 0).tolist() for circle in result.circles)
    places = (plate.centers_mm @ other.rotation.T + other.translation - pose.translation) @ pose.rotation
    assert np.allclose(centers, sorted(np.round(places, 0).tolist()), atol=1.01)
    first = result.circles[0].pose
    assert np.allclose(first.center, board.pose.translation, atol=1e-9)
    assert np.allclose(first.covariance[:3, :3], board.pose.covariance[:3, :3])


def test_without_the_board_there_are_no_poses_and_the_reason():
    image, *_ = scene(2, np.random.default_rng(2))
    hexagonal = Target.board(grid("hexagonal", 5, 5, 30.0, 9.0))
    result = circlepose.estimate(image, CAMERA, TARGET, world_board=hexagonal)
    assert result.status is Status.NO_WORLD_BOARD
    assert result.reason.startswith("world board: ")
    assert result.world is None
    assert (result.circles, result.boards) == ((), ())
    assert circlepose.relative_to_world(result) is result


def test_two_boards_of_one_layout_are_no_frame():
    small = grid("symmetric", 3, 3, 25.0, 7.0)
    image = picture([(small, posed(small, at=(-80.0, 0.0))), (small, posed(small, at=(80.0, 0.0)))])
    result = circlepose.estimate(image, CAMERA, TARGET, world_board=Target.board(small))
    assert result.status is Status.NO_WORLD_BOARD
    assert result.reason == "world board: 2 of this layout are in the image"


def test_a_board_that_may_be_turned_flags_what_is_relative_to_it():
    image, *_ = scene(3, np.random.default_rng(3), layouts=((PLAIN, -50.0),))
    result = circlepose.estimate(image, CAMERA, TARGET, world_board=Target.board(PLAIN))
    assert Flag.ROLL_AMBIGUOUS not in result.circles[0].flags
    assert Flag.ROLL_AMBIGUOUS in circlepose.relative_to_world(result).circles[0].flags


@pytest.mark.parametrize(
    ("target", "world", "message"),
    [
        (TARGET, TARGET, "world_board: expected a target of kind board, got one of kind circle"),
        (Target.board(GRID), Target.board(GRID), "world_board: is the target itself"),
        (TARGET, GRID, "world_board: expected a Target"),
        (TARGET, Target.board(GRID, count=2), "world_board: is one board in each image, but its count is 2; leave"),
        (TARGET, Target.board(GRID, count="all"), "world_board: is one board in each image, but its count is all"),
    ],
)
def test_a_world_board_that_is_none_is_refused(target, world, message):
    image = np.zeros((480, 640), np.uint8)
    with pytest.raises(ArgumentError, match=message):
        circlepose.estimate(image, CAMERA, target, world_board=world)
    with pytest.raises(ArgumentError, match=message):
        circlepose.measure("none.png", CAMERA, target, world_board=world)
