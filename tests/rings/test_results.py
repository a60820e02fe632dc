"""Ring targets: one ring missing, radii that are not the target's, several targets in clutter."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

import circlepose
from benchmarks.support.scoring import TrueCircle, error
from circlepose.camera.camera import Camera
from circlepose.geometry.cone import plane_basis
from circlepose.results import Flag, Status
from circlepose.synthesis.render import render
from circlepose.synthesis.scene import CoaxialPart, Disc, Paint, Rings, Scene
from circlepose.targets.target import AxisIntervals, Target

CAMERA = Camera.create([[600.0, 0, 319.5], [0, 600.0, 239.5], [0, 0, 1]], (), (640, 480))
CENTER = np.array([30.0, -20.0, 500.0])
NORMAL = np.array([0.5, 0.3, -0.8]) / np.linalg.norm([0.5, 0.3, -0.8])
DARK, BRIGHT = Paint(40.0), Paint(220.0)
COPLANAR = Target("coplanar", (50.0, 30.0))
COAXIAL = Target("coaxial", (45.0, 30.0), generatrix_mm=45.21)
HEIGHT_MM = float(np.sqrt(45.21**2 - 15.0**2))


def rendered(*parts, camera=CAMERA):
    return render(Scene(camera, parts, Paint(170.0), noise_levels=1.0, noise_seed=3))


def measured(target, *parts):
    return circlepose.estimate(rendered(*parts), CAMERA, target)


def disc(radius, center=CENTER, paint=DARK):
    return Disc(center, NORMAL, radius, paint)


RINGS = Rings(CENTER, NORMAL, (50.0, 30.0), (DARK, BRIGHT))
BOSS = CoaxialPart(CENTER, NORMAL, (45.0, 30.0), HEIGHT_MM, "boss", Paint(80.0), Paint(230.0))


@pytest.mark.parametrize(
    ("radius", "known", "name"),
    [
        (50.0, {}, "outer"),
        (30.0, {}, "outer"),
        (30.0, {"depth_range_mm": (450.0, 560.0)}, "inner"),
        (50.0, {"depth_range_mm": (450.0, 560.0)}, "outer"),
        (30.0, {"axis_intervals": AxisIntervals(major_px=(110.0, 130.0))}, "inner"),
        (50.0, {"axis_intervals": AxisIntervals(major_px=(110.0, 130.0))}, "outer"),
        (30.0, {"polarity": "bright"}, "inner"),
    ],
)
def test_a_ring_alone_is_the_largest_that_what_is_known_allows(radius, known, name):
    result = measured(replace(COPLANAR, **known), disc(radius))
    assert result.status is Status.TOO_FEW_CIRCLES
    assert f"measured, as the {name} one; nothing else in the image" in result.reason
    (circle,) = result.circles
    assert circle.circle == name
    assert circle.radius_mm == (50.0 if name == "outer" else 30.0)
    assert {Flag.LONE_CIRCLE, Flag.AMBIGUOUS} <= set(circle.flags)
    if circle.radius_mm == radius:
        assert error(circle, TrueCircle(CENTER, NORMAL, None, None, name)).position_mm < 0.5


def test_a_ring_that_no_circle_of_the_target_can_be_is_no_result():
    result = measured(replace(COPLANAR, depth_range_mm=(2000.0, 2500.0)), disc(50.0))
    assert (result.status, result.circles) == (Status.NO_CIRCLE, ())


@pytest.mark.parametrize(
    "known", [{"depth_range_mm": (450.0, 560.0)}, {"axis_intervals": AxisIntervals((110.0, 130.0), (60.0, 130.0))}]
)
def test_what_is_known_of_the_largest_circle_does_not_rule_out_the_others(known):
    result = measured(replace(COPLANAR, **known), RINGS)
    assert result.status is Status.OK
    assert [circle.circle for circle in result.circles] == ["outer", "inner"]


@pytest.mark.parametrize(
    ("target", "part", "says"),
    [
        (
            Target("coplanar", (50.0, 20.0)),
            RINGS,
            "nested circles seen are 0.60 of the largest, radii_mm asks for 0.40",
        ),
        (Target("coplanar", (50.0, 40.0, 30.0)), RINGS, "seen are 0.60 of the largest, radii_mm asks for 0.80, 0.60"),
        (
            Target("coaxial", (50.0, 30.0), generatrix_mm=60.0),
            RINGS,
            "a generatrix of 20 mm, generatrix_mm asks for 60",
        ),
        (replace(COAXIAL, generatrix_mm=20.0), BOSS, "a generatrix of 45.* mm, generatrix_mm asks for 20"),
        (
            replace(COAXIAL, radii_mm=(45.0, 15.0)),
            BOSS,
            "generatrix|no two circles seen have radii of the ratio of radii_mm",
        ),
        (COAXIAL, disc(45.0), "nothing else in the image can be another circle of it"),
    ],
)
def test_what_contradicts_the_target_is_said(target, part, says):
    result = measured(target, part)
    assert result.status is Status.TOO_FEW_CIRCLES
    assert all(Flag.LONE_CIRCLE in circle.flags for circle in result.circles)
    assert re.search(says, result.reason), result.reason


def test_rings_that_are_not_concentric_are_said_to_be_so():
    across, _ = plane_basis(NORMAL)
    result = measured(COPLANAR, disc(50.0), disc(30.0, CENTER + 8.0 * across, BRIGHT))
    assert result.status is Status.TOO_FEW_CIRCLES
    assert "the nested circles seen are not concentric, their centers are " in result.reason
    assert result.circles[0].circle == "outer"


@pytest.mark.parametrize(("inner_mm", "told"), [(30.0, False), (30.1, False), (32.0, True), (28.5, True)])
def test_radii_that_are_nearly_the_targets_are_flagged(inner_mm, told):
    result = measured(replace(COPLANAR, radii_mm=(50.0, inner_mm)), RINGS)
    assert result.status is Status.OK
    for circle in result.circles:
        assert (Flag.RING_MISFIT in circle.flags) is told


@pytest.mark.parametrize(("generatrix_mm", "told"), [(45.21, False), (45.4, False), (47.5, True)])
def test_a_generatrix_that_is_nearly_the_targets_is_flagged(generatrix_mm, told):
    result = measured(replace(COAXIAL, generatrix_mm=generatrix_mm), BOSS)
    assert result.status is Status.OK
    for circle in result.circles:
        assert (Flag.RING_MISFIT in circle.flags) is told


@pytest.mark.parametrize("form", ["boss", "recess"])
@pytest.mark.parametrize("generatrix_mm", [45.21, None])
def test_boss_and_recess_are_told_apart_with_and_without_a_generatrix(form, generatrix_mm):
    result = measured(replace(COAXIAL, generatrix_mm=generatrix_mm), replace(BOSS, form=form))
    assert result.status is Status.OK
    big, small = result.circles
    assert big.ambiguity < 0.01
    assert big.candidates[0].normal @ NORMAL > 0.9999
    assert small.candidates[0].normal @ NORMAL > 0.999
    in_front = float((small.candidates[0].center - big.candidates[0].center) @ NORMAL)
    assert in_front == pytest.approx(HEIGHT_MM if form == "boss" else -HEIGHT_MM, abs=1.0)
    assert big.candidates[0].generatrix_mm == pytest.approx(45.21, abs=1.0)
    assert abs(big.candidates[1].generatrix_mm - 45.21) > 3.0


def test_every_method_has_the_same_circle_first():
    result = circlepose.estimate(rendered(BOSS), CAMERA, COAXIAL, method="all")
    assert len(result.circles) == 10
    for circle in result.circles:
        if circle.method == "chen-huang-contour":
            # Where the boss hides the big rim its four points may be of no circle.
            continue
        assert circle.candidates[0].normal @ NORMAL > 0.995, circle.method
        assert circle.candidates[0].generatrix_mm is not None


WIDE = Camera.create([[1200.0, 0, 639.5], [0, 1200.0, 479.5], [0, 0, 1]], (), (1280, 960))


def clutter(kind, seed):
    """Three targets among discs, discs with holes and ring targets of another ratio; and the three."""
    generator = np.random.default_rng([seed, len(kind)])
    places = [(x, y) for x in (200, 520, 840, 1120) for y in (170, 480, 790)]
    generator.shuffle(places)
    parts, targets = [], []
    for number, place in enumerate(places[:11]):
        ray = WIDE.rays(np.array(place) + generator.uniform(-15.0, 15.0, 2))
        center = generator.uniform(700.0, 1100.0) * ray
        first, second = plane_basis(ray)
        tilt, lean = np.radians(generator.uniform(10.0, 50.0)), generator.uniform(0.0, 2.0 * np.pi)
        normal = -np.cos(tilt) * ray + np.sin(tilt) * (np.cos(lean) * first + np.sin(lean) * second)
        if number < 3 and kind == "coplanar":
            targets.append(Rings(center, normal, (50.0, 30.0), (DARK, Paint(200.0))))
        elif number < 3:
            form = "boss" if number % 2 else "recess"
            targets.append(CoaxialPart(center, normal, (45.0, 30.0), HEIGHT_MM, form, Paint(80.0), Paint(230.0)))
        elif number < 6:
            parts.append(Disc(center, normal, generator.uniform(25.0, 55.0), Paint(60.0), ((12.0, Paint(190.0)),)))
        elif number < 9:
            parts.append(Disc(center, normal, generator.uniform(15.0, 55.0), Paint(generator.uniform(20.0, 110.0))))
        else:
            parts.append(Rings(center, normal, (50.0, 20.0), (DARK, Paint(200.0))))
    return (*parts, *targets), targets


@pytest.fixture(scope="module", params=[COPLANAR, COAXIAL], ids=lambda target: target.kind)
def crowd(request):
    """A target, an image with three of it in clutter, and the three."""
    parts, targets = clutter(request.param.kind, 4)
    return request.param, rendered(*parts, camera=WIDE), targets


@pytest.mark.parametrize("count", [3, None])
def test_several_targets_in_clutter(crowd, count):
    target, image, targets = crowd
    result = circlepose.estimate(image, WIDE, replace(target, count=count))
    assert result.status is Status.OK
    largest = [circle for circle in result.circles if circle.circle == target.circle_names[0]]
    assert [circle.instance for circle in largest] == [0, 1, 2]
    assert len(result.circles) == 6
    for part in targets:
        truth = TrueCircle(part.center_mm, part.normal, None, None, "")
        nearest = min((error(circle, truth) for circle in largest), key=lambda each: each.position_mm)
        assert nearest.chosen
        assert nearest.position_mm < 0.5
        assert nearest.normal_deg < 0.5


def test_more_targets_than_there_are(crowd):
    target, image, _ = crowd
    result = circlepose.estimate(image, WIDE, replace(target, count=4))
    assert (result.status, result.reason) == (Status.TOO_FEW_CIRCLES, "3 of 4 found")
    assert len(result.circles) == 6
