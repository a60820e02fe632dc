"""The images of the recall and false-alarm benchmarks are what their names say."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks import false_alarms
from benchmarks.false_alarms import FAMILIES as EMPTY
from benchmarks.recall import matched
from benchmarks.support.disc_families import COLORS, counted, isoluminant, mosaic, scene_picture, spoiled
from benchmarks.support.disc_pictures import RADIUS_MM, board, hiding, rims, rough_patch
from circlepose.fitting.direct import fit_ellipse
from circlepose.geometry.ellipse import rim_distance
from circlepose.imaging.gray import to_grey

GENERATOR_SEED = 5
KINDS = [(family, kind) for family, kinds in EMPTY.items() for kind in kinds]


@pytest.fixture
def generator():
    return np.random.default_rng(GENERATOR_SEED)


@pytest.mark.parametrize("in_plane", [False, True])
def test_the_discs_of_a_board_lie_apart_and_in_the_image(generator, in_plane):
    where = board(generator, 20.0, in_plane=in_plane)
    seen = rims(where.camera, where.discs(0.0))
    reach = seen.semi_major
    assert np.all(seen.center - reach[:, None] > 0.0)
    assert np.all(seen.center + reach[:, None] < np.array(where.camera.image_size) - 1.0)
    gaps = np.linalg.norm(seen.center[:, None] - seen.center, axis=-1) - reach[:, None] - reach
    assert np.all(gaps[~np.eye(len(gaps), dtype=bool)] > 0.0)


def test_the_rims_are_where_the_image_changes():
    picture = scene_picture("a", -120.0, 0.0, 20.0, 0.7, 0.0)
    rim = picture.ellipses()
    y, x = np.mgrid[0 : picture.image.shape[0], 0 : picture.image.shape[1]]
    points = np.broadcast_to(np.stack([x, y], axis=-1).reshape(1, -1, 2), (len(picture.discs), x.size, 2))
    away = rim_distance(rim, points.astype(float)).min(axis=0).reshape(x.shape)
    assert np.ptp(picture.image[away < -3.0]) == 0
    assert np.ptp(picture.image[away > 3.0]) == 0
    assert picture.image[away < -3.0][0] + 120 == picture.image[away > 3.0][0]


@pytest.mark.parametrize(("share", "pieces"), [(0.25, 1), (0.4, 2)])
def test_tape_hides_the_share_of_the_rim(generator, share, pieces):
    disc = board(generator, 30.0).discs(0.0)[3]
    turn = np.linspace(0.0, 2.0 * np.pi, 3600, endpoint=False)
    rim = RADIUS_MM * np.column_stack([np.cos(turn), np.sin(turn)])
    is_hidden = np.zeros(len(rim), bool)
    for patch in hiding(disc, share, pieces, 0.0, generator):
        box = patch.shape
        along = np.array([np.cos(box.angle), np.sin(box.angle)])
        across = np.array([-np.sin(box.angle), np.cos(box.angle)])
        off = rim - box.at
        is_hidden |= (abs(off @ along) < box.size[0] / 2.0) & (abs(off @ across) < box.size[1] / 2.0)
    assert is_hidden.mean() == pytest.approx(share, abs=0.01)


def test_a_rough_edge_has_its_disc_as_the_best_ellipse(generator):
    disc = board(generator, 30.0).discs(0.0)[0]
    points = np.array(rough_patch(disc, 0.03, 0.0, generator).shape.points)
    assert np.std(np.hypot(*points.T)) == pytest.approx(0.03 * RADIUS_MM, rel=1e-3)
    ellipse = fit_ellipse(points)
    assert ellipse.semi_major == pytest.approx(RADIUS_MM, rel=5e-3)
    assert ellipse.semi_minor == pytest.approx(RADIUS_MM, rel=5e-3)


@pytest.mark.parametrize("name", COLORS)
def test_the_pairs_of_colors_have_one_gray(name):
    disc, ground = COLORS[name]
    pixels = np.rint([[isoluminant(disc, ground), ground]]).astype(np.uint8)
    grays = to_grey(pixels)[0].astype(int)
    assert abs(grays[0] - grays[1]) <= 1
    assert np.abs(pixels[0, 0].astype(int) - pixels[0, 1]).max() > 60


def test_a_mosaic_has_each_color_in_its_place():
    image = np.broadcast_to(np.array([1, 2, 3], np.uint8), (4, 6, 3))
    assert np.array_equal(mosaic(image, "RGGB")[:2, :2], [[3, 2], [2, 1]])


def test_odd_pixels_are_few_and_far_from_the_others():
    counts = np.full((300, 400), 8000.0)
    assert np.count_nonzero(spoiled(counts, "a hot pixel") != counts) == 1
    assert 1 <= np.count_nonzero(spoiled(counts, "twenty odd pixels") != counts) <= 20
    assert np.array_equal(spoiled(counts, "plain"), counts)


def test_a_report_is_matched_once_by_place_and_size():
    truth = np.array([[50.0, 50.0, 40.0], [120.0, 50.0, 40.0], [120.0, 52.0, 40.0]])
    reports = np.array([[50.0, 52.0, 60.0], [121.0, 50.0, 42.0]])
    assert matched(reports, truth) == [None, 1, None]
    assert matched(np.empty((0, 3)), truth) == [None] * 3


def test_images_are_grouped_by_setting():
    first, second = (scene_picture(name, 60.0, 2.0, 4.0, 0.7, 0.0) for name in ("a", "b"))
    assert counted(iter([first, second, first])) == {"a": [first, first], "b": [second]}


@pytest.mark.parametrize(("family", "kind"), KINDS)
def test_an_image_without_circles_is_the_same_each_time(family, kind):
    if family == "text":
        pytest.importorskip("matplotlib")
    first, again = (next(false_alarms.images_of(family, kind)) for _ in range(2))
    assert np.array_equal(first, again)
    assert (first.dtype, first.shape) == (np.uint8, (480, 640))
    assert first.std() > 0.5


def test_there_are_500_images_without_circles():
    packaged = 20
    assert sum(number for kinds in EMPTY.values() for number, _ in kinds.values()) + packaged == 500
