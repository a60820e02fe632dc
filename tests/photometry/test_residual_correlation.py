"""Residuals that go together: by chance, and so that estimates scatter more than independent ones would let them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import ndtr

from circlepose.geometry.cone_perturbation import mode_shapes
from circlepose.photometry.residual_correlation import residual_correlation

ACROSS = np.linspace(-2.5, 2.5, 11)


def rim_of(stretches):
    """Slopes (8, k) of a rim's modes and blurs at pixels around it, five places along each stretch.

    And the derivatives (11, k) to the levels inside and outside and of the odd term, and the stretch (k,).
    """
    angle = np.repeat(2.0 * np.pi * (np.arange(5 * stretches) + 0.5) / (5 * stretches), len(ACROSS))
    z = np.tile(ACROSS, 5 * stretches)
    density, shapes = np.exp(-0.5 * z * z), mode_shapes(angle).T
    unequal = np.stack([np.ones_like(angle), np.cos(2.0 * angle), np.sin(2.0 * angle)])
    slopes = np.concatenate([shapes * density, unequal * density * z])
    share = ndtr(-z)
    levels = np.concatenate([shapes * share, shapes * (1.0 - share), (ndtr(-z / 2.5) - share)[None]])
    return slopes, levels, np.repeat(np.arange(stretches), 5 * len(ACROSS))


def told(stretches, noise):
    """Correlations (n,) told of draws of the noise (n, k), each fitted; estimates (n, 8), their matrix; variances."""
    slopes, levels, stretch = rim_of(stretches)
    slopes = slopes - np.linalg.solve(levels @ levels.T, levels @ slopes.T).T @ levels
    matrix = slopes @ slopes.T
    estimates = np.linalg.solve(matrix, slopes @ noise.T).T
    rest = np.linalg.solve(levels @ levels.T, levels @ noise.T).T
    residual = noise - estimates @ slopes - rest @ levels
    variance = np.sum(residual**2, axis=1) / (noise.shape[1] - len(slopes) - len(levels))
    many = np.broadcast_to(stretch, noise.shape)
    inverses = np.broadcast_to(np.linalg.inv(matrix), (len(noise), *matrix.shape))
    number = np.full(len(noise), stretches)
    return residual_correlation(slopes, residual, many, number, inverses, variance), estimates, matrix, variance


@pytest.mark.parametrize("stretches", [12, 24, 72])
def test_independent_residuals_hardly_ever_go_together(stretches):
    pixels = 5 * stretches * len(ACROSS)
    correlation, *_ = told(stretches, np.random.default_rng(1).normal(0.0, 2.0, (400, pixels)))
    assert np.mean(correlation > 1.0) < 0.15
    assert np.mean(correlation) < 1.15


@pytest.mark.parametrize(("stretches", "length"), [(24, 1), (72, 1), (72, 3)])
def test_what_goes_together_is_told_as_much_as_the_estimates_scatter(stretches, length):
    """Each stretch, or so many at a time, errs in common: the edge is a little elsewhere there."""
    slopes, _, stretch = rim_of(stretches)
    generator = np.random.default_rng(2)
    common = np.repeat(generator.normal(0.0, 1.0, (400, stretches // length)), length, axis=1)[:, stretch]
    noise = generator.normal(0.0, 2.0, (400, len(stretch))) + common * slopes[0]
    correlation, estimates, matrix, variance = told(stretches, noise)
    independent = np.linalg.inv(matrix) * np.mean(variance)
    modes = slice(0, 5)
    scatter = np.mean(np.diagonal(np.cov(estimates[:, modes].T)) / np.diagonal(independent)[modes])
    assert scatter > 1.5
    assert 0.8 * scatter < np.mean(correlation) < 1.5 * scatter
