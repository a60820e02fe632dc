"""Circles of which a part of the rim is hidden: answered where the rest settles the pose, never quietly wrong."""

from __future__ import annotations

import numpy as np
import pytest

import circlepose
from benchmarks import sweep
from benchmarks.support.scoring import TrueCircle, error
from circlepose.camera.camera import Camera, circle_contour
from circlepose.fitting.arc_precision import axis_errors, curvature_radius
from circlepose.fitting.direct import fit_ellipse
from circlepose.geometry.ellipse import Ellipse
from circlepose.results import Flag
from circlepose.synthesis.render import render
from circlepose.synthesis.scene import Disc, Paint, Patch, Polygon, Scene
from circlepose.targets.target import AxisIntervals, Target
from tests.support.cases import circle_case

CAMERA = Camera.create([[900.0, 0, 319.5], [0, 900.0, 239.5], [0, 0, 1]], (), (640, 480))
TARGET = Target.circle(60.0, axis_intervals=AxisIntervals(major_px=(80.0, 440.0)))


def card(part: Disc, start: float, share: float, level: float) -> Patch:
    """A card that hides the rim from `start` on, both shares of its length in the image."""
    rim = circle_contour(CAMERA, part.center_mm, part.normal, part.radius_mm, 1440)
    along = np.cumsum(np.linalg.norm(np.roll(rim, -1, axis=0) - rim, axis=1))
    arc = rim[np.searchsorted(along / along[-1], np.mod(start + share * np.linspace(0.0, 1.0, 40), 1.0)) % len(rim)]
    edge = (arc[-1] - arc[0]) / np.linalg.norm(arc[-1] - arc[0])
    outwards = np.array([edge[1], -edge[0]])
    outwards = outwards * np.sign(outwards @ (arc[20] - rim.mean(axis=0)))
    ends, reach = (arc - arc[0]) @ edge, float(((arc - arc[0]) @ outwards).max()) + 20.0
    corners = [
        (ends.min() - 15.0, 0.0),
        (ends.max() + 15.0, 0.0),
        (ends.max() + 15.0, reach),
        (ends.min() - 15.0, reach),
    ]
    return Patch(Polygon(tuple(tuple((arc[0] + x * edge + y * outwards).tolist()) for x, y in corners)), Paint(level))


def seen(tilt_deg: float, *cards: tuple[float, float, float]) -> tuple[circlepose.ImageResult, TrueCircle]:
    """Measure a disc behind cards (start, share, level)."""
    case = circle_case(60.0, 600.0, 4.0, 30.0, tilt_deg, 70.0)
    part = Disc(case.center, case.normal, 60.0, Paint(40.0))
    occluders = tuple(card(part, *each) for each in cards)
    image = render(Scene(CAMERA, (part,), Paint(200.0), occluders=occluders, noise_levels=2.0, noise_seed=5))
    return circlepose.estimate(image, CAMERA, TARGET), TrueCircle(case.center, case.normal, None, None, "disc")


@pytest.mark.parametrize("tilt_deg", [20.0, 65.0])
@pytest.mark.parametrize(
    "cards",
    [[(0.1, 0.4, 230.0)], [(0.1, 0.4, 140.0)], [(0.0, 0.2, 30.0), (0.45, 0.2, 230.0)]],
    ids=["bright", "between", "two"],
)
def test_four_tenths_hidden(tilt_deg, cards):
    result, true = seen(tilt_deg, *cards)
    (circle,) = result.circles
    measured = error(circle, true)
    assert measured.position_mm < 3.0
    assert measured.normal_deg < 0.5
    assert Flag.PARTIAL_RIM in circle.flags
    assert 0.3 < circle.rim_used < 0.75


@pytest.mark.parametrize("tilt_deg", [82.0, 86.0])
def test_a_sliver_hidden_beside_its_tips(tilt_deg):
    """Its length is seen, so its distance is known."""
    result, true = seen(tilt_deg, (0.05, 0.15, 140.0))
    (circle,) = result.circles
    measured = error(circle, true)
    assert measured.position_mm < 1.0
    assert measured.normal_deg < 0.1
    assert Flag.PARTIAL_RIM in circle.flags


@pytest.mark.parametrize(("start", "level"), [(0.0, 230.0), (0.25, 30.0), (0.5, 30.0), (0.75, 230.0)])
def test_a_sliver_is_never_quietly_wrong(start, level):
    result, true = seen(85.0, (start, 0.35, level))
    for circle in result.circles:
        measured = error(circle, true)
        assert measured.position_mm < 5.0 or set(circle.flags) - {Flag.AMBIGUOUS}
        assert measured.position_mm < 60.0


# How far an arc settles the axes.


def test_the_errors_of_the_axes_are_those_of_repeated_fits():
    truth = Ellipse.from_axes([100.0, 80.0], [60.0, 30.0], 0.5)
    arc = truth.points(240)[20:170]
    noise = np.random.default_rng(1)
    fits = [fit_ellipse(arc + 0.05 * noise.normal(size=arc.shape)) for _ in range(300)]
    spread = np.std([[fit.semi_major, fit.semi_minor] for fit in fits], axis=0)
    np.testing.assert_allclose(axis_errors(truth, arc, 0.05), spread, rtol=0.25)


def test_the_shorter_the_arc_the_more_open_the_axis():
    truth = Ellipse.from_axes([0.0, 0.0], [60.0, 20.0], -1.0)
    points = truth.points(200)
    errors = [float(axis_errors(truth, points[:number], 0.1)[0]) for number in (200, 150, 100, 50)]
    assert errors == sorted(errors)
    assert errors[-1] > 20.0 * errors[0]
    assert np.all(np.isinf(axis_errors(truth, points[:4], 0.1)))


def test_the_curvature_at_the_ends_of_the_axes():
    radius = curvature_radius(Ellipse.from_axes([0.0, 0.0], [50.0, 10.0], 0.3), 4)
    np.testing.assert_allclose(radius, [2.0, 250.0, 2.0, 250.0])


@pytest.mark.parametrize("view", [189, 283, 351])
def test_a_cover_along_the_rim_is_seen_though_a_smaller_image_shows_none(view):
    # Reduced by 4 or 8, an ellipse passes through the rim and the cover's edge within a tenth of a pixel.
    drawn, _ = sweep.scene(1999, view, 20)
    (circle,) = circlepose.estimate(render(drawn), sweep.CAMERA, sweep.TARGET).circles
    (disc,) = drawn.targets
    assert min(np.linalg.norm(each.center - disc.center_mm) for each in circle.candidates) < 5.0
