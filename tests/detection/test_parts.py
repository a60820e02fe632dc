"""Laws of the parts of extraction: rough fits, chains, reduced images, repeats."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from circlepose._batching import joined
from circlepose.detection.duplicates import inside_others, repeats
from circlepose.detection.edges import canny
from circlepose.detection.edges.arc_grouping import joined_arcs
from circlepose.detection.edges.arcs import arcs_of
from circlepose.detection.edges.chains import Chains
from circlepose.detection.edges.options import EdgeOptions
from circlepose.detection.offset_fit import fit_offsets
from circlepose.fitting.direct import fit_each, fit_ellipse, fit_scatter, scatter_of
from circlepose.geometry.ellipse import Ellipse, rim_distance
from circlepose.imaging.pyramid import pyramid, to_full_size, to_reduced
from circlepose.imaging.subpixel_edges import edges_along
from tests.support.drawn import drawn_by_opencv_5


def random_ellipses(number: int, seed: int = 3) -> Ellipse:
    noise = np.random.default_rng(seed)
    return Ellipse.from_axes(
        noise.uniform(150.0, 900.0, (number, 2)),
        noise.uniform(8.0, 120.0, (number, 2)),
        noise.uniform(-1.5, 1.5, number),
    )


def chains_of(*polygons: np.ndarray) -> Chains:
    return Chains.of_borders([p.astype(np.int32)[:, None, :] for p in polygons], None, 1, size=1000)


def drawn_chain(ellipse: Ellipse) -> np.ndarray:
    """The closed chain of pixels along an ellipse."""
    canvas = np.zeros((1200, 1200), np.uint8)
    cv2.fillPoly(canvas, [np.rint(16.0 * ellipse.points(720)).astype(np.int32)], 255, cv2.LINE_8, 4)
    (border,) = cv2.findContours(canvas, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)[0]
    return border[:, 0, :]


def test_the_quick_fit_is_the_direct_fit():
    truth = random_ellipses(40)
    noise = np.random.default_rng(4)
    arcs = truth.points(60)[:, 5:40] + 0.1 * noise.normal(size=(40, 35, 2))
    quick, found = fit_each(arcs)
    assert found.all()
    for i, arc in enumerate(arcs):
        direct = fit_ellipse(arc)
        np.testing.assert_allclose(quick.center[i], direct.center, atol=1e-5)
        np.testing.assert_allclose(quick.semi_major[i], direct.semi_major, atol=1e-5)
        np.testing.assert_allclose(quick.semi_minor[i], direct.semi_minor, atol=1e-5)
        assert abs(np.sin(quick.angle[i] - direct.angle)) < 1e-5


def test_scatters_of_arcs_add_up_to_that_of_all_points():
    points = random_ellipses(1).points(80) / 100.0
    together, _ = fit_scatter(scatter_of(points))
    parts, _ = fit_scatter(scatter_of(points[:, :30]) + scatter_of(points[:, 30:]))
    np.testing.assert_allclose(parts.semi_major, together.semi_major, rtol=1e-6)


def test_no_ellipse_through_a_line_or_a_point():
    line = np.stack([np.arange(20.0), 2.0 * np.arange(20.0)], axis=-1)
    point = np.full((20, 2), 7.0)
    ellipse, found = fit_each(np.stack([line, point]))
    sizes = ellipse.semi_minor / ellipse.semi_major
    assert not np.any(found & (sizes > 1e-3) & (ellipse.semi_major > 1e-3))


def test_the_moments_of_a_chain_are_those_of_its_ellipse():
    truth = random_ellipses(12)
    found, fullness = chains_of(*(drawn_chain(truth[i]) for i in range(12))).moment_ellipses(np.arange(12))
    np.testing.assert_allclose(found.center, truth.center, atol=0.3)
    np.testing.assert_allclose(found.semi_major, truth.semi_major, atol=0.8)
    np.testing.assert_allclose(found.semi_minor, truth.semi_minor, atol=0.8)
    np.testing.assert_allclose(fullness, 1.0, atol=0.01)


def test_other_shapes_fill_less_of_their_ellipse():
    square = np.array([[0, 0], [100, 0], [100, 100], [0, 100]])
    there_and_back = np.array([[0, 0], [50, 10], [100, 0], [50, 10]])
    _, fullness = chains_of(square, there_and_back).moment_ellipses(np.arange(2))
    np.testing.assert_allclose(fullness[0], 3.0 / np.pi, rtol=1e-9)
    assert fullness[1] < 0.01


def test_chains_keep_their_points_when_chosen():
    polygons = [np.arange(2 * n).reshape(n, 2) + 100 * n for n in (5, 8, 3)]
    chains = chains_of(*polygons)
    chosen = chains[np.array([2, 0])]
    np.testing.assert_array_equal(chosen.points, np.concatenate([polygons[2], polygons[0]]))
    np.testing.assert_array_equal(chains.extents(), [8, 14, 4])
    np.testing.assert_allclose(chains.shares(chains.points[:, 0] > 600), [0.0, 1.0, 0.0])


def test_a_hole_knows_the_outer_border_of_its_edge():
    image = np.zeros((80, 120), np.uint8)
    cv2.circle(image, (40, 40), 20, 255, 1)
    cv2.line(image, (90, 10), (92, 10), 255, 1)
    borders, hierarchy = cv2.findContours(image, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    chains = Chains.of_borders(borders, hierarchy, 12, size=120)
    assert len(chains) == 2
    (hole,) = np.flatnonzero(chains.parents >= 0)
    assert chains.parents[hole] == 1 - hole


def test_a_chain_is_cut_at_its_corners():
    """A half moon has a straight side and a round one."""
    ellipse = Ellipse.from_axes([300.0, 300.0], [80.0, 80.0], 0.0)
    canvas = np.zeros((600, 600), np.uint8)
    cv2.fillPoly(canvas, [np.rint(ellipse.points(360)).astype(np.int32)], 255)
    canvas[:, 300:] = 0
    (border,) = cv2.findContours(canvas, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)[0]
    arcs = arcs_of(chains_of(border[:, 0, :]))
    on_rim = np.abs(rim_distance(ellipse, arcs.samples.reshape(-1, 2))).reshape(len(arcs), -1).max(axis=1) < 2.0
    assert on_rim.sum() == 1
    assert arcs.lengths[on_rim][0] > 0.85 * np.pi * 80.0
    assert len(arcs_of(chains_of(np.zeros((EdgeOptions().shortest_chain - 1, 2))))) == 0


def test_arcs_of_one_rim_are_joined():
    truth = Ellipse.from_axes([300.0, 280.0], [120.0, 70.0], 0.3)
    rim = truth.points(720)
    pieces = [rim[20:160], rim[300:420], rim[520:640]]
    # Each as an edge goes: there and back.
    arcs = arcs_of(chains_of(*(np.concatenate([np.rint(p), np.rint(p[::-1])]) for p in pieces)))
    ellipse, cover = joined_arcs(arcs, 1000.0)
    right = np.linalg.norm(ellipse.center - truth.center, axis=1) < 1.5
    right &= np.abs(ellipse.semi_major - truth.semi_major) < 2.0
    assert right.any()
    # Of the three arcs, each there and back or once.
    assert cover[right].max() > 0.5


@pytest.mark.parametrize("shape", [(5, 5), (90, 70), (480, 640), (2058, 2456)])
def test_reduced_images_hold_the_same_place(shape):
    images = pyramid(np.zeros(shape, np.uint8))
    for level, image in enumerate(images):
        assert np.all(np.abs(np.array(image.shape) * 2**level - shape) <= 2**level)
    assert images[-1].size <= max(shape[0] * shape[1], 1) if len(images) == 1 else images[-1].size < 150_000
    points = np.array([[0.0, 0.0], [10.5, 3.25]])
    np.testing.assert_allclose(to_reduced(to_full_size(points, 8.0), 8.0), points)


def test_averaging_shifts_pixel_centres_as_the_formula_says():
    ramp = np.tile(np.arange(64.0, dtype=np.float32), (64, 1))
    half = cv2.resize(ramp, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    x = to_full_size(np.stack([np.arange(32.0), np.zeros(32)], axis=-1), 2.0)[:, 0]
    np.testing.assert_allclose(half[0], x, atol=1e-4)


def test_repeats_and_what_is_inside_are_told():
    ellipses = joined(
        [Ellipse.from_axes([[100.0, 100.0]], [[a, b]], [0.0]) for a, b in ((50, 40), (50.5, 40.2), (30, 24), (30, 5))]
        + [Ellipse.from_axes([[180.0, 100.0]], [[50.0, 40.0]], [0.0])]
    )
    assert repeats(ellipses, np.array([1, 0, 2, 3, 4])).tolist() == [0]
    assert inside_others(ellipses, np.array([0, 2, 3, 4])).tolist() == [2]
    assert repeats(ellipses, np.empty(0, np.int64)).size == 0


def test_ellipses_are_moved_to_the_edges_along_them():
    truth = Ellipse.from_axes([[160.0, 118.0], [90.0, 60.0]], [[60.0, 35.0], [20.0, 20.0]], [0.4, 0.0])
    near = Ellipse.from_axes(truth.center + np.array([0.8, -0.6]), [[60.7, 34.4], [20.5, 19.6]], [0.405, 0.0])
    eccentric = near.points(72)
    # To first order the offset of the truth from a point of the rim is minus the point's distance from it.
    offsets = -rim_distance(truth, eccentric)
    moved, left = fit_offsets(near, offsets, np.ones(offsets.shape, bool))
    assert np.abs(left).max() < 0.1
    assert np.abs(rim_distance(truth, moved.points(72))).max() < 0.1
    # What is hidden does not count.
    hidden = np.arange(72) < 20
    wrong, _ = fit_offsets(near, np.where(hidden, 5.0, offsets), np.tile(~hidden, (2, 1)))
    assert np.abs(rim_distance(truth, wrong.points(72))).max() < 0.15


def test_quick_profiles_find_the_same_edges():
    y, x = np.mgrid[0:240, 0:320]
    pixels = np.stack([x.ravel(), y.ravel()], axis=-1).astype(float)
    truth = Ellipse.from_axes([[160.0, 118.0]], [[60.0, 35.0]], [0.4])
    cover = np.clip(0.5 - rim_distance(truth, pixels[None])[0], 0.0, 1.0).reshape(240, 320)
    image = cv2.GaussianBlur(200.0 - 160.0 * cover, (0, 0), 0.8)
    for levels in (np.rint(image).astype(np.uint8), image.astype(np.float32), (100 * image).astype(np.uint16)):
        exact = edges_along(levels, truth, 3.0, 72)
        quick = edges_along(levels, truth, 3.0, 72, quick=True)
        np.testing.assert_array_equal(quick.valid, exact.valid)
        np.testing.assert_allclose(quick.points, exact.points, atol=0.06)
        np.testing.assert_array_equal(quick.polarity, exact.polarity)


@drawn_by_opencv_5
def test_edges_that_are_followed_in_strips_are_the_same(monkeypatch):
    page = np.full((500, 400), 235, np.uint8)
    for line in range(18, 500, 18):
        cv2.putText(page, "Oboe, good; eggs 80 & 6", (5, line), cv2.FONT_HERSHEY_SIMPLEX, 0.5, 20, 1, cv2.LINE_AA)
    cv2.rectangle(page, (300, 60), (380, 330), 20, 2)
    monkeypatch.setattr(canny, "_MANY_EDGES", 0.0)
    strips = canny._strips(canny.edge_map(page))
    assert len(strips) > 3
    in_strips = canny.edge_chains(page, 12)
    monkeypatch.setattr(canny, "_MANY_EDGES", 2.0)
    at_once = canny.edge_chains(page, 12)
    assert len(at_once) > 100
    assert np.count_nonzero(at_once.parents >= 0) > 20
    for name in ("points", "starts", "sizes", "parents"):
        np.testing.assert_array_equal(getattr(in_strips, name), getattr(at_once, name))
