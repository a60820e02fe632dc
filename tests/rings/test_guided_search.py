"""Rims of which little is seen are found where another rim of the target puts them, and nowhere else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import circlepose
from benchmarks.support.scoring import TrueCircle, error
from circlepose.camera.camera import Camera, circle_contour
from circlepose.fitting.cone_fit import fit_cone
from circlepose.geometry.cone import plane_basis
from circlepose.imaging.gray import to_grey
from circlepose.measurement.rim import rim_from_fit
from circlepose.results import Status
from circlepose.rings.guided_search import with_hidden_rims
from circlepose.rings.matching import match_rings
from circlepose.rings.results import find_ring_targets
from circlepose.synthesis.render import render
from circlepose.synthesis.scene import Box, CoaxialPart, Disc, Paint, Patch, Rings, Scene, Texture
from circlepose.targets.target import Target

CAMERA = Camera.create([[900.0, 0, 319.5], [0, 900.0, 239.5], [0, 0, 1]], (), (640, 480))
CENTER = np.array([30.0, -20.0, 500.0])
COPLANAR = Target("coplanar", (50.0, 30.0))
COAXIAL = Target("coaxial", (45.0, 30.0), generatrix_mm=45.21)
HEIGHT_MM = float(np.sqrt(45.21**2 - 15.0**2))


def tilted(degrees):
    sight = CENTER / np.linalg.norm(CENTER)
    first, second = plane_basis(sight)
    tilt = np.radians(degrees)
    return -np.cos(tilt) * sight + np.sin(tilt) * (0.6 * first + 0.8 * second)


def exact_rim(circle):
    """The rim that a perfect extraction would give."""
    contour = circle_contour(CAMERA, circle.center, circle.normal, circle.radius, 200)
    return rim_from_fit(CAMERA, fit_cone(CAMERA, contour), contour)


def picture(*parts, occluders=(), background=None):
    scene = Scene(CAMERA, parts, background or Paint(170.0), occluders=occluders, noise_levels=2.0, noise_seed=5)
    return to_grey(render(scene))


def found_from(image, circle, target):
    """What is found in `image` when of the target only `circle` is known."""
    return searched(image, [exact_rim(circle)], target)[1:]


def searched(image, rims, target):
    """The rims of an image after the search, those known first."""
    matched = with_hidden_rims(image, CAMERA, match_rings(rims, CAMERA, target), target)
    return [each.rim for each in matched.rims]


def in_sight(part):
    """Share of a recess's floor's rim that its big rim does not hide."""
    big, small = part.circles
    rays = CAMERA.rays(circle_contour(CAMERA, small.center, small.normal, small.radius, 360))
    cone = np.linalg.inv(exact_rim(big).cone.factor)
    local = rays @ cone.T
    return float(np.mean(np.hypot(local[:, 0], local[:, 1]) < local[:, 2]))


@pytest.mark.parametrize("known", ["big", "small"])
@pytest.mark.parametrize("form", ["boss", "recess"])
def test_each_circle_of_a_part_finds_the_other(form, known):
    part = CoaxialPart(CENTER, tilted(40.0), (45.0, 30.0), HEIGHT_MM, form, Paint(80.0), Paint(230.0))
    own, other = part.circles if known == "big" else part.circles[::-1]
    found = found_from(picture(part), own, COAXIAL)
    assert found
    exact = exact_rim(other).ellipse
    rim = min(found, key=lambda each: np.linalg.norm(each.ellipse.center - exact.center))
    assert np.linalg.norm(rim.ellipse.center - exact.center) < 0.5
    assert abs(rim.ellipse.semi_major - exact.semi_major) < 0.5
    assert rim.rim_used < 1.0 or form == "recess"


def test_a_floor_of_which_a_quarter_is_in_sight_settles_which_candidate_is_right():
    part = CoaxialPart(CENTER, tilted(53.0), (45.0, 30.0), HEIGHT_MM, "recess", Paint(80.0), Paint(230.0))
    assert 0.22 < in_sight(part) < 0.37
    image = picture(part)
    known = match_rings([exact_rim(part.circles[0])], CAMERA, COAXIAL)
    matched = with_hidden_rims(image, CAMERA, known, COAXIAL)
    rims = [each.rim for each in matched.rims]
    assert len(rims) > 1
    assert rims[1].rim_used < 0.4
    results = find_ring_targets(rims, matched, CAMERA, COAXIAL, ("chen-huang",)).circles
    assert [circle.circle for circle in results] == ["big", "small"]
    for circle, true in zip(results, part.circles, strict=True):
        measured = error(circle, TrueCircle(true.center, true.normal, None, None, true.name))
        assert measured.chosen
        assert measured.position_mm < 0.5
        assert measured.normal_deg < 0.2
    result = circlepose.estimate(image, CAMERA, COAXIAL)
    assert result.status is Status.OK
    assert result.circles[0].candidates[0].normal @ part.normal > 0.9999


def test_a_floor_that_is_hidden_is_not_found():
    part = CoaxialPart(CENTER, tilted(68.0), (45.0, 30.0), HEIGHT_MM, "recess", Paint(80.0), Paint(230.0))
    assert in_sight(part) < 0.05
    assert found_from(picture(part), part.circles[0], COAXIAL) == []


@pytest.mark.parametrize(("covered", "is_found"), [(0.5, True), (0.65, True), (0.9, False)])
def test_an_inner_ring_that_is_mostly_covered(covered, is_found):
    rings = Rings(CENTER, tilted(45.0), (50.0, 30.0), (Paint(40.0), Paint(220.0)))
    rim = circle_contour(CAMERA, CENTER, rings.normal, 30.0, 200)
    low, high = rim.min(axis=0) - 25.0, rim.max(axis=0) + 25.0
    edge = float(np.quantile(rim[:, 0], covered))
    cover = Patch(
        Box(tuple(np.array([edge, high[1]]) - low), tuple((np.array([edge, high[1]]) + low) / 2.0)), Paint(120.0)
    )
    found = found_from(picture(rings, occluders=(cover,)), rings.circles[0], COPLANAR)
    assert bool(found) is is_found
    for each in found:
        assert each.rim_used < 1.05 - covered
        exact = exact_rim(rings.circles[1]).ellipse
        assert np.linalg.norm(each.ellipse.center - exact.center) < 0.6


@pytest.mark.parametrize("target", [COPLANAR, COAXIAL])
@pytest.mark.parametrize("tilt_deg", [10.0, 40.0, 65.0])
def test_nothing_is_found_around_a_disc_in_texture(target, tilt_deg):
    disc = Disc(CENTER, tilted(tilt_deg), target.radii_mm[0], Paint(60.0, Texture(25.0, 4.0)))
    background = Paint(150.0, Texture(40.0, 6.0))
    image = picture(disc, background=background)
    assert found_from(image, disc.circles[0], target) == []


def test_nothing_is_sought_that_is_there_or_that_nothing_predicts():
    part = CoaxialPart(CENTER, tilted(30.0), (45.0, 30.0), HEIGHT_MM, "boss", Paint(80.0), Paint(230.0))
    image = picture(part)
    both = [exact_rim(circle) for circle in part.circles]
    assert searched(image, both, COAXIAL) == both
    assert searched(image, both[:1], replace(COAXIAL, generatrix_mm=None)) == both[:1]
    assert searched(image, [], COAXIAL) == []
