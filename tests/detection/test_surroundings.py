"""Small round things among shapes that are not: letters and cells are dropped, dots among dots are kept."""

from __future__ import annotations

from itertools import pairwise

import cv2
import numpy as np
import pytest

import circlepose
from circlepose.detection.contour import Rejection
from circlepose.detection.detect import find_contours
from circlepose.detection.edges.canny import edge_chains
from circlepose.detection.options import DEFAULT
from circlepose.detection.surroundings import Surroundings, chance_scores
from circlepose.geometry.ellipse import Ellipse
from circlepose.targets.target import AxisIntervals
from tests.support.shapes import CAMERA, coverage, discs, photographed

FREE = AxisIntervals()
LINES = ["a good ocean code", "doze on a balcony", "go back to school", "a broad boat dock", "cocoa and a goose"]


def text(top: int, bottom: int):
    """White paper (480, 640) with lines of round letters from `top` to `bottom`, px."""
    page = np.full((480, 640), 225, np.uint8)
    for number, y in enumerate(range(top, bottom, 34)):
        cv2.putText(page, LINES[number % 5], (20, y), cv2.FONT_HERSHEY_DUPLEX, 0.9, 30, 1, cv2.LINE_AA)
    return page.astype(np.float64)


def test_letters_with_bowls_are_dropped_unless_a_lower_score_is_asked_for():
    page = photographed(text(40, 470), 0.8, 2.0)
    found = find_contours(page, FREE)
    assert len(found.contours) <= 3
    assert found.rejected[Rejection.BY_CHANCE] >= 20
    lenient = find_contours(page, FREE, options=DEFAULT.with_least_score(0.0))
    assert len(lenient.contours) >= 20
    assert lenient.rejected[Rejection.BY_CHANCE] == 0


def test_dots_beside_text_are_kept():
    places = [(60.0 + 40.0 * column, 50.0 + 36.0 * row) for row in range(5) for column in range(14)]
    page = text(270, 470)
    page -= 190.0 * coverage(discs(places, 8.0), 8.0)
    found = find_contours(photographed(page, 0.8, 2.0), FREE).contours
    assert sum(contour.ellipse.center[1] < 225.0 for contour in found) == 70


@pytest.mark.parametrize("radius_px", [5.0, 8.0, 30.0])
def test_a_disc_on_its_own_is_kept_and_a_large_one_in_text(radius_px):
    page = np.full((480, 640), 225.0) if radius_px < 20.0 else text(40, 470)
    cleared = coverage(discs([(320.0, 240.0)], radius_px + 8.0), radius_px + 8.0)
    page = page * (1.0 - cleared) + 225.0 * cleared - 190.0 * coverage(discs([(320.0, 240.0)], radius_px), radius_px)
    found = find_contours(photographed(page, 0.8, 2.0), FREE).contours
    assert any(np.linalg.norm(contour.ellipse.center - [320.0, 240.0]) < 1.0 for contour in found)


@pytest.mark.parametrize("radius_px", [8.5, 10.0, 12.0])
def test_dots_beside_a_scale_are_kept(radius_px):
    places = [(80.0 + 90.0 * number, 200.0) for number in range(6)]
    page = 200.0 - 170.0 * coverage(discs(places, radius_px), radius_px)
    for x in range(20, 620, 10):
        page[230 : 245 + 10 * (x % 50 == 20), x : x + 2] = 30.0
    assert len(find_contours(photographed(page, 0.8, 2.0), FREE).contours) == 6


def test_faint_shapes_around_do_not_count():
    rng = np.random.default_rng(0)
    for strength, is_dropped in ((20.0, False), (150.0, True)):
        page = np.full((240, 320), 200.0)
        for x, y in rng.uniform(10.0, 230.0, (150, 2)):
            if np.hypot(x - 120.0, y - 120.0) > 14.0:
                page[int(y) - 3 : int(y) + 3, int(x) - 3 : int(x) + 3] = 200.0 - strength
        y, x = np.mgrid[:240, :320]
        page[np.hypot(x - 120.0, y - 120.0) < 5.0] = 50.0
        image = np.clip(cv2.GaussianBlur(page, (0, 0), 0.8), 0, 255).astype(np.uint8)
        edges = Surroundings.of(edge_chains(image, DEFAULT.shortest_chain), image)
        disc = Ellipse(np.array([[120.0, 120.0]]), np.array([5.0]), np.array([5.0]), np.array([0.0]))
        assert bool(chance_scores(disc, np.ones(1), edges)[0] < DEFAULT.least_score) is is_dropped


def test_more_kin_never_make_a_contour_one_by_chance():
    image = photographed(text(40, 470), 0.8, 2.0)
    edges = Surroundings.of(edge_chains(image, DEFAULT.shortest_chain), image)
    rng = np.random.default_rng(3)
    center = rng.uniform([250.0, 200.0], [390.0, 280.0], (40, 2))
    alone, with_kin = (chance_scores(ellipse_at(each), np.ones(len(each)), edges)[0] for each in (center[:1], center))
    assert alone < DEFAULT.least_score < with_kin


def ellipse_at(center):
    """Circles of radius 7 px."""
    number = len(center)
    return Ellipse(center, np.full(number, 7.0), np.full(number, 7.0), np.zeros(number))


def test_a_page_of_text_names_what_was_dropped_and_a_lower_score_takes_it():
    page = photographed(text(40, 470), 0.8, 2.0)
    result = circlepose.estimate(page, CAMERA, circlepose.Target.circle(1.0))
    assert result.status == "no_circle"
    assert "round by chance" in result.reason
    lenient = circlepose.estimate(page, CAMERA, circlepose.Target.circle(1.0, count="all"), min_score=0.0)
    assert len(lenient.circles) >= 20


def test_a_lower_least_score_adds_contours_and_changes_none():
    page = photographed(text(40, 470), 0.8, 2.0)
    cv2.circle(page, (590, 60), 40, 10, -1, cv2.LINE_AA)
    found = []
    for score in (1.0, 0.7, DEFAULT.least_score, 0.25, 0.15, 0.05, 0.0):
        contours = find_contours(page, FREE, options=DEFAULT.with_least_score(score)).contours
        found.append({(*c.ellipse.center.tolist(), float(c.ellipse.semi_major), c.score) for c in contours})
        assert all(contour.score >= score for contour in contours)
    assert all(fewer <= more for fewer, more in pairwise(found))
    assert {each for each in found[-1] if each[-1] >= DEFAULT.least_score} == found[2]
    assert len(found[0]) == 0 < len(found[1]) <= len(found[2]) < 10 < len(found[-1])
