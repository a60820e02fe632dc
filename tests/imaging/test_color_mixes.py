"""Color mixes: where gray shows all there is none; else the mix shows what gray does not, whatever the colors."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from circlepose import DirectionHint, Target, estimate
from circlepose.camera.camera import circle_contour
from circlepose.diagnostics.explain import explain
from circlepose.diagnostics.inspection import inspect
from circlepose.imaging.color_mixes import color_mixes
from circlepose.imaging.gray import GRAY_WEIGHTS, to_channels, to_grey
from tests.support.discs import CAMERA, CENTER_MM, NORMAL, RADIUS_MM

GREEN_ON_RED = ((60.0, 110.0, 60.0), (60.0, 40.6, 196.3))
PAIRS = {
    "green on red": GREEN_ON_RED,
    "pink on teal": ((150.0, 110.0, 225.0), (165.0, 164.0, 113.3)),
    "blue on olive": ((220.0, 90.0, 90.0), (20.0, 110.0, 127.0)),
}
CENTERS = [CENTER_MM + np.array(step) for step in ([0.0, 0.0, 0.0], [-55.0, 10.0, 20.0], [40.0, 35.0, 10.0])]


def coverage(centers=CENTERS, finer: int = 8):
    """How much of each pixel discs cover, (240, 320), blurred."""
    large = np.zeros((240 * finer, 320 * finer), np.uint8)
    for center in centers:
        rim = (circle_contour(CAMERA, center, NORMAL, RADIUS_MM) + 0.5) * finer - 0.5
        cv2.fillPoly(large, [np.round(rim * 16).astype(np.int32)], 255, shift=4)
    small = cv2.resize(large, (320, 240), interpolation=cv2.INTER_AREA).astype(np.float64) / 255.0
    return cv2.GaussianBlur(small, (0, 0), 0.8)


def painted(inside, outside, cover=None, noise: float = 2.0, seed: int = 1):
    """Discs of one color on another, levels (240, 320, channels) with noise."""
    cover = coverage() if cover is None else cover
    levels = np.asarray(outside) + cover[..., None] * (np.asarray(inside) - np.asarray(outside))
    return levels + np.random.default_rng(seed).normal(0.0, noise, levels.shape)


def rounded(levels):
    return np.clip(np.round(levels), 0, 255).astype(np.uint8)


def found(image, count=None, **target):
    result = estimate(
        image,
        CAMERA,
        Target.circle(RADIUS_MM, count=count, normal_hint=DirectionHint(tuple(NORMAL.tolist()), 20.0), **target),
    )
    return sorted(result.circles, key=lambda circle: circle.ellipse.center[0])


def centers_of(circles):
    return np.array([circle.pose.center for circle in circles])


@pytest.mark.parametrize("pair", PAIRS)
@pytest.mark.parametrize("form", ["uint8", "uint16", "float"])
def test_discs_as_bright_as_what_is_around_them_are_measured(pair, form):
    inside, outside = PAIRS[pair]
    assert abs(np.dot(GRAY_WEIGHTS, np.subtract(inside, outside))) < 2.0
    image = rounded(painted(inside, outside))
    image = {"uint8": image, "uint16": image.astype(np.uint16) * 200, "float": image.astype(np.float32) / 255.0}[form]
    circles = found(image)
    assert len(circles) == 3
    # What the drawing itself does to a disc is the same in gray.
    exact = found(painted([150.0], [40.0], noise=0.02, seed=5)[..., 0].astype(np.float32))
    for circle, same in zip(circles, exact, strict=True):
        assert np.linalg.norm(list(circle.color_mix.values())) == pytest.approx(1.0)
        error = circle.pose.center - same.pose.center
        assert error @ np.linalg.solve(circle.pose.covariance[:3, :3], error) < 20.0
        assert circle.pose.sigma_mm.max() < 0.5


def test_the_pose_in_a_mix_is_that_of_the_same_scene_in_gray():
    colored = found(rounded(painted(*GREEN_ON_RED)))
    mix = np.array([colored[0].color_mix.get(name, 0.0) for name in ("blue", "green", "red")])
    inside, outside = (float(mix @ np.array(color)) for color in GREEN_ON_RED)
    gray = found(rounded(painted([inside + 128.0], [outside + 128.0])[..., 0]))
    assert all(circle.color_mix is None for circle in gray)
    for one, other in zip(colored, gray, strict=True):
        sigma = np.sqrt(one.pose.covariance[:3, :3].diagonal() + other.pose.covariance[:3, :3].diagonal())
        assert (np.abs(one.pose.center - other.pose.center) < 4.0 * sigma).all()
        assert one.pose.sigma_mm.max() < 1.5 * other.pose.sigma_mm.max()


def test_channels_may_be_permuted():
    # All in one channel: only its weight in gray differs, and a mix has none.
    image = rounded(painted((120.0, 120.0, 120.0), (120.0, 120.0, 60.0), noise=1.0))
    centers = [centers_of(found(image[..., order])) for order in ([0, 1, 2], [2, 0, 1], [1, 2, 0])]
    for other in centers[1:]:
        np.testing.assert_allclose(other, centers[0], atol=0.2)


def test_where_gray_shows_all_nothing_changes():
    gray = rounded(painted([60.0], [180.0])[..., 0])
    tinted = rounded(painted((50.0, 60.0, 70.0), (170.0, 180.0, 190.0)))
    for image in (gray, np.dstack([gray] * 3), tinted, np.dstack([gray] * 3 + [np.full_like(gray, 255)])):
        assert color_mixes(to_channels(image)) == ()
    assert all(circle.color_mix is None for circle in found(tinted))
    one, other = found(gray), found(np.dstack([gray] * 3 + [np.full_like(gray, 7)]))
    np.testing.assert_array_equal(centers_of(one), centers_of(other))


@pytest.mark.parametrize("quality", [60, 90])
def test_compression_and_noise_of_color_give_no_mix(quality):
    rng = np.random.default_rng(2)
    shades = cv2.resize(rng.uniform(60.0, 190.0, (6, 8, 1)), (640, 480), interpolation=cv2.INTER_CUBIC)
    tints = cv2.resize(rng.uniform(-25.0, 25.0, (4, 5, 3)), (640, 480), interpolation=cv2.INTER_CUBIC)
    image = rounded(shades[..., None] + tints + rng.normal(0.0, 4.0, (480, 640, 3)))
    cv2.putText(image, "all in gray", (60, 250), cv2.FONT_HERSHEY_SIMPLEX, 3.0, (20, 20, 20), 9, cv2.LINE_AA)
    stored = cv2.imdecode(cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])[1], cv2.IMREAD_COLOR)
    assert color_mixes(image) == color_mixes(stored) == ()


def test_subsampled_color_of_a_jpeg_is_measured_with_its_own_blur():
    stored = cv2.imencode(".jpg", rounded(painted(*GREEN_ON_RED)), [cv2.IMWRITE_JPEG_QUALITY, 92])[1]
    circles = found(cv2.imdecode(stored, cv2.IMREAD_COLOR))
    true = np.array(sorted(CENTERS, key=lambda center: center[0] / center[2]))
    assert len(circles) == 3
    np.testing.assert_allclose(centers_of(circles)[:, :2], true[:, :2], atol=0.3)


@pytest.mark.parametrize("channels", [2, 4])
def test_a_shape_of_alpha_alone_is_found(channels):
    flat = rounded(painted([90.0] * (channels - 1), [90.0] * (channels - 1)))
    alpha = rounded(painted([250.0], [30.0]))
    circles = found(np.dstack([flat, alpha]))
    assert [circle.color_mix for circle in circles] == [{"alpha": 1.0}] * 3


def test_colors_of_transparent_pixels_mean_nothing():
    cover = coverage(CENTERS[:1])
    hidden = rounded(painted((10.0, 10.0, 10.0), (200.0, 200.0, 200.0), cover))
    alpha = np.full((240, 320), 255, np.uint8)
    alpha[:, :280] = 0
    assert np.ptp(to_grey(np.dstack([hidden, alpha]))) < 40
    # A disc that was cut out: its border is that of alpha, whatever is under it.
    plain = rounded(painted((80.0, 90.0, 100.0), (80.0, 90.0, 100.0), noise=0.0))
    cut = np.dstack([plain, rounded(255.0 * coverage()[..., None])])
    cut[cut[..., 3] == 0, :3] = np.random.default_rng(0).integers(0, 255, 3)
    assert [circle.color_mix for circle in found(cut)] == [{"alpha": 1.0}] * 3


def two_kinds():
    """Two discs that gray shows, the fainter one at the left, and one that only color shows, strongly."""
    levels = painted(*GREEN_ON_RED, coverage(CENTERS[:1]), noise=0.0)
    levels += coverage(CENTERS[1:2])[..., None] * np.array([20.0, 20.0, 20.0])
    levels += coverage(CENTERS[2:])[..., None] * np.array([45.0, 45.0, 45.0])
    return rounded(levels + np.random.default_rng(3).normal(0.0, 2.0, levels.shape))


def test_circles_of_several_mixes_are_ranked_together_and_reported_once():
    image = two_kinds()
    every = found(image)
    assert [circle.color_mix is None for circle in every] == [True, False, True]
    assert len(inspect(image).extraction.contours) == 3
    best = found(image, count=1)
    np.testing.assert_allclose(best[0].pose.center, CENTERS[0], atol=0.5)
    two = found(image, count=2)
    np.testing.assert_allclose(centers_of(two)[:, 0], [CENTERS[0][0], CENTERS[2][0]], atol=0.5)


def test_polarity_is_about_gray():
    image = two_kinds()
    assert len(found(image, polarity="bright")) == 3
    assert [circle.color_mix is None for circle in found(image, polarity="dark")] == [False]


def test_explain_names_the_mix_and_has_its_levels():
    explanation = explain(two_kinds(), CAMERA, Target.circle(RADIUS_MM, count=None))
    mixed = [circle for circle in explanation.circles if circle.result.color_mix is not None]
    assert len(mixed) == 1
    assert mixed[0].contour.color_mix == mixed[0].result.color_mix
    assert abs(mixed[0].levels.contrast_levels) > 80.0


def test_a_ring_target_that_only_color_shows():
    cover = coverage(CENTERS[:1])
    rim = (circle_contour(CAMERA, CENTER_MM, NORMAL, 0.5 * RADIUS_MM) + 0.5) * 8 - 0.5
    hole = np.zeros((1920, 2560), np.uint8)
    cv2.fillPoly(hole, [np.round(rim * 16).astype(np.int32)], 255, shift=4)
    hole = cv2.resize(hole, (320, 240), interpolation=cv2.INTER_AREA).astype(np.float64) / 255.0
    image = rounded(painted(*GREEN_ON_RED, cover - cv2.GaussianBlur(hole, (0, 0), 0.8)))
    result = estimate(image, CAMERA, Target("coplanar", (RADIUS_MM, 0.5 * RADIUS_MM), polarity="dark"))
    assert [circle.circle for circle in result.circles] == ["outer", "inner"]
    assert all(circle.color_mix is not None for circle in result.circles)
    np.testing.assert_allclose(result.circles[0].pose.center, CENTER_MM, atol=0.3)


def test_a_colored_disc_of_which_a_part_is_hidden_is_measured_and_arcs_of_leaves_are_not():
    levels = painted(*GREEN_ON_RED, coverage(CENTERS[:1]), noise=0.0)
    levels[:, 198:] = (60.0, 75.0, 150.0)
    hidden = found(rounded(levels + np.random.default_rng(4).normal(0.0, 2.0, levels.shape)))
    assert [circle.color_mix is not None for circle in hidden] == [True]
    assert hidden[0].rim_used < 0.9
    rng = np.random.default_rng(0)
    leaves = np.full((240, 320, 3), (60, 110, 80), np.uint8)
    t = np.linspace(-1.0, 1.0, 20)
    for _ in range(60):
        length, angle = rng.uniform(12.0, 50.0), rng.uniform(0.0, np.pi)
        side = np.stack([t * length, length * rng.uniform(0.2, 0.5) * (1.0 - t * t)], axis=1)
        turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        leaf = np.concatenate([side, side[::-1] * [1.0, -1.0]]) @ turn + rng.uniform([0, 0], [320, 240])
        color = rng.uniform((10, 60, 40), (90, 180, 220)).tolist()
        cv2.fillPoly(leaves, [np.round(leaf * 16).astype(np.int32)], color, cv2.LINE_AA, 4)
    leaves = rounded(cv2.GaussianBlur(leaves, (0, 0), 1.0) + rng.normal(0.0, 4.0, leaves.shape))
    assert color_mixes(leaves) != ()
    # Of sixty leaves, one whose arc agrees with an ellipse by chance.
    assert len([circle for circle in found(leaves) if circle.color_mix is not None]) <= 1
