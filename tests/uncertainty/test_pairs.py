"""Distances and angles of pairs of circles: their deviations against changes that are tried."""

from __future__ import annotations

from dataclasses import fields, replace

import cv2
import numpy as np
import pytest

from circlepose.board_result import BoardPose, BoardResult, BoardTerms
from circlepose.camera.camera import Camera, CameraSigma, circle_contour
from circlepose.geometry.cone import plane_basis
from circlepose.results import Candidate, CircleResult, CovarianceTerms, ImageResult
from circlepose.targets.target import Target
from circlepose.uncertainty import pairs as pairs_module
from circlepose.uncertainty.pairs import circle_pairs, placed_circles
from circlepose.uncertainty.systematic import radius_term, with_all_terms
from tests.support.board_results import placed
from tests.support.cases import circle_case
from tests.uncertainty.test_systematic import changed, measured

LENS = Camera.create(
    [[900.0, 0.0, 639.5], [0.0, 930.0, 479.5], [0.0, 0.0, 1.0]], [-0.25, 0.08, 0.001, -0.0005, 0.01], (1280, 960)
)
FIRST = circle_case(60.0, 600.0, 12.0, 35.0, 30.0, 160.0)
SECOND = circle_case(60.0, 750.0, 15.0, 200.0, 48.0, 20.0)
NOTHING = np.zeros((5, 5))


def values(center, normal, other_center, other_normal):
    """Distance in mm and angle in deg."""
    cosine = normal @ other_normal / np.linalg.norm(normal) / np.linalg.norm(other_normal)
    return np.array([np.linalg.norm(center - other_center), np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))])


def moved(case, step):
    """Center and normal after a step (5,) of a pose."""
    return case.center + step[:3], case.normal + step[3:] @ np.stack(plane_basis(case.normal))


def pair_of(*circles, boards=()):
    return circle_pairs(placed_circles(ImageResult("a.png", circles=circles, boards=boards)))


def sigmas(pairs):
    return np.array([pairs.sigma_mm[0], pairs.sigma_deg[0]])


def test_the_noise_of_lone_circles_is_independent():
    rng = np.random.default_rng(3)
    terms, variance = [], np.zeros(2)
    for which in range(2):
        root = rng.normal(size=(5, 5)) * np.repeat([[0.1], [1e-4]], [3, 2], axis=0)
        terms.append(CovarianceTerms(root @ root.T))
        for column in root.T:
            ends = [
                values(*moved(FIRST, sign * column * (which == 0)), *moved(SECOND, sign * column * (which == 1)))
                for sign in (1.0, -1.0)
            ]
            variance += (0.5 * (ends[0] - ends[1])) ** 2
    pairs = pair_of(placed(FIRST.center, FIRST.normal, terms[0]), placed(SECOND.center, SECOND.normal, terms[1], 1))
    exact = values(FIRST.center, FIRST.normal, SECOND.center, SECOND.normal)
    np.testing.assert_allclose([pairs.distance_mm[0], pairs.angle_deg[0]], exact, rtol=1e-12)
    np.testing.assert_allclose(sigmas(pairs), np.sqrt(variance), rtol=1e-5)


def test_an_error_of_the_camera_moves_both_circles_together():
    sigma = CameraSigma(2.0, 0.7)
    camera = replace(LENS, sigma=sigma)
    target = Target.circle(60.0)
    circles = [
        replace(placed(case.center, case.normal, CovarianceTerms(1e-18 * np.eye(5)), number), radius_mm=60.0)
        for number, case in enumerate((FIRST, SECOND))
    ]
    pairs = pair_of(*with_all_terms(circles, camera, target))
    pixels = [circle_contour(camera, case.center, case.normal, case.radius, 720) for case in (FIRST, SECOND)]
    variance = np.zeros(2)
    for name, deviation in (
        ("focal", sigma.focal_px / np.sqrt(900.0 * 930.0)),
        ("x", sigma.center_px),
        ("y", sigma.center_px),
    ):
        ends = []
        for sign in (0.01, -0.01):
            other = changed(LENS, **{name: sign * deviation})
            poses = [
                moved(case, measured(other, rim, case, case.radius))
                for case, rim in zip((FIRST, SECOND), pixels, strict=True)
            ]
            ends.append(values(*poses[0], *poses[1]))
        variance += ((ends[0] - ends[1]) / 0.02) ** 2
    np.testing.assert_allclose(sigmas(pairs), np.sqrt(variance), rtol=5e-3)
    # Each for itself they would be farther off.
    alone = pair_of(
        *(
            placed(case.center, case.normal, CovarianceTerms(circle.candidates[0].covariance), number)
            for number, (case, circle) in enumerate(
                zip((FIRST, SECOND), with_all_terms(circles, camera, target), strict=True)
            )
        )
    )
    assert abs(alone.sigma_mm[0] / pairs.sigma_mm[0] - 1.0) > 0.1


def test_a_larger_radius_scales_the_distance():
    terms = [CovarianceTerms(NOTHING, radius=radius_term(case.center, 0.01)) for case in (FIRST, SECOND)]
    pairs = pair_of(placed(FIRST.center, FIRST.normal, terms[0]), placed(SECOND.center, SECOND.normal, terms[1], 1))
    np.testing.assert_allclose(sigmas(pairs), [0.01 * pairs.distance_mm[0], 0.0], rtol=1e-9, atol=1e-12)


def board(number, rotation, translation, covariance, relative=0.0):
    """A board of two circles, and these."""
    moves = np.array([*translation, 0.0, 0.0, 0.0]) * relative
    terms = BoardTerms(covariance, None, np.outer(moves, moves) if relative else None)
    pose = BoardPose(rotation, translation, terms.total, terms, 0.1)
    circles = []
    for name, place in (("r0c0", np.zeros(3)), ("r0c1", np.array([90.0, 0.0, 0.0]))):
        arm, normal = rotation @ place, -rotation[:, 2]
        chain = np.zeros((5, 6))
        chain[:3, :3] = np.eye(3)
        for axis in range(3):
            turn = np.eye(3)[axis]
            chain[:3, 3 + axis] = np.cross(turn, arm)
            chain[3:, 3 + axis] = np.stack(plane_basis(normal)) @ np.cross(turn, normal)
        center = arm + translation
        own = CovarianceTerms(
            chain @ covariance @ chain.T, radius=radius_term(center, relative) if relative else None
        )
        candidate = Candidate(center, normal, np.zeros(2), covariance=own.total, covariance_terms=own)
        circles.append(CircleResult(number, name, "chen-huang", 35.0, (candidate,)))
    return BoardResult(number, (pose,), 0.0, (), 2), circles


TURNS = [cv2.Rodrigues(np.array(vector))[0] for vector in ([0.4, -0.3, 0.1], [-0.2, 0.5, 0.3])]
PLACES = [np.array([-80.0, -60.0, 600.0]), np.array([120.0, 40.0, 700.0])]


def covariances():
    roots = np.random.default_rng(5).normal(size=(2, 6, 6)) * np.repeat([[0.1], [1e-4]], 3, axis=0)
    return roots, roots @ np.swapaxes(roots, 1, 2)


def test_within_a_board_only_the_scale_changes_distances():
    _, (covariance, _) = covariances()
    whole, circles = board(0, TURNS[0], PLACES[0], covariance, 0.002)
    pairs = pair_of(*circles, boards=(whole,))
    np.testing.assert_allclose([pairs.distance_mm[0], pairs.angle_deg[0]], [90.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(sigmas(pairs), [0.18, 0.0], atol=1e-9)
    exact, circles = board(0, TURNS[0], PLACES[0], covariance)
    np.testing.assert_allclose(sigmas(pair_of(*circles, boards=(exact,))), 0.0, atol=1e-9)


def test_between_boards_each_has_its_own_noise():
    roots, spreads = covariances()
    made = [board(number, TURNS[number], PLACES[number], spreads[number]) for number in range(2)]
    pairs = pair_of(*(circle for _, circles in made for circle in circles), boards=tuple(whole for whole, _ in made))
    between = list(zip(pairs.first.tolist(), pairs.second.tolist(), strict=True)).index((1, 3))

    def poses(steps):
        for rotation, translation, step in zip(TURNS, PLACES, steps, strict=True):
            turned = cv2.Rodrigues(step[3:])[0] @ rotation
            yield from (turned @ [90.0, 0.0, 0.0] + translation + step[:3], -turned[:, 2])

    variance = np.zeros(2)
    for which in range(2):
        for column in roots[which].T:
            steps = [column * (which == 0), column * (which == 1)]
            ends = [values(*poses([sign * step for step in steps])) for sign in (1.0, -1.0)]
            variance += (0.5 * (ends[0] - ends[1])) ** 2
    found = [pairs.sigma_mm[between], pairs.sigma_deg[between]]
    np.testing.assert_allclose(found, np.sqrt(variance), rtol=1e-4)


def test_what_is_not_known_is_nan():
    known = placed(FIRST.center, FIRST.normal, CovarianceTerms(1e-6 * np.eye(5)))
    bare = placed(SECOND.center, SECOND.normal, None, 1)
    assert np.isnan(sigmas(pair_of(known, bare))).all()
    # Two circles of a ring target: how their errors go together is not kept.
    ring = replace(placed(SECOND.center, SECOND.normal, CovarianceTerms(1e-6 * np.eye(5))), circle="inner")
    assert np.isnan(sigmas(pair_of(known, ring))).all()
    assert np.isfinite(pair_of(known, ring).distance_mm).all()


def test_parallel_and_coinciding_circles_have_numbers():
    terms = CovarianceTerms(np.diag([1e-4, 1e-4, 1e-4, 4e-8, 4e-8]))
    first = placed(FIRST.center, FIRST.normal, terms)
    pairs = pair_of(first, placed(FIRST.center + np.array([0.0, 0.0, 50.0]), FIRST.normal, terms, 1))
    assert pairs.angle_deg[0] == 0.0
    assert pairs.sigma_deg[0] == pytest.approx(np.degrees(np.sqrt(8e-8)))
    same = pair_of(first, placed(FIRST.center, FIRST.normal, terms, 1))
    assert same.distance_mm[0] == 0.0
    assert np.isnan(same.sigma_mm[0])


def test_many_pairs_are_computed_in_blocks(monkeypatch):
    _, spreads = covariances()
    made = [board(number, TURNS[number], PLACES[number], spreads[number], 0.001) for number in range(2)]
    circles = [circle for _, both in made for circle in both]
    whole = pair_of(*circles, boards=tuple(each for each, _ in made))
    monkeypatch.setattr(pairs_module, "_BLOCK", 4)
    again = pair_of(*circles, boards=tuple(each for each, _ in made))
    assert len(whole.first) == 6
    for field in fields(whole):
        np.testing.assert_array_equal(getattr(again, field.name), getattr(whole, field.name))


def test_circles_of_two_methods_are_no_pair_and_circles_without_a_pose_have_none():
    first = placed(FIRST.center, FIRST.normal, None)
    second = placed(SECOND.center, SECOND.normal, None, 1)
    assert len(pair_of(first, replace(second, method="kanatani-liu")).first) == 0
    assert len(pair_of(first, replace(second, candidates=()), second).first) == 1
    assert len(pair_of().first) == len(pair_of(first).first) == 0
