"""Where on its board a lattice of circles lies: which of its circles is which.

A lattice fits its grid after a shift and a turn. Each is judged by what it leaves unexplained: circles on the lattice
that the layout does not have, groups of circles that should be in the image and are not (what hides one hides its
neighbors), and circles of another size than the layout's. Shifts and turns that map the layout on itself are one
place. The best place counts only where all others are far less likely; else nothing is assigned. So a board of which
a whole row is not seen is placed by its marks alone: the row may be hidden, or beyond the border.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from circlepose._typing import BoolArray, FloatArray, IntArray
from circlepose.boards.homography import projected
from circlepose.boards.lattice import Patch, all_turns, turned
from circlepose.boards.options import DEFAULT, BoardOptions
from circlepose.boards.symmetry import symmetries
from circlepose.geometry.ellipse import Ellipse
from circlepose.targets.board import BoardLayout, Grid


@dataclass(frozen=True, slots=True, eq=False)
class Placement:
    """Which circle of the layout each circle of a lattice is."""

    members: IntArray
    """(k,) indices of ellipses"""
    circles: IntArray
    """(k,) of the layout's circles, of each of them"""


def place(
    patch: Patch,
    ellipse: Ellipse,
    layout: BoardLayout,
    image_size: tuple[int, int],
    is_ring: BoolArray | None = None,
    options: BoardOptions = DEFAULT,
) -> Placement | str:
    """Return where a lattice lies on a grid, or why that is not known: two places are as likely, or none fits.

    Parameters
    ----------
    patch
        The lattice.
    ellipse
        (m,) those of the image, px.
    layout
        Of a grid.
    image_size
        Width and height, px.
    is_ring
        (m,) which have another rim inside, of the same center; none where it is not given.
    options
        The numbers of boards.
    """
    assert layout.grid is not None
    same = symmetries(layout)
    scored: list[tuple[float, IntArray, IntArray]] = []
    sizes = _relative_sizes(patch, ellipse, options)
    size_noise = max(options.size_noise, 1.5 * float(np.median(np.abs(sizes - np.median(sizes)))))
    rings = np.zeros(len(patch.members), np.bool_) if is_ring is None else is_ring[patch.members]
    for nodes, common in _candidates(patch, layout, options):
        most = options.foreign_log * (len(nodes) - common)
        if scored and most < max(each[0] for each in scored) - 2.0 * options.decisive_log:
            break
        score, circles = _judged(patch, nodes, sizes, size_noise, rings, ellipse, layout, image_size, options)
        # Equal but for a symmetry of the layout.
        again = any(
            np.array_equal(permutation[circles[circles >= 0]], other[circles >= 0])
            and (other >= 0).sum() == (circles >= 0).sum()
            for _, other, _ in scored
            for permutation in same
        )
        if not again:
            scored.append((score, circles, nodes))
    scored.sort(key=lambda each: -each[0])
    best, circles, nodes = scored[0]
    odds = best - scored[1][0] if len(scored) > 1 else np.inf
    on_board = circles >= 0
    number, shared = len(circles), int(np.count_nonzero(on_board))
    most_foreign = max(options.most_foreign, options.foreign_share * number)
    foreign = nodes[~on_board & (np.abs(np.log(sizes)) < np.log(options.as_large))]
    # One alone may lie there by chance; neighbors are printed, and so are many.
    together = max((len(group) for group in _groups(foreign, layout)), default=0)
    is_printed = together > options.most_foreign
    is_printed |= len(foreign) > max(options.most_foreign, options.printed_share * number)
    if shared < options.least_share * number or number - shared > most_foreign or is_printed:
        return (
            f"{number} circles lie on the layout's lattice, {shared} of them fit it: more rows or columns than stated"
        )
    if odds < options.decisive_log:
        against = _against_sizes(sizes[on_board], layout, circles[on_board], size_noise, options)
        unlike = np.flatnonzero(
            (against >= options.decisive_log) | (rings[on_board] != layout.is_ring[circles[on_board]])
        )
        if len(unlike):
            name = layout.names[circles[on_board][unlike[0]]]
            return (
                f"the marks are not where the layout has them: {name}, for one, is of another size, or a ring that "
                "should be none"
            )
        has_marks = len(np.unique(layout.radius_mm)) > 1 or len(np.unique(layout.is_ring)) > 1
        return f"{number} circles fit the layout in more than one place; " + (
            "its marks were not seen, or not distinguished from its other circles; more of the board is needed in "
            "the image"
            if has_marks
            else "more of its circles are needed in the image, or a mark"
        )
    between = _number_between(patch, ellipse, options)
    if between > max(options.most_foreign, options.between_share * number):
        return f"{between} circles as large lie between the {number} that could be the layout's: another spacing"
    return Placement(patch.members[on_board], circles[on_board])


def _candidates(patch: Patch, layout: BoardLayout, options: BoardOptions) -> Iterator[tuple[IntArray, int]]:
    """Yield the nodes (k, 2) of the patch in the layout's lattice, turned and shifted, most circles in common first.

    With each, how many these are.
    """
    assert layout.grid is not None
    order = layout.grid.order
    ranked: list[tuple[int, int, IntArray]] = []
    for turn in range(order):
        nodes = turned(patch.nodes, turn, order)
        shifts, numbers = _shifts(nodes, layout.node_of)
        best = np.argsort(-numbers, kind="stable")[: options.most_places]
        ranked += [(int(numbers[i]), turn, shifts[i]) for i in best.tolist()]
    ranked.sort(key=lambda each: -each[0])
    for number, turn, shift in ranked[: options.most_places]:
        yield turned(patch.nodes, turn, order) + shift, number


def _shifts(nodes: IntArray, others: IntArray) -> tuple[IntArray, IntArray]:
    """Return the shifts (s, 2) that bring any of `nodes` to any of `others`, and how many each brings (s,)."""
    differences = (others[None] - nodes[:, None]).reshape(-1, 2)
    low = differences.min(axis=0)
    wide = int(np.ptp(differences[:, 1])) + 1
    key = (differences[:, 0] - low[0]) * wide + differences[:, 1] - low[1]
    numbers = np.bincount(key)
    used = np.flatnonzero(numbers)
    return np.column_stack([used // wide, used % wide]) + low, numbers[used]


def _judged(
    patch: Patch,
    nodes: IntArray,
    sizes: FloatArray,
    size_noise: float,
    rings: BoolArray,
    ellipse: Ellipse,
    layout: BoardLayout,
    image_size: tuple[int, int],
    options: BoardOptions,
) -> tuple[float, IntArray]:
    """Return the log likelihood of a place, and the circle that each ellipse is, (k,) -1 for none."""
    index = layout.index_of_node
    circles = np.array([index.get((a, b), -1) for a, b in nodes.tolist()], np.int64)
    on_board = circles >= 0
    score = options.foreign_log * float(np.count_nonzero(~on_board))
    score -= float(_against_sizes(sizes[on_board], layout, circles[on_board], size_noise, options).sum())
    score += options.unlike_ring_log * float(np.count_nonzero(rings[on_board] != layout.is_ring[circles[on_board]]))
    absent = np.setdiff1d(np.arange(len(layout)), circles[on_board])
    inside = _are_inside(patch, nodes, ellipse, layout.node_of[absent], image_size)
    groups = _groups(layout.node_of[absent[inside]], layout)
    return score + options.hidden_log * len(groups), circles


def _against_sizes(
    sizes: FloatArray, layout: BoardLayout, circles: IntArray, size_noise: float, options: BoardOptions
) -> FloatArray:
    """Return (k,) the log odds against each of `circles` (k,) by the size that is seen, over the usual ones.

    Blur changes all sizes, so each is held against those of the layout; one between two of them tells nothing.
    """
    kinds = np.unique(layout.radius_mm)
    if len(kinds) == 1 or len(sizes) == 0:
        return np.zeros(len(sizes))
    off = np.abs(np.log(sizes[:, None] * layout.usual_radius_mm / kinds))
    own = np.abs(np.log(sizes * layout.usual_radius_mm / layout.radius_mm[circles]))
    nearest, next_nearest = np.sort(off, axis=1)[:, :2].T
    against = 0.5 * (own**2 - nearest**2) / size_noise**2
    is_clear = nearest < options.clear_size * next_nearest
    return np.where(is_clear, np.minimum(against, -options.unlike_log), 0.0)


def _groups(nodes: IntArray, layout: BoardLayout) -> list[list[tuple[int, int]]]:
    """Return the groups of neighbors that `nodes` (j, 2) of a lattice make up."""
    assert layout.grid is not None
    order = layout.grid.order
    # With diagonals: they are the neighbors in a row of an asymmetric grid.
    first = [(1, 0), (1, 1)] if order == 4 else [(1, 0)]
    steps = [step for node in first for step in all_turns(node, order)]
    left = {(a, b) for a, b in nodes.tolist()}
    groups = []
    while left:
        group = [left.pop()]
        for a, b in group:
            around = [(a + da, b + db) for da, db in steps]
            group += [node for node in around if node in left]
            left.difference_update(around)
        groups.append(group)
    return groups


def _number_between(patch: Patch, ellipse: Ellipse, options: BoardOptions) -> int:
    """Return how many other ellipses lie among those of a patch, and are as large as those near them."""
    others = np.setdiff1d(np.arange(len(ellipse)), patch.members)
    if len(others) == 0:
        return 0
    own = ellipse[patch.members]
    nodes = projected(own.center, patch.nodes.astype(np.float64), ellipse.center[others])
    with np.errstate(invalid="ignore"):
        is_among = np.all((nodes > patch.nodes.min(axis=0)) & (nodes < patch.nodes.max(axis=0)), axis=1)
    number = 0
    for i in others[is_among].tolist():
        apart = np.linalg.norm(own.center - ellipse.center[i], axis=1)
        near = np.argsort(apart, kind="stable")[:4]
        sizes = own[near].size
        ratio = float(ellipse[i].size) / float(np.median(sizes))
        number += 1.0 / options.as_large < ratio < options.as_large
    return number


def _are_inside(
    patch: Patch, nodes: IntArray, ellipse: Ellipse, absent: IntArray, image_size: tuple[int, int]
) -> BoolArray:
    """Return which nodes `absent` (j, 2) are seen within the image, by a map of the lattice to it."""
    if len(absent) == 0:
        return np.zeros(0, np.bool_)
    own = ellipse[patch.members]
    places = projected(nodes.astype(np.float64), own.center, absent.astype(np.float64))
    margin = 1.5 * float(np.median(own.semi_major))
    width, height = image_size
    with np.errstate(invalid="ignore"):
        return np.asarray(
            (places[:, 0] > margin)
            & (places[:, 0] < width - 1.0 - margin)
            & (places[:, 1] > margin)
            & (places[:, 1] < height - 1.0 - margin)
        )


def _relative_sizes(patch: Patch, ellipse: Ellipse, options: BoardOptions) -> FloatArray:
    """Return (k,) the size of each circle over that of a usual one at its place.

    Of equal circles in a plane the areas seen are as the cube of 1/depth, which is linear in the nodes.
    """
    own = ellipse[patch.members]
    per_depth = own.size ** (2.0 / 3.0)
    nodes = patch.nodes - patch.nodes.mean(axis=0)
    design = np.column_stack([np.ones(len(nodes)), nodes])
    weight = np.ones(len(nodes))
    usual = np.full(len(nodes), np.median(per_depth))
    for _ in range(options.size_rounds):
        # Half of the circles at least are usual ones.
        off = np.abs(per_depth / usual - 1.0)
        weight = 1.0 / (1.0 + (off / max(float(np.median(off)), options.size_noise)) ** 2)
        solution = np.linalg.lstsq(design * weight[:, None], per_depth * weight, rcond=None)[0]
        usual = np.maximum(design @ solution, 1e-3 * per_depth)
    return np.asarray((per_depth / usual) ** 1.5)


def neighbor_radii(grid: Grid, layout: BoardLayout) -> float:
    """Return the distance of neighbors in the usual radius."""
    return grid.neighbor_mm / layout.usual_radius_mm
