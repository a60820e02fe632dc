"""The farthest distance and the smallest radius are the last that are as accurate as wanted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from circlepose.errors import UsageError
from circlepose.planning import search
from circlepose.planning.predict import predict
from circlepose.planning.search import PLACES, Wanted, farthest, place_px, smallest, steps
from circlepose.planning.views import View, scaled
from circlepose_cli.options import parse
from tests.planning.test_views import CAMERA, TARGETS

VIEW = View(500.0, 35.0, (159.5, 119.5))
DISC = TARGETS["disc"]
PREDICTED = predict(CAMERA, DISC, VIEW)
WANTED = Wanted(position_mm=0.2)
BEYOND = 1.1
"""From view to view what is predicted scatters by some percent."""


def test_the_farthest_is_as_accurate_as_wanted_and_what_is_farther_is_not():
    # The nearest are not whole in the image.
    found = farthest(CAMERA, DISC, VIEW, (40.0, 5000.0), WANTED)
    assert found.position_mm <= 0.2
    distance = found.view.distance_mm
    again = predict(CAMERA, DISC, replace(VIEW, distance_mm=distance))
    assert again.position_mm == found.position_mm
    assert not WANTED.holds(predict(CAMERA, DISC, replace(VIEW, distance_mm=BEYOND * distance)))
    assert not WANTED.holds(predict(CAMERA, DISC, replace(VIEW, distance_mm=40.0)))


def test_the_smallest_is_as_accurate_as_wanted_and_what_is_smaller_is_not():
    target, found = smallest(CAMERA, DISC, VIEW, (0.1, 10.0), WANTED)
    assert found.position_mm <= 0.2
    assert predict(CAMERA, target, VIEW).position_mm == pytest.approx(found.position_mm)
    assert not WANTED.holds(predict(CAMERA, scaled(target, 1.0 / BEYOND), VIEW))


@given(limit=st.floats(120.0, 900.0), first=st.floats(50.0, 90.0))
def test_a_search_ends_within_a_percent(limit, first):
    """Where the accuracy falls with the distance; what is nearer than `first` is not whole in the image."""

    def known(camera, target, view, look):
        sigma = np.array([0.0, 0.0, view.distance_mm / limit])
        return replace(PREDICTED, view=view, found=float(view.distance_mm > first), sigma_mm=sigma)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(search, "predict", known)
        found = farthest(CAMERA, DISC, VIEW, (50.0, 1000.0), Wanted(1.0))
    assert limit / 1.0101 <= found.view.distance_mm <= limit


def test_both_agree():
    """A target and its distance scaled together have one image, so sigma over distance is the same."""
    by_normal = Wanted(normal_deg=0.1)
    distance = farthest(CAMERA, DISC, VIEW, (200.0, 2000.0), by_normal).view.distance_mm
    target, _ = smallest(CAMERA, DISC, VIEW, (0.1, 10.0), by_normal)
    assert target.radii_mm[0] / VIEW.distance_mm == pytest.approx(DISC.radii_mm[0] / distance, rel=0.03)


def test_the_end_of_the_range_where_all_of_it_is_accurate():
    assert farthest(CAMERA, DISC, VIEW, (300.0, 400.0), WANTED).view.distance_mm == pytest.approx(400.0)


def test_none_where_nothing_is_as_accurate():
    never = Wanted(position_mm=1e-6)
    assert farthest(CAMERA, DISC, VIEW, (300.0, 600.0), never) is None
    assert smallest(CAMERA, DISC, VIEW, (0.5, 2.0), never) is None


def test_both_kinds_of_accuracy_must_hold():
    found = predict(CAMERA, DISC, VIEW)
    mm, deg = found.position_mm, found.sigma_normal_deg
    assert Wanted(mm, deg).holds(found)
    assert not Wanted(0.99 * mm, deg).holds(found)
    assert not Wanted(mm, 0.99 * deg).holds(found)
    assert Wanted(mm).holds(found)
    assert not Wanted(mm).holds(replace(found, found=0.75))
    assert not Wanted(mm).holds(replace(found, sigma_mm=None))


@given(
    low=st.floats(1.0, 100.0),
    more=st.just(0.0) | st.floats(0.1, 100.0),
    number=st.integers(1, 20),
    are_ratios=st.booleans(),
)
def test_steps_go_from_the_first_to_the_last(low, more, number, are_ratios):
    found = steps(low, low + more, number, are_ratios=are_ratios)
    assert found[0] == pytest.approx(low)
    assert list(found) == sorted(found)
    if number == 1 or more == 0.0:
        assert found == (low,)
    else:
        assert len(found) == number
        assert found[-1] == pytest.approx(low + more)


def test_places_are_those_of_the_option_and_in_the_image():
    assert set(PLACES) == set(parse.PLACES)
    assert place_px(CAMERA, "middle") == (159.5, 119.5)
    for place in PLACES:
        u, v = place_px(CAMERA, place)
        assert 0.0 <= u <= 319.0
        assert 0.0 <= v <= 239.0
    with pytest.raises(UsageError, match="image_size: the camera must state"):
        place_px(replace(CAMERA, image_size=None), "middle")
