from __future__ import annotations

import numpy as np
import pytest

from circlepose.disambiguation.common_plane import common_plane
from circlepose.disambiguation.hint_likelihoods import decide, facing, rough_normal, up_direction
from circlepose.errors import ArgumentError
from circlepose.geometry.cone import factor_from_circle, plane_basis, principal_frame
from circlepose.solvers.chen_huang import poses_from_frame
from tests.support.cases import random_rotation


def scene(rng, number, tilt_deg, half_width_mm, sigma_deg, *, strangers=0, distance_mm=800.0, radius_mm=20.0):
    """Candidates of measured circles in one plane, in any order, and which is right; the first ones are not in it."""
    tilt, lean, sigma = np.radians(tilt_deg), rng.uniform(0.0, 2.0 * np.pi), np.radians(sigma_deg)
    normal = np.array([np.sin(tilt) * np.cos(lean), np.sin(tilt) * np.sin(lean), -np.cos(tilt)])
    e1, e2 = plane_basis(normal)
    place = rng.uniform(-half_width_mm, half_width_mm, (number, 2))
    centers = np.array([0.0, 0.0, distance_mm]) + place[:, :1] * e1 + place[:, 1:] * e2
    normals = np.tile(normal, (number, 1))
    for i in range(strangers):
        other = rng.normal(size=3)
        normals[i] = -np.sign(other @ centers[i]) * other / np.linalg.norm(other)
        centers[i] += rng.choice([-70.0, 70.0]) * normal
    ranges = np.linalg.norm(centers, axis=-1, keepdims=True)
    sight = centers / ranges
    error = rng.normal(size=(number, 3))
    first, second = plane_basis(normals)
    measured = normals + sigma * (error[:, :1] * first + error[:, 1:2] * second)
    measured /= np.linalg.norm(measured, axis=-1, keepdims=True)
    sigma_range = 0.5 * sigma * ranges
    moved = centers + sigma_range * error[:, 2:] * sight
    radii = np.full(number, radius_mm)
    pairs = poses_from_frame(principal_frame(factor_from_circle(moved, measured, radii)), radii)
    right = np.argmax(np.einsum("mkx,mx->mk", pairs[1], measured), axis=-1)
    turned = rng.random(number) < 0.5
    candidates = [np.where(turned[:, None, None], p[:, ::-1], p) for p in pairs]
    sigma_mm = np.abs(sigma_range[:, 0] * np.sum(sight * normals, axis=-1))
    return (
        *candidates,
        np.full((number, 2), sigma),
        np.stack([sigma_mm, sigma_mm], axis=-1),
        np.where(turned, 1 - right, right),
    )


@pytest.mark.parametrize("tilt_deg", [3.0, 30.0, 70.0])
@pytest.mark.parametrize("number", [3, 8, 40])
@pytest.mark.parametrize("given_mm", [True, False])
def test_circles_on_a_board_are_all_told(tilt_deg, number, given_mm):
    rng = np.random.default_rng(number)
    centers, normals, sigma_rad, sigma_mm, right = scene(rng, number, tilt_deg, 150.0, 0.1)
    choice = decide(common_plane(centers, normals, sigma_rad, sigma_mm if given_mm else None))
    np.testing.assert_array_equal(choice.chosen, right)
    assert np.median(choice.ambiguity) < 1e-4


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("strangers", [1, 4])
def test_a_few_circles_elsewhere_do_no_harm_and_are_not_judged(seed, strangers):
    centers, normals, sigma_rad, sigma_mm, right = scene(
        np.random.default_rng(seed), 12, 30.0, 150.0, 0.3, strangers=strangers
    )
    scores = common_plane(centers, normals, sigma_rad, sigma_mm)
    choice = decide(scores)
    np.testing.assert_array_equal(choice.chosen[strangers:], right[strangers:])
    np.testing.assert_allclose(choice.ambiguity[:strangers], 0.5, atol=1e-3)
    np.testing.assert_allclose(np.exp(scores).sum(axis=1), 1.0)


@pytest.mark.parametrize(
    ("number", "tilt_deg", "half_width_mm", "sigma_deg", "scenes"),
    [(2, 10.0, 50.0, 3.0, 160), (3, 10.0, 50.0, 3.0, 120), (8, 20.0, 30.0, 4.0, 80), (8, 20.0, 10.0, 4.0, 80)],
)
def test_the_probability_of_being_wrong_is_a_share_of_wrong_ones(number, tilt_deg, half_width_mm, sigma_deg, scenes):
    """From two circles to a small board that its own mirror image explains as well."""
    rng = np.random.default_rng(11)
    said, wrong = [], []
    for _ in range(scenes):
        centers, normals, sigma_rad, sigma_mm, right = scene(rng, number, tilt_deg, half_width_mm, sigma_deg)
        choice = decide(common_plane(centers, normals, sigma_rad, sigma_mm))
        said.extend(choice.ambiguity)
        wrong.extend(choice.chosen != right)
    said, wrong = np.array(said), np.array(wrong)
    # The circles of one scene are right or wrong together, so only the scenes count.
    assert wrong.mean() == pytest.approx(said.mean(), abs=3.0 * np.sqrt(said.mean() / scenes))
    for low, high in ((0.0, 0.01), (0.01, 0.1), (0.1, 0.3), (0.3, 0.5)):
        among = (said >= low) & (said <= high)
        if among.sum() > 40:
            error = np.sqrt(said[among].mean() * number / among.sum())
            assert wrong[among].mean() == pytest.approx(said[among].mean(), abs=3.0 * error + 0.01)


def test_a_small_far_board_is_as_well_its_mirror_image():
    centers, normals, sigma_rad, sigma_mm, _ = scene(
        np.random.default_rng(0), 30, 25.0, 1.0, 2.0, distance_mm=4000.0, radius_mm=1.0
    )
    choice = decide(common_plane(centers, normals, sigma_rad, sigma_mm))
    assert np.all(choice.ambiguity > 0.3)


def test_the_plane_does_not_depend_on_the_frame_the_order_or_the_unit():
    rng = np.random.default_rng(1)
    centers, normals, sigma_rad, sigma_mm, _ = scene(rng, 6, 10.0, 40.0, 3.0)
    scores = common_plane(centers, normals, sigma_rad, sigma_mm)
    turn = random_rotation(5)
    np.testing.assert_allclose(
        common_plane(centers @ turn.T, normals @ turn.T, sigma_rad, sigma_mm), scores, atol=1e-4
    )
    np.testing.assert_allclose(common_plane(1e-3 * centers, normals, sigma_rad, 1e-3 * sigma_mm), scores, atol=1e-4)
    order = rng.permutation(6)
    shuffled = common_plane(centers[order], normals[order], sigma_rad[order], sigma_mm[order])
    np.testing.assert_allclose(shuffled, scores[order], atol=1e-4)
    np.testing.assert_allclose(
        common_plane(centers[:, ::-1], normals[:, ::-1], sigma_rad, sigma_mm), scores[:, ::-1], atol=1e-4
    )


@pytest.mark.parametrize("number", [0, 1])
def test_one_circle_alone_has_no_plane_with_others(number):
    centers, normals, sigma_rad, sigma_mm, _ = scene(np.random.default_rng(0), 1, 30.0, 50.0, 1.0)
    scores = common_plane(centers[:number], normals[:number], sigma_rad[:number], sigma_mm[:number])
    np.testing.assert_allclose(np.exp(scores), np.full((number, 2), 0.5))


def test_two_circles_that_share_no_plane_are_not_judged():
    centers = np.array([[[-50.0, 0.0, 800.0]] * 2, [[50.0, 0.0, 800.0]] * 2])
    normals = np.array([[[0.6, 0.0, -0.8], [-0.6, 0.0, -0.8]], [[0.0, 0.8, -0.6], [0.0, -0.8, -0.6]]])
    scores = common_plane(centers, normals, np.full((2, 2), 0.01))
    np.testing.assert_allclose(np.exp(scores), 0.5, atol=0.01)


MIRRORED = np.array([[[0.3, 0.0, -0.954], [-0.3, 0.0, -0.954]], [[0.0, -0.5, -0.866], [0.0, 0.5, -0.866]]])
SIGMA = np.full((2, 2), np.radians(2.0))


def test_rough_normal():
    choice = decide(rough_normal(MIRRORED, np.array([-2.0, 1.0, -4.0]), 10.0))
    np.testing.assert_array_equal(choice.chosen, [1, 1])
    assert np.all(choice.ambiguity < 0.05)
    vaguer = decide(rough_normal(MIRRORED, np.array([-2.0, 1.0, -4.0]), 60.0))
    assert np.all(vaguer.ambiguity > choice.ambiguity)


def test_rough_normal_is_a_gaussian_of_the_angle():
    normals = np.array([[[0.0, 0.0, -1.0], [0.0, np.sin(0.2), -np.cos(0.2)]]])
    scores = rough_normal(normals, np.array([0.0, 0.0, -3.0]), np.degrees(0.1))
    np.testing.assert_allclose(scores, [[0.0, -2.0]], atol=1e-12)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_up_direction_takes_floors_and_ceilings(sign):
    tilt = np.radians(40.0)
    floor_seen_from_above = [0.0, -np.cos(tilt), -np.sin(tilt)]
    ceiling = [0.0, np.cos(tilt), -np.sin(tilt)]
    wall = [0.9, 0.0, -np.sqrt(1.0 - 0.81)]
    normals = np.array([[floor_seen_from_above, wall], [wall, ceiling]])
    up = np.array(floor_seen_from_above)
    choice = decide(up_direction(normals[:1], sign * up, 10.0))
    assert choice.chosen[0] == 0
    assert choice.ambiguity[0] < 1e-3
    assert decide(up_direction(normals[1:], sign * np.array(ceiling), 10.0)).chosen[0] == 1


@pytest.mark.parametrize(("side", "expected"), [([1.0, 0, 0], 0), ([-1.0, 0, 0], 1)])
def test_facing(side, expected):
    choice = decide(facing(MIRRORED, np.array(side), SIGMA))
    assert choice.chosen[0] == expected
    assert choice.ambiguity[0] < 1e-6
    # The other surface leans up or down, which says nothing on left and right.
    assert choice.ambiguity[1] == pytest.approx(0.5)


def test_the_chance_that_errors_have_exchanged_the_candidates():
    """Surfaces that lean right by anything, measured with errors: those that seem to lean left are told wrong."""
    rng = np.random.default_rng(2)
    sigma, number = 0.05, 20000
    tilt = rng.uniform(0.0, 0.5, number) + sigma * rng.normal(size=number)
    normals = np.stack([np.sin(tilt), np.zeros_like(tilt), -np.cos(tilt)], axis=-1)
    candidates = np.stack([normals, normals * np.array([-1.0, 1.0, 1.0])], axis=1)
    choice = decide(facing(candidates, np.array([2.0, 0.0, 0.0]), np.full((number, 2), sigma)))
    wrong = choice.chosen == 1
    for low, high in ((0.0, 0.05), (0.05, 0.2), (0.2, 0.5)):
        among = (choice.ambiguity >= low) & (choice.ambiguity <= high)
        assert among.sum() > 500
        assert wrong[among].mean() == pytest.approx(choice.ambiguity[among].mean(), abs=0.03)


def test_hints_add_up():
    normals = np.array([[[0.1, 0.0, -0.995], [-0.1, 0.0, -0.995]]])
    weak = rough_normal(normals, np.array([0.3, 0.0, -1.0]), 20.0)
    twice = decide(weak + weak)
    once = decide(weak)
    assert twice.chosen[0] == once.chosen[0] == 0
    assert twice.ambiguity[0] < once.ambiguity[0] < 0.5


def test_no_hint_is_a_toss():
    choice = decide(np.zeros((3, 2)))
    np.testing.assert_array_equal(choice.ambiguity, 0.5)
    np.testing.assert_array_equal(choice.chosen, 0)


@pytest.mark.parametrize(
    ("normals", "sigma"),
    [(np.zeros((3, 3)), np.ones((3, 2))), (MIRRORED, np.ones((3, 2))), (MIRRORED, np.zeros((2, 2)))],
    ids=["one candidate", "other number", "no error"],
)
def test_misuse(normals, sigma):
    with pytest.raises(ArgumentError, match="expected"):
        facing(normals, np.array([1.0, 0.0, 0.0]), sigma)
    with pytest.raises(ArgumentError, match="expected"):
        common_plane(normals, normals, sigma)
