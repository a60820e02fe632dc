"""Crops, and grounds that change along a rim: what is found depends on neither."""

from __future__ import annotations

import numpy as np
import pytest

import circlepose
from circlepose.detection.detect import find_contours
from circlepose.detection.levels_around import are_solid
from circlepose.detection.options import DEFAULT
from circlepose.geometry.ellipse import Ellipse
from circlepose.imaging.pyramid import Reduced
from circlepose.results import Flag
from circlepose.targets.target import AxisIntervals
from tests.support.shapes import CAMERA, RADIUS_MM, coverage, discs, photographed, rough

FREE = AxisIntervals()
ALL = circlepose.Target.circle(RADIUS_MM, count="all")
MIDDLE = (320.0, 240.0)


def cropped(image, width, height):
    """The middle of an image (480, 640), and its first pixel."""
    left, top = (640 - width) // 2, (480 - height) // 2
    return np.ascontiguousarray(image[top : top + height, left : left + width]), np.array([left, top])


@pytest.mark.parametrize(("width", "height"), [(320, 240), (240, 200), (640, 480)])
@pytest.mark.parametrize(("radius_px", "blur_px"), [(30.0, 8.0), (30.0, 12.0), (45.0, 12.0), (60.0, 16.0)])
def test_a_disc_out_of_focus_is_found_in_a_crop(width, height, radius_px, blur_px):
    disc = discs([MIDDLE], radius_px)[0]
    image = photographed(60.0 + 120.0 * coverage([disc], radius_px), blur_px, 2.0)
    crop, first = cropped(image, width, height)
    found = find_contours(crop, FREE).contours
    assert len(found) == 1
    assert np.linalg.norm(found[0].ellipse.center + first - disc.place) < 0.1 * radius_px
    assert abs(float(found[0].ellipse.semi_major) - radius_px) < 0.1 * radius_px


@pytest.mark.parametrize("size", [(320, 240), (240, 180)])
def test_noise_adds_no_rim_to_the_edge_of_a_disc(size):
    for seed in range(8):
        disc = discs([MIDDLE], 30.0, seed)[0]
        image = photographed(140.0 - 60.0 * coverage([disc], 30.0), noise=24.0, seed=seed)
        assert len(find_contours(cropped(image, *size)[0], FREE).contours) == 1


def test_a_disc_on_a_ground_that_runs_from_darker_to_brighter_is_found():
    for seed in range(4):
        disc = discs([MIDDLE], 45.0, seed)[0]
        ground = np.broadcast_to(np.linspace(-260.0, 260.0, 640), (480, 640)).clip(-90.0, 90.0) + 120.0
        inside = coverage([disc], 45.0)
        image = photographed(ground * (1.0 - inside) + 120.0 * inside, noise=2.0, seed=seed)
        near = [c for c in find_contours(image, FREE).contours if np.linalg.norm(c.ellipse.center - disc.place) < 3.0]
        assert len(near) == 1


def test_a_disc_between_a_darker_and_a_brighter_ground_is_found():
    disc = discs([MIDDLE], 40.0)[0]
    ground = np.where(np.arange(640) < 330, 50.0, 150.0)[None] + np.zeros((480, 1))
    inside = coverage([disc], 40.0)
    found = find_contours(photographed(ground * (1.0 - inside) + 100.0 * inside, noise=2.0), FREE).contours
    assert any(np.linalg.norm(contour.ellipse.center - disc.place) < 2.0 for contour in found)


def test_no_rim_is_reported_twice():
    places = [(110.0, 120.0), (320.0, 120.0), (530.0, 120.0), (110.0, 360.0), (320.0, 360.0), (530.0, 360.0)]
    for seed in range(3):
        circles = discs(places, 40.0, seed)
        shapes = [rough(0.03, 10 * seed + number) for number in range(6)]
        image = photographed(200.0 - 140.0 * coverage(circles, 40.0, shapes), 3.0, 2.0)
        found = circlepose.estimate(image, CAMERA, ALL).circles
        assert len(found) >= 5
        centers = np.array([circle.ellipse.center for circle in found])
        apart = np.linalg.norm(centers[:, None] - centers, axis=-1) + 1e3 * np.eye(len(found))
        assert apart.min() > 20.0


def test_a_fit_to_the_levels_leaves_no_clean_edge():
    # Rings so close that their edges run into each other.
    radii = [50.0, 46.5, 42.0, 38.5, 30.0]
    levels = np.full((480, 640), 220.0)
    for number, radius_px in enumerate(radii):
        inside = coverage(discs([MIDDLE], radius_px), radius_px)
        levels = levels * (1.0 - inside) + (30.0 if number % 2 == 0 else 220.0) * inside
    image = photographed(levels, 1.5, 2.0)
    edges = circlepose.estimate(image, CAMERA, ALL, refine=False).circles
    for circle in circlepose.estimate(image, CAMERA, ALL).circles:
        same = min(edges, key=lambda each: abs(float(each.ellipse.semi_major - circle.ellipse.semi_major)))
        assert circle.residual_px <= 3.1 * max(same.residual_px, 0.1)


def test_a_hole_in_a_line_is_not_a_solid_disc():
    inside = coverage(discs([(200.0, 240.0), (440.0, 240.0)], 8.0), 8.0)
    line = coverage(discs([(440.0, 240.0)], 13.0), 13.0)
    image = photographed(200.0 - 150.0 * np.maximum(line, inside) + 300.0 * inside * line)
    disc_and_hole = Ellipse(np.array([[200.0, 240.0], [440.0, 240.0]]), np.full(2, 8.0), np.full(2, 8.0), np.zeros(2))
    solid = are_solid(Reduced(image), disc_and_hole, np.array([1.0, -1.0]), DEFAULT)
    assert solid.tolist() == [True, False]


def test_what_a_low_score_takes_is_flagged_doubtful():
    y, x = np.mgrid[:480, :640]
    rng = np.random.default_rng(5)
    levels = np.full((480, 640), 220.0)
    for left, top in rng.uniform([20.0, 20.0], [610.0, 450.0], (900, 2)):
        if np.hypot(left - 320.0, top - 240.0) > 14.0:
            levels[int(top) : int(top) + 7, int(left) : int(left) + 7] = 40.0
    levels[np.hypot(x - 320.0, y - 240.0) < 4.0] = 40.0
    image = photographed(levels, 0.8, 1.0)

    def at_middle(min_score):
        found = circlepose.estimate(image, CAMERA, ALL, min_score=min_score).circles
        return [circle for circle in found if np.linalg.norm(circle.ellipse.center - MIDDLE) < 2.0]

    assert not at_middle(None)
    (circle,) = at_middle(0.01)
    assert circle.score is not None
    assert circle.score < 0.32
    assert Flag.DOUBTFUL in circle.flags


def test_what_proves_no_disc_does_not_stand_for_one():
    # Of the small one the blur leaves a blob.
    large, small = discs([(200.0, 240.0)], 60.0)[0], discs([(480.0, 240.0)], 14.0)[0]
    for contrast in (76.0, 133.0):
        image = photographed(230.0 - contrast * coverage([large], 60.0) - 190.0 * coverage([small], 14.0), 11.0, 2.0)
        one = circlepose.estimate(image, CAMERA, circlepose.Target.circle(RADIUS_MM))
        assert one.status == "ok"
        assert np.linalg.norm(one.circles[0].ellipse.center - large.place) < 3.0


@pytest.mark.parametrize(
    ("blur_px", "noise", "contrast", "radius_px"), [(2.5, 2.0, 10.0, 14.0), (0.8, 6.0, 12.0, 20.0)]
)
def test_a_faint_disc_beside_strong_ones_is_found_as_in_a_crop_without_them(blur_px, noise, contrast, radius_px):
    faint = discs([MIDDLE], radius_px, seed=4)
    strong = discs([(120.0, 120.0), (520.0, 120.0), (120.0, 360.0), (520.0, 360.0)], 40.0)
    levels = 180.0 - contrast * coverage(faint, radius_px) - 140.0 * coverage(strong, 40.0)
    image = photographed(levels, blur_px, noise)
    found = [
        c for c in circlepose.estimate(image, CAMERA, ALL).circles if np.linalg.norm(c.ellipse.center - MIDDLE) < 3.0
    ]
    crop = find_contours(np.ascontiguousarray(image[190:290, 270:370]), AxisIntervals()).contours
    assert len(found) == len(crop) == 1
