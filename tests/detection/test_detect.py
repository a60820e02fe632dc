from __future__ import annotations

import cv2
import numpy as np
import pytest

from circlepose.camera.camera import Camera
from circlepose.detection.axis_intervals import axis_intervals
from circlepose.detection.contour import Rejection
from circlepose.detection.detect import find_contours
from circlepose.detection.occluded import in_runs
from circlepose.errors import ArgumentError
from circlepose.geometry.ellipse import Ellipse, signed_distance
from circlepose.imaging.gray import to_grey
from circlepose.imaging.stretch import in_edge_levels
from circlepose.imaging.subpixel_edges import contour_normals, ellipse_rim, locate_edges, sample
from circlepose.targets.target import AxisIntervals, Target

FREE = AxisIntervals()


def draw(*ellipses: Ellipse, levels=(40.0,), background=200.0, size=(320, 240), blur=0.8, noise=0.0) -> np.ndarray:
    """Ellipses with area-sampled edges, from the exact distance to each rim."""
    width, height = size
    y, x = np.mgrid[0:height, 0:width]
    pixels = np.stack([x.ravel(), y.ravel()], axis=-1).astype(float)
    image = np.full((height, width), background)
    for ellipse, level in zip(ellipses, np.resize(levels, len(ellipses)), strict=True):
        cover = np.clip(0.5 - signed_distance(ellipse, pixels), 0.0, 1.0).reshape(height, width)
        image = image + (level - image) * cover
    image = cv2.GaussianBlur(image, (0, 0), blur) + noise * np.random.default_rng(0).normal(size=image.shape)
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def ellipse(x=160.3, y=118.7, a=60.0, b=35.0, angle=0.4) -> Ellipse:
    return Ellipse.from_axes([x, y], [a, b], angle)


def test_an_ellipse_is_found_to_a_fraction_of_a_pixel():
    truth = ellipse()
    found = find_contours(draw(truth, noise=1.0), FREE).contours
    assert len(found) == 1
    np.testing.assert_allclose(found[0].ellipse.center, truth.center, atol=0.02)
    np.testing.assert_allclose(found[0].ellipse.semi_major, truth.semi_major, atol=0.02)
    np.testing.assert_allclose(found[0].ellipse.semi_minor, truth.semi_minor, atol=0.02)
    assert found[0].polarity == 1
    assert found[0].rim_used > 0.99
    assert "darker inside" in found[0].kept_because


@pytest.mark.parametrize("radius", [3.5, 5.0, 8.0, 20.0, 100.0])
def test_from_a_few_pixels_to_large(radius):
    truth = ellipse(a=radius, b=0.9 * radius)
    found = find_contours(draw(truth, noise=1.0), FREE).contours
    assert len(found) == 1
    np.testing.assert_allclose(found[0].ellipse.semi_major, radius, atol=0.1)


def test_polarity_is_told_and_obeyed():
    image = draw(
        ellipse(x=90.0, a=40.0, b=30.0), ellipse(x=230.0, a=40.0, b=30.0), levels=(20.0, 240.0), background=130.0
    )
    assert {c.polarity for c in find_contours(image, FREE).contours} == {1, -1}
    for polarity, sign in (("dark", 1), ("bright", -1)):
        found = find_contours(image, FREE, polarity)
        assert [c.polarity for c in found.contours] == [sign]
        assert found.rejected[Rejection.POLARITY] >= 1


def test_axis_intervals_select_and_count_what_they_reject():
    image = draw(ellipse(x=80.0, a=50.0, b=40.0), ellipse(x=230.0, a=30.0, b=12.0))
    by_major = find_contours(image, AxisIntervals(major_px=(90.0, 110.0)))
    assert len(by_major.contours) == 1
    by_minor = find_contours(image, AxisIntervals(minor_px=(20.0, 30.0)))
    assert [round(float(c.ellipse.semi_minor)) for c in by_minor.contours] == [12]
    assert by_minor.rejected[Rejection.MINOR_AXIS] >= 1


def test_the_most_evident_contour_comes_first():
    image = draw(ellipse(x=80.0, a=50.0, b=40.0), ellipse(x=230.0, a=50.0, b=40.0), levels=(150.0, 20.0))
    first, second = find_contours(image, FREE).contours
    assert first.step > second.step
    assert first.evidence > second.evidence


def test_nested_rims_count_once_unless_rings_are_wanted():
    image = draw(ellipse(a=60.0, b=45.0), ellipse(a=36.0, b=27.0), levels=(30.0, 220.0))
    assert [round(float(c.ellipse.semi_major)) for c in find_contours(image, FREE).contours] == [60]
    rings = find_contours(image, FREE, keep_concentric=True).contours
    assert sorted(round(float(c.ellipse.semi_major)) for c in rings) == [36, 60]


def test_straight_edged_shapes_are_no_circles():
    image = np.full((240, 320), 200, np.uint8)
    cv2.rectangle(image, (40, 40), (110, 110), 30, -1)
    cv2.fillPoly(image, [np.array([[200, 40], [280, 60], [230, 150]])], 30)
    cv2.putText(image, "XKWE", (40, 210), cv2.FONT_HERSHEY_SIMPLEX, 1.5, 0, 3)
    found = find_contours(cv2.GaussianBlur(image, (0, 0), 0.8), FREE)
    assert not found.contours
    assert sum(found.rejected.values()) > 0


def test_a_disc_touched_by_a_bar_is_found():
    truth = ellipse()
    image = draw(truth)
    cv2.rectangle(image, (205, 0), (225, 239), 40, -1)
    found = find_contours(cv2.GaussianBlur(image, (0, 0), 0.6), FREE).contours
    assert found
    np.testing.assert_allclose(found[0].ellipse.center, truth.center, atol=0.3)


def covered(image: np.ndarray, part: Ellipse, first_deg: float, last_deg: float, level: int) -> np.ndarray:
    """Hide the rim between two eccentric angles under a card, whose edge goes through both ends of that arc."""
    at = np.radians([first_deg, (first_deg + last_deg) / 2.0, last_deg])
    first, middle, last = np.stack([np.cos(at), np.sin(at), np.ones(3)], axis=-1) @ part.factor[:2].T
    along = (last - first) / np.linalg.norm(last - first)
    outwards = np.array([along[1], -along[0]])
    outwards = outwards * np.sign(outwards @ (middle - first))
    reach = (middle - first) @ outwards + 30.0
    wide = 150.0 if last_deg - first_deg > 180.0 else 10.0
    sides = np.array([first - wide * along, last + wide * along])
    card = np.concatenate([sides, (sides + reach * outwards)[::-1]])
    mask = np.zeros(image.shape, np.uint8)
    cv2.fillPoly(mask, [np.rint(16.0 * card).astype(np.int32)], 255, shift=4)
    soft = cv2.GaussianBlur(mask, (0, 0), 0.6) / 255.0
    return np.rint(image + (level - image) * soft).astype(np.uint8)


@pytest.mark.parametrize("arcs", [[(20.0, 160.0)], [(-30.0, 40.0), (120.0, 190.0)]], ids=["one arc", "two arcs"])
@pytest.mark.parametrize("level", [30, 140, 230])
def test_a_rim_hidden_by_four_tenths_is_found(arcs, level):
    truth = ellipse()
    image = draw(truth, noise=1.0)
    for arc in arcs:
        image = covered(image, truth, *arc, level)
    found = find_contours(image, FREE, enough=1).contours
    assert found
    assert np.linalg.norm(found[0].ellipse.center - truth.center) < 1.0
    assert abs(found[0].ellipse.semi_major - truth.semi_major) < 1.0
    assert abs(found[0].ellipse.semi_minor - truth.semi_minor) < 1.0
    # The cards' own edges along the rim are not taken for it.
    assert found[0].rim_used < 0.75
    assert np.abs(signed_distance(truth, found[0].points)).max() < 1.0


def test_arcs_of_neighbours_make_no_circle():
    """Dots in close rows: an ellipse around two of them runs along half of each."""
    at = [(60.0 + 22.4 * (i + 0.5 * (j % 2)), 60.0 + 10.08 * j) for i in range(6) for j in range(4)]
    dots = [ellipse(x, y, 8.0, 5.6, 0.0) for x, y in at]
    for enough in (None, 30):
        found = find_contours(draw(*dots, noise=1.0), FREE, enough=enough).contours
        assert len(found) == len(dots)
        assert max(float(c.ellipse.semi_major) for c in found) < 8.5


def test_two_thirds_hidden_is_too_much():
    truth = ellipse()
    image = covered(draw(truth, noise=1.0), truth, -60.0, 180.0, 140)
    assert not find_contours(image, FREE, enough=1).contours


def test_only_long_runs_of_places_count():
    which = np.array([1, 1, 1, 0, 0, 1, 1, 1, 1, 1, 1, 0, 0, 1, 0, 0, 1, 1], dtype=bool)
    # Six in the middle; five over the seam; one alone.
    expected = np.array([1, 1, 1, 0, 0, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0, 1, 1], dtype=bool)
    np.testing.assert_array_equal(in_runs(which), expected)
    np.testing.assert_array_equal(in_runs(np.roll(which, 5)), np.roll(expected, 5))
    assert in_runs(np.ones(9, dtype=bool)).all()
    assert not in_runs(np.arange(20) % 4 > 0).any()


@pytest.mark.parametrize(
    "image", [np.zeros((5, 5)), np.full((200, 300), 255), np.eye(2) * 99], ids=["tiny", "white", "2x2"]
)
def test_images_without_anything(image):
    assert find_contours(image.astype(np.uint8), FREE).contours == ()


def test_sixteen_bit_images_use_their_own_range():
    truth = ellipse()
    narrow = (draw(truth, noise=1.0).astype(np.uint16) * 4 + 30000).astype(np.uint16)
    found = find_contours(narrow, FREE).contours
    np.testing.assert_allclose(found[0].ellipse.center, truth.center, atol=0.02)


def test_edges_are_found_from_a_prediction_that_is_off():
    truth = ellipse()
    image = draw(truth, blur=1.0)
    predicted = Ellipse.from_axes(truth.center[None] + [[1.2, -0.8]], [[61.0, 36.0]], [0.41])
    points, normals, curvature = ellipse_rim(predicted, 90)
    edges = locate_edges(image, points, normals, np.array([4.0]), curvature)
    assert edges.valid.mean() > 0.95
    assert np.abs(signed_distance(truth, edges.points[0][edges.valid[0]])).max() < 0.1


@pytest.mark.parametrize("radius", [6.0, 12.0, 40.0])
def test_the_edge_of_a_blurred_disc_is_not_drawn_inwards(radius):
    truth = ellipse(a=radius, b=radius, angle=0.0)
    image = draw(truth, blur=1.2).astype(np.float32)
    points, normals, _ = ellipse_rim(Ellipse.from_axes(truth.center[None], [[radius, radius]], [0.0]), 180)
    edges = locate_edges(image, points, normals, np.array([3.0]))
    # Without the correction the edge of the smallest would be 0.12 px too far in.
    assert abs(np.mean(edges.offset_px[edges.valid])) < 0.035


def test_normals_of_a_contour_point_outwards():
    points = ellipse().points(100)[None]
    for contour in (points, points[:, ::-1]):
        normals = contour_normals(contour)
        assert np.all(signed_distance(ellipse(), (contour + 2.0 * normals)[0]) > 1.9)


def test_bilinear_sampling_of_a_ramp_is_exact_and_the_outside_is_marked():
    ramp = np.add.outer(2.0 * np.arange(20), 3.0 * np.arange(30)).astype(np.float32)
    level, inside = sample(ramp, np.array([[4.25, 7.5], [29.0, 19.0], [-0.1, 3.0], [3.0, 19.5], [np.nan, 1.0]]))
    np.testing.assert_allclose(level[:2], [3 * 4.25 + 2 * 7.5, 3 * 29 + 2 * 19], atol=1e-3)
    assert inside.tolist() == [True, True, False, False, False]


@pytest.mark.parametrize(
    ("image", "expected"),
    [
        (np.full((4, 5, 3), (10, 20, 30), np.uint8), 22),
        (np.full((4, 5, 4), (10, 20, 30, 0), np.uint8), 22),
        (np.full((4, 5, 1), 7, np.uint8), 7),
        (np.full((4, 5), 700, np.uint16), 700),
        (np.full((4, 5), 0.5), 0.0),
        (np.ones((4, 5), bool), 255),
    ],
    ids=["bgr", "bgra", "one channel", "16 bit", "float", "bool"],
)
def test_grey(image, expected):
    grey = to_grey(image)
    assert grey.shape == (4, 5)
    assert np.all(grey == expected)


@pytest.mark.parametrize("image", [np.zeros(5), np.zeros((0, 4)), np.zeros((3, 3, 7)), np.zeros((3, 3), complex)])
def test_what_is_no_image_is_refused(image):
    with pytest.raises(ArgumentError, match="image"):
        to_grey(image)


def test_an_image_with_noise_is_stretched_to_8_bits():
    levels = np.random.default_rng(0).integers(1000, 1300, (64, 64), np.uint16)
    stretched = in_edge_levels(levels)[0]
    assert stretched.dtype == np.uint8
    assert (stretched.min(), stretched.max()) == (0, 255)
    assert np.all(in_edge_levels(np.full((3, 3), 9, np.uint16))[0] == 0)


CAMERA = Camera.create([[1000.0, 0, 320], [0, 1000.0, 240], [0, 0, 1]])


def test_intervals_given_are_used():
    given = AxisIntervals(major_px=(10.0, 20.0))
    target = Target.circle(50.0, axis_intervals=given, depth_range_mm=(500.0, 1000.0))
    assert axis_intervals(target, CAMERA, (640, 480)) == given


def test_intervals_from_radius_and_depth_hold_the_frontal_circle():
    low, high = axis_intervals(Target.circle(50.0, depth_range_mm=(500.0, 1000.0)), CAMERA, (640, 480)).major_px
    assert low < 2.0 * 50.0 / 1000.0 * 1000.0 < 2.0 * 50.0 / 500.0 * 1000.0 < high
    assert low > 60.0
    assert high < 300.0


def test_no_interval_without_a_depth_range():
    assert axis_intervals(Target.circle(50.0), CAMERA, (640, 480)).major_px is None


def test_the_score_is_the_share_of_a_clean_rim():
    truth = ellipse()
    (whole,) = find_contours(draw(truth, noise=1.0), FREE).contours
    assert whole.score > 0.95
    hidden = find_contours(covered(draw(truth, noise=1.0), truth, 20.0, 160.0, 140), FREE).contours[0]
    assert 0.5 < hidden.score < 0.75
    assert hidden.score <= hidden.rim_used


def test_a_spot_that_is_not_quite_round_scores_less():
    angle = np.linspace(0.0, 2.0 * np.pi, 240, endpoint=False)
    scores = {}
    for name, radius, wobble, center in (
        ("even spot", 5.0, 0.0, (60.4, 60.3)),
        ("odd spot", 5.0, 0.12, (60.4, 180.3)),
        ("disc", 60.0, 0.0, (220.0, 120.0)),
    ):
        rim = radius * (1.0 + wobble * np.cos(3.0 * angle))
        polygon = np.stack([center[0] + rim * np.cos(angle), center[1] + rim * np.sin(angle)], axis=-1)
        canvas = np.full((960, 1280), 200, np.uint8)
        cv2.fillPoly(canvas, [np.rint(16.0 * (4.0 * polygon + 1.5)).astype(np.int32)], 40, cv2.LINE_AA, 4)
        image = cv2.GaussianBlur(
            cv2.resize(canvas, None, fx=0.25, fy=0.25, interpolation=cv2.INTER_AREA), (0, 0), 0.7
        )
        found = find_contours(image, FREE).contours
        scores[name] = max((c.score for c in found), default=0.0)
    assert scores["disc"] > 0.95
    assert scores["even spot"] > 0.7
    assert scores["odd spot"] < 0.5
    assert scores["odd spot"] < scores["even spot"]


def test_the_search_ends_with_as_many_as_asked_for_when_no_smaller_one_could_be_more_evident():
    big, small = ellipse(x=500.0, y=400.0, a=200.0, b=150.0), ellipse(x=1000.0, y=200.0, a=5.0, b=5.0)
    image = draw(big, small, size=(1280, 960), noise=1.0)
    one = find_contours(image, FREE, enough=1)
    assert not one.is_complete
    assert len(one.contours) == 1
    everything = find_contours(image, FREE)
    assert everything.is_complete
    assert len(everything.contours) == 2
    assert find_contours(image, FREE, enough=2).is_complete
    np.testing.assert_allclose(one.contours[0].ellipse.center, everything.contours[0].ellipse.center, atol=0.05)


@pytest.mark.parametrize("noise", [0.0, 0.5, 3.0])
@pytest.mark.parametrize("contrast", [12.0, 18.0, 40.0])
def test_what_the_reduced_image_does_not_explain_is_looked_at_in_full(monkeypatch, noise, contrast):
    """Small discs and thin rings beside a large disc of the same contrast: as many as by looking everywhere."""
    cell = 40
    radii = np.resize([2.2, 2.6, 3.0, 3.5, 4.0, 5.0, 6.5], 24)
    walls = np.resize([0.7, 1.0, 1.5, 2.0], 12)
    generator = np.random.default_rng(4)
    places = 20.0 + generator.uniform(-3.0, 3.0, (36, 2))
    cells = [
        draw(ellipse(*at, r, 0.9 * r), levels=(180.0 - contrast,), background=180.0, size=(cell, cell))
        for at, r in zip(places, radii, strict=False)
    ]
    cells += [
        draw(
            ellipse(*at, 10.0, 9.0),
            ellipse(*at, 10.0 - wall, 9.0 - wall),
            levels=(180.0 - contrast, 180.0),
            background=180.0,
            size=(cell, cell),
        )
        for at, wall in zip(places[24:], walls, strict=True)
    ]
    large = draw(ellipse(240.0, 150.0, 120.0, 90.0), levels=(180.0 - contrast,), background=180.0, size=(480, 280))
    rows = [np.concatenate(cells[i : i + 12], axis=1) for i in (0, 12, 24)]
    image = np.concatenate([large, *rows]) + noise * generator.normal(size=(400, 480))
    image = np.clip(np.rint(image), 0, 255).astype(np.uint8)

    found = find_contours(image, FREE).contours
    monkeypatch.setattr("circlepose.detection.coarse_to_fine.unexplained_tiles", lambda *_: np.ones((7, 8), np.bool_))
    everywhere = find_contours(image, FREE).contours
    centers = np.array([c.ellipse.center for c in found])
    for other in everywhere:
        assert np.min(np.linalg.norm(centers - other.ellipse.center, axis=1)) < 0.5
    assert len(found) == len(everywhere)
    assert len(found) > 12 or noise > 2.0 or contrast < 15.0
