"""Edge chains -> arcs: a chain that merged with something else is cut where it turns a corner or bends back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from circlepose._batching import joined
from circlepose._typing import BoolArray, FloatArray, IntArray
from circlepose.detection.edges.chains import Chains
from circlepose.detection.edges.options import DEFAULT, EdgeOptions

SAMPLES = 16
"""Points that represent an arc."""
_AT_ONCE = 5_000
"""About how many points of chains are cut together; bounds memory."""


@dataclass(frozen=True, slots=True, eq=False)
class Arcs:
    """A batch of m arcs that bend one way only."""

    samples: FloatArray
    """(m, 16, 2) px, evenly along each"""
    lengths: FloatArray
    """(m,) px"""

    def __len__(self) -> int:
        return len(self.lengths)

    def __getitem__(self, which: IntArray | BoolArray) -> Self:
        """Return the arcs that `which` names."""
        return type(self)(self.samples[which], self.lengths[which])

    def longest(self, options: EdgeOptions = DEFAULT) -> Self:
        """Return the longest, longest first, without those that run along another: an edge has two sides."""
        most = options.most_arcs
        ranked = self[np.argsort(-self.lengths, kind="stable")[: 2 * most]]
        middles = ranked.samples.mean(axis=1)
        near = np.max(np.abs(middles[:, None, :] - middles[None, :, :]), axis=-1) < options.twin_px
        twins = near & (
            ranked.lengths[None, :] - ranked.lengths[:, None] <= options.twin_share * ranked.lengths[None, :]
        )
        return ranked[np.flatnonzero(~np.tril(twins, -1).any(axis=1))[:most]]


def arcs_of(chains: Chains, options: EdgeOptions = DEFAULT) -> Arcs:
    """Cut closed chains into arcs; a chain without a corner or a change of bend gives no arc.

    The points next to a cut, which belong to the corner, are left out.
    """
    chains = chains[chains.sizes >= options.shortest_chain]
    if len(chains) == 0:
        return Arcs(np.empty((0, SAMPLES, 2)), np.empty(0))
    part = np.cumsum(chains.sizes) // _AT_ONCE
    return joined([_arcs_of(chains[part == i], options) for i in np.unique(part)])


def _arcs_of(chains: Chains, options: EdgeOptions) -> Arcs:
    cuts = np.flatnonzero(_is_cut(chains, options))
    owner = chains.owner[cuts]
    starts, sizes = chains.starts[owner], chains.sizes[owner]
    # From each cut to the next of the same chain, from the last one on to the first.
    following = np.append(cuts[1:], 0)
    last = np.append(owner[1:] != owner[:-1], True) if len(owner) else np.empty(0, np.bool_)
    first = np.searchsorted(owner, owner, side="left")
    following[last] = cuts[first[last]] + sizes[last]
    half = options.arc_span // 2
    begin, number = cuts + half, following - cuts - 2 * half
    long = number >= options.shortest_arc
    begin, number, starts, sizes = begin[long], number[long], starts[long], sizes[long]
    steps = np.round(np.linspace(0.0, 1.0, SAMPLES)[None, :] * (number[:, None] - 1)).astype(np.int64)
    rows = starts[:, None] + (begin[:, None] - starts[:, None] + steps) % sizes[:, None]
    samples = chains.points[rows].astype(np.float64)
    return Arcs(samples, np.linalg.norm(np.diff(samples, axis=1), axis=-1).sum(axis=1))


def _is_cut(chains: Chains, options: EdgeOptions) -> BoolArray:
    """Return (n,) at which points chains turn a corner, or begin to bend the other way."""
    span = options.arc_span
    points = chains.points.astype(np.float32)
    starts, sizes = (np.repeat(each.astype(np.int32), chains.sizes) for each in (chains.starts, chains.sizes))
    index = np.arange(len(points), dtype=np.int32) - starts

    def shifted(by: int, which: IntArray | slice = slice(None)) -> IntArray:
        moved = index[which] + by
        moved += sizes[which] * (moved < 0)
        moved -= sizes[which] * (moved >= sizes[which])
        moved += starts[which]
        return moved

    before = points - points[shifted(-span)]
    after = points[shifted(span)] - points
    turn = np.arctan2(
        before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0],
        before[:, 0] * after[:, 0] + before[:, 1] * after[:, 1],
    )
    size = np.abs(turn)
    sharp = np.flatnonzero(size > options.corner_rad + options.corner_turns * 2.0 * np.pi * span / sizes)
    sharpest = size[sharp]
    for by in range(-span, span + 1):
        np.maximum(sharpest, size[shifted(by, sharp)], out=sharpest)
    cut = np.zeros(len(points), dtype=np.bool_)
    cut[sharp[size[sharp] == sharpest]] = True
    bends = np.flatnonzero(size > options.bend_rad)
    # The bend before, of the same chain: of its first, the last.
    before_it = np.roll(bends, 1)
    chain = chains.owner[bends]
    firsts = np.flatnonzero(np.append(True, chain[1:] != chain[:-1])) if len(bends) else bends
    lasts = np.append(firsts[1:], len(bends)) - 1
    before_it[firsts] = bends[lasts] if len(bends) else before_it[firsts]
    cut[bends[np.sign(turn[bends]) != np.sign(turn[before_it])]] = True
    return cut
