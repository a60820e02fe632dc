"""What is known of the scene settles lone circles: on results made by hand and on rendered discs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import circlepose
from circlepose.disambiguation.settle import settled as settled_circles
from circlepose.geometry.cone import plane_basis
from circlepose.results import Flag
from circlepose.synthesis.render import render
from circlepose.synthesis.scene import Disc, Paint, Scene
from circlepose.targets import SIDES
from circlepose.targets.hints import DirectionHint
from circlepose.targets.target import Target
from tests.support.discs import CAMERA, NORMAL, RADIUS_MM, made_circle

DISC = Target.circle(RADIUS_MM)


def lone(covariance=None):
    """The exact disc with its right candidate last, as if nothing had ranked the two."""
    circle = made_circle(covariance=covariance)
    return replace(circle, candidates=circle.candidates[::-1], ambiguity=0.5, flags=(Flag.AMBIGUOUS, Flag.POOR_FIT))


def settled(circle=None, **hints):
    return settled_circles([lone() if circle is None else circle], replace(DISC, **hints), CAMERA).circles[0]


@pytest.mark.parametrize(
    "hints",
    [
        {"normal_hint": DirectionHint(tuple(3.0 * NORMAL), 20.0)},
        {"normal_hint": DirectionHint((1.0, 0.0, -1.0), 20.0)},
        {"up_hint": DirectionHint(tuple(NORMAL), 5.0)},
        {"up_hint": DirectionHint(tuple(-NORMAL), 5.0)},
        {"facing": "right"},
        {"facing": (5.0, 1.0, 0.0)},
    ],
)
def test_a_hint_puts_the_right_candidate_first_and_takes_the_flag_away(hints):
    circle = settled(**hints)
    assert circle.candidates[0].normal @ NORMAL > 0.999999
    assert circle.chosen == 0
    assert circle.ambiguity < 0.2
    assert circle.flags == (Flag.POOR_FIT,)


def test_the_opposite_hint_puts_the_other_first():
    assert settled(facing="left").candidates[0].normal @ NORMAL < 0.9
    other = lone().candidates[0].normal
    assert settled(normal_hint=DirectionHint(tuple(other), 10.0)).candidates[0].normal @ NORMAL < 0.9


def test_without_a_hint_nothing_changes():
    circle = lone()
    assert settled(circle) is circle


def test_hints_that_agree_add_up_and_those_that_do_not_leave_doubt():
    rough = DirectionHint((1.0, 0.0, -1.0), 40.0)
    one, both = settled(normal_hint=rough), settled(normal_hint=rough, up_hint=DirectionHint(tuple(NORMAL), 40.0))
    assert both.ambiguity < one.ambiguity
    against = settled(normal_hint=rough, up_hint=DirectionHint(tuple(lone().candidates[0].normal), 40.0))
    assert against.ambiguity > one.ambiguity


def test_a_hint_that_holds_for_neither_candidate_tells_nothing():
    circle = settled(normal_hint=DirectionHint((0.0, -1.0, 0.3), 2.0))
    assert circle.ambiguity > 0.45
    assert Flag.AMBIGUOUS in circle.flags


def test_a_hint_between_the_candidates_tells_nothing():
    first, second = (c.normal for c in lone().candidates)
    circle = settled(normal_hint=DirectionHint(tuple(first + second), 20.0))
    assert circle.ambiguity == pytest.approx(0.5, abs=1e-6)
    assert Flag.AMBIGUOUS in circle.flags


@pytest.mark.parametrize("sigma_deg", [1.0, 20.0, 60.0])
def test_the_candidates_own_errors_make_a_hint_tell_less(sigma_deg):
    covariance = np.diag([0.1, 0.1, 0.1, *(2 * [np.radians(sigma_deg) ** 2])])
    for hints in ({"facing": "right"}, {"normal_hint": DirectionHint(tuple(NORMAL), 10.0)}):
        certain, unsure = settled(**hints), settled(lone(covariance), **hints)
        assert unsure.ambiguity > certain.ambiguity
    assert settled(lone(covariance), facing="right").ambiguity < (0.45 if sigma_deg < 60.0 else 0.51)


def test_a_circle_with_one_candidate_stays_as_it_is():
    circle = replace(lone(), candidates=lone().candidates[:1], ambiguity=0.0, flags=())
    assert settled(circle, facing="left") is circle


def test_each_method_is_settled():
    circles = [lone(), replace(lone(), method="kanatani-liu")]
    for circle in settled_circles(circles, replace(DISC, facing="right"), CAMERA).circles:
        assert circle.candidates[0].normal @ NORMAL > 0.999999


def board(normal):
    """Three small discs far away, whose common plane has a mirror image that fits them nearly as well."""
    first, second = plane_basis(normal)
    centers = [np.array([0.0, 0.0, 900.0]) + x * first + y * second for x, y in ((-45, -30), (45, -25), (0, 50))]
    discs = tuple(Disc(center, normal, 20.0, Paint(40.0)) for center in centers)
    return Scene(camera=CAMERA, targets=discs, noise_levels=4.0, noise_seed=1)


def test_a_common_plane_and_a_rough_normal_add_up():
    normal = np.array([0.35, 0.1, -1.0]) / np.linalg.norm([0.35, 0.1, -1.0])
    image = render(board(normal))
    target = Target.circle(20.0, count=3)
    hint = DirectionHint((0.2, 0.0, -1.0), 30.0)

    def measured(**hints):
        return circlepose.estimate(image, CAMERA, replace(target, **hints)).circles

    both, plane, rough = (
        measured(**hints)
        for hints in (
            {"same_plane": True, "normal_hint": hint},
            {"same_plane": True},
            {"same_plane": False, "normal_hint": hint},
        )
    )
    assert all(c.candidates[0].normal @ normal > 0.95 for c in both)
    for circle, with_plane, with_hint in zip(both, plane, rough, strict=True):
        assert 0.0 < circle.ambiguity < min(with_plane.ambiguity, with_hint.ambiguity)


@pytest.mark.parametrize("side", SIDES)
def test_a_rendered_disc_that_faces_a_side(side):
    normal = np.array(SIDES[side]) + np.array([0.1, 0.1, -1.2])
    disc = Disc(np.array([-20.0, 15.0, 180.0]), normal, RADIUS_MM, Paint(40.0))
    image = render(Scene(camera=CAMERA, targets=(disc,), noise_levels=2.0, noise_seed=3))
    circle = circlepose.estimate(image, CAMERA, replace(DISC, facing=side)).circles[0]
    assert circle.candidates[0].normal @ disc.normal > 0.999
    assert circle.ambiguity < 0.01
    assert Flag.AMBIGUOUS not in circle.flags
