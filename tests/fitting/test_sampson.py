from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from circlepose.errors import ArgumentError
from circlepose.fitting.direct import fit_ellipse
from circlepose.fitting.sampson import LATENT_CONICS, covariance_of_axes, fit_guaranteed, refine_ellipse, uncertainty
from circlepose.geometry.conic import conic_from_ellipse
from circlepose.geometry.ellipse import Ellipse, rim_distance, signed_distance


def arc(truth: Ellipse, number: int, start: float = 0.0, share: float = 1.0):
    """Points evenly spaced, in the eccentric angle, over a share of the rim."""
    angle = start + 2.0 * np.pi * share * np.arange(number) / number
    unit = np.stack([np.cos(angle), np.sin(angle), np.ones(number)], axis=-1)
    return (unit @ truth.factor.T)[:, :2]


def parameters(ellipse: Ellipse):
    return np.array([*ellipse.center, ellipse.semi_major, ellipse.semi_minor, ellipse.angle], dtype=float)


def errors(fitted: Ellipse, truth: Ellipse):
    difference = parameters(fitted) - parameters(truth)
    difference[4] = (difference[4] + np.pi / 2.0) % np.pi - np.pi / 2.0
    return difference


@pytest.mark.parametrize("angle_deg", [-90, -20, 0, 65])
@pytest.mark.parametrize("ratio", [1.0, 0.999, 0.5, 0.02])
@pytest.mark.parametrize("shift", [0.0, 1e5])
@pytest.mark.parametrize("share", [1.0, 0.4])
def test_exact_points_give_the_exact_ellipse_anywhere(angle_deg, ratio, shift, share):
    truth = Ellipse.from_axes([shift + 3.0, shift - 7.0], [40.0, 40.0 * ratio], np.radians(angle_deg))
    fit = fit_guaranteed(arc(truth, 40, 0.3, share))
    assert fit is not None
    assert fit.converged
    rounding = 1e-8 + 1e-13 * shift / ratio**2
    np.testing.assert_allclose(errors(fit.ellipse, truth)[:4], 0.0, atol=100.0 * rounding)
    np.testing.assert_allclose(fit.residuals, 0.0, atol=rounding)
    assert fit.noise <= rounding


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("with_covariances", [False, True])
def test_the_cost_is_least(seed, with_covariances):
    """No ellipse close by has less; Szpak's cost, with f = |y| - 1, written out."""
    rng = np.random.default_rng(seed)
    truth = Ellipse.from_axes([10.0, -4.0], [50.0, 30.0], 0.7)
    points = arc(truth, 60, 1.0, 0.6) + 0.4 * rng.normal(size=(60, 2))
    root = rng.normal(size=(60, 2, 2)) if with_covariances else np.broadcast_to(np.eye(2), (60, 2, 2))
    covariances = root @ np.swapaxes(root, -1, -2) + 0.2 * np.eye(2)

    def cost(values):
        ellipse = Ellipse.from_axes(values[:2], values[2:4], values[4])
        inverse = np.linalg.inv(ellipse.factor[:2, :2])
        y = (points - ellipse.center) @ inverse.T
        radius = np.linalg.norm(y, axis=-1)
        gradient = (y / radius[:, None]) @ inverse
        return np.sum((radius - 1.0) ** 2 / np.einsum("ni,nij,nj->n", gradient, covariances, gradient))

    fit = fit_guaranteed(points, covariances=covariances if with_covariances else None)
    assert fit is not None
    assert fit.converged
    best = parameters(fit.ellipse)
    least = cost(best)
    for k, step in enumerate([1e-3, 1e-3, 1e-3, 1e-3, 1e-5]):
        for sign in (1.0, -1.0):
            aside = best.copy()
            aside[k] += sign * step
            assert cost(aside) > least
    assert least < cost(parameters(fit_ellipse(points)))


@given(st.integers(0, 10**6), st.floats(1e-3, 1e3), st.floats(-1e3, 1e3), st.floats(0.0, 3.0))
def test_the_fit_turns_moves_and_scales_with_the_points(seed, scale, shift, turn):
    rng = np.random.default_rng(seed)
    points = arc(Ellipse.from_axes([1.0, 2.0], [5.0, 3.0], 0.4), 30, 0.0, 0.7) + 0.02 * rng.normal(size=(30, 2))
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    first, second = fit_guaranteed(points), fit_guaranteed(scale * points @ rotation.T + shift)
    assert first is not None
    assert second is not None
    expected = scale * rotation @ first.ellipse.center + shift
    np.testing.assert_allclose(second.ellipse.center, expected, atol=1e-5 * scale + 1e-9 * abs(shift))
    np.testing.assert_allclose(second.ellipse.semi_major, scale * first.ellipse.semi_major, rtol=1e-5)
    np.testing.assert_allclose(second.noise, scale * first.noise, rtol=1e-5)
    # The axes may come out turned by half a turn.
    np.testing.assert_allclose(np.diag(second.latent_covariance), np.diag(first.latent_covariance), rtol=1e-3)


TRUTH = Ellipse.from_axes([300.0, 200.0], [60.0, 35.0], 0.5)


@pytest.mark.parametrize(
    ("truth", "start", "share", "noise"),
    [
        (TRUTH, 0.0, 1.0, 0.2),
        (TRUTH, 0.0, 0.4, 0.1),
        (TRUTH, 1.0, 0.4, 0.1),
        (TRUTH, 2.0, 0.6, 0.2),
        (Ellipse.from_axes([1e5, -1e5], [60.0, 35.0], -1.2), 0.0, 1.0, 0.2),
        (Ellipse.from_axes([300.0, 200.0], [60.0, 6.0], 0.5), 0.0, 1.0, 0.05),
    ],
    ids=["whole", "side", "tip", "more", "far", "thin"],
)
def test_errors_are_unbiased_and_as_large_as_the_covariance_says(truth, start, share, noise):
    rng = np.random.default_rng(1)
    points = arc(truth, 80, start, share)
    found, squared = [], []
    for _ in range(250):
        fit = fit_guaranteed(points + noise * rng.normal(size=points.shape))
        assert fit is not None
        assert fit.converged
        error = errors(fit.ellipse, truth)
        found.append(error)
        squared.append(error @ np.linalg.solve(fit.covariance, error))
    # Five degrees of freedom, a little more for the noise being estimated; standard error 0.2.
    assert 4.5 < np.mean(squared) < 5.5
    found = np.array(found)
    assert np.all(np.abs(found.mean(axis=0)) < 0.3 * found.std(axis=0))


def test_less_biased_than_the_direct_fit_on_an_arc():
    """What the maximum likelihood is for: the algebraic fit draws arcs together."""
    rng = np.random.default_rng(2)
    points = arc(TRUTH, 80, 1.0, 0.4)
    ours, direct = [], []
    for _ in range(150):
        noisy = points + 0.3 * rng.normal(size=points.shape)
        start, fit = fit_ellipse(noisy), fit_guaranteed(noisy)
        assert start is not None
        assert fit is not None
        ours.append(float(fit.ellipse.semi_major) - 60.0)
        direct.append(float(start.semi_major) - 60.0)
    assert abs(np.mean(ours)) < 0.2 * abs(np.mean(direct))
    assert np.sqrt(np.mean(np.square(ours))) < np.sqrt(np.mean(np.square(direct)))


def test_a_circle_has_a_regular_latent_covariance():
    """The axes are ordered and the angle is anything, so those have no Gaussian errors: latent parameters have."""
    rng = np.random.default_rng(13)
    truth = Ellipse.from_axes([300.0, 200.0], [50.0, 50.0], 0.0)
    points, squared = arc(truth, 80), []
    for _ in range(300):
        fit = fit_guaranteed(points + 0.2 * rng.normal(size=points.shape))
        assert fit is not None
        assert fit.converged
        axes = fit.ellipse.factor[:2, :2]
        # The latent step from the fit back to the truth, which has no e2 along the fit's axes.
        stretch = np.log(50.0 / np.array([fit.ellipse.semi_major, fit.ellipse.semi_minor]))
        t = np.linalg.solve(axes, truth.center - fit.ellipse.center)
        step = np.array([*t, stretch.mean(), (stretch[0] - stretch[1]) / 2.0, 0.0])
        squared.append(step @ np.linalg.solve(fit.latent_covariance, step))
        assert fit.covariance[4, 4] > 0.05**2
    assert 4.5 < np.mean(squared) < 5.5


@pytest.mark.parametrize("seed", range(15))
def test_two_fifths_of_a_rim_with_heavy_noise_stay_an_ellipse(seed):
    rng = np.random.default_rng(seed)
    points = arc(TRUTH, 60, rng.uniform(0.0, 6.3), 0.4) + 3.0 * rng.normal(size=(60, 2))
    fit = fit_guaranteed(points)
    assert fit is not None
    assert np.all(np.isfinite(parameters(fit.ellipse)))
    assert fit.ellipse.semi_major >= fit.ellipse.semi_minor > 0.0


def shapes_that_are_no_ellipses():
    t = np.linspace(-1.5, 1.5, 60)
    rng = np.random.default_rng(0)
    return {
        "hyperbola": np.stack([np.cosh(t), np.sinh(t)], axis=1),
        "wave": np.stack([6.0 * t, np.sin(6.0 * t)], axis=1),
        "parallels": np.concatenate([np.stack([t, 0.0 * t], axis=1), np.stack([t, 0.0 * t + 1.0], axis=1)]),
        "cross": np.concatenate([np.stack([t, t], axis=1), np.stack([t, -t], axis=1)]),
        "rough line": np.stack([t, 1e-3 * rng.normal(size=60)], axis=1),
    }


@pytest.mark.parametrize("name", list(shapes_that_are_no_ellipses()))
def test_what_no_ellipse_fits_best_gets_one_that_is_said_not_to_have_converged(name):
    fit = fit_guaranteed(shapes_that_are_no_ellipses()[name])
    assert fit is not None
    assert fit.ellipse.semi_minor > 0.0
    assert not fit.converged


@pytest.mark.parametrize(
    "points",
    [np.zeros((0, 2)), np.ones((5, 2)), np.ones((50, 2)), np.linspace([0.0, 1.0], [9.0, 4.0], 50)],
    ids=["none", "five", "equal", "line"],
)
def test_points_without_an_ellipse(points):
    assert fit_guaranteed(points) is None


def test_weights_leave_points_out():
    rng = np.random.default_rng(4)
    points = arc(TRUTH, 60) + 0.1 * rng.normal(size=(60, 2))
    spoiled = points.copy()
    spoiled[:10] += 15.0
    weights = np.ones(60)
    weights[:10] = 0.0
    with_outliers, without = fit_guaranteed(spoiled, weights), fit_guaranteed(points[10:])
    assert with_outliers is not None
    assert without is not None
    np.testing.assert_allclose(parameters(with_outliers.ellipse), parameters(without.ellipse), rtol=1e-7)
    assert with_outliers.noise == pytest.approx(without.noise)
    np.testing.assert_allclose(with_outliers.latent_covariance, without.latent_covariance, rtol=1e-5)
    assert np.abs(with_outliers.residuals[:10]).min() > 1.0
    assert fit_guaranteed(points, np.full(60, 0.05)) is None


def test_the_noise_and_the_residuals_are_in_the_unit_of_the_plane():
    rng = np.random.default_rng(5)
    points = arc(TRUTH, 800) + 0.25 * rng.normal(size=(800, 2))
    fit = fit_guaranteed(points)
    assert fit is not None
    assert fit.noise == pytest.approx(0.25, rel=0.08)
    np.testing.assert_allclose(fit.residuals, rim_distance(fit.ellipse, points))
    np.testing.assert_allclose(fit.residuals, signed_distance(fit.ellipse, points), atol=0.02)


def test_covariances_of_the_points_count_up_to_a_common_factor():
    """Points known well on one half of the rim only: the covariance of the fit says what its errors are."""
    rng = np.random.default_rng(6)
    points = arc(TRUTH, 80)
    sigma = np.where(np.arange(80) < 40, 0.05, 0.5)
    covariances = 7.0 * sigma[:, None, None] ** 2 * np.eye(2)
    squared, factors, plain = [], [], []
    for _ in range(200):
        noisy = points + sigma[:, None] * rng.normal(size=points.shape)
        fit, unaware = fit_guaranteed(noisy, covariances=covariances), fit_guaranteed(noisy)
        assert fit is not None
        assert unaware is not None
        error = errors(fit.ellipse, TRUTH)
        squared.append(error @ np.linalg.solve(fit.covariance, error))
        factors.append(fit.noise)
        plain.append([error[2], errors(unaware.ellipse, TRUTH)[2]])
    assert 4.5 < np.mean(squared) < 5.6
    assert np.mean(factors) == pytest.approx(1.0 / np.sqrt(7.0), rel=0.03)
    knowing, not_knowing = np.std(plain, axis=0)
    assert knowing < 0.7 * not_knowing


def test_refining_never_makes_an_ellipse_worse():
    rng = np.random.default_rng(7)
    points = arc(TRUTH, 40, 0.0, 0.5) + 0.5 * rng.normal(size=(40, 2))
    start = Ellipse.from_axes([310.0, 190.0], [80.0, 20.0], 0.9)
    costs = [float(np.sum(rim_distance(start, points) ** 2))]
    for steps in range(1, 8):
        refined, _ = refine_ellipse(start, points, steps=steps)
        costs.append(float(np.sum(rim_distance(refined, points) ** 2)))
    assert all(after <= before * (1.0 + 1e-9) for before, after in itertools.pairwise(costs))
    assert costs[-1] < 0.1 * costs[0]


def test_latent_conics_are_the_derivatives_of_the_conic():
    """To first order the centre moves by t and the axes stretch by E, here of an ellipse along the axes."""
    a, b, step = 50.0, 30.0, 1e-6
    moved = [
        Ellipse.from_axes([a * step, 0.0], [a, b], 0.0),
        Ellipse.from_axes([0.0, b * step], [a, b], 0.0),
        Ellipse.from_axes([0.0, 0.0], [a * (1.0 + step), b * (1.0 + step)], 0.0),
        Ellipse.from_axes([0.0, 0.0], [a * (1.0 + step), b * (1.0 - step)], 0.0),
        Ellipse.from_axes([0.0, 0.0], [a, b], 2.0 * a * b / (a * a - b * b) * step),
    ]
    factor = Ellipse.from_axes([0.0, 0.0], [a, b], 0.0).factor
    for ellipse, change in zip(moved, LATENT_CONICS, strict=True):
        conic = factor.T @ conic_from_ellipse(ellipse) @ factor
        slope = (conic / -conic[2, 2] - np.diag([1.0, 1.0, -1.0])) / step
        np.testing.assert_allclose(slope, change, atol=1e-3)


def test_what_the_points_do_not_determine_has_a_huge_error():
    """At the four vertices alone the axes may turn freely."""
    inside, outside = (scale * (arc(TRUTH, 4) - TRUTH.center) + TRUTH.center for scale in (0.99, 1.01))
    _, covariance = uncertainty(TRUTH, np.concatenate([inside, outside]))
    assert covariance[4, 4] > 1e9
    assert np.all(np.diag(covariance)[:4] < 0.01)
    circle = Ellipse.from_axes([0.0, 0.0], [50.0, 50.0], 0.0)
    assert covariance_of_axes(circle, 1e-6 * np.eye(5))[4, 4] > 1e6


@pytest.mark.parametrize(
    ("points", "weights", "covariances"),
    [
        (np.zeros((9, 3)), None, None),
        (np.zeros((9, 2)), np.ones(8), None),
        (np.zeros((9, 2)), None, np.ones((9, 2))),
    ],
    ids=["points", "weights", "covariances"],
)
def test_misuse(points, weights, covariances):
    with pytest.raises(ArgumentError, match="expected"):
        fit_guaranteed(points, weights, covariances)
