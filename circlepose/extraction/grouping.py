"""Arcs of one broken or partly hidden rim -> one chain: all pairs are tried at once."""

from __future__ import annotations

import numpy as np

from circlepose._typing import BoolArray, FloatArray
from circlepose.conic import Ellipse, rim_distance
from circlepose.fitting.direct import Contours, fit_ellipses

_MOST_ARCS = 160
"""The longest are tried: pairs grow with the square."""
_SAMPLES = 16
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


def joined_arcs(arcs: list[FloatArray], longest_px: float) -> list[FloatArray]:
    """Return the points of each family of `arcs` (n, 2) that lie on one ellipse no longer than `longest_px`.

    A family is a pair that agrees on an ellipse, and all other arcs on that ellipse.
    """
    arcs = sorted((a for a in arcs if _bulges(a)), key=len, reverse=True)[:_MOST_ARCS]
    if len(arcs) < 2:
        return []
    samples = np.stack([a[np.linspace(0, len(a) - 1, _SAMPLES).astype(int)] for a in arcs])
    lengths = np.array([float(np.linalg.norm(np.diff(a, axis=0), axis=1).sum()) for a in arcs])
    first, second = np.triu_indices(len(arcs), 1)
    facing = _facing(samples)
    candidates = facing[first, second] & facing[second, first]
    gap = np.linalg.norm(samples[first].mean(axis=1) - samples[second].mean(axis=1), axis=-1)
    candidates &= gap < longest_px
    first, second = first[candidates], second[candidates]
    if len(first) == 0:
        return []
    points = np.concatenate([samples[first], samples[second]], axis=1)
    # Each arc counts by its length, however it was sampled.
    weights = np.repeat(np.stack([lengths[first], lengths[second]], axis=1), _SAMPLES, axis=1)
    pairs = Contours(points.reshape(-1, 2), np.arange(len(first)) * 2 * _SAMPLES)
    ellipse, found = fit_ellipses(pairs, (weights / weights.max()).reshape(-1))
    good = found & _agree(ellipse, points) & (2.0 * ellipse.semi_major < longest_px)
    perimeter = np.pi * (ellipse.semi_major + ellipse.semi_minor)
    good &= (lengths[first] + lengths[second] > _LEAST_PAIR * perimeter) & (ellipse.semi_minor > 0.0)
    families: set[tuple[int, ...]] = set()
    for k in np.flatnonzero(good):
        members = {int(first[k]), int(second[k]), *_also_on(ellipse[k], samples)}
        cover = lengths[list(members)].sum() / perimeter[k]
        # Both borders of one edge may count, hence up to twice the rim.
        if _LEAST_COVER < cover < _MOST_COVER:
            families.add(tuple(sorted(members)))
    return [np.concatenate([arcs[i] for i in family]) for family in sorted(families)]


def _also_on(ellipse: Ellipse, samples: FloatArray) -> list[int]:
    """Return which arcs, by their `samples` (m, k, 2), lie on the ellipse of a pair, which may be a little off."""
    distance = np.abs(rim_distance(ellipse, samples.reshape(-1, 2))).reshape(len(samples), -1)
    return [
        int(i) for i in np.flatnonzero(distance.max(axis=1) < max(_ALSO_PX, _ALSO_SHARE * float(ellipse.semi_major)))
    ]


def _bulges(arc: FloatArray) -> bool:
    chord = arc[-1] - arc[0]
    length = float(np.hypot(*chord))
    if length < _LEAST_PX:
        return len(arc) > 2.0 * _LEAST_PX
    middle = arc[len(arc) // 2] - arc[0]
    return abs(float(chord[0] * middle[1] - chord[1] * middle[0])) > _LEAST_BULGE * length**2


def _facing(samples: FloatArray) -> BoolArray:
    """Tell, (m, m), whether arc j lies on the hollow side of arc i, as the other arcs of its ellipse do."""
    ends = (samples[:, 0] + samples[:, -1]) / 2.0
    middles = samples[:, _SAMPLES // 2]
    inwards = ends - middles
    offset = samples.mean(axis=1)[None, :, :] - middles[:, None, :]
    return np.einsum("ijk,ik->ij", offset, inwards) > 0.0


def _agree(ellipse: Ellipse, points: FloatArray) -> BoolArray:
    """Tell (m,) whether both halves of `points` (m, 2k, 2) lie on their ellipse."""
    distance = rim_distance(ellipse, points)
    rms = np.sqrt(np.mean(distance.reshape(len(points), 2, -1) ** 2, axis=-1))
    return np.all(rms < np.maximum(_NEAR_PX, _NEAR_SHARE * ellipse.semi_major)[:, None], axis=1)
