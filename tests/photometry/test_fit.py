"""The fit to gray levels: exact coverage and derivatives, errors as large as the covariance says, refusals."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from circlepose.camera.camera import Camera
from circlepose.fitting.cone_fit import ConeFit
from circlepose.fitting.cone_projection import rim_pixels
from circlepose.geometry.cone import factor_from_circle, plane_basis
from circlepose.geometry.cone_perturbation import coefficients_between, dual_circle, grown
from circlepose.geometry.ellipse import Ellipse
from circlepose.measurement.intensity_fit import refined
from circlepose.measurement.rim import EdgeRim, FittedRim, rim_from_fit
from circlepose.photometry.edge_spread import curved_edge_spread, straight_edge_spread
from circlepose.photometry.intensity_model import DesignMatrix, fit_levels
from circlepose.photometry.pixel_band import bands_around
from circlepose.photometry.rim_coordinates import LEVELS, rim_coordinates
from circlepose.synthesis.render import render
from circlepose.synthesis.scene import Disc, Paint, Scene, Texture

FOCAL = 1200.0
RADIUS_MM = 60.0


def disc_scene(radius_px, tilt_deg, seed, *, blur=0.7, noise=2.0, dark=40.0, light=200.0, dist=()):
    side = int(2 * radius_px + 40)
    middle = (side - 1) / 2.0
    camera = Camera.create([[FOCAL, 0.0, middle], [0.0, FOCAL, middle], [0.0, 0.0, 1.0]], dist, (side, side))
    rng = np.random.default_rng(seed)
    ray = camera.rays(middle + rng.uniform(-2.0, 2.0, 2))
    first, second = plane_basis(ray)
    tilt, azimuth = np.radians(tilt_deg), rng.uniform(0.0, 2.0 * np.pi)
    normal = -np.cos(tilt) * ray + np.sin(tilt) * (np.cos(azimuth) * first + np.sin(azimuth) * second)
    center = FOCAL * RADIUS_MM / radius_px * ray
    disc = Disc(center, normal, RADIUS_MM, Paint(dark))
    return Scene(camera, (disc,), Paint(light), blur_px=blur, noise_levels=noise, noise_seed=seed, name="disc")


def start(scene, off_px, seed):
    """A rim displaced by about `off_px` from the truth, as after a detection."""
    disc = scene.targets[0]
    factor = factor_from_circle(disc.center_mm, disc.normal, disc.radius_mm)
    radius_px = FOCAL * disc.radius_mm / np.linalg.norm(disc.center_mm)
    factor = grown(factor, np.random.default_rng(seed).normal(0.0, off_px / radius_px, 5))
    return rim_from_fit(scene.camera, ConeFit(factor, np.full(72, 0.1)), rim_pixels(scene.camera, factor, 72))


def errors(scene, rim):
    disc = scene.targets[0]
    return coefficients_between(rim.cone.factor, dual_circle(disc.center_mm, disc.normal, disc.radius_mm))


@pytest.mark.parametrize(
    ("radius_px", "blur", "noise"), [(8.0, 0.7, 2.0), (12.0, 1.0, 4.0), (30.0, 0.7, 2.0), (60.0, 1.5, 1.0)]
)
def test_errors_are_as_large_as_the_covariance_says(radius_px, blur, noise):
    squares, sigmas = [], []
    for seed in range(24):
        scene = disc_scene(radius_px, 10.0 + 2.0 * seed, seed, blur=blur, noise=noise)
        (rim,) = refined(render(scene), scene.camera, [start(scene, 0.2, seed)])
        assert rim.modes_covariance is not None
        error = errors(scene, rim)
        squares.append(error @ np.linalg.solve(rim.modes_covariance, error))
        sigmas.append(np.sqrt(np.diag(rim.modes_covariance)) * radius_px)
    # Of five coefficients: 5 on average, with a standard deviation of 3.2/sqrt(24).
    assert 3.0 < np.mean(squares) < 8.0
    assert np.median(sigmas) < 0.05 * np.sqrt(10.0 / radius_px) * max(noise / 2.0, 1.0)


def test_the_covariance_holds_on_textured_surfaces():
    """Texture near a rim looks like an edge a little elsewhere: the fit meets most of it, the covariance the rest."""
    squares, pixels = [], []
    for seed in range(16):
        scene = disc_scene(40.0, 20.0 + 2.0 * seed, seed, noise=2.0)
        (disc,) = scene.targets
        on_disc = replace(disc, paint=Paint(40.0, Texture(6.0, 20.0, seed)))
        mottled = replace(scene, targets=(on_disc,), background=Paint(200.0, Texture(6.0, 14.0, 100 + seed)))
        (rim,) = refined(render(mottled), scene.camera, [start(scene, 0.1, seed)])
        assert rim.modes_covariance is not None
        error = errors(scene, rim)
        squares.append(error @ np.linalg.solve(rim.modes_covariance, error))
        pixels.append(np.abs(error) * 40.0)
    assert 1.5 < np.mean(squares) < 8.0
    assert np.median(pixels) < 0.01


def test_the_lens_is_inside_the_model():
    scene = disc_scene(40.0, 40.0, 3, noise=0.5, dist=(-0.3, 0.1, 0.001, -0.001))
    (rim,) = refined(render(scene), scene.camera, [start(scene, 0.3, 3)])
    error = errors(scene, rim)
    assert error @ np.linalg.solve(rim.modes_covariance, error) < 25.0
    assert np.max(np.abs(error)) * 40.0 < 0.01


def test_sixteen_bits_and_eight_say_the_same():
    scene = disc_scene(25.0, 35.0, 4, noise=2.0)
    image = render(scene)
    (eight,) = refined(image, scene.camera, [start(scene, 0.2, 4)])
    (sixteen,) = refined(image.astype(np.uint16) * 200, scene.camera, [start(scene, 0.2, 4)])
    apart = coefficients_between(eight.cone.factor, sixteen.cone.factor @ np.diag([1, 1, -1]) @ sixteen.cone.factor.T)
    assert np.max(np.abs(apart)) * 25.0 < 1e-3
    np.testing.assert_allclose(sixteen.modes_covariance, eight.modes_covariance, rtol=0.1)


def test_an_image_without_noise_has_that_of_its_whole_levels():
    scene = disc_scene(30.0, 30.0, 5, noise=0.0)
    (rim,) = refined(render(scene), scene.camera, [start(scene, 0.2, 5)])
    sigma = np.sqrt(np.diag(rim.modes_covariance)) * 30.0
    assert np.all(sigma > 1e-5)
    assert np.all(sigma < 2e-3)


def test_saturated_pixels_do_not_bias_the_rim():
    scene = disc_scene(30.0, 40.0, 6, light=260.0, noise=1.0)
    image = render(scene)
    assert (image == 255).mean() > 0.3
    (rim,) = refined(image, scene.camera, [start(scene, 0.2, 6)])
    assert np.max(np.abs(errors(scene, rim))) * 30.0 < 0.02


def test_a_hidden_segment_is_left_out():
    scene = disc_scene(40.0, 35.0, 7, noise=1.0)
    image = render(scene)
    middle = image.shape[0] // 2
    image[middle - 12 : middle + 12, : middle - 10] = 120
    (rim,) = refined(image, scene.camera, [start(scene, 0.1, 7)])
    assert 0.6 < rim.rim_used < 0.95
    assert np.max(np.abs(errors(scene, rim))) * 40.0 < 0.02


def test_a_rim_is_fitted_together_with_others_as_it_is_alone():
    """Of four discs apart one is seen as it is, one begins far off, one is hidden in part, one is mottled."""
    first = disc_scene(30.0, 40.0, 9, noise=1.0)
    disc, camera = first.targets[0], replace(first.camera, image_size=(420, 100))
    step_mm = 100.0 / FOCAL * float(disc.center_mm[2])
    discs = [replace(disc, center_mm=disc.center_mm + np.array([i * step_mm, 0.0, 0.0])) for i in range(4)]
    discs[3] = replace(discs[3], paint=Paint(40.0, texture=Texture(5.0, 20.0, 3)))
    scenes = [replace(first, camera=camera, targets=(each,)) for each in discs]
    image = render(replace(scenes[0], targets=tuple(discs)))
    image[40:60, 200:235] = 120
    starts = [start(scene, offset, 9) for scene, offset in zip(scenes, (0.1, 0.5, 0.1, 0.1), strict=True)]
    together = refined(image, camera, starts)
    assert together[2].rim_used < 0.95 < together[0].rim_used
    for rim, scene, begun in zip(together, scenes, starts, strict=True):
        (alone,) = refined(image, camera, [begun])
        error = np.sqrt(np.diagonal(alone.modes_covariance))
        # How many pixels beyond the bands are sampled the longest rim of all says.
        assert np.all(np.abs(errors(scene, rim) - errors(scene, alone)) < error)
        np.testing.assert_allclose(np.diagonal(rim.modes_covariance), error**2, rtol=0.1)
        assert rim.rim_used == alone.rim_used


def test_discs_that_nearly_touch_do_not_pull_each_other():
    """Two discs with 2.5 px between their rims, each measured with the other beside it."""
    first = disc_scene(8.0, 1e-3, 8, noise=1.0)
    disc = first.targets[0]
    camera = first.camera
    apart_mm = (2.0 * 8.0 + 2.5) * np.linalg.norm(disc.center_mm) / FOCAL
    right = replace(disc, center_mm=disc.center_mm + np.array([apart_mm / 2.0, 0.0, 0.0]))
    left = replace(disc, center_mm=disc.center_mm - np.array([apart_mm / 2.0, 0.0, 0.0]))
    scene = replace(first, targets=(left, right))
    starts = [start(replace(scene, targets=(each,)), 0.1, 8) for each in (left, right)]
    for each, rim in zip((left, right), refined(render(scene), camera, starts), strict=True):
        assert rim.modes_covariance is not None
        error = errors(replace(scene, targets=(each,)), rim)
        # Without the neighbor's levels subtracted, the first harmonic alone is about 0.04 px.
        assert np.max(np.abs(error)) * 8.0 < 0.04


def test_without_contrast_the_edges_stand_and_the_rim_is_flagged():
    scene = disc_scene(20.0, 30.0, 9)
    before = start(scene, 0.2, 9)
    flat = np.full(render(scene).shape, 128, np.uint8)
    (rim,) = refined(flat, scene.camera, [before])
    assert isinstance(rim, EdgeRim)
    assert rim.level_fit.reason


def test_a_rim_mostly_outside_the_image_has_no_covariance_or_a_wide_one():
    scene = disc_scene(30.0, 30.0, 10)
    image = render(scene)[:, :22].copy()
    whole = start(scene, 0.1, 10)
    (rim,) = refined(image, scene.camera, [whole])
    if isinstance(rim, FittedRim):
        error = errors(scene, rim)
        assert error @ np.linalg.solve(rim.modes_covariance, error) < 30.0
        assert np.sqrt(rim.modes_covariance[0, 0]) * 30.0 > 0.02


def seen(radius_px, tilt_deg, reach=4.0):
    scene = disc_scene(radius_px, tilt_deg, 11, noise=0.0)
    disc = scene.targets[0]
    factor = factor_from_circle(disc.center_mm, disc.normal, disc.radius_mm)[None]
    rim = rim_from_fit(scene.camera, ConeFit(factor[0], np.zeros(72)), rim_pixels(scene.camera, factor[0], 72))
    image = render(scene)
    bands = bands_around(image, scene.camera, [rim.ellipse], np.array([reach]))
    double = replace(
        bands, **{name: getattr(bands, name).astype(np.float64) for name in ("levels", "weight", "rays")}
    )
    return double, factor, rim.ellipse


@pytest.mark.parametrize("way", [straight_edge_spread, curved_edge_spread])
def test_derivatives_of_the_share(way):
    bands, factor, _ = seen(20.0, 40.0)
    blur = np.array([[np.log(0.9), 0.1, -0.05]])
    spread = way(rim_coordinates(bands, factor), blur)
    step = 1e-5
    for i in range(5):
        amounts = np.zeros(5)
        amounts[i] = step
        high = way(rim_coordinates(bands, grown(factor, amounts[None])), blur).coverage
        low = way(rim_coordinates(bands, grown(factor, -amounts[None])), blur).coverage
        numeric = (high - low) / (2.0 * step)
        scale = np.max(np.abs(numeric))
        # `straight_edge_spread` takes the curvature for constant along the rim.
        assert (
            np.max(np.abs(spread.derivatives[:, i] - numeric))
            < (0.06 if way is straight_edge_spread else 0.03) * scale
        )
    for i in range(3):
        moved = np.zeros((1, 3))
        moved[0, i] = step
        at = rim_coordinates(bands, factor)
        numeric = (way(at, blur + moved).coverage - way(at, blur - moved).coverage) / (2.0 * step)
        np.testing.assert_allclose(spread.derivatives[:, 5 + i], numeric, atol=1e-6)


def test_both_ways_agree_where_the_rim_is_nearly_straight():
    bands, factor, _ = seen(150.0, 20.0)
    at, blur = rim_coordinates(bands, factor), np.array([[np.log(0.8), 0.0, 0.0]])
    np.testing.assert_allclose(
        straight_edge_spread(at, blur).coverage, curved_edge_spread(at, blur).coverage, atol=1e-4
    )


@pytest.mark.parametrize(("radius_px", "tilt_deg"), [(4.0, 20.0), (6.0, 50.0), (12.0, 60.0)])
def test_the_share_of_a_small_disc_is_exact(radius_px, tilt_deg):
    """Against the ellipse's indicator on a grid 20 times finer, blurred by sums."""
    bands, factor, ellipse = seen(radius_px, tilt_deg, reach=3.0)
    sigma = 0.8
    share = curved_edge_spread(rim_coordinates(bands, factor), np.array([[np.log(sigma), 0.0, 0.0]])).coverage[0]
    used = bands.weight[0] > 0.0
    for pixel, value in zip(bands.pixels[0][used][::7], share[used][::7], strict=True):
        assert value == pytest.approx(blurred_indicator(ellipse, pixel, sigma), abs=0.006)


def blurred_indicator(ellipse: Ellipse, pixel, sigma):
    u = np.linspace(-5.0 * sigma, 5.0 * sigma, 201)
    x, y = np.meshgrid(pixel[0] + u, pixel[1] + u)
    cos, sin = np.cos(ellipse.angle), np.sin(ellipse.angle)
    dx, dy = x - ellipse.center[0], y - ellipse.center[1]
    inside = np.hypot((cos * dx + sin * dy) / ellipse.semi_major, (cos * dy - sin * dx) / ellipse.semi_minor) < 1.0
    weight = np.exp(-0.5 * (u / sigma) ** 2)
    weight = np.outer(weight, weight)
    return float(np.sum(weight * inside) / np.sum(weight))


def test_anisotropic_blur_is_distinguished_from_a_tilt():
    """A frontal disc blurred more along rows than along columns: alpha is met, and the levels fit."""
    scene = disc_scene(15.0, 30.0, 12, blur=0.3, noise=0.0)
    image = cv2.GaussianBlur(render(scene).astype(np.float32), (0, 0), sigmaX=1.2, sigmaY=0.8)
    disc = scene.targets[0]
    factor = factor_from_circle(disc.center_mm, disc.normal, disc.radius_mm)[None]
    rim = start(scene, 0.0, 12)
    bands = bands_around(image, scene.camera, [rim.ellipse], np.array([4.0]))
    at = rim_coordinates(bands, factor)

    def rms(alpha):
        variance = 0.3**2 + 1.0 / 12.0 + (1.2**2 + 0.8**2) / 2.0
        share = curved_edge_spread(at, np.array([[np.log(variance) / 2.0, alpha, 0.0]]))
        return float(fit_levels(DesignMatrix.of(bands, at, share), np.zeros((1, LEVELS))).square[0])

    wanted = (1.2**2 - 0.8**2) / (1.2**2 + 0.8**2 + 2.0 * (0.3**2 + 1.0 / 12.0))
    assert rms(wanted) < 0.1 * rms(0.0)
    assert rms(wanted) < 0.1 * rms(-wanted)
