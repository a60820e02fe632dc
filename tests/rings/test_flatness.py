"""Coplanar targets that are not flat: the law by which the wrong candidate looks flatter, and that none is silent."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.flatness import CAMERA, View, flips_at, law, measured, rims_of, targets_among, views
from circlepose.errors import TargetError
from circlepose.io.target_file import target_from_mapping, target_to_mapping
from circlepose.results import Flag, SettledBy
from circlepose.rings.options import DEFAULT
from circlepose.targets.target import FLATNESS_SHARE, Target

RADII = (45.0, 30.0)
DISTANCE = 714.0


def view(tilt_deg, step, radii=RADII, distance=DISTANCE):
    tilt = np.radians(tilt_deg)
    ray = CAMERA.rays(np.array([700.0, 420.0]))
    across = np.cross(ray, [0.0, 1.0, 0.0])
    across = across / np.linalg.norm(across)
    return View(distance * ray, -np.cos(tilt) * ray + np.sin(tilt) * across, radii, step)


def is_right(circle, target):
    first, last = circle.candidates[0], circle.candidates[-1]
    return first.normal @ target.normal >= last.normal @ target.normal


@pytest.mark.parametrize("tilt_deg", [10.0, 35.0, 60.0])
@pytest.mark.parametrize(("radii", "distance"), [(RADII, 714.0), (RADII, 1500.0), ((50.0, 20.0), 2000.0)])
def test_from_the_depth_of_the_law_on_a_fit_without_height_takes_the_wrong_candidate(radii, distance, tilt_deg):
    tilt = float(np.radians(tilt_deg))
    assert flips_at(radii, distance, tilt) == pytest.approx(float(law(radii, distance, np.array(tilt))), rel=0.03)


@pytest.mark.parametrize("tilt_deg", range(5, 65, 5))
@pytest.mark.parametrize("step", [-2.0, -1.0, -0.5, 2.0])
def test_a_step_is_found_and_no_wrong_candidate_is_sure(tilt_deg, step):
    target = view(float(tilt_deg), step)
    circle = measured(target, np.random.default_rng(tilt_deg))
    assert circle is not None
    assert Flag.NOT_FLAT in circle.flags
    assert circle.ambiguity > DEFAULT.least_contradicted_ambiguity / 2.0
    right = max(circle.candidates, key=lambda candidate: float(candidate.normal @ target.normal))
    assert abs(right.height_mm - step) < 4.0 * right.height_sigma_mm
    if tilt_deg >= 40:
        assert is_right(circle, target) or circle.ambiguity > 0.2


def test_over_random_steps_no_wrong_choice_without_a_flag_is_sure():
    for radii in ((25.0, 15.0), RADII):
        for target, generator in views(radii, 60, flat=False):
            circle = measured(target, generator)
            if circle is not None and not is_right(circle, target):
                assert circle.ambiguity >= 0.01, (radii, target.tilt_deg, target.step)


def test_flat_targets_are_found_flat_with_errors_as_told():
    heights, distances, ambiguities = [], [], []
    for target, generator in views(RADII, 80, flat=True):
        circle = measured(target, generator)
        assert circle is not None
        assert is_right(circle, target)
        assert Flag.NOT_FLAT not in circle.flags
        assert Flag.VANISHING_LINE_DISAGREES not in circle.flags
        ambiguities.append(circle.ambiguity)
        chosen = circle.candidates[0]
        heights.append(chosen.height_mm / chosen.height_sigma_mm)
        distances.append(chosen.vanishing_distance_sigmas)
    assert np.mean(ambiguities) < DEFAULT.step_weight
    # The radii are exact here, while a tolerance of theirs is told: less than one.
    assert 0.05 < np.mean(np.square(heights)) < 1.4
    assert np.mean(np.square(distances)) < 2.8


def test_what_is_known_of_flatness_enters_the_choice_and_the_covariance():
    target = view(40.0, -0.25)
    rims = rims_of(target, None)

    def outer(flatness):
        what = Target("coplanar", RADII, flatness_sigma_mm=flatness)
        return targets_among(rims, what)[0]

    flat, usual, rough = outer(0.0), outer(None), outer(0.5)
    assert Flag.NOT_FLAT in flat.flags
    assert Flag.NOT_FLAT not in rough.flags
    assert usual.candidates[0].height_mm == flat.candidates[0].height_mm
    far = rims_of(view(40.0, 0.0, distance=3000.0), None)
    told = [
        targets_among(far, Target("coplanar", RADII, flatness_sigma_mm=each))[0].ambiguity
        for each in (0.0, 0.1, 0.3, 1.0)
    ]
    assert told == sorted(told)
    assert told[0] < 1.01 * DEFAULT.step_weight
    assert told[-1] > 0.4
    frontal = rims_of(view(2.0, 0.0), None)
    sigma = [
        targets_among(frontal, Target("coplanar", RADII, flatness_sigma_mm=each))[0]
        .candidates[0]
        .covariance[3:, 3:]
        .trace()
        for each in (0.0, 0.1, 1.0)
    ]
    assert sigma == sorted(sigma)
    assert sigma[2] > 1.03 * sigma[0]


def test_the_vanishing_line_is_an_alarm_of_its_own():
    """A step bends the normal of eq. 10 away from both candidates, where it does not exchange them."""
    circle = measured(view(40.0, -2.0), np.random.default_rng(1))
    assert circle is not None
    assert Flag.VANISHING_LINE_DISAGREES in circle.flags
    assert circle.ambiguity >= DEFAULT.least_contradicted_ambiguity
    assert all(candidate.vanishing_distance_deg > 10.0 for candidate in circle.candidates)
    assert circle.settled_by is not SettledBy.VANISHING_LINE
    flat = measured(view(40.0, 0.0), np.random.default_rng(1))
    assert flat is not None
    assert flat.settled_by is SettledBy.VANISHING_LINE
    assert flat.candidates[0].vanishing_distance_deg < 5.0 * flat.vanishing_sigma_deg
    assert flat.candidates[1].vanishing_distance_deg > 60.0


def test_the_route_of_the_paper_settles_nothing_on_a_step_that_is_seen():
    """A step breaks the premise of the vanishing line, so both candidates of the circle are returned."""
    seen = 0
    for target, generator in views(RADII, 40, flat=False):
        circle = measured(target, generator, "fu-zhou")
        if circle is None or Flag.NOT_FLAT not in circle.flags:
            continue
        seen += 1
        assert circle.method == "fu-zhou"
        assert (circle.ambiguity, circle.settled_by) == (0.5, SettledBy.NONE)
        assert Flag.AMBIGUOUS in circle.flags
        assert len(circle.candidates) == 2
        best = max(float(candidate.normal @ target.normal) for candidate in circle.candidates)
        assert best > np.cos(np.radians(1.5)), (target.tilt_deg, target.step)
    assert seen > 15


def test_the_route_of_the_paper_is_not_sure_of_a_recess_that_looks_flat():
    circle = measured(view(50.0, -2.0), np.random.default_rng(2), "fu-zhou")
    assert circle is not None
    assert Flag.NOT_FLAT in circle.flags
    assert circle.ambiguity == 0.5
    assert Flag.AMBIGUOUS in circle.flags


def test_the_vanishing_line_settles_a_flat_target_in_one_pose_or_leaves_both_candidates():
    settled = 0
    for target, generator in [*views(RADII, 40, flat=True), (view(3.0, 0.0), np.random.default_rng(3))]:
        circle = measured(target, generator, "fu-zhou")
        assert circle is not None
        is_settled = circle.settled_by is SettledBy.VANISHING_LINE
        settled += is_settled
        if is_settled:
            assert circle.ambiguity < 0.05
            assert Flag.AMBIGUOUS not in circle.flags
            assert len(circle.candidates) == 1
        elif circle.cone_kind != "right" and len(circle.candidates) > 1:
            assert circle.ambiguity >= 0.05
            assert Flag.AMBIGUOUS in circle.flags
            apart = circle.candidates[0].normal @ target.normal, circle.candidates[1].normal @ target.normal
            assert max(apart) > np.cos(np.radians(1.0))
    assert settled > 35


def test_a_view_in_which_the_line_agrees_with_both_candidates_is_not_settled_by_it():
    """Nearly frontal and far away: the error of the line is as large as the angle between the candidates."""
    for seed in range(5):
        circle = measured(view(4.0, 0.0, (25.0, 15.0), 2500.0), np.random.default_rng(seed), "fu-zhou")
        assert circle is not None
        assert circle.settled_by is SettledBy.NONE
        if len(circle.candidates) == 2:
            assert Flag.AMBIGUOUS in circle.flags
            assert circle.ambiguity > 0.05


def test_flatness_in_a_target_file():
    mapping = {"kind": "coplanar", "radii_mm": [50.0, 30.0], "flatness_sigma_mm": 0.3}
    target = target_from_mapping(mapping, "t.yaml")
    assert target.flatness_mm == 0.3
    assert target_from_mapping(target_to_mapping(target), "t.yaml") == target
    assert Target("coplanar", (50.0, 30.0)).flatness_mm == FLATNESS_SHARE * 50.0
    assert "flatness_sigma_mm" not in target_to_mapping(Target("coplanar", (50.0, 30.0)))


@pytest.mark.parametrize(
    ("mapping", "said"),
    [
        ({"kind": "circle", "radius_mm": 50.0, "flatness_sigma_mm": 0.1}, "only a coplanar target"),
        ({"kind": "coplanar", "radii_mm": [50.0, 30.0], "flatness_sigma_mm": -0.1}, "0 or more"),
        ({"kind": "coplanar", "radii_mm": [50.0, 30.0], "flatness_sigma_mm": 60.0}, "less than the radius"),
    ],
)
def test_a_flatness_that_cannot_be_is_refused(mapping, said):
    with pytest.raises(TargetError, match=rf"t.yaml: flatness_sigma_mm: .*{said}"):
        target_from_mapping(mapping, "t.yaml")
