"""Arcs of one broken or partly hidden rim -> one ellipse. All pairs are tried at once."""

from __future__ import annotations

import numpy as np

from circlepose._typing import BoolArray, FloatArray, IntArray
from circlepose.detection.edges.arcs import SAMPLES, Arcs
from circlepose.detection.edges.options import DEFAULT, EdgeOptions
from circlepose.fitting.direct import fit_scatter, scatter_of
from circlepose.geometry.ellipse import NO_ELLIPSES, Ellipse, rim_distance


def joined_arcs(arcs: Arcs, longest_px: float, options: EdgeOptions = DEFAULT) -> tuple[Ellipse, FloatArray]:
    """Fit an ellipse no longer than `longest_px` to each group of `arcs` that lie on one.

    A group is a pair that agrees on an ellipse, and all other arcs on that ellipse. Returns the ellipses (batch of
    f) and the share of the rim that its arcs cover (f,).
    """
    first, second = _pairs(arcs, longest_px) if len(arcs) > 1 else (np.empty(0, np.int64), np.empty(0, np.int64))
    if len(first) == 0:
        return _none()
    samples, lengths = arcs.samples, arcs.lengths
    middle, scale = samples.mean(axis=(0, 1)), float(np.std(samples)) + 1.0
    # Each arc counts by its length, however it was sampled.
    weights = np.repeat(lengths[:, None] / lengths.max(), SAMPLES, axis=1)
    scatter = scatter_of((samples - middle) / scale, weights)
    ellipse, found = _fitted(scatter[first] + scatter[second], middle, scale)
    perimeter = ellipse.perimeter
    found &= (lengths[first] + lengths[second] > options.least_pair_cover * perimeter) & (ellipse.semi_minor > 0.0)
    found &= 2.0 * ellipse.semi_major < longest_px
    kept = np.flatnonzero(found)
    agree = [_agree(ellipse[kept], samples[either[kept]], options) for either in (first, second)]
    kept = kept[agree[0] & agree[1]]
    if len(kept) == 0:
        return _none()
    # The pairs with the longest arcs, where there are very many.
    kept = kept[np.argsort(-(lengths[first[kept]] + lengths[second[kept]]), kind="stable")[: options.most_arc_groups]]
    also = _also_on(ellipse[kept], samples, options)
    also[np.arange(len(kept)), first[kept]] = True
    also[np.arange(len(kept)), second[kept]] = True
    groups = np.unique(also, axis=0)
    ellipse, found = _fitted(np.einsum("fm,mij->fij", groups.astype(np.float64), scatter), middle, scale)
    perimeter = ellipse.perimeter
    cover = groups @ lengths / np.maximum(perimeter, 1e-9)
    # Both borders of one edge may count, hence up to twice the rim.
    found &= (cover > options.least_group_cover) & (cover < options.most_group_cover)
    return ellipse[found], cover[found]


def _none() -> tuple[Ellipse, FloatArray]:
    return NO_ELLIPSES, np.empty(0)


def _fitted(scatter: FloatArray, middle: FloatArray, scale: float) -> tuple[Ellipse, BoolArray]:
    mass = np.maximum(scatter[:, 5, 5], 1e-12)
    ellipse, found = fit_scatter(scatter / mass[:, None, None])
    return (
        Ellipse(
            ellipse.center * scale + middle, ellipse.semi_major * scale, ellipse.semi_minor * scale, ellipse.angle
        ),
        found,
    )


def _pairs(arcs: Arcs, longest_px: float) -> tuple[IntArray, IntArray]:
    """Return the indices of the arcs of each pair that may lie on one ellipse."""
    facing = _facing(arcs.samples)
    middles = arcs.samples.mean(axis=1)
    gap = np.linalg.norm(middles[:, None, :] - middles[None, :, :], axis=-1)
    first, second = np.nonzero(np.triu(facing & facing.T & (gap < longest_px), 1))
    return first, second


def bulging(arcs: Arcs, options: EdgeOptions = DEFAULT) -> BoolArray:
    """Return (m,) which arcs are not straight lines."""
    chord = arcs.samples[:, -1] - arcs.samples[:, 0]
    length = np.linalg.norm(chord, axis=1)
    middle = arcs.samples[:, SAMPLES // 2] - arcs.samples[:, 0]
    sagitta_area = np.abs(chord[:, 0] * middle[:, 1] - chord[:, 1] * middle[:, 0])
    return np.where(
        length < options.least_chord_px,
        arcs.lengths > 2.0 * options.least_chord_px,
        sagitta_area > options.least_bulge * length**2,
    )


def _also_on(ellipse: Ellipse, samples: FloatArray, options: EdgeOptions) -> BoolArray:
    """Return (f, m) which arcs, by `samples` (m, k, 2), lie on the ellipses of pairs, roughly."""
    few = samples[:, :: SAMPLES // 4].reshape(-1, 2)
    distance = np.abs(rim_distance(ellipse, few))
    near = np.maximum(options.group_px, options.group_share * ellipse.semi_major)[:, None]
    return np.asarray(distance.reshape(len(ellipse), len(samples), -1).max(axis=2) < near)


def _facing(samples: FloatArray) -> BoolArray:
    """Return (m, m) whether arc j lies on the hollow side of arc i, as the other arcs of its ellipse do."""
    ends = (samples[:, 0] + samples[:, -1]) / 2.0
    middles = samples[:, SAMPLES // 2]
    inwards = ends - middles
    offset = samples.mean(axis=1)[None, :, :] - middles[:, None, :]
    return np.einsum("ijk,ik->ij", offset, inwards) > 0.0


def _agree(ellipse: Ellipse, points: FloatArray, options: EdgeOptions) -> BoolArray:
    """Return (f,) whether `points` (f, k, 2) lie on their ellipse."""
    rms = np.sqrt(np.mean(rim_distance(ellipse, points) ** 2, axis=-1))
    return np.asarray(rms < np.maximum(options.pair_px, options.pair_share * ellipse.semi_major))
