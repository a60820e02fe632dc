"""Edge chains -> arcs: a chain that merged with something else is cut where it turns a corner or bends back."""

from __future__ import annotations

import numpy as np

from circlepose._typing import FloatArray

_SPAN = 6
"""Points on either side over which a chain's turning is measured."""
_CORNER_RAD = np.radians(22.0)
_CORNER_TURNS = 1.5
"""A corner turns by more than the first, and so many times what a circle as long as the chain would."""
_BEND_RAD = np.radians(14.0)
"""Turning that the pixel grid alone does not make."""
_SHORTEST_CHAIN = 60
_SHORTEST_ARC = 20


def arcs(chain: FloatArray) -> list[FloatArray]:
    """Cut a closed chain (n, 2) into arcs that bend one way only; empty when it has no place to cut.

    The points next to a cut, which belong to the corner, are left out.
    """
    if len(chain) < _SHORTEST_CHAIN:
        return []
    cuts = _cuts(chain)
    if len(cuts) == 0:
        return []
    rolled = np.roll(chain, -cuts[0], axis=0)
    pieces = np.split(rolled, cuts[1:] - cuts[0])
    trimmed = [piece[_SPAN // 2 : len(piece) - _SPAN // 2] for piece in pieces]
    return [piece for piece in trimmed if len(piece) >= _SHORTEST_ARC]


def _cuts(chain: FloatArray) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    before = chain - np.roll(chain, _SPAN, axis=0)
    after = np.roll(chain, -_SPAN, axis=0) - chain
    turn = np.arctan2(
        before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0],
        before[:, 0] * after[:, 0] + before[:, 1] * after[:, 1],
    )
    size = np.abs(turn)
    neighbours = np.max([np.roll(size, k) for k in range(-_SPAN, _SPAN + 1)], axis=0)
    sharp = _CORNER_RAD + _CORNER_TURNS * 2.0 * np.pi * _SPAN / len(chain)
    corner = (size > sharp) & (size == neighbours)
    bends = np.flatnonzero(size > _BEND_RAD)
    flips = bends[np.sign(turn[bends]) != np.sign(turn[np.roll(bends, 1)])] if len(bends) else bends
    return np.unique(np.concatenate([np.flatnonzero(corner), flips]))
