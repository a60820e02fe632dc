"""One scale of an image -> rough ellipses, all edge chains at once, without those of rims that are known."""

from __future__ import annotations

from collections import Counter
from functools import partial

import numpy as np

from circlepose._batching import in_parts, joined
from circlepose._typing import BoolArray, FloatArray, Image, IntArray
from circlepose.detection import EXTRACTIONS
from circlepose.detection.contour import Rejection
from circlepose.detection.edges.arc_grouping import MOST_ARCS, bulging, joined_arcs
from circlepose.detection.edges.arcs import SHORTEST_CHAIN, Arcs, arcs_of
from circlepose.detection.edges.canny import edge_chains
from circlepose.detection.edges.chains import Chains
from circlepose.detection.edges.region_borders import border_chains
from circlepose.detection.unexplained_edges import rims_drawn
from circlepose.fitting.direct_batch import fit_each
from circlepose.geometry.conic import Ellipse, rim_distance
from circlepose.imaging.pyramid import to_full_size
from circlepose.targets.target import AxisIntervals

_SHORTEST = 12
"""Points in the shortest chain of interest: the border of a circle 5 px across."""
_LEAST_EXTENT = 8
"""px of a reduced image; what is smaller is left to the next finer one."""
_SLACK_PX = 4.0
"""How far an axis of a rough ellipse may be from that of the edge in the end."""
_LEAST_FULLNESS = 0.9
"""Area within a closed chain, as a share of that of its ellipse, from which it may be one."""
_SAMPLES = 32
_ROUGH_RMS_PX = 1.0
_ROUGH_RMS_SHARE = 0.03
"""A chain may stray this far (px, or share of the minor axis) and still be worth a closer look."""
_CLOSED_RMS_PX = 0.5
"""The pixels of a closed chain stray no more (px) by themselves."""
_CLOSE_RMS_PX = 0.6
_CLOSE_RMS_SHARE = 0.01
"""One that strays no more is of the ellipse and nothing else."""
_TRIMS = 3
_LEAST_RIM = 0.35
_MOSTLY = 0.6
_NEARLY_ALL = 0.9
_SHORTEST_OPEN = 20
_MOST_OPEN = 400
"""Chains of one scale that enclose no ellipse and are looked at closer, the longest first."""
_MOST_POINTS = 40_000
"""Points of chains of one scale that are cut into arcs, the longest chains first."""
_MOST_FROM_ARCS = 80
_LONG_PX = 15.0
"""Semi-major axis from which a line may be a circle seen edge-on."""
_EXPLAINED = 0.7
"""Share of a chain on known rims from which there is nothing new in it."""
_TWIN_AREA = 0.25
_LEAST_RATIO = 0.1
"""Axis ratio from which a chain that encloses nothing may be of a circle where none edge-on is looked for."""


def rough_ellipses(
    image: Image,
    scale: float,
    intervals: AxisIntervals,
    known: Ellipse,
    rejected: Counter[Rejection],
    extraction: str = EXTRACTIONS[0],
    tiles: BoolArray | None = None,
    *,
    lines: bool = False,
) -> Ellipse:
    """Return the ellipses (batch, full-size px) that edge chains of `image`, reduced by `scale`, suggest.

    With `tiles`, see `unexplained`, edges are looked for only there. Chains along the rims `known` (batch, full-size
    px) suggest nothing new. Chains passed over are counted in `rejected`. With `lines` also straight ones
    count, which may be a side of a circle seen edge-on.
    """
    is_coincidence = extraction == "coincidence"
    chains = border_chains(image, _SHORTEST) if is_coincidence else edge_chains(image, _SHORTEST, tiles)
    extents = chains.extents()
    shortest, longest = _extents(intervals, scale, image)
    large = extents >= shortest
    rejected[Rejection.TOO_SHORT] += int(np.count_nonzero(~large))
    on_known = rims_drawn(known, scale, image)
    if on_known is not None and len(chains):
        explained = chains.shares(on_known[chains.points[:, 1], chains.points[:, 0]]) >= _EXPLAINED
        rejected[Rejection.DUPLICATE] += int(np.count_nonzero(explained & large))
        large &= ~explained
    whole = large & (extents <= longest)
    closed, is_closed, is_settled = _closed(chains, whole)
    rest = np.flatnonzero(large & ~is_closed)
    opened, clean, fits = _opened(chains, rest, whole[rest], 0.0 if lines else _LEAST_RATIO)
    is_settled[rest[clean]] = True
    # A chain that strays, or is too long, has merged with something, or is none; its arcs may still be of a rim.
    pieces = _pieces(chains, np.flatnonzero(large & ~is_settled), on_known, lines=lines)
    # It takes as much memory as the image.
    del on_known
    from_arcs = _from_arcs(pieces, longest)
    rejected[Rejection.NOT_ELLIPTICAL] += int(np.count_nonzero(~fits))
    found = joined([closed, opened, from_arcs])
    found = Ellipse(
        to_full_size(found.center, scale), found.semi_major * scale, found.semi_minor * scale, found.angle
    )
    major_ok = _within(2.0 * found.semi_major, intervals.major_px, scale)
    minor_ok = _within(2.0 * found.semi_minor, intervals.minor_px, scale)
    rejected[Rejection.MAJOR_AXIS] += int(np.count_nonzero(~major_ok))
    rejected[Rejection.MINOR_AXIS] += int(np.count_nonzero(major_ok & ~minor_ok))
    return found[major_ok & minor_ok]


def _extents(intervals: AxisIntervals, scale: float, image: Image) -> tuple[float, float]:
    """Return the smallest and largest extent (px of a reduced `image`) that a rim's chain can have."""
    least = _LEAST_EXTENT if scale > 1.0 else 0.0
    if intervals.major_px is None:
        return least, 1.5 * max(image.shape)
    low, high = intervals.major_px
    # An ellipse's box is at least major/sqrt(2) wide; a chain of part of a rim may be half that.
    return max((0.35 * low - _SLACK_PX) / scale, least), (1.1 * high + 2.0 * _SLACK_PX) / scale


def _closed(chains: Chains, whole: BoolArray) -> tuple[Ellipse, BoolArray, BoolArray]:
    """Return the ellipses that chains enclose, one for each edge, which (m,) enclose one, and which closely."""
    index = np.flatnonzero(whole)
    parent = chains.parents[index]
    if len(index) == 0:
        return _no_ellipses(), np.zeros(len(chains), np.bool_), np.zeros(len(chains), np.bool_)
    ellipse, fullness = chains.moment_ellipses(index)
    good = np.abs(fullness - 1.0) <= 1.0 - _LEAST_FULLNESS
    good &= ellipse.semi_minor >= 1.0
    kept = np.flatnonzero(good)
    rms = in_parts(partial(_straying, chains), index[kept], ellipse[kept])
    good[kept] = rms < np.maximum(_CLOSED_RMS_PX, _ROUGH_RMS_SHARE * 2.0 * ellipse.semi_minor[kept])
    is_closed, is_settled = np.zeros(len(chains), np.bool_), np.zeros(len(chains), np.bool_)
    is_closed[index[good]] = True
    is_settled[index[kept[rms < _closely(ellipse[kept])]]] = True
    # The hole within an edge is the same edge again.
    area = np.zeros(len(chains))
    area[index] = ellipse.semi_major * ellipse.semi_minor
    twin = (parent >= 0) & is_closed[parent] & (area[index] > (1.0 - _TWIN_AREA) * area[parent])
    return ellipse[good & ~twin], is_closed, is_settled


def _straying(chains: Chains, which: IntArray, ellipse: Ellipse) -> FloatArray:
    """Return how far (rms, px) each of the chains `which` (m,) strays from the ellipse that it is held against."""
    return np.asarray(np.sqrt(np.mean(rim_distance(ellipse, chains.samples(which, _SAMPLES)) ** 2, axis=1)))


def _opened(
    chains: Chains, rest: IntArray, whole: BoolArray, least_ratio: float
) -> tuple[Ellipse, BoolArray, BoolArray]:
    """Fit ellipses to chains that enclose none: with gaps, or merged with something.

    Returns the ellipses, which chains of `rest` lie on one closely, and which have one.
    """
    settled, fits = np.zeros(len(rest), np.bool_), np.zeros(len(rest), np.bool_)
    index = np.flatnonzero(whole & (chains.sizes[rest] >= _SHORTEST_OPEN))
    index = index[np.argsort(-chains.sizes[rest[index]], kind="stable")[:_MOST_OPEN]]
    if len(index) == 0:
        return _no_ellipses(), settled, fits
    samples = chains.samples(rest[index], _SAMPLES)
    ellipse, good, _ = in_parts(_trimmed, samples, chains.sizes[rest[index]].astype(np.float64))
    distance = np.abs(rim_distance(ellipse, samples))
    # With less of it on the ellipse its arcs say more.
    good &= np.mean(distance < _near(ellipse)[:, None], axis=1) >= _MOSTLY
    good &= ellipse.semi_minor >= least_ratio * ellipse.semi_major
    settled[index] = good & (np.mean(distance < 2.0 * _closely(ellipse)[:, None], axis=1) >= _NEARLY_ALL)
    fits[index] = good
    return ellipse[good], settled, fits


def _trimmed(samples: FloatArray, lengths: FloatArray) -> tuple[Ellipse, BoolArray, FloatArray]:
    """Fit each row of `samples` (m, k, 2), letting go of stray points; returns also which fit, with which share."""
    weights = np.ones(samples.shape[:2])
    for _ in range(_TRIMS):
        ellipse, found = fit_each(samples, weights)
        distance = np.abs(rim_distance(ellipse, samples))
        spread = np.sqrt(np.sum(weights * distance**2, axis=1) / np.maximum(weights.sum(axis=1), 1e-9))
        scale = np.maximum(1.5 * spread, 0.7)[:, None]
        weights = 1.0 / (1.0 + (distance / scale) ** 2) ** 2
    share = np.mean(distance < 2.0 * _near(ellipse)[:, None], axis=1)
    # A shorter arc says too little of the rest of the rim.
    perimeter = np.pi * (ellipse.semi_major + ellipse.semi_minor)
    good = found & (share * lengths >= _LEAST_RIM * perimeter)
    return ellipse, good & ((ellipse.semi_minor >= 1.0) | (ellipse.semi_major >= _LONG_PX)), share


def _pieces(chains: Chains, rest: IntArray, on_known: BoolArray | None, *, lines: bool) -> Arcs:
    """Return the arcs of the longest chains of `rest`, but for those along known rims and straight ones.

    With `lines` these too: they may be sides of a circle seen edge-on.
    """
    rest = rest[chains.sizes[rest] >= SHORTEST_CHAIN]
    rest = rest[np.argsort(-chains.sizes[rest], kind="stable")]
    sizes = chains.sizes[rest]
    arcs = arcs_of(chains[rest[np.cumsum(sizes) - sizes < _MOST_POINTS]])
    if len(arcs) == 0:
        return arcs
    if not lines:
        arcs = arcs[bulging(arcs)]
    if on_known is not None:
        x, y = arcs.samples.astype(np.int64).transpose(2, 0, 1)
        arcs = arcs[on_known[y, x].mean(axis=1) < _EXPLAINED]
    return arcs.longest(MOST_ARCS)


def _from_arcs(arcs: Arcs, longest: float) -> Ellipse:
    """Return the ellipses of single arcs and of those that lie on one, the fullest."""
    if len(arcs) == 0:
        return _no_ellipses()
    single, good, share = in_parts(_trimmed, arcs.samples, arcs.lengths)
    cover = share * arcs.lengths / (np.pi * (single.semi_major + single.semi_minor))
    together, together_cover = joined_arcs(arcs[bulging(arcs)], longest)
    found = joined([single[good], together])
    ranked = found[np.argsort(-np.concatenate([cover[good], together_cover]), kind="stable")]
    return without_repeats(ranked, 1.0)[:_MOST_FROM_ARCS]


def without_repeats(ellipse: Ellipse, near_px: float) -> Ellipse:
    """Drop ellipses that repeat an earlier one of the batch, most of them: same to `near_px` on a grid of that."""
    key = np.column_stack([ellipse.center, ellipse.semi_major, ellipse.semi_minor])
    _, first = np.unique(np.round(key / (2.0 * near_px)).astype(np.int64), axis=0, return_index=True)
    return ellipse[np.sort(first)]


def _near(ellipse: Ellipse) -> FloatArray:
    return np.maximum(_ROUGH_RMS_PX, _ROUGH_RMS_SHARE * 2.0 * ellipse.semi_minor)


def _closely(ellipse: Ellipse) -> FloatArray:
    return np.maximum(_CLOSE_RMS_PX, _CLOSE_RMS_SHARE * ellipse.semi_major)


def _no_ellipses() -> Ellipse:
    return Ellipse(np.empty((0, 2)), np.empty(0), np.empty(0), np.empty(0))


def _within(length_px: FloatArray, interval: tuple[float, float] | None, scale: float) -> BoolArray:
    if interval is None:
        return np.ones(len(length_px), dtype=np.bool_)
    slack = _SLACK_PX + scale - 1.0
    return (length_px >= interval[0] - slack) & (length_px <= interval[1] + slack)
