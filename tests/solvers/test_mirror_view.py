"""Where proposition 2 of Fu & Zhou fails: solved for with exact cones, beside the closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.optimize import brentq

from circlepose.errors import ArgumentError
from circlepose.geometry.cone import factor_from_circle, principal_frame
from circlepose.solvers.chen_huang import poses_from_frame
from circlepose.solvers.fu_zhou_coaxial import generatrix_ends, pair_candidates
from circlepose.solvers.mirror_view import equal_length_tilt, farthest_mirror_distance, mirror_tilt, mirror_view
from tests.support.cases import circle_case

RADIUS = 45.0
SHAPES = {
    "recess": (8.0, 0.667, -0.938, 78.8),
    "boss": (5.0, 0.9, 0.94, 29.8),
    "recess of a wide floor": (5.0, 0.9, -0.94, 60.1),
    "low boss, close": (3.0, 0.9, 0.6, 32.1),
}
"""distance, small radius and height in big radii; the tilt (deg) at which both circles are seen under one angle"""


def axis_misalignment(center_big, normal_big, center_small, normal_small):
    """How far the small circle's center is off the axis that has the mean direction of both normals."""
    axis = normal_big + normal_small
    axis /= np.linalg.norm(axis, axis=-1, keepdims=True)
    return np.linalg.norm(np.cross(center_small - center_big, axis), axis=-1)


def pairs(distance, share, height, tilt_deg):
    """Centers and normals (2, 3) of both pairs, the right one first: (big, small)."""
    case = circle_case(RADIUS, distance * RADIUS, 11.0, 25.0, tilt_deg, 70.0)
    center = case.center + height * RADIUS * case.normal
    made = []
    for middle, radius in ((case.center, RADIUS), (center, share * RADIUS)):
        centers, normals = poses_from_frame(principal_frame(factor_from_circle(middle, case.normal, radius)), radius)
        right = int(np.argmax(normals @ case.normal))
        made.append((centers[[right, 1 - right]], normals[[right, 1 - right]]))
    return made


def lengths(distance, share, height, tilt_deg):
    """Generatrices (2, 2), mm, of the right pair and the wrong one, at both ends."""
    big, small = pairs(distance, share, height, tilt_deg)
    return generatrix_ends(*big, RADIUS, *small, share * RADIUS)


def excess_mm(distance, share, height, tilt_deg, end):
    """By how much the wrong pair's generatrix is too long at an end: CC1 - NN1."""
    right, wrong = lengths(distance, share, height, tilt_deg)
    return float(wrong[end] - right[end])


def between_bisectors(distance, share, height, tilt_deg):
    """The angle between the axes of both cones, with a sign."""
    case = circle_case(RADIUS, distance * RADIUS, 11.0, 25.0, tilt_deg, 70.0)
    center = case.center + height * RADIUS * case.normal
    first, second = (
        principal_frame(factor_from_circle(middle, case.normal, radius)).rotation[:, 2]
        for middle, radius in ((case.center, RADIUS), (center, share * RADIUS))
    )
    return float(np.cross(first, second) @ np.cross(case.center, case.normal))


@pytest.mark.parametrize("end", [0, 1])
@pytest.mark.parametrize("shape", SHAPES)
def test_proposition_2_fails_where_both_circles_are_seen_under_one_angle(shape, end):
    distance, share, height, tilt_deg = SHAPES[shape]
    known = RADIUS * np.hypot(height, 1.0 - share)
    solved = brentq(lambda t: excess_mm(distance, share, height, t, end), tilt_deg - 5.0, tilt_deg + 5.0, xtol=1e-13)
    assert solved == pytest.approx(tilt_deg, abs=0.05)
    # To nine digits, and at the other end as well.
    np.testing.assert_allclose(lengths(distance, share, height, solved), known, rtol=1e-9)
    closed = equal_length_tilt(RADIUS, share * RADIUS, height * RADIUS, distance * RADIUS)
    assert np.degrees(closed) == pytest.approx(solved, abs=1e-9)
    # The pair is not coaxial, so its other cue remains.
    big, small = pairs(distance, share, height, solved)
    right, wrong = axis_misalignment(*big, *small)
    assert right < 1e-9
    assert wrong > 0.1 * RADIUS


@pytest.mark.parametrize(
    ("share", "height", "distance", "tilt_deg"), [(2 / 3, -1 / 45, 714 / 45, 50.75), (0.5, -0.02, 20.0, 57.84)]
)
def test_a_shallow_recess_has_a_view_in_which_both_pairs_fit(share, height, distance, tilt_deg):
    around = tilt_deg - 5.0, tilt_deg + 5.0
    solved = brentq(lambda t: between_bisectors(distance, share, height, t), *around, xtol=1e-13)
    assert solved == pytest.approx(tilt_deg, abs=0.005)
    by_length = brentq(lambda t: excess_mm(distance, share, height, t, 0), *around, xtol=1e-13)
    assert by_length == pytest.approx(solved, abs=1e-8)
    assert np.degrees(mirror_tilt(RADIUS, share * RADIUS, height * RADIUS, distance * RADIUS)) == pytest.approx(
        solved, abs=1e-8
    )
    known = RADIUS * np.hypot(height, 1.0 - share)
    np.testing.assert_allclose(lengths(distance, share, height, solved), known, rtol=1e-9)
    # Nothing is left that tells the pairs apart: the wrong one is coaxial, too, and has the same height.
    big, small = pairs(distance, share, height, solved)
    assert axis_misalignment(*big, *small).max() < 1e-6
    np.testing.assert_allclose(np.sum(big[1] * small[1], axis=-1), 1.0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(small[0] - big[0], axis=-1), -height * RADIUS, rtol=1e-7)


def test_the_rule_of_thumb_for_shallow_recesses():
    """cos(tilt) = |h| D / (R^2 - r^2) to first order in h and in R/D."""
    rough = np.degrees(np.arccos(1.0 * 714.0 / (45.0**2 - 30.0**2)))
    assert np.degrees(mirror_tilt(45.0, 30.0, -1.0, 714.0)) == pytest.approx(rough, abs=0.3)


TALL = st.floats(-2.0, 2.0).filter(lambda h: abs(h) > 0.01)


@given(st.floats(1.05, 30.0), st.floats(0.1, 0.98), TALL, st.floats(0.0, 89.0))
def test_equal_lengths_are_found_at_these_tilts_alone(distance, share, height, tilt_deg):
    """Away from the frontal view CC1 = NN1 means one angle of view or one bisector: no third kind of view."""
    y = distance * np.cos(np.radians(tilt_deg))
    assume(tilt_deg > 2.0 and y > max(height, 0.0) + 0.05)
    (right, _), (wrong_near, wrong_far) = lengths(distance, share, height, tilt_deg)
    special = [float(np.degrees(tilt(1.0, share, height, distance))) for tilt in (equal_length_tilt, mirror_tilt)]
    if min(abs(np.nan_to_num(each, nan=180.0) - tilt_deg) for each in special) > 1.0:
        assert abs(wrong_near - right) > 1e-7 * RADIUS
        # One end is too long and the other too short.
        assert (wrong_near > right) != (wrong_far > right)


@given(st.floats(1.05, 30.0), st.floats(0.1, 0.98), TALL)
def test_the_tilts_are_those_of_their_definitions(distance, share, height):
    for tilt in (equal_length_tilt, mirror_tilt):
        degrees = float(np.degrees(tilt(RADIUS, share * RADIUS, height * RADIUS, distance * RADIUS)))
        if not 2.0 < degrees < 88.0 or distance * np.cos(np.radians(degrees)) - max(height, 0.0) < 0.05:
            continue
        np.testing.assert_allclose(
            lengths(distance, share, height, degrees), RADIUS * np.hypot(height, 1.0 - share), rtol=1e-8, atol=1e-8
        )
        if tilt is mirror_tilt:
            assert between_bisectors(distance, share, height, degrees) == pytest.approx(0.0, abs=1e-6)


@given(st.floats(1.05, 30.0), st.floats(0.1, 0.98), TALL, st.floats(1.0, 89.0), st.booleans(), st.booleans())
def test_candidates_are_paired_one_to_one_and_rightly_from_any_distance(
    distance, share, height, tilt_deg, turn_big, turn_small
):
    """Also in close-ups, where both candidates of one circle may be nearest to one candidate of the other."""
    assume(distance * np.cos(np.radians(tilt_deg)) > max(height, 0.0) + 0.05)
    (_, big), (_, small) = pairs(distance, share, height, tilt_deg)
    partners = pair_candidates(big[::-1] if turn_big else big, small[::-1] if turn_small else small)
    assert partners.tolist() == ([0, 1] if turn_big == turn_small else [1, 0])


def test_a_close_up_in_which_both_candidates_are_nearest_to_one():
    (_, big), (_, small) = pairs(1.6, 0.3, 0.9, 40.0)
    assert len(set(np.argmax(big @ small.T, axis=1))) == 1
    assert pair_candidates(big, small).tolist() == [0, 1]


def test_a_circle_with_one_candidate_is_the_partner_of_both():
    (_, big), (_, small) = pairs(8.0, 0.6, 0.9, 20.0)
    assert pair_candidates(big, small[1:]).tolist() == [0, 0]
    assert pair_candidates(big[1:], small).tolist() == [1]


@given(st.floats(0.1, 0.99), st.floats(0.01, 0.99))
def test_the_farthest_distance_is_that_at_which_the_view_is_frontal(share, part):
    depth = part * np.sqrt(1.0 - share**2)
    farthest = farthest_mirror_distance(RADIUS, share * RADIUS, depth * RADIUS)
    assert farthest > RADIUS
    assert mirror_tilt(RADIUS, share * RADIUS, -depth * RADIUS, farthest * (1.0 - 1e-9)) < 1e-2
    assert np.isnan(mirror_tilt(RADIUS, share * RADIUS, -depth * RADIUS, farthest * (1.0 + 1e-9)))
    distances = np.linspace(1.001 * RADIUS, 0.999 * farthest, 9)
    if distances[0] < distances[-1]:
        assert (np.diff(mirror_tilt(RADIUS, share * RADIUS, -depth * RADIUS, distances)) < 0.0).all()


@pytest.mark.parametrize("depth", [0.0, 34.0, 42.65])
def test_flat_and_deep_targets_have_no_such_distance(depth):
    assert farthest_mirror_distance(45.0, 30.0, depth) is None


def test_a_view_beside_the_one_in_which_both_pairs_fit():
    case = circle_case(45.0, 714.0, 11.0, 25.0, 50.0, 70.0)
    view = mirror_view(case.center, case.normal, 45.0, case.center - 1.0 * case.normal, 30.0)
    assert view.distance == pytest.approx(714.0)
    assert np.degrees(view.tilt_rad) == pytest.approx(50.0)
    assert np.degrees(view.mirror_tilt_rad) == pytest.approx(50.75, abs=0.005)
    assert mirror_view(case.center, case.normal, 45.0, case.center + 1.0 * case.normal, 30.0) is None


def test_targets_without_such_a_view():
    # A boss, no height at all, and a recess from farther than any view of it is ambiguous.
    assert np.isnan(mirror_tilt(45.0, 30.0, np.array([42.65, 0.0, -1.0]), np.array([714.0, 714.0, 1200.0]))).all()
    assert np.isnan(equal_length_tilt(45.0, 30.0, 0.0, 714.0))
    assert np.isnan([mirror_tilt(45.0, 30.0, -10.0, 40.0), equal_length_tilt(45.0, 30.0, -10.0, 40.0)]).all()


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ((0.0, 30.0, 1.0, 714.0), "radius_big"),
        ((45.0, -1.0, 1.0, 714.0), "radius_small"),
        ((45.0, 30.0, 1.0, 0.0), "distance"),
        ((30.0, 45.0, 1.0, 714.0), "radius_small"),
    ],
)
@pytest.mark.parametrize("tilt", [mirror_tilt, equal_length_tilt])
def test_lengths_must_be_positive_and_radii_in_order(tilt, arguments, named):
    with pytest.raises(ArgumentError, match=named):
        tilt(*arguments)
