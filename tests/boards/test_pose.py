"""The pose of a board from exact rims: laws, and what does not belong to it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circlepose.boards.fit import fit_board
from circlepose.boards.pose import (
    BoardRims,
    RigidPose,
    circle_derivatives,
    circles_at,
    mirrored,
    pose_of_plane,
    rotation_of,
)
from circlepose.geometry.cone import factor_from_circle
from circlepose.geometry.cone_perturbation import MODES
from circlepose.targets.board import BoardLayout
from tests.support.boards import apart, grid, plate, posed

GRID = grid("symmetric", 4, 5, 30.0, 9.0)
INFORMATION = 1e6


def rims_at(layout: BoardLayout, pose: RigidPose, growth: float = 0.0) -> BoardRims:
    nothing = np.zeros((len(layout), 3, 3))
    rims = BoardRims(
        layout.centers_mm,
        layout.normals,
        layout.radius_mm,
        nothing,
        np.zeros((len(layout), MODES)),
        np.tile(INFORMATION * np.eye(MODES), (len(layout), 1, 1)),
    )
    center, normal, radius = circles_at(rims, pose, growth)
    factor = factor_from_circle(center, normal, radius)
    return BoardRims(rims.centers_mm, rims.normals, rims.radius_mm, factor, rims.coefficients, rims.information)


POSES = st.builds(
    posed,
    st.just(GRID),
    tilt_deg=st.floats(0.0, 70.0),
    azimuth_deg=st.floats(0.0, 360.0),
    roll_deg=st.floats(0.0, 360.0),
    distance_mm=st.floats(300.0, 2000.0),
    at=st.tuples(st.floats(-100.0, 100.0), st.floats(-100.0, 100.0)),
)


@settings(max_examples=50, deadline=None)
@given(pose=POSES, step=st.tuples(*[st.floats(-0.05, 0.05)] * 6))
def test_the_fit_finds_the_pose_back(pose, step):
    shift = np.array(step[:3]) * 300.0
    start = pose.moved(np.array([*shift, *step[3:]]))
    fit = fit_board(rims_at(GRID, pose), start)
    assert fit is not None
    millimeters, degrees = apart(pose, fit.pose.rotation, fit.pose.translation)
    assert millimeters < 1e-4
    assert degrees < 1e-5
    assert fit.used.all()


@settings(max_examples=50, deadline=None)
@given(pose=POSES, turn=st.tuples(*[st.floats(-0.4, 0.4)] * 3))
def test_the_camera_turns_and_the_pose_turns_with_it(pose, turn):
    rotation = rotation_of(np.array(turn))
    rims = rims_at(GRID, pose)
    turned = BoardRims(
        rims.centers_mm, rims.normals, rims.radius_mm, rotation @ rims.factor, rims.coefficients, rims.information
    )
    own, other = (
        fit_board(rims, pose),
        fit_board(turned, RigidPose(rotation @ pose.rotation, rotation @ pose.translation)),
    )
    assert own is not None
    assert other is not None
    millimeters, degrees = apart(other.pose, rotation @ own.pose.rotation, rotation @ own.pose.translation)
    assert millimeters < 1e-4
    assert degrees < 1e-5
    block = np.zeros((6, 6))
    block[:3, :3] = block[3:, 3:] = rotation
    assert np.allclose(other.covariance, block @ own.covariance @ block.T, rtol=1e-4, atol=1e-12)


@settings(max_examples=30, deadline=None)
@given(pose=POSES)
def test_the_derivatives_are_those_of_the_circles(pose):
    rims = rims_at(GRID, pose)
    slopes = circle_derivatives(rims, pose)
    center, normal, _ = circles_at(rims, pose)
    for i in range(6):
        step = np.zeros(6)
        step[i] = 1e-6
        moved_center, moved_normal, _ = circles_at(rims, pose.moved(step))
        assert np.allclose((moved_center - center) / 1e-6, slopes[:, :3, i], atol=1e-3)
        # Tilts lie in the plane that is perpendicular to the normal, so their lengths can be compared.
        change = np.linalg.norm((moved_normal - normal) / 1e-6, axis=1)
        assert np.allclose(change, np.linalg.norm(slopes[:, 3:, i], axis=1), atol=1e-4)


@settings(max_examples=30, deadline=None)
@given(pose=POSES)
def test_a_start_from_the_plane_is_close(pose):
    center, _, _ = circles_at(rims_at(GRID, pose), pose)
    start = pose_of_plane(GRID.centers_mm, center / np.linalg.norm(center, axis=1, keepdims=True), GRID.normals[0])
    assert start is not None
    assert apart(pose, start.rotation, start.translation)[1] < 0.01


def test_no_start_from_a_line():
    line = plate([(40.0 * i, 0.0) for i in range(5)])
    center = line.centers_mm + np.array([0.0, 0.0, 500.0])
    assert (
        pose_of_plane(line.centers_mm, center / np.linalg.norm(center, axis=1, keepdims=True), line.normals[0])
        is None
    )


def test_wrong_rims_do_not_count():
    pose = posed(GRID)
    rims = rims_at(GRID, pose)
    center, normal, radius = circles_at(rims, pose)
    factor = rims.factor.copy()
    for wrong, shift in ((3, [4.0, 0.0, 0.0]), (11, [0.0, -2.0, 1.0])):
        factor[wrong] = factor_from_circle(center[wrong] + shift, normal[wrong], radius[wrong])
    spoilt = BoardRims(rims.centers_mm, rims.normals, rims.radius_mm, factor, rims.coefficients, rims.information)
    fit = fit_board(spoilt, pose.moved(np.full(6, 0.01)))
    assert fit is not None
    assert np.flatnonzero(~fit.used).tolist() == [3, 11]
    assert apart(pose, fit.pose.rotation, fit.pose.translation)[0] < 1e-3


@pytest.mark.parametrize("growth", [-0.08, 0.03])
def test_the_distances_are_believed_where_the_radii_are_not_as_stated(growth):
    pose = posed(GRID)
    fit = fit_board(rims_at(GRID, pose, growth), pose.moved(np.full(6, 0.01)))
    assert fit is not None
    assert fit.growth == pytest.approx(growth, abs=1e-6)
    assert apart(pose, fit.pose.rotation, fit.pose.translation)[0] < 1e-3


def test_the_covariance_is_that_of_the_fits():
    pose = posed(GRID, 40.0)
    rims = rims_at(GRID, pose)
    generator = np.random.default_rng(3)
    squares = []
    for _ in range(60):
        noise = generator.normal(0.0, INFORMATION**-0.5, rims.coefficients.shape)
        noisy = BoardRims(rims.centers_mm, rims.normals, rims.radius_mm, rims.factor, noise, rims.information)
        fit = fit_board(noisy, pose)
        assert fit is not None
        turn = pose.rotation @ fit.pose.rotation.T
        vector = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / 2.0
        error = np.concatenate([pose.translation - fit.pose.translation, vector])
        squares.append(error @ np.linalg.solve(fit.covariance, error))
    # The mean of 60 values of chi-square with 6 degrees of freedom has a standard deviation of 0.45.
    assert 4.8 < np.mean(squares) < 7.2


def test_the_other_tilt_is_reached_by_turning_about_the_line_of_sight():
    pose = posed(GRID, 25.0, distance_mm=4000.0)
    center = GRID.centers_mm.mean(axis=0)
    other = mirrored(pose, center, GRID.normals[0])
    sight = pose.rotation @ center + pose.translation
    sight = sight / np.linalg.norm(sight)
    own, reflected = pose.rotation @ GRID.normals[0], other.rotation @ GRID.normals[0]
    assert np.allclose(own @ sight, reflected @ sight)
    assert np.allclose(other.rotation @ center + other.translation, pose.rotation @ center + pose.translation)
    again = mirrored(other, center, GRID.normals[0])
    assert np.allclose(again.rotation, pose.rotation, atol=1e-9)
