"""The hint that circles lie in one plane: each is compared with the plane of the others. Pure NumPy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from circlepose._typing import FloatArray, IntArray
from circlepose.disambiguation.hint_likelihoods import check_candidates
from circlepose.disambiguation.options import DEFAULT, DisambiguationOptions
from circlepose.geometry.cone import plane_basis


def common_plane(
    centers: FloatArray,
    normals: FloatArray,
    sigma_rad: FloatArray,
    sigma_mm: FloatArray | None = None,
    *,
    options: DisambiguationOptions = DEFAULT,
) -> FloatArray:
    """Return log probabilities (m, 2) where the circles lie in one plane, except for a few.

    Each candidate proposes its normal for the plane. The plane is fitted, to normals and centers together, to the
    candidates that agree best with it. Then each circle is compared with the plane of the others, with the error of
    that plane. Where several planes explain the circles, as the mirror image does for circles seen from afar, each
    has the weight of its likelihood.

    Parameters
    ----------
    centers, normals
        (m, 2, 3) of the candidates; normals are unit vectors.
    sigma_rad
        (m, 2) standard error of each normal per axis, rad.
    sigma_mm
        (m, 2) standard error of a center across the plane, in the unit of the centers. The default is the distance
        times `sigma_rad`, which is more than the error by image noise.
    options
        The numbers of the hints.

    Returns
    -------
    (m, 2) log probabilities. Both are one half for a circle alone, and for one that is not in the plane with either
    candidate.

    Raises
    ------
    ArgumentError
        For arrays of another shape, or errors that are not positive.
    """
    check_candidates(normals, sigma_rad)
    if len(centers) < 2:
        return np.full((len(centers), 2), np.log(0.5))
    distances = np.linalg.norm(centers, axis=-1)
    across = distances * sigma_rad if sigma_mm is None else sigma_mm
    circles = _Circles(
        centers=centers - np.median(np.reshape(centers, (-1, 3)), axis=0),
        normals=np.asarray(normals, dtype=np.float64),
        variances=np.stack([sigma_rad, sigma_rad, across], axis=-1) ** 2,
        prior=options.plane_prior * np.array([1.0, 1.0, 1.0 / float(np.median(distances)) ** 2]),
    )
    plane_normals, offsets = _proposals(circles, options)
    for round_ in range(options.rounds):
        fit = _fit(circles, plane_normals, offsets, options, soft=round_ < options.soft_rounds)
        plane_normals, offsets = fit.moved(circles.prior)
        # Of planes that choose alike the first, and best, will do.
        _, first = np.unique(fit.picked, axis=0, return_index=True)
        plane_normals, offsets = plane_normals[np.sort(first)], offsets[np.sort(first)]
    fit = _fit(circles, plane_normals, offsets, options, soft=False)
    least = np.minimum(np.min(fit.misfits, axis=-1), options.outlier_chi_square)
    evidence = -0.5 * np.sum(least, axis=-1)
    share = np.exp(evidence - evidence.max())
    return np.log(np.einsum("h,hmk->mk", share / share.sum(), _by_the_others(circles, fit, options)))


@dataclass(frozen=True, slots=True, eq=False)
class _Circles:
    centers: FloatArray
    """(m, 2, 3) from a point among them"""
    normals: FloatArray
    """(m, 2, 3)"""
    variances: FloatArray
    """(m, 2, 3) of two tilts and of the center across the plane"""
    prior: FloatArray
    """(3,)"""


@dataclass(frozen=True, slots=True, eq=False)
class _Planes:
    """Planes n.x = d fitted to m circles: h of them, linearized at n and d in two tilts and an offset, (h, 3)."""

    normals: FloatArray
    """(h, 3) n"""
    offsets: FloatArray
    """(h,) d"""
    basis: FloatArray
    """(h, 3, 2) directions in which n tilts"""
    values: FloatArray
    """(h, m, 2, 3) each candidate's tilts from n and height over the plane"""
    slopes: FloatArray
    """(h, m, 2, 3, 3) of those by the plane's parameters"""
    misfits: FloatArray
    """(h, m, 2) squared and standardized"""
    picked: IntArray
    """(h, m) the candidate with the smaller misfit"""
    information: FloatArray
    """(h, m, 3, 3) that the picked candidate gives on the plane"""
    pull: FloatArray
    """(h, m, 3) information times the plane's step that it asks for"""

    def moved(self, prior: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return normals and offsets after the step that all circles together ask for."""
        total = self.information.sum(axis=1) + np.diag(prior)
        step = np.linalg.solve(total, self.pull.sum(axis=1)[..., None])[..., 0]
        normals = self.normals + np.einsum("hxt,ht->hx", self.basis, step[:, :2])
        return normals / np.linalg.norm(normals, axis=-1, keepdims=True), self.offsets + step[:, 2]


def _proposals(circles: _Circles, options: DisambiguationOptions) -> tuple[FloatArray, FloatArray]:
    """Return the normals (h, 3) that agree best with those of all circles, and offsets (h,).

    Half of them are candidates that the best one rejects: among them is its mirror image, if there is one.
    """
    every = -(-len(circles.normals) // options.most_proposers)
    proposed = circles.normals[::every].reshape(-1, 3)
    misfits = np.sum((proposed[:, None, None] - circles.normals) ** 2, axis=-1) / circles.variances[..., 0]
    score = np.sum(np.minimum(misfits.min(axis=-1), options.outlier_chi_square), axis=-1)
    picked = np.argmin(misfits[np.argmin(score)], axis=-1)[::every]
    rejected = np.stack([picked == 1, picked == 0], axis=-1).ravel()
    order = np.argsort(score, kind="stable")
    best = np.concatenate(
        [order[~rejected[order]][: options.most_proposals], order[rejected[order]][: options.most_proposals]]
    )
    heights = np.einsum("hx,mx->hm", proposed[best], circles.centers.mean(axis=1))
    return proposed[best], np.median(heights, axis=-1)


def _fit(
    circles: _Circles, normals: FloatArray, offsets: FloatArray, options: DisambiguationOptions, *, soft: bool
) -> _Planes:
    """Linearize planes (normals (h, 3), offsets (h,)) and weigh the circles: softly, or outliers not at all."""
    basis = np.stack(plane_basis(normals), axis=-1)
    tilts = np.einsum("hxt,mkx->hmkt", basis, circles.normals)
    sine = np.linalg.norm(tilts, axis=-1)
    angle = np.arctan2(sine, np.einsum("hx,mkx->hmk", normals, circles.normals))
    tilts = tilts * (angle / np.maximum(sine, 1e-300))[..., None]
    heights = np.einsum("hx,mkx->hmk", normals, circles.centers) - offsets[:, None, None]
    values = np.concatenate([tilts, heights[..., None]], axis=-1)
    slopes = np.broadcast_to(np.eye(3), (*values.shape, 3)).copy()
    slopes[..., 2, :2] = -np.einsum("hxt,mkx->hmkt", basis, circles.centers)
    misfits = np.sum(values**2 / circles.variances, axis=-1)
    picked = np.argmin(misfits, axis=-1)
    plane, circle = np.indices(picked.shape)
    least = misfits[plane, circle, picked]
    if soft:
        scale = np.maximum(np.median(least, axis=-1, keepdims=True), 3.0)
        weights = 1.0 / (1.0 + least / scale)
    else:
        weights = (least <= options.outlier_chi_square).astype(np.float64)
    weighted = slopes[plane, circle, picked] * (weights[..., None] / circles.variances[circle, picked])[..., None]
    return _Planes(
        normals,
        offsets,
        basis,
        values,
        slopes,
        misfits,
        picked,
        information=np.einsum("hmip,hmiq->hmpq", weighted, slopes[plane, circle, picked]),
        pull=np.einsum("hmip,hmi->hmp", weighted, values[plane, circle, picked]),
    )


def _by_the_others(circles: _Circles, fit: _Planes, options: DisambiguationOptions) -> FloatArray:
    """Return the probabilities (h, m, 2) of each circle's candidates, given the plane of the other circles."""
    others = fit.information.sum(axis=1, keepdims=True) - fit.information + np.diag(circles.prior)
    covariance = np.linalg.inv(others)
    pull = fit.pull.sum(axis=1, keepdims=True) - fit.pull
    plane = np.einsum("hmpq,hmq->hmp", covariance, pull)
    residual = fit.values - np.einsum("hmkip,hmp->hmki", fit.slopes, plane)
    spread = np.einsum("hmkip,hmpq,hmkjq->hmkij", fit.slopes, covariance, fit.slopes)
    spread = spread + circles.variances[..., None] * np.eye(3)
    misfits = np.einsum("hmki,hmki->hmk", residual, np.linalg.solve(spread, residual[..., None])[..., 0])
    likelihood = np.exp(-0.5 * misfits)
    # Out of the plane either candidate is as likely.
    outside = np.exp(-0.5 * options.outlier_chi_square)
    return (likelihood + outside) / (likelihood.sum(axis=-1, keepdims=True) + 2.0 * outside)
