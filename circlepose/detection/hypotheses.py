"""One scale of an image -> rough ellipses from all its edge chains at once, without those along known rims."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import partial

import numpy as np

from circlepose._batching import in_parts, joined
from circlepose._typing import BoolArray, FloatArray, Image, IntArray
from circlepose.detection import EXTRACTIONS
from circlepose.detection.contour import Rejection
from circlepose.detection.edges.arc_grouping import bulging, joined_arcs
from circlepose.detection.edges.arcs import Arcs, arcs_of
from circlepose.detection.edges.canny import edge_chains
from circlepose.detection.edges.chains import Chains
from circlepose.detection.edges.region_borders import border_chains
from circlepose.detection.options import DEFAULT, DetectionOptions
from circlepose.detection.surroundings import Surroundings
from circlepose.detection.unexplained_edges import rims_drawn
from circlepose.fitting.direct import fit_each
from circlepose.geometry.ellipse import NO_ELLIPSES, Ellipse, rim_distance
from circlepose.imaging.pyramid import to_full_size
from circlepose.targets.target import AxisIntervals

_SAMPLES = 32
"""Points of a chain that its fit is made to."""


@dataclass(frozen=True, slots=True, eq=False)
class Hypotheses:
    """Rough ellipses of one scale."""

    ellipse: Ellipse
    """(batch) px of the full image"""
    rejected: Counter[Rejection]
    """number of chains and ellipses that were passed over, by reason"""
    surroundings: Surroundings | None
    """the boxes of all edges, of the full-size image alone"""


def rough_ellipses(
    image: Image,
    scale: float,
    intervals: AxisIntervals,
    known: Ellipse,
    extraction: str = EXTRACTIONS[0],
    tiles: BoolArray | None = None,
    *,
    lines: bool = False,
    options: DetectionOptions = DEFAULT,
) -> Hypotheses:
    """Return the ellipses that edge chains of `image`, reduced by `scale`, suggest.

    Chains along the rims `known` (batch, px of the full image) suggest nothing new. With `tiles` edges are sought
    only there, see `unexplained_edges`. With `lines` straight chains count too: one may be a side of a circle seen
    edge-on.
    """
    rejected: Counter[Rejection] = Counter()
    # A dot of a reduced image is a circle of the full one.
    chains = _chains(image, extraction, tiles, options.least_major_px if scale == 1.0 else 0.0, options)
    surroundings = Surroundings.of(chains, image) if scale == 1.0 else None
    extents = chains.extents()
    shortest, longest = _extents(intervals, scale, image, options)
    large = extents >= shortest
    rejected[Rejection.TOO_SHORT] = int(np.count_nonzero(~large))
    rejected[Rejection.TOO_SMALL] = chains.dots
    on_known = rims_drawn(known, scale, image)
    if on_known is not None and len(chains):
        explained = chains.shares(on_known[chains.points[:, 1], chains.points[:, 0]]) >= options.known_share
        rejected[Rejection.DUPLICATE] = int(np.count_nonzero(explained & large))
        large &= ~explained
    whole = large & (extents <= longest)
    closed, is_closed, is_settled = _closed(chains, whole, options)
    rest = np.flatnonzero(large & ~is_closed)
    least_ratio = 0.0 if lines else options.least_open_ratio
    opened, clean, fits = _opened(chains, rest, whole[rest], least_ratio, options)
    is_settled[rest[clean]] = True
    # A chain that strays, or is too long, may have merged with something; its arcs may still be of a rim.
    pieces = _pieces(chains, np.flatnonzero(large & ~is_settled), on_known, options, lines=lines)
    # It takes as much memory as the image.
    del on_known
    from_arcs = _from_arcs(pieces, longest, options)
    rejected[Rejection.NOT_ELLIPTICAL] = int(np.count_nonzero(~fits))
    found = joined([closed, opened, from_arcs])
    found = Ellipse(
        to_full_size(found.center, scale), found.semi_major * scale, found.semi_minor * scale, found.angle
    )
    slack_px = options.axis_slack_px + scale - 1.0
    major_ok = _within(2.0 * found.semi_major, intervals.major_px, slack_px)
    minor_ok = _within(2.0 * found.semi_minor, intervals.minor_px, slack_px)
    rejected[Rejection.MAJOR_AXIS] = int(np.count_nonzero(~major_ok))
    rejected[Rejection.MINOR_AXIS] = int(np.count_nonzero(major_ok & ~minor_ok))
    return Hypotheses(found[major_ok & minor_ok], rejected, surroundings)


def _chains(
    image: Image, extraction: str, tiles: BoolArray | None, dot_px: float, options: DetectionOptions
) -> Chains:
    if extraction == "coincidence":
        return border_chains(image, options.shortest_chain, options.edges)
    return edge_chains(image, options.shortest_chain, tiles, options.edges, dot_px=dot_px)


def _extents(intervals: AxisIntervals, scale: float, image: Image, options: DetectionOptions) -> tuple[float, float]:
    """Return the smallest and largest extent (px of a reduced `image`) that a rim's chain can have."""
    least = options.least_extent_px if scale > 1.0 else 0.0
    if intervals.major_px is None:
        return least, 1.5 * max(image.shape)
    low, high = intervals.major_px
    # An ellipse's box is at least major/sqrt(2) wide; a chain of part of a rim may be half that.
    slack_px = options.axis_slack_px
    return max((0.35 * low - slack_px) / scale, least), (1.1 * high + 2.0 * slack_px) / scale


def _closed(chains: Chains, whole: BoolArray, options: DetectionOptions) -> tuple[Ellipse, BoolArray, BoolArray]:
    """Return the ellipses that chains enclose, one for each edge, which (m,) enclose one, and which closely."""
    index = np.flatnonzero(whole)
    parent = chains.parents[index]
    if len(index) == 0:
        return NO_ELLIPSES, np.zeros(len(chains), np.bool_), np.zeros(len(chains), np.bool_)
    ellipse, fullness = chains.moment_ellipses(index)
    good = np.abs(fullness - 1.0) <= 1.0 - options.least_fullness
    good &= ellipse.semi_minor >= 1.0
    kept = np.flatnonzero(good)
    rms = in_parts(partial(_straying, chains), index[kept], ellipse[kept])
    good[kept] = rms < np.maximum(options.closed_rms_px, options.rough_rms_share * 2.0 * ellipse.semi_minor[kept])
    is_closed, is_settled = np.zeros(len(chains), np.bool_), np.zeros(len(chains), np.bool_)
    is_closed[index[good]] = True
    is_settled[index[kept[rms < _closely(ellipse[kept], options)]]] = True
    # The hole within an edge is the same edge again.
    area = np.zeros(len(chains))
    area[index] = ellipse.semi_major * ellipse.semi_minor
    twin = (parent >= 0) & is_closed[parent] & (area[index] > (1.0 - options.twin_area) * area[parent])
    return ellipse[good & ~twin], is_closed, is_settled


def _straying(chains: Chains, which: IntArray, ellipse: Ellipse) -> FloatArray:
    """Return the rms distance (px) of each of the chains `which` (m,) from its ellipse."""
    return np.asarray(np.sqrt(np.mean(rim_distance(ellipse, chains.samples(which, _SAMPLES)) ** 2, axis=1)))


def _opened(
    chains: Chains, rest: IntArray, whole: BoolArray, least_ratio: float, options: DetectionOptions
) -> tuple[Ellipse, BoolArray, BoolArray]:
    """Fit ellipses to chains that do not enclose one: with gaps, or merged with something.

    Returns the ellipses, which chains of `rest` lie on one closely, and which have one.
    """
    settled, fits = np.zeros(len(rest), np.bool_), np.zeros(len(rest), np.bool_)
    index = np.flatnonzero(whole & (chains.sizes[rest] >= options.shortest_open_chain))
    index = index[np.argsort(-chains.sizes[rest[index]], kind="stable")[: options.most_open_chains]]
    if len(index) == 0:
        return NO_ELLIPSES, settled, fits
    samples = chains.samples(rest[index], _SAMPLES)
    ellipse, good, _ = in_parts(partial(_trimmed, options), samples, chains.sizes[rest[index]].astype(np.float64))
    distance = np.abs(rim_distance(ellipse, samples))
    # Where less of it is on the ellipse, its arcs are better hypotheses.
    good &= np.mean(distance < _near(ellipse, options)[:, None], axis=1) >= options.mostly_share
    good &= ellipse.semi_minor >= least_ratio * ellipse.semi_major
    settled[index] = good & (
        np.mean(distance < 2.0 * _closely(ellipse, options)[:, None], axis=1) >= options.nearly_all_share
    )
    fits[index] = good
    return ellipse[good], settled, fits


def _trimmed(
    options: DetectionOptions, samples: FloatArray, lengths: FloatArray
) -> tuple[Ellipse, BoolArray, FloatArray]:
    """Fit each row of `samples` (m, k, 2) robustly; returns also which fit (m,), and with which share (m,)."""
    weights = np.ones(samples.shape[:2])
    for _ in range(options.trim_rounds):
        ellipse, found = fit_each(samples, weights)
        distance = np.abs(rim_distance(ellipse, samples))
        spread = np.sqrt(np.sum(weights * distance**2, axis=1) / np.maximum(weights.sum(axis=1), 1e-9))
        scale = np.maximum(options.trim_scale * spread, options.least_trim_px)[:, None]
        weights = 1.0 / (1.0 + (distance / scale) ** 2) ** 2
    share = np.mean(distance < 2.0 * _near(ellipse, options)[:, None], axis=1)
    # A shorter arc does not determine the rest of the rim.
    good = found & (share * lengths >= options.least_chain_cover * ellipse.perimeter)
    return ellipse, good & ((ellipse.semi_minor >= 1.0) | (ellipse.semi_major >= options.line_semi_major_px)), share


def _pieces(
    chains: Chains, rest: IntArray, on_known: BoolArray | None, options: DetectionOptions, *, lines: bool
) -> Arcs:
    """Return the arcs of the longest chains of `rest`, except those along known rims and straight ones.

    With `lines` straight ones are kept: they may be sides of a circle seen edge-on.
    """
    rest = rest[chains.sizes[rest] >= options.edges.shortest_chain]
    rest = rest[np.argsort(-chains.sizes[rest], kind="stable")]
    sizes = chains.sizes[rest]
    arcs = arcs_of(chains[rest[np.cumsum(sizes) - sizes < options.most_arc_points]], options.edges)
    if len(arcs) == 0:
        return arcs
    if not lines:
        arcs = arcs[bulging(arcs, options.edges)]
    if on_known is not None:
        x, y = arcs.samples.astype(np.int64).transpose(2, 0, 1)
        arcs = arcs[on_known[y, x].mean(axis=1) < options.known_share]
    return arcs.longest(options.edges)


def _from_arcs(arcs: Arcs, longest: float, options: DetectionOptions) -> Ellipse:
    """Return the ellipses of single arcs and of those that lie on one, the fullest."""
    if len(arcs) == 0:
        return NO_ELLIPSES
    single, good, share = in_parts(partial(_trimmed, options), arcs.samples, arcs.lengths)
    cover = share * arcs.lengths / single.perimeter
    together, together_cover = joined_arcs(arcs[bulging(arcs, options.edges)], longest, options.edges)
    found = joined([single[good], together])
    ranked = found[np.argsort(-np.concatenate([cover[good], together_cover]), kind="stable")]
    return without_repeats(ranked, 1.0)[: options.most_from_arcs]


def without_repeats(ellipse: Ellipse, near_px: float) -> Ellipse:
    """Drop most ellipses that repeat an earlier one of the batch: those in the same cell of a grid of 2 `near_px`."""
    key = np.column_stack([ellipse.center, ellipse.semi_major, ellipse.semi_minor])
    _, first = np.unique(np.round(key / (2.0 * near_px)).astype(np.int64), axis=0, return_index=True)
    return ellipse[np.sort(first)]


def _near(ellipse: Ellipse, options: DetectionOptions) -> FloatArray:
    """Return the distance (m,), px, up to which a chain is of its ellipse."""
    return np.maximum(options.rough_rms_px, options.rough_rms_share * 2.0 * ellipse.semi_minor)


def _closely(ellipse: Ellipse, options: DetectionOptions) -> FloatArray:
    """Return the distance (m,), px, up to which a chain is of its ellipse alone."""
    return np.maximum(options.close_rms_px, options.close_rms_share * ellipse.semi_major)


def _within(length_px: FloatArray, interval: tuple[float, float] | None, slack_px: float) -> BoolArray:
    if interval is None:
        return np.ones(len(length_px), dtype=np.bool_)
    return (length_px >= interval[0] - slack_px) & (length_px <= interval[1] + slack_px)
