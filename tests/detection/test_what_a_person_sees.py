"""Noise, blur, roughness, covers and faintness: what a person sees is found, and what only looks round is not."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

import circlepose
from circlepose.detection.contour import Rejection
from circlepose.detection.detect import find_contours
from circlepose.results import Flag
from circlepose.targets.target import AxisIntervals
from tests.support.shapes import CAMERA, RADIUS_MM, coverage, discs, photographed, polygon, rough

FREE = AxisIntervals()
SIX = [(110.0, 120.0), (320.0, 120.0), (530.0, 120.0), (110.0, 360.0), (320.0, 360.0), (530.0, 360.0)]
ALL = circlepose.Target.circle(RADIUS_MM, count="all")


def measured(image):
    return circlepose.estimate(image, CAMERA, ALL).circles


def squares(image, circles):
    """Squared errors of the centers over their covariance (n,), of the circles that are found."""
    found = []
    for result in measured(image):
        true = min(circles, key=lambda disc: np.linalg.norm(disc.place - result.ellipse.center))
        nearest = min(result.candidates, key=lambda each: np.linalg.norm(each.center - true.center))
        if nearest.covariance is not None:
            error = nearest.center - true.center
            found.append(error @ np.linalg.solve(nearest.covariance[:3, :3], error) / 3.0)
    return np.array(found)


@pytest.mark.parametrize(("radius_px", "noise"), [(14.0, 15.0), (30.0, 24.0), (70.0, 24.0)])
def test_a_disc_of_60_levels_stands_out_of_strong_noise(radius_px, noise):
    circles = discs(SIX, radius_px)
    image = photographed(140.0 - 60.0 * coverage(circles, radius_px), noise=noise)
    assert len(measured(image)) == 6
    assert 0.2 < squares(image, circles).mean() < 3.0


@pytest.mark.parametrize("noise", [2.0, 12.0, 28.0])
def test_noise_alone_is_no_circle(noise):
    for seed in range(6):
        assert not find_contours(photographed(np.full((480, 640), 128.0), noise=noise, seed=seed), FREE).contours


@pytest.mark.parametrize(("radius_px", "blur_px"), [(6.0, 2.0), (30.0, 4.0), (30.0, 8.0), (30.0, 12.0), (60.0, 16.0)])
def test_a_disc_out_of_focus_is_measured_with_its_covariance(radius_px, blur_px):
    circles = discs(SIX, radius_px)
    image = photographed(60.0 + 120.0 * coverage(circles, radius_px), blur_px, 2.0)
    assert len(measured(image)) == 6
    found = squares(image, circles)
    assert len(found) == 6
    assert found.mean() < 4.0


def test_a_gaussian_blob_is_no_disc():
    y, x = np.mgrid[:480, :640]
    blobs = 20.0 + 200.0 * np.exp(-0.5 * ((x - 320.0) ** 2 + (y - 240.0) ** 2) / 12.0**2)
    result = circlepose.estimate(photographed(blobs), CAMERA, ALL)
    assert not result.circles


@pytest.mark.parametrize("height", [-80.0, 60.0, 120.0])
def test_blobs_of_which_the_slopes_have_edges_are_no_discs(height):
    """Edges are found along their slopes, but the levels have their width in the blur alone."""
    y, x = np.mgrid[0:480, 0:640]
    levels = np.full((480, 640), 100.0)
    for width, stretch, place in zip(
        (4.0, 8.0, 12.0, 18.0, 24.0, 30.0), (1.0, 1.5, 1.0, 1.3, 1.6, 1.0), SIX, strict=True
    ):
        levels += height * np.exp(-0.5 * (((x - place[0]) / stretch) ** 2 + (y - place[1]) ** 2) / width**2)
    assert not measured(photographed(levels, noise=2.0))


def test_a_faint_disc_beside_strong_ones_is_found():
    circles = discs(SIX, 30.0)
    levels = 200.0 - 140.0 * coverage(circles[:5], 30.0) - 15.0 * coverage(circles[5:], 30.0)
    assert len(measured(photographed(levels, noise=1.5))) == 6


@pytest.mark.parametrize("corners", [3, 4, 5, 6, 8, 10, 12, 14])
@pytest.mark.parametrize("radius_px", [16.0, 30.0, 60.0])
def test_polygons_are_told_by_their_corners(corners, radius_px):
    circles = discs(SIX, radius_px, seed=corners)
    shapes = [polygon(corners, 0.3 * number) for number in range(6)]
    found = find_contours(photographed(200.0 - 150.0 * coverage(circles, radius_px, shapes), noise=2.0), FREE)
    assert len(found.contours) <= (1 if corners < 14 or radius_px > 20.0 else 6)
    if corners > 6 and not found.contours:
        assert found.rejected[Rejection.POLYGON] >= 3


@pytest.mark.parametrize("radius_px", [4.0, 6.0, 10.0, 30.0, 60.0])
def test_discs_are_no_polygons(radius_px):
    for seed in range(4):
        circles = discs(SIX, radius_px, seed)
        found = find_contours(photographed(200.0 - 150.0 * coverage(circles, radius_px), noise=3.0, seed=seed), FREE)
        assert len(found.contours) == 6


@pytest.mark.parametrize("radius_px", [15.0, 30.0, 60.0])
@pytest.mark.parametrize("share", [0.01, 0.02])
def test_a_rough_rim_is_found_with_a_covariance_from_its_residuals(radius_px, share):
    found, flagged, of_all = [], 0, 0
    for seed in range(2):
        circles = discs(SIX, radius_px, seed)
        shapes = [rough(share, 10 * seed + number) for number in range(6)]
        image = photographed(200.0 - 140.0 * coverage(circles, radius_px, shapes), noise=2.0)
        results = measured(image)
        of_all += len(results)
        flagged += sum(Flag.POOR_FIT in result.flags for result in results)
        found += squares(image, circles).tolist()
    assert of_all >= 11
    assert len(found) >= 8
    assert np.mean(found) < 6.0
    if share * radius_px >= 0.6:
        assert flagged >= 8


def test_every_disc_of_a_board_is_found_though_tape_covers_a_part_of_each():
    places = [(60.0 + 104.0 * column, 70.0 + 112.0 * row) for row in range(4) for column in range(6)]
    circles = discs(places, 22.0)
    levels = 210.0 - 170.0 * coverage(circles, 22.0)
    rng = np.random.default_rng(4)
    for x, y in places:
        angle = rng.uniform(0.0, 2.0 * np.pi)
        out, along = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
        middle = np.array([x, y]) + 20.0 * out
        corners = [middle + s * 26.0 * along + t * 6.0 * out for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        cv2.fillPoly(levels, [np.round(np.array(corners) * 16).astype(np.int32)], 140.0, cv2.LINE_8, 4)
    assert len(find_contours(photographed(levels), FREE).contours) == 24


@pytest.mark.parametrize("level", [30.0, 90.0, 140.0, 230.0])
def test_a_covered_rim_is_not_taken_for_a_rough_one(level):
    # Chords run close to the rim: an ellipse through all edges would be several px off.
    circles = discs(SIX, 60.0, seed=3)
    levels = 200.0 - 160.0 * coverage(circles, 60.0)
    rng = np.random.default_rng(int(level))
    for circle in circles:
        for angle in rng.uniform(0.0, 2.0 * np.pi) + np.array([0.0, 2.1]):
            out, along = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
            corners = [
                circle.place + 46.0 * out + s * 40.0 * along + t * 40.0 * out
                for s, t in ((-1, 0), (1, 0), (1, 1), (-1, 1))
            ]
            cv2.fillPoly(levels, [np.round(np.array(corners) * 16).astype(np.int32)], level, cv2.LINE_8, 4)
    results = measured(photographed(levels, noise=2.0))
    near = [
        min(np.linalg.norm(each.center - circle.center) / np.linalg.norm(circle.center) for each in result.candidates)
        for result in results
        for circle in circles
        if result.candidates and np.linalg.norm(result.ellipse.center - circle.place) < 12.0
    ]
    assert len(near) >= 5
    assert np.max(near) < 0.005


def test_what_bends_away_from_an_ellipse_scores_less_than_what_a_cover_cuts():
    circles = discs([(200.0, 240.0)], 60.0)
    cut = 200.0 - 150.0 * coverage(circles, 60.0)
    cut[:, 220:] = 120.0
    (hidden,) = find_contours(photographed(cut), FREE).contours
    # A pear: half of it is that circle, from which the rest departs without a corner.
    pear = [lambda angle: 1.0 + 0.5 * np.maximum(np.cos(angle), 0.0) ** 2]
    bent = find_contours(photographed(200.0 - 150.0 * coverage(circles, 60.0, pear)), FREE).contours
    assert all(contour.score < hidden.score for contour in bent)


def test_letters_without_bowls_and_the_cells_of_markers_are_no_discs():
    page = np.full((480, 640), 230, np.uint8)
    for row in range(8):
        cv2.putText(
            page, "LYNX UNIT HYMN VINYL", (20, 50 + 54 * row), cv2.FONT_HERSHEY_SIMPLEX, 1.2, 30, 2, cv2.LINE_AA
        )
    assert len(measured(photographed(page.astype(np.float64), 0.8))) <= 2
    cells = np.kron(np.random.default_rng(1).random((60, 80)) < 0.4, np.ones((8, 8))) * 180.0 + 40.0
    assert len(measured(photographed(cells, 1.5))) <= 4
