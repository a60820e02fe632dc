"""Which ellipses lie on one lattice, from the image alone.

The image of a circle is a ruler: near it, an offset is as long as in the circle's own ellipse it has radii. Averaged
over two circles the ruler is right up to the second order of the perspective. So neighbors are known by their
distance, of which neither the camera nor the tilt has to be known, and the turns between them by the same map. From
a circle and its neighbors the lattice grows node by node: the next is where the affine map of those around puts it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from circlepose._typing import FloatArray, IntArray
from circlepose.boards.options import DEFAULT, BoardOptions
from circlepose.geometry.ellipse import Ellipse

Node = tuple[int, int]
_REACH = 2.25
"""Steps by a circle's own ruler within which its neighbors are looked for; cost."""


@dataclass(frozen=True, slots=True, eq=False)
class Patch:
    """Ellipses on one lattice."""

    members: IntArray
    """(k,) their indices"""
    nodes: IntArray
    """(k, 2) coordinates of each in the lattice's basis, up to a shift and a turn of the lattice"""


def turned(nodes: IntArray, turn: int, order: int) -> IntArray:
    """Return `nodes` (..., 2) of a lattice after `turn` turns, of which each brings the first vector to the next."""
    a, b = nodes[..., 0], nodes[..., 1]
    for _ in range(turn % order):
        a, b = (-b, a + b) if order == 6 else (-b, a)
    return np.stack([a, b], axis=-1)


def all_turns(node: Node, order: int) -> list[Node]:
    """Return a node after none, one, ... of the turns of a lattice."""
    return [(int(a), int(b)) for a, b in (turned(np.array(node), turn, order) for turn in range(order))]


def shapes_of(ellipse: Ellipse) -> FloatArray:
    """Return (m, 2, 2) S of ellipses (m,): the points x with x' S^-1 x = 1 about the center are the rim, px^2."""
    cos, sin = np.cos(ellipse.angle), np.sin(ellipse.angle)
    major, minor = ellipse.semi_major**2, ellipse.semi_minor**2
    xy = (major - minor) * cos * sin
    return np.stack(
        [
            np.stack([major * cos**2 + minor * sin**2, xy], axis=-1),
            np.stack([xy, major * sin**2 + minor * cos**2], axis=-1),
        ],
        axis=-2,
    )


def in_radii(shapes: FloatArray, offsets: FloatArray) -> FloatArray:
    """Return the lengths (...) of `offsets` (..., 2) px by circles of `shapes` (..., 2, 2), in radii."""
    solved = np.linalg.solve(shapes, offsets[..., None])[..., 0]
    return np.asarray(np.sqrt(np.maximum(np.einsum("...i,...i->...", offsets, solved), 0.0)))


def lattices(ellipse: Ellipse, neighbor_radii: float, order: int, options: BoardOptions = DEFAULT) -> list[Patch]:
    """Return the lattices on which `ellipse` (m,) lie, the largest first; each ellipse is of one at most.

    Parameters
    ----------
    ellipse
        In the raw image, px.
    neighbor_radii
        Distance of neighbors over the usual radius.
    order
        4 of a square lattice, 6 of a hexagonal one.
    options
        The numbers of boards.
    """
    number = min(len(ellipse), options.most_ellipses)
    search = _Search(ellipse[:number], neighbor_radii, order, options)
    patches = []
    while (patch := search.next_patch()) is not None:
        patches.append(patch)
    return sorted(patches, key=lambda each: -len(each.members))


class _Search:
    """Grows lattices one after the other from the ellipses that are left."""

    def __init__(self, ellipse: Ellipse, neighbor_radii: float, order: int, options: BoardOptions) -> None:
        self.options = options
        self.order = order
        self.centers = ellipse.center
        self.shapes = shapes_of(ellipse)
        self.sizes = ellipse.size
        self.step = neighbor_radii
        self.free = np.ones(len(ellipse), np.bool_)
        self.first, self.second, self.angle = self._neighbors()
        self.steps = all_turns((1, 0), order)

    def _neighbors(self) -> tuple[IntArray, IntArray, FloatArray]:
        """Return the pairs (i, j) at the distance of neighbors, and the direction to j in the frame of i, rad."""
        order = np.argsort(self.centers[:, 0], kind="stable")
        first: list[IntArray] = []
        second: list[IntArray] = []
        x = self.centers[order, 0]
        for at, i in enumerate(order.tolist()):
            own_reach = _REACH * self.step * float(np.sqrt(self.shapes[i].trace()))
            near = order[at + 1 : int(np.searchsorted(x, x[at] + own_reach))]
            near = near[np.abs(self.centers[near, 1] - self.centers[i, 1]) <= own_reach]
            ratio = self.sizes[near] / self.sizes[i]
            near = near[(ratio < self.options.alike_ratio) & (ratio > 1.0 / self.options.alike_ratio)]
            offset = self.centers[near] - self.centers[i]
            length = in_radii((self.shapes[near] + self.shapes[i]) / 2.0, offset)
            near = near[np.abs(length / self.step - 1.0) <= self.options.neighbor_tolerance]
            first += [np.full(len(near), i), near]
            second += [near, np.full(len(near), i)]
        i, j = (np.concatenate([np.zeros(0, np.int64), *each]) for each in (first, second))
        by_first = np.argsort(i, kind="stable")
        i, j = i[by_first], j[by_first]
        own = np.linalg.cholesky((self.shapes[i] + self.shapes[j]) / 2.0) if len(i) else np.zeros((0, 2, 2))
        local = np.linalg.solve(own, (self.centers[j] - self.centers[i])[..., None])[..., 0]
        return i, j, np.arctan2(local[:, 1], local[:, 0])

    def next_patch(self) -> Patch | None:
        seed = self._seed()
        if seed is None:
            return None
        at = self._grown(seed)
        members = np.array(list(at.values()), np.int64)
        self.free[members] = False
        nodes = np.array(list(at), np.int64).reshape(-1, 2)
        return Patch(members, nodes)

    def _seed(self) -> dict[Node, int] | None:
        """Return the circle with most neighbors in the directions of a lattice, with these, by node."""
        usable = self.free[self.first] & self.free[self.second]
        i, j, angle = self.first[usable], self.second[usable], self.angle[usable]
        if len(i) == 0:
            return None
        number = len(self.free)
        # The neighbors' directions modulo the turn of the lattice.
        phase = np.exp(1j * self.order * angle)
        total = np.bincount(i, phase.real, number) + 1j * np.bincount(i, phase.imag, number)
        # The turn that most of them agree on, not their mean, which a foreign circle moves.
        best: tuple[float, int, list[tuple[int, int, float]]] | None = None
        counts = np.bincount(i, minlength=number)
        score = np.abs(total)
        starts = np.searchsorted(i, np.arange(number + 1))
        for k in np.argsort(-score, kind="stable")[:12].tolist():
            if counts[k] < self.options.least_neighbors:
                continue
            own = slice(starts[k], starts[k + 1])
            found = self._directed(j[own], angle[own], float(np.angle(total[k])) / self.order)
            value = len(found) - sum(off for _, _, off in found) / max(len(found), 1)
            if len(found) >= self.options.least_neighbors and (best is None or value > best[0]):
                best = (value, k, found)
        if best is None:
            return None
        _, k, found = best
        return {(0, 0): k, **{self.steps[turn]: neighbor for neighbor, turn, _ in found}}

    def _directed(self, neighbors: IntArray, angle: FloatArray, zero: float) -> list[tuple[int, int, float]]:
        """Return neighbor, turn and departure (of a tolerance) of the nearest to each direction of the lattice."""
        turn_rad = 2.0 * np.pi / self.order
        turns = np.round((angle - zero) / turn_rad)
        off = np.abs(angle - zero - turns * turn_rad) / np.radians(self.options.turn_tolerance_deg)
        found: dict[int, tuple[int, int, float]] = {}
        for neighbor, turn, away in zip(
            neighbors.tolist(), (turns % self.order).astype(int).tolist(), off.tolist(), strict=True
        ):
            if away <= 1.0 and (turn not in found or away < found[turn][2]):
                found[turn] = (neighbor, turn, away)
        return list(found.values())

    def _grown(self, at: dict[Node, int]) -> dict[Node, int]:
        """Add circles to the nodes around those known, until none is where it should be."""
        used = set(at.values())
        tried: dict[Node, int] = {}
        while True:
            frontier = self._frontier(at)
            added = False
            # Nodes with most neighbors first: their places are surest.
            for node in sorted(frontier, key=lambda each: -frontier[each]):
                near = self._around(node, at)
                if tried.get(node) == len(near) or (len(near) < 3 and added):
                    continue
                tried[node] = len(near)
                found = self._circle_at(node, near, at, used)
                if found is not None:
                    at[node] = found
                    used.add(found)
                    added = True
            if not added:
                return at

    def _frontier(self, at: dict[Node, int]) -> dict[Node, int]:
        frontier: dict[Node, int] = {}
        for a, b in at:
            for da, db in self.steps:
                node = (a + da, b + db)
                if node not in at:
                    frontier[node] = frontier.get(node, 0) + 1
        return frontier

    def _around(self, node: Node, at: dict[Node, int]) -> list[Node]:
        """Return the known nodes near `node`."""
        reach = int(self.options.fit_steps)
        return [
            near
            for da in range(-reach, reach + 1)
            for db in range(-reach, reach + 1)
            if (near := (node[0] + da, node[1] + db)) in at and self._steps_between(da, db) <= self.options.fit_steps
        ]

    def _steps_between(self, da: int, db: int) -> float:
        return float(np.sqrt(da * da + db * db + (da * db if self.order == 6 else 0)))

    def _circle_at(self, node: Node, near: list[Node], at: dict[Node, int], used: set[int]) -> int | None:
        """Return the free circle nearest to where the circles `near` a node put it, if it is close enough."""
        known = np.array([at[each] for each in near])
        local = np.array(near, np.float64) - np.array(node)
        place, step = _extrapolated(local, self.centers[known])
        if place is None:
            return None
        offset = self.centers - place
        # In steps of the lattice as it is seen there.
        a, b = np.linalg.solve(step, offset.T)
        square = a * a + b * b + (a * b if self.order == 6 else 0.0)
        apart = np.sqrt(np.maximum(square, 0.0))
        apart[~self.free] = np.inf
        apart[list(used)] = np.inf
        best = int(np.argmin(apart))
        return best if apart[best] <= self.options.step_tolerance else None


def _extrapolated(local: FloatArray, places: FloatArray) -> tuple[FloatArray | None, FloatArray]:
    """Return where the node at 0 is (2,), and the vectors (2, 2) of a step there.

    By the affine map of the nodes `local` (k, 2) to their `places` (k, 2), of which near ones count more.
    """
    square = np.sum(local**2, axis=1)
    weight = 1.0 / np.maximum(square, 0.5)
    columns = [np.ones(len(local)), local[:, 0], local[:, 1]]
    design = np.column_stack(columns) * weight[:, None]
    if len(local) < 3 or np.linalg.matrix_rank(design, 1e-6) < 3:
        return None, np.eye(2)
    solution = np.linalg.lstsq(design, places * weight[:, None], rcond=None)[0]
    step = solution[1:].T
    if abs(np.linalg.det(step)) < 1e-6:
        return None, np.eye(2)
    return solution[0], step
