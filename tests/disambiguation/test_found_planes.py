"""Planes that are found: laws on simulated circles, whose errors are those that their covariances state."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.support.plane_scenes import simulated
from circlepose.disambiguation.found_planes import find_planes
from circlepose.disambiguation.observed import observations, observed
from circlepose.disambiguation.options import DEFAULT
from circlepose.disambiguation.settle import settled
from circlepose.geometry.cone import plane_basis
from circlepose.results import Flag, SettledBy
from circlepose.targets.hints import DirectionHint
from circlepose.targets.target import Target
from tests.support.cases import random_rotation
from tests.support.discs import CAMERA

TARGET = Target.circle(20.0, count="all")
SEEDS = st.integers(0, 10**6)


def scene(seed, in_planes, strays=0, **setup):
    return simulated(np.random.default_rng(seed), in_planes, strays, **setup)


def found(candidates):
    return find_planes(candidates)


def turned(circles, rotation):
    """The candidates as a camera sees them that is turned."""
    slopes = np.zeros((len(circles.centers), 2, 3, 3))
    normals = circles.normals @ rotation.T
    # The tilts are towards other vectors.
    bases = np.stack(plane_basis(normals), axis=-2)
    slopes[..., :2, :2] = np.einsum("mktx,xy,mksy->mkts", bases, rotation, circles.bases)
    slopes[..., 2, 2] = 1.0
    covariances = slopes @ circles.covariances @ np.swapaxes(slopes, -1, -2)
    return observations(circles.centers @ rotation.T, normals, covariances)


def chosen(planes):
    return np.argmax(planes.log_probabilities, axis=1)


def ambiguity(planes):
    return np.exp(planes.log_probabilities.min(axis=1))


@given(SEEDS, st.integers(0, 10**6))
def test_a_turned_camera_chooses_alike(seed, turn):
    circles = observed(scene(seed, (5,), 2).circles, DEFAULT)
    rotation = random_rotation(turn)
    before, after = found(circles), found(turned(circles, rotation))
    np.testing.assert_array_equal(after.planes, before.planes)
    np.testing.assert_allclose(np.exp(after.log_probabilities), np.exp(before.log_probabilities), atol=1e-3)
    np.testing.assert_allclose(after.normals, before.normals @ rotation.T, atol=1e-4)
    np.testing.assert_allclose(after.offsets, before.offsets, rtol=1e-4)


@given(SEEDS)
def test_the_order_of_circles_and_candidates_does_not_count(seed):
    circles = observed(scene(seed, (4, 4), 2).circles, DEFAULT)
    order = np.random.default_rng(seed).permutation(len(circles.centers))
    before, after = found(circles), found(circles.subset(order))
    np.testing.assert_allclose(np.exp(after.log_probabilities), np.exp(before.log_probabilities)[order], atol=1e-3)
    same = before.planes[:, None] == before.planes
    np.testing.assert_array_equal((after.planes[:, None] == after.planes), same[np.ix_(order, order)])
    swapped = observations(circles.centers[:, ::-1], circles.normals[:, ::-1], circles.covariances[:, ::-1])
    np.testing.assert_allclose(
        np.exp(found(swapped).log_probabilities), np.exp(before.log_probabilities)[:, ::-1], atol=1e-3
    )


@pytest.mark.parametrize("most_tilt_deg", [75.0, 15.0])
def test_no_plane_is_made_up_of_circles_with_poses_of_their_own(most_tilt_deg):
    """Also where all nearly face the camera, and so have nearly the same normal."""
    for seed in range(200):
        number = 3 + seed % 18
        noise_px = (0.02, 0.1, 0.5)[seed % 3]
        made = scene(seed, (), number, noise_px=noise_px, most_tilt_deg=most_tilt_deg)
        circles = settled(made.circles, TARGET, CAMERA)
        assert circles.planes == ()
        for circle in circles.circles:
            assert circle.ambiguity == 0.5
            assert circle.settled_by is SettledBy.NONE
            assert circle.plane is None
            assert Flag.AMBIGUOUS in circle.flags


@given(SEEDS, st.integers(3, 8), st.integers(0, 3))
def test_circles_in_one_plane_settle_each_other_and_no_others(seed, number, strays):
    made = scene(seed, (number,), strays)
    result = settled(made.circles, TARGET, CAMERA)
    if np.sum(made.planes == 0) < 3:
        return
    (plane,) = result.planes
    assert np.degrees(np.arccos(min(plane.normal @ made.normals[made.planes == 0][0], 1.0))) < 1.0
    for circle, right, own in zip(result.circles, made.right, made.planes, strict=True):
        assert (circle.plane is None) or own == 0
        if own < 0:
            assert circle.ambiguity > 0.45
            assert Flag.AMBIGUOUS in circle.flags
        elif circle.ambiguity < 1e-3:
            original = next(each for each in made.circles if each.instance == circle.instance)
            assert circle.candidates[0] is original.candidates[right]
            assert circle.settled_by is SettledBy.COMMON_PLANE
            assert circle.plane == 0


@pytest.mark.parametrize("seed", range(10))
def test_two_and_three_planes_are_told_apart(seed):
    made = scene(seed, (6, 5, 4) if seed % 2 else (8, 4), 2)
    planes = found(observed(made.circles, DEFAULT))
    assert len(planes.normals) == 2 + seed % 2
    for index in range(made.planes.max() + 1):
        inside = planes.planes[made.planes == index]
        assert len(set(inside.tolist())) == 1
        assert inside[0] >= 0
    np.testing.assert_array_equal(planes.planes[made.planes < 0], -1)
    sure = ambiguity(planes) < 1e-3
    assert np.mean(sure[made.planes >= 0]) > 0.9
    np.testing.assert_array_equal(chosen(planes)[sure], made.right[sure])


@pytest.mark.parametrize("seed", range(10))
def test_two_circles_make_no_plane_by_themselves(seed):
    made = scene(seed, (2,), 3, noise_px=0.02)
    assert len(found(observed(made.circles, DEFAULT)).normals) == 0
    pair = [circle for circle, own in zip(made.circles, made.planes, strict=True) if own == 0]
    assert settled(pair, TARGET, CAMERA).circles == pair


def test_mirror_planes_far_away_stay_ambiguous():
    """Seen from afar the mirror image of a small board is a board as well."""
    doubted = []
    for seed in range(10):
        made = scene(seed, (8,), distance_mm=6000.0, extent_mm=8.0, noise_px=0.3, most_tilt_deg=40.0)
        doubted.extend(ambiguity(found(observed(made.circles, DEFAULT))))
    assert np.mean(np.array(doubted) > 0.2) > 0.8


def test_a_hint_settles_mirror_planes():
    made = scene(3, (8,), distance_mm=6000.0, extent_mm=8.0, noise_px=0.3, most_tilt_deg=40.0)
    hint = DirectionHint(tuple(made.normals[0]), 20.0)
    plain, hinted = (settled(made.circles, t, CAMERA) for t in (TARGET, replace(TARGET, normal_hint=hint)))
    for before, after in zip(plain.circles, hinted.circles, strict=True):
        assert after.ambiguity < before.ambiguity


@pytest.mark.parametrize("extent_mm", [25.0, 100.0])
def test_the_ambiguity_is_the_probability_of_being_wrong(extent_mm):
    """From near to so far that the mirror image is nearly as good."""
    rng = np.random.default_rng(7)
    said, wrong = [], []
    for _ in range(250):
        made = simulated(
            rng,
            (int(rng.integers(3, 9)),),
            int(rng.integers(0, 3)),
            noise_px=float(10.0 ** rng.uniform(-1.0, 0.0)),
            distance_mm=float(10.0 ** rng.uniform(2.9, 3.7)),
            extent_mm=extent_mm,
            most_tilt_deg=60.0,
        )
        planes = found(observed(made.circles, DEFAULT))
        inside = ambiguity(planes) < 0.499
        said.append(ambiguity(planes)[inside].sum())
        wrong.append(np.sum(chosen(planes)[inside] != made.right[inside]))
    assert np.sum(said) > 3.0
    # The circles of one plane are right or wrong together.
    error = np.sqrt(np.sum((np.array(said) - np.array(wrong)) ** 2))
    assert np.sum(wrong) == pytest.approx(np.sum(said), abs=3.0 * error)


def test_errors_larger_than_stated_make_doubt_not_mistakes():
    wrong = total = 0
    for seed in range(40):
        made = scene(seed, (8,), 1, noise_px=0.3)
        stated = observed(made.circles, replace(DEFAULT, flatness_deg=1e-3, flatness_mm=1e-3))
        planes = found(observations(stated.centers, stated.normals, stated.covariances / 9.0))
        sure = ambiguity(planes) < 0.05
        wrong += np.sum(chosen(planes)[sure] != made.right[sure])
        total += sure.sum()
    assert total > 200
    assert wrong <= 0.01 * total


def test_a_thousand_circles_take_a_fraction_of_a_second():
    import time  # noqa: PLC0415

    circles = observed(scene(0, (700, 200), 100, extent_mm=400.0).circles, DEFAULT)
    best = np.inf
    for _ in range(3):
        start = time.perf_counter()
        planes = found(circles)
        best = min(best, time.perf_counter() - start)
    assert len(planes.normals) == 2
    # A wide margin for a busy machine.
    assert best < 1.0
