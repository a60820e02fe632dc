from __future__ import annotations

import pytest

from circlepose.errors import TargetError
from circlepose.targets.hints import DirectionHint
from circlepose.targets.target import AxisIntervals, Target


def test_names_of_the_circles():
    assert Target.circle(60.0).circle_names == ("disc",)
    assert Target("coplanar", (50.0, 30.0)).circle_names == ("outer", "inner")
    assert Target("coplanar", (50.0, 30.0, 10.0, 5.0)).circle_names == ("outer", "inner", "ring2", "ring3")
    assert Target("coaxial", (45.0, 30.0), generatrix_mm=45.21).circle_names == ("big", "small")


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Target.circle(-60.0), "radius_mm: expected a positive radius in mm"),
        (lambda: Target.circle(0.0), "positive"),
        (lambda: Target.circle(float("nan")), "positive"),
        (lambda: Target("coplanar", (30.0, 50.0)), "outer radius first"),
        (lambda: Target("coplanar", (50.0, 50.0)), "outer radius first"),
        (lambda: Target("coplanar", (50.0,)), "two or more"),
        (lambda: Target("circle", (50.0, 30.0)), "one radius"),
        (lambda: Target("coaxial", (50.0, 30.0, 10.0)), "two radii"),
        (lambda: Target("coaxial", (50.0, 30.0), generatrix_mm=20.0), "longer than the difference"),
        (lambda: Target("coplanar", (50.0, 30.0), generatrix_mm=40.0), "only a coaxial"),
        (lambda: Target("square", (50.0,)), "circle, coplanar, coaxial"),
        (lambda: Target("circle", (50.0,), polarity="blue"), "any, dark, bright"),
        (lambda: Target.circle(5.0, count=0), "at least 1"),
        (lambda: Target.circle(5.0, depth_range_mm=(500.0, 100.0)), "smallest < largest"),
        (lambda: Target("circle", (5.0,), same_plane=True), "count of 2 or more"),
        (lambda: Target("circle", (5.0,), same_plane="yes"), "count of 2 or more"),
        (lambda: Target("coplanar", (5.0, 3.0), count=None, same_plane=True), "needs kind: circle"),
        (lambda: Target("circle", (5.0,), facing="sideways"), "left, right, up, down"),
        (lambda: Target("circle", (5.0,), facing=(1.0, 0.0)), "three numbers"),
        (lambda: Target("circle", (5.0,), normal_hint=DirectionHint((0.0, 0.0, float("nan")), 5.0)), "other than 0"),
        (lambda: Target("circle", (5.0,), up_hint=DirectionHint((0.0, 1.0, 0.0), 181.0)), "at most 180"),
        (lambda: Target("coaxial", (5.0, 3.0), up_hint=DirectionHint((0.0, 1.0, 0.0), 5.0)), "lone circles"),
        (lambda: AxisIntervals(major_px=(-1.0, 5.0)), "axis_intervals_px.major"),
        (lambda: AxisIntervals(minor_px=(5.0, 5.0)), "axis_intervals_px.minor"),
    ],
)
def test_what_is_no_target_is_refused(make, message):
    with pytest.raises(TargetError, match=message):
        make()
