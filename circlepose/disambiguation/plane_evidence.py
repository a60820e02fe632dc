"""How much better planes explain circles than chance does, and what they say of each circle. Pure NumPy.

The evidence of a plane is the likelihood of all circles with it, over that without it. Its two tilts, its place, the
share of circles in it and the scale of their errors are integrated out, so that a plane pays for what it may choose.
Each circle is judged by the plane of the others.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from circlepose._typing import FloatArray, IntArray
from circlepose.disambiguation.background import Background
from circlepose.disambiguation.observed import Observed, inverse, misfits
from circlepose.disambiguation.options import DisambiguationOptions
from circlepose.disambiguation.plane_search import Fits, terms, weak_information

_LARGEST = 700.0
"""logarithm that does not overflow; numerical"""


@dataclass(frozen=True, slots=True, eq=False)
class Weighed:
    """p explanations of m circles, the likeliest first: a plane and a scale of the errors each."""

    planes: IntArray
    """(p,) index of the plane"""
    log_evidence: FloatArray
    """(p,) logarithm of the odds against chance"""
    log_gains: FloatArray
    """(p, m) how much likelier each circle is in the plane of the others than without that plane, logarithm"""
    belongs: FloatArray
    """(p, m) probability that it lies in the plane"""
    shares: FloatArray
    """(p, m, k) probabilities of the candidates, if it lies in the plane"""
    share_in: FloatArray
    """(p,) of the circles in the plane"""


def weigh(
    circles: Observed, fits: Fits, base: FloatArray, anywhere: Background, options: DisambiguationOptions
) -> Weighed:
    """Weigh planes against chance, and circles by the plane of the others.

    Parameters
    ----------
    circles
        m circles of k candidates.
    fits
        h planes, fitted to them.
    base
        (m,) log density of each circle by other planes, relative to the background: 0 where there are none.
    anywhere
        Where circles lie that share no plane.
    options
        Scales of the errors with their probabilities.

    Returns
    -------
    The explanations that are not out of the question beside the likeliest one.
    """
    scales = np.array(options.error_scales)
    count, elsewhere = np.log(circles.centers.shape[1]), anywhere.log_densities
    values, slopes = circles.deviations(fits.normals, fits.points)
    squares = misfits(values, circles.information)[:, None] / scales[:, None, None] ** 2
    densities = circles.log_peaks - 3.0 * np.log(scales)[:, None, None] - 0.5 * squares - count
    gains = np.logaddexp.reduce(densities, axis=-1) - elsewhere
    log_likelihood, share_in = _integrated(gains, base, options)
    # Laplace: the volume that the data leave to the plane's own parameters, over that before.
    volume = 0.5 * np.linalg.slogdet(fits.covariances)[1][:, None] + 3.0 * np.log(scales)
    before = anywhere.of_planes(fits.normals, fits.points)[:, None] + 1.5 * np.log(2.0 * np.pi)
    log_evidence = log_likelihood + volume + before + np.log(options.scale_shares)

    order = np.argsort(-log_evidence, axis=None)
    order = order[log_evidence.ravel()[order] >= log_evidence.max() - options.log_evidence_window]
    if log_evidence.max() + np.log(len(scales)) < options.least_log_evidence:
        # None will be accepted.
        order = order[:1]
    plane, scale = np.unravel_index(order, log_evidence.shape)
    share = share_in[plane, scale]
    inside, outside = np.log(share)[:, None], np.log1p(-share)[:, None] + base
    total = np.logaddexp(outside, inside + gains[plane, scale])
    weights = np.exp(inside[..., None] + densities[plane, scale] - elsewhere[:, None] - total[..., None])
    others = _by_the_others(
        circles, fits.subset(plane), values[plane], slopes[plane], weights, scales[scale], anywhere.depth_mm
    )
    others = others - count
    log_gains = np.logaddexp.reduce(others, axis=-1) - elsewhere
    return Weighed(
        plane,
        log_evidence[plane, scale],
        log_gains - base,
        np.exp(inside + log_gains - np.logaddexp(inside + log_gains, outside)),
        np.exp(others - np.logaddexp.reduce(others, axis=-1, keepdims=True)),
        share,
    )


def _integrated(gains: FloatArray, base: FloatArray, options: DisambiguationOptions) -> tuple[FloatArray, FloatArray]:
    """Return log likelihoods (h, e) over all shares of circles in the plane, and the expected share (h, e)."""
    nodes, weights = np.polynomial.legendre.leggauss(options.member_nodes)
    share = (nodes + 1.0) / 2.0
    relative = np.exp(np.minimum(gains - base, _LARGEST))
    joint = np.log((1.0 - share)[:, None] + share[:, None] * relative[..., None, :])
    each = joint.sum(axis=-1) + np.log(weights / 2.0)
    total = np.logaddexp.reduce(each, axis=-1)
    return total, np.sum(np.exp(each - total[..., None]) * share, axis=-1)


def _by_the_others(
    circles: Observed,
    fits: Fits,
    values: FloatArray,
    slopes: FloatArray,
    weights: FloatArray,
    scales: FloatArray,
    depth_mm: float,
) -> FloatArray:
    """Return log densities (p, m, k) of each candidate, given the plane of the other circles and its errors."""
    variances = scales[:, None, None] ** 2
    information, pull = terms(circles, fits, weights / variances)
    rest = information.sum(axis=1, keepdims=True) - information + weak_information(depth_mm)
    covariance, _ = inverse(rest)
    steps = -covariance @ (pull.sum(axis=1, keepdims=True) - pull)[..., None]
    residuals = values + (slopes @ steps[:, :, None])[..., 0]
    spread = circles.covariances * variances[..., None, None]
    spread = spread + slopes @ covariance[:, :, None] @ np.swapaxes(slopes, -1, -2)
    precision, determinants = inverse(spread)
    return -0.5 * (misfits(residuals, precision) + np.log(determinants)) - 1.5 * np.log(2.0 * np.pi)
