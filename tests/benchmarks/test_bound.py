"""The bound on rendered discs: laws of the numbers that the estimator is judged by."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import circlepose
from benchmarks.accuracy import BASE, better, condition_views, noisy
from benchmarks.support.bound import pose_bound, share_derivatives
from circlepose.synthesis.disc_sets import RADIUS_MM
from circlepose.synthesis.render import render, render_float
from circlepose.synthesis.scene import Disc, Scene

CONTRAST, NOISE = 160.0, 2.0


@pytest.fixture(scope="module")
def scene() -> Scene:
    return next(condition_views(replace(BASE, radius=12.0), 1))


@pytest.fixture(scope="module")
def derivatives(scene: Scene) -> np.ndarray:
    return share_derivatives(scene)


def sigmas(bound: np.ndarray) -> np.ndarray:
    return np.sqrt(np.diag(bound))


@pytest.mark.parametrize(("step_px", "oversampling"), [(0.01, 3), (0.02, 6)])
def test_the_bound_does_not_depend_on_how_it_is_computed(scene, derivatives, step_px, oversampling):
    finer = share_derivatives(scene, step_px, oversampling)
    ratio = sigmas(pose_bound(finer, CONTRAST, NOISE)) / sigmas(pose_bound(derivatives, CONTRAST, NOISE))
    np.testing.assert_allclose(ratio, 1.0, atol=5e-3)


def test_the_derivatives_are_those_of_the_image(scene, derivatives):
    """A pose a little off has the image that they predict, by a render of the whole scene."""
    disc = scene.targets[0]
    assert isinstance(disc, Disc)
    shift = np.array([0.02, -0.03, 1.0])
    moved = replace(scene, targets=(replace(disc, center_mm=disc.center_mm + shift),))
    change = render_float(moved) - render_float(scene)
    predicted = (disc.paint.level - scene.background.level) * (shift @ derivatives[1:4])
    # The window holds all that changes.
    assert np.sum(change**2) == pytest.approx(np.sum(predicted**2), rel=0.02)


def test_noise_and_contrast_scale_the_bound(derivatives):
    bound = pose_bound(derivatives, CONTRAST, NOISE)
    np.testing.assert_allclose(pose_bound(derivatives, 2.0 * CONTRAST, NOISE) * 4.0, bound, rtol=1e-6)
    quantized = NOISE**2 + 1.0 / 12.0
    np.testing.assert_allclose(pose_bound(derivatives, CONTRAST, 0.0) * 12.0 * quantized, bound, rtol=1e-6, atol=0.0)


def test_draw_0_is_the_rendered_image(scene):
    np.testing.assert_array_equal(noisy(render_float(scene), scene, 0), render(scene))


def test_no_covariance_is_better_than_the_bound(scene, derivatives):
    disc = scene.targets[0]
    assert isinstance(disc, Disc)
    bound = pose_bound(derivatives, CONTRAST, NOISE)
    candidate = better(circlepose.estimate(render(scene), scene.camera, circlepose.Target.circle(RADIUS_MM)), disc)
    assert candidate is not None
    assert candidate.covariance is not None
    # The noise is measured on some hundred pixels, so within 10 %.
    least = np.linalg.eigvals(np.linalg.solve(bound[:3, :3], candidate.covariance[:3, :3])).real.min()
    assert least > 0.8
