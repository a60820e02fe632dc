"""Correlation of neighboring residuals: 1 for independent noise, else the scatter of the estimates."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import ndtr

from circlepose.geometry.cone_perturbation import mode_shapes
from circlepose.photometry.residual_correlation import residual_correlation

ACROSS = np.linspace(-2.5, 2.5, 11)


def rim_of(segments):
    """Slopes (8, k) of a rim's modes and blurs at pixels around it, five positions along each segment.

    Also the derivatives (11, k) to the levels and the halo term, and the segment (k,) of each pixel.
    """
    angle = np.repeat(2.0 * np.pi * (np.arange(5 * segments) + 0.5) / (5 * segments), len(ACROSS))
    z = np.tile(ACROSS, 5 * segments)
    density, shapes = np.exp(-0.5 * z * z), mode_shapes(angle).T
    unequal = np.stack([np.ones_like(angle), np.cos(2.0 * angle), np.sin(2.0 * angle)])
    slopes = np.concatenate([shapes * density, unequal * density * z])
    share = ndtr(-z)
    levels = np.concatenate([shapes * share, shapes * (1.0 - share), (ndtr(-z / 2.5) - share)[None]])
    return slopes, levels, np.repeat(np.arange(segments), 5 * len(ACROSS))


def estimated(segments, noise):
    """Correlations (n,) of draws of the noise (n, k), each fitted; estimates (n, 8), their information; variances."""
    slopes, levels, segment = rim_of(segments)
    slopes = slopes - np.linalg.solve(levels @ levels.T, levels @ slopes.T).T @ levels
    matrix = slopes @ slopes.T
    estimates = np.linalg.solve(matrix, slopes @ noise.T).T
    rest = np.linalg.solve(levels @ levels.T, levels @ noise.T).T
    residual = noise - estimates @ slopes - rest @ levels
    variance = np.sum(residual**2, axis=1) / (noise.shape[1] - len(slopes) - len(levels))
    many = np.broadcast_to(segment, noise.shape)
    inverses = np.broadcast_to(np.linalg.inv(matrix), (len(noise), *matrix.shape))
    number = np.full(len(noise), segments)
    return residual_correlation(slopes, residual, many, number, inverses, variance), estimates, matrix, variance


@pytest.mark.parametrize("segments", [12, 24, 72])
def test_independent_residuals_are_hardly_ever_correlated(segments):
    pixels = 5 * segments * len(ACROSS)
    correlation, *_ = estimated(segments, np.random.default_rng(1).normal(0.0, 2.0, (400, pixels)))
    assert np.mean(correlation > 1.0) < 0.15
    assert np.mean(correlation) < 1.15


@pytest.mark.parametrize(("segments", "length"), [(24, 1), (72, 1), (72, 3)])
def test_correlation_is_the_scatter_of_the_estimates(segments, length):
    """The edge of each segment, or of `length` segments together, is displaced."""
    slopes, _, segment = rim_of(segments)
    generator = np.random.default_rng(2)
    common = np.repeat(generator.normal(0.0, 1.0, (400, segments // length)), length, axis=1)[:, segment]
    noise = generator.normal(0.0, 2.0, (400, len(segment))) + common * slopes[0]
    correlation, estimates, matrix, variance = estimated(segments, noise)
    independent = np.linalg.inv(matrix) * np.mean(variance)
    modes = slice(0, 5)
    scatter = np.mean(np.diagonal(np.cov(estimates[:, modes].T)) / np.diagonal(independent)[modes])
    assert scatter > 1.5
    assert 0.8 * scatter < np.mean(correlation) < 1.5 * scatter
