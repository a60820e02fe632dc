"""Planes that some of the circles of an image may share: proposed by single candidates, fitted to all. Pure NumPy.

Circles off the plane do not count: each circle is, with even odds before, either in the plane with one of its
candidates or anywhere (`Background`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from circlepose._typing import BoolArray, FloatArray, IntArray
from circlepose.disambiguation.background import Background
from circlepose.disambiguation.observed import Observed, inverse, misfits, moved
from circlepose.disambiguation.options import DisambiguationOptions
from circlepose.geometry.cone import plane_basis


@dataclass(frozen=True, slots=True, eq=False)
class Fits:
    """h planes fitted to the circles in them."""

    normals: FloatArray
    """(h, 3) unit"""
    points: FloatArray
    """(h, 3) mm"""
    covariances: FloatArray
    """(h, 3, 3) of two tilts about the point (rad) and the shift along the normal (mm)"""

    def subset(self, index: IntArray | slice) -> Fits:
        """Return the planes of `index`."""
        return Fits(self.normals[index], self.points[index], self.covariances[index])


def proposed(
    circles: Observed, free: BoolArray, base: FloatArray, anywhere: Background, options: DisambiguationOptions
) -> Fits:
    """Return the candidate planes that most circles agree with, and those of their rejected candidates.

    Parameters
    ----------
    circles
        m circles.
    free
        (m,) those that may propose a plane.
    base
        (m,) log density of each circle by what is known before, relative to the background.
    anywhere
        Where circles lie that share no plane.
    options
        The numbers of the search.

    Returns
    -------
    Planes of single candidates, with their covariances. The mirror image of the best plane is among them, if it has
    one.
    """
    proposers = _spread(np.flatnonzero(free), options.most_plane_proposers)
    sample = circles.subset(_spread(np.arange(len(circles.centers)), options.most_compared))
    compared = _spread(np.arange(len(base)), options.most_compared)
    base, elsewhere = base[compared], anywhere.log_densities[compared, None]
    k = circles.centers.shape[1]
    own = circles.subset(proposers)
    starts = Fits(own.normals.reshape(-1, 3), own.centers.reshape(-1, 3), own.covariances.reshape(-1, 3, 3))
    scale = options.search_scale
    density = _log_densities(sample, starts, scale) - elsewhere
    score = np.sum(np.logaddexp(base, np.logaddexp.reduce(density, axis=-1) - np.log(k)) - base, axis=-1)
    order = np.argsort(-score, kind="stable")
    best = order[: options.most_planes_fitted]
    # The candidates that the best plane rejects, of the circles that are in it.
    against = _log_densities(own, starts.subset(order[:1]), scale)[0]
    is_in = np.max(against, axis=-1, keepdims=True) > anywhere.log_densities[proposers, None]
    rejected = ((against < np.max(against, axis=-1, keepdims=True)) & is_in).reshape(-1)
    mirrored = order[rejected[order]][: options.most_planes_fitted]
    return starts.subset(np.unique(np.concatenate([best, mirrored])))


def refined(circles: Observed, starts: Fits, anywhere: Background, options: DisambiguationOptions) -> Fits:
    """Return planes fitted to the circles in them: expectation maximization, with the planes' own errors."""
    fits = starts
    for _ in range(options.fit_rounds):
        density = _log_densities(circles, fits, options.search_scale) - np.log(circles.centers.shape[1])
        total = np.logaddexp(anywhere.log_densities, np.logaddexp.reduce(density, axis=-1))
        weights = np.exp(density - total[..., None])
        information, pull = terms(circles, fits, weights)
        covariances = np.linalg.inv(information.sum(axis=1) + weak_information(anywhere.depth_mm))
        steps = -np.einsum("hpq,hq->hp", covariances, pull.sum(axis=1))
        normals, points = moved(fits.normals, fits.points, steps)
        fits = Fits(normals, points, covariances)
    return fits


def weak_information(depth_mm: float) -> FloatArray:
    """Return the information (3, 3) on a plane that lies anywhere: 1 rad and the range of heights."""
    return np.diag([1.0, 1.0, depth_mm**-2.0])


def terms(circles: Observed, fits: Fits, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return what each circle adds to information (h, m, 3, 3) and gradient (h, m, 3) of the planes."""
    values, slopes = circles.deviations(fits.normals, fits.points)
    weighted = np.swapaxes(slopes, -1, -2) @ (circles.information * weights[..., None, None])
    return (weighted @ slopes).sum(axis=2), (weighted @ values[..., None])[..., 0].sum(axis=2)


def are_same(one: Fits, others: Fits, chi_square: float) -> BoolArray:
    """(h,) Whether planes are the same as plane `one` (h = 1) within its errors."""
    turns = np.stack(plane_basis(one.normals[0]))
    across = others.normals @ turns.T
    sine = np.linalg.norm(across, axis=-1)
    angle = np.arctan2(sine, others.normals @ one.normals[0])
    shifts = np.einsum("hx,hx->h", others.normals, others.points - one.points[0])
    steps = np.column_stack([across * (angle / np.maximum(sine, 1e-300))[:, None], shifts])
    return np.asarray(np.einsum("hp,pq,hq->h", steps, np.linalg.inv(one.covariances[0]), steps) < chi_square)


def _log_densities(circles: Observed, fits: Fits, scale: float) -> FloatArray:
    """Return log densities (h, m, k) of candidates in planes, whose own errors count; `scale` times all errors."""
    values, slopes = circles.deviations(fits.normals, fits.points)
    spread = circles.covariances * scale**2 + slopes @ (fits.covariances * scale**2)[:, None, None] @ np.swapaxes(
        slopes, -1, -2
    )
    information, determinants = inverse(spread)
    return -0.5 * (misfits(values, information) + np.log(determinants)) - 1.5 * np.log(2.0 * np.pi)


def _spread(index: IntArray, most: int) -> IntArray:
    """Return at most `most` of an index, evenly spread."""
    every = -(-len(index) // most) if len(index) else 1
    return index[::every]
