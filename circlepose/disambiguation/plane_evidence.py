"""How much better planes explain circles than chance does, and what they say of each circle. Pure NumPy.

The evidence of a plane is the likelihood of all circles with it, over that without it. Its two tilts, its place, the
share of circles in it and the scale of their errors are integrated out, so that a plane pays for what it may choose.
Each circle is judged by the plane of the others.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from circlepose._typing import FloatArray
from circlepose.disambiguation.observed import Observed, inverse
from circlepose.disambiguation.options import DisambiguationOptions
from circlepose.disambiguation.plane_search import Fits, background, terms, weak_information


@dataclass(frozen=True, slots=True, eq=False)
class Weighed:
    """h planes, each with e scales of the errors."""

    log_evidence: FloatArray
    """(h, e) logarithm of the odds against chance"""
    log_gains: FloatArray
    """(h, e, m) how much likelier each circle is in the plane of the others than anywhere, logarithm"""
    belongs: FloatArray
    """(h, e, m) probability that it lies in the plane"""
    shares: FloatArray
    """(h, e, m, k) probabilities of the candidates, if it lies in the plane"""
    share_in: FloatArray
    """(h, e) of the circles in the plane"""

    @property
    def of_planes(self) -> FloatArray:
        """(h,) logarithm of the odds of each plane, whatever the scale."""
        return np.asarray(np.logaddexp.reduce(self.log_evidence, axis=1))


def weigh(
    circles: Observed, fits: Fits, base: FloatArray, depth_mm: float, options: DisambiguationOptions
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
    depth_mm
        Range of heights of circles that lie anywhere.
    options
        Scales of the errors with their probabilities.
    """
    number = circles.centers.shape[1]
    scales = np.array(options.error_scales)[:, None, None]
    anywhere = np.log(background(depth_mm))
    values, slopes = circles.deviations(fits.normals, fits.points)
    misfits = np.einsum("hmki,mkij,hmkj->hmk", values, circles.information, values)[:, None]
    densities = circles.log_peaks - 3.0 * np.log(scales) - 0.5 * misfits / scales**2 - np.log(number)
    gains = np.logaddexp.reduce(densities, axis=-1) - anywhere
    log_likelihood, share_in = _integrated(gains, base, options)
    # Laplace: the plane's own parameters, of which the data leave that volume.
    determinants = np.linalg.slogdet(fits.covariances)[1][:, None] + 6.0 * np.log(scales[:, 0, 0])
    volume = 0.5 * determinants + 1.5 * np.log(2.0 * np.pi) + anywhere
    log_evidence = log_likelihood + volume + np.log(options.scale_shares)

    total = np.logaddexp(_log(1.0 - share_in)[..., None] + base, _log(share_in)[..., None] + gains)
    odds = _log(share_in)[..., None, None] + densities - anywhere
    responsibility = np.exp(odds - total[..., None])
    alone = [
        _by_the_others(circles, fits, values, slopes, responsibility[:, e], float(scale), depth_mm)
        for e, scale in enumerate(scales[:, 0, 0])
    ]
    others = np.stack(alone, axis=1) - np.log(number)
    log_gains = np.logaddexp.reduce(others, axis=-1) - anywhere
    inside = _log(share_in)[..., None] + log_gains
    outside = _log(1.0 - share_in)[..., None] + base
    return Weighed(
        log_evidence,
        log_gains - base,
        np.exp(inside - np.logaddexp(inside, outside)),
        np.exp(others - np.logaddexp.reduce(others, axis=-1, keepdims=True)),
        share_in,
    )


def _log(values: FloatArray) -> FloatArray:
    return np.log(np.maximum(values, 1e-300))


def _integrated(gains: FloatArray, base: FloatArray, options: DisambiguationOptions) -> tuple[FloatArray, FloatArray]:
    """Return log likelihoods (h, e) over all shares of circles in the plane, and the expected share (h, e)."""
    nodes, weights = np.polynomial.legendre.leggauss(options.member_nodes)
    share = (nodes + 1.0) / 2.0
    joint = np.logaddexp(np.log(1.0 - share)[:, None] + base, np.log(share)[:, None] + gains[..., None, :]) - base
    each = joint.sum(axis=-1) + np.log(weights / 2.0)
    total = np.logaddexp.reduce(each, axis=-1)
    return total, np.sum(np.exp(each - total[..., None]) * share, axis=-1)


def _by_the_others(
    circles: Observed,
    fits: Fits,
    values: FloatArray,
    slopes: FloatArray,
    weights: FloatArray,
    scale: float,
    depth_mm: float,
) -> FloatArray:
    """Return log densities (h, m, k) of each candidate, given the plane of the other circles and its errors."""
    information, pull = terms(circles, fits, weights / scale**2)
    rest = information.sum(axis=1, keepdims=True) - information + weak_information(depth_mm)
    covariance, _ = inverse(rest)
    steps = -np.einsum("hmpq,hmq->hmp", covariance, pull.sum(axis=1, keepdims=True) - pull)
    residuals = values + np.einsum("hmkip,hmp->hmki", slopes, steps)
    spread = circles.covariances * scale**2 + slopes @ covariance[:, :, None] @ np.swapaxes(slopes, -1, -2)
    precision, determinants = inverse(spread)
    misfits = np.einsum("hmki,hmkij,hmkj->hmk", residuals, precision, residuals)
    return -0.5 * (misfits + np.log(determinants)) - 1.5 * np.log(2.0 * np.pi)
