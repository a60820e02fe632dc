"""The rigid motions that map a layout on itself: what no image of it can tell apart."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from circlepose._typing import IntArray
from circlepose.boards.lattice import turned
from circlepose.boards.pose import rotation_between
from circlepose.targets.board import BoardLayout

_SAME_SHARE = 1e-3
"""Distance over the layout's extent, up to which two circles are at one place; numerical."""


@lru_cache(maxsize=64)
def symmetries(layout: BoardLayout) -> tuple[IntArray, ...]:
    """Return the permutations (n,) of a layout's circles that rigid motions make; the first is the identity."""
    return tuple(_of_grid(layout) if layout.grid is not None else _of_list(layout))


def _of_grid(layout: BoardLayout) -> list[IntArray]:
    """Return those of turns about the viewing direction: from behind a grid shows nothing."""
    assert layout.grid is not None
    found = []
    radii = [circle.radii_mm for circle in layout.circles]
    index = layout.index_of_node
    for turn in range(layout.grid.order):
        nodes = turned(layout.node_of, turn, layout.grid.order)
        # A turn that maps the layout on itself maps its bounding box there, too.
        shift = layout.node_of.min(axis=0) - nodes.min(axis=0)
        moved = [index.get((a, b)) for a, b in (nodes + shift).tolist()]
        if all(k is not None and radii[k] == radii[i] for i, k in enumerate(moved)):
            found.append(np.array(moved, np.int64))
    return found


def _of_list(layout: BoardLayout) -> list[IntArray]:
    """Each motion takes the first two circles that are not alike in place to two others as far apart."""
    centers, normals = layout.centers_mm, layout.normals
    radii = [circle.radii_mm for circle in layout.circles]
    number = len(centers)
    extent = float(np.ptp(centers, axis=0).max())
    near = _SAME_SHARE * extent
    found = [np.arange(number)]
    away = centers[1] - centers[0]
    # A motion that maps the layout on itself leaves its middle in place.
    from_middle = np.linalg.norm(centers - centers.mean(axis=0), axis=1)
    for a in np.flatnonzero(np.abs(from_middle - from_middle[0]) < near).tolist():
        if radii[a] != radii[0]:
            continue
        apart = centers - centers[a]
        alike = np.abs(np.linalg.norm(apart, axis=1) - np.linalg.norm(away)) < near
        alike &= np.abs(apart @ normals[a] - away @ normals[0]) < near
        alike &= np.abs(from_middle - from_middle[1]) < near
        for b in np.flatnonzero(alike).tolist():
            turn = rotation_between(normals[0], away, normals[a], apart[b])
            moved = (centers - centers[0]) @ turn.T + centers[a]
            distance = np.linalg.norm(moved[:, None] - centers[None], axis=2)
            permutation = np.argmin(distance, axis=1)
            is_same = (distance[np.arange(number), permutation] < near).all() and len(
                set(permutation.tolist())
            ) == number
            is_same = is_same and all(radii[k] == radii[i] for i, k in enumerate(permutation.tolist()))
            is_same = is_same and bool((np.abs(normals @ turn.T - normals[permutation]) < _SAME_SHARE).all())
            if is_same and not any(np.array_equal(permutation, other) for other in found):
                found.append(permutation)
    return found
