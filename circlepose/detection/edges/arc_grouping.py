"""Arcs of one broken or partly hidden rim -> one ellipse: all pairs are tried at once."""

from __future__ import annotations

import numpy as np

from circlepose._typing import BoolArray, FloatArray, IntArray
from circlepose.detection.edges.arcs import SAMPLES, Arcs
from circlepose.fitting.direct import fit_scatter, scatter_of
from circlepose.geometry.ellipse import Ellipse, rim_distance

MOST_ARCS = 100
"""Of one image at one scale, the longest are tried: pairs grow with the square."""
_MOST_FAMILIES = 200
_LEAST_BULGE = 0.02
"""Sagitta over chord below which an arc is a straight line."""
_LEAST_PX = 15.0
_NEAR_PX = 0.8
_NEAR_SHARE = 0.004
_LEAST_PAIR = 0.2
_LEAST_COVER = 0.35
_MOST_COVER = 2.3
"""Shares of the common ellipse's rim that two arcs, and all that lie on it, must cover."""
_ALSO_PX = 2.0
_ALSO_SHARE = 0.04


def joined_arcs(arcs: Arcs, longest_px: float) -> tuple[Ellipse, FloatArray]:
    """Fit an ellipse no longer than `longest_px` to each family of `arcs` that lie on one.

    A family is a pair that agrees on an ellipse, and all other arcs on that ellipse. Returns the ellipses (batch of
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
    perimeter = np.pi * (ellipse.semi_major + ellipse.semi_minor)
    found &= (lengths[first] + lengths[second] > _LEAST_PAIR * perimeter) & (ellipse.semi_minor > 0.0)
    found &= 2.0 * ellipse.semi_major < longest_px
    kept = np.flatnonzero(found)
    kept = kept[_agree(ellipse[kept], samples[first[kept]]) & _agree(ellipse[kept], samples[second[kept]])]
    if len(kept) == 0:
        return _none()
    # The pairs that hold most of their ellipse, where there are very many.
    kept = kept[np.argsort(-(lengths[first[kept]] + lengths[second[kept]]), kind="stable")[:_MOST_FAMILIES]]
    also = _also_on(ellipse[kept], samples)
    also[np.arange(len(kept)), first[kept]] = True
    also[np.arange(len(kept)), second[kept]] = True
    families = np.unique(also, axis=0)
    ellipse, found = _fitted(np.einsum("fm,mij->fij", families.astype(np.float64), scatter), middle, scale)
    perimeter = np.pi * (ellipse.semi_major + ellipse.semi_minor)
    cover = families @ lengths / np.maximum(perimeter, 1e-9)
    # Both borders of one edge may count, hence up to twice the rim.
    found &= (cover > _LEAST_COVER) & (cover < _MOST_COVER)
    return ellipse[found], cover[found]


def _none() -> tuple[Ellipse, FloatArray]:
    return Ellipse(np.empty((0, 2)), np.empty(0), np.empty(0), np.empty(0)), np.empty(0)


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


def bulging(arcs: Arcs) -> BoolArray:
    """Tell (m,) which arcs are no straight lines."""
    chord = arcs.samples[:, -1] - arcs.samples[:, 0]
    length = np.linalg.norm(chord, axis=1)
    middle = arcs.samples[:, SAMPLES // 2] - arcs.samples[:, 0]
    sagitta_area = np.abs(chord[:, 0] * middle[:, 1] - chord[:, 1] * middle[:, 0])
    return np.where(length < _LEAST_PX, arcs.lengths > 2.0 * _LEAST_PX, sagitta_area > _LEAST_BULGE * length**2)


def _also_on(ellipse: Ellipse, samples: FloatArray) -> BoolArray:
    """Tell (f, m) which arcs, by `samples` (m, k, 2), lie on the ellipses of pairs, which may be a little off."""
    few = samples[:, :: SAMPLES // 4].reshape(-1, 2)
    distance = np.abs(rim_distance(ellipse, np.broadcast_to(few, (len(ellipse), *few.shape))))
    near = np.maximum(_ALSO_PX, _ALSO_SHARE * ellipse.semi_major)[:, None]
    return np.asarray(distance.reshape(len(ellipse), len(samples), -1).max(axis=2) < near)


def _facing(samples: FloatArray) -> BoolArray:
    """Tell, (m, m), whether arc j lies on the hollow side of arc i, as the other arcs of its ellipse do."""
    ends = (samples[:, 0] + samples[:, -1]) / 2.0
    middles = samples[:, SAMPLES // 2]
    inwards = ends - middles
    offset = samples.mean(axis=1)[None, :, :] - middles[:, None, :]
    return np.einsum("ijk,ik->ij", offset, inwards) > 0.0


def _agree(ellipse: Ellipse, points: FloatArray) -> BoolArray:
    """Tell (f,) whether `points` (f, k, 2) lie on their ellipse."""
    rms = np.sqrt(np.mean(rim_distance(ellipse, points) ** 2, axis=-1))
    return np.asarray(rms < np.maximum(_NEAR_PX, _NEAR_SHARE * ellipse.semi_major))
