"""Boards: circles at known places of one rigid thing, as a grid or as a list. No image, no camera.

The frame of a grid has its origin at circle (0, 0), x along a row, y down the rows and z away from the viewer. A list
has any right-handed frame. The normals point to the side from which a circle is seen.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Literal, get_args

import numpy as np

from circlepose import _arguments
from circlepose._typing import BoolArray, FloatArray, IntArray
from circlepose.errors import TargetError
from circlepose.targets.lengths import MAX_RADII

Pattern = Literal["symmetric", "asymmetric", "hexagonal"]
PATTERNS: tuple[Pattern, ...] = get_args(Pattern)
Place = tuple[float, float, float]
MOST_CIRCLES = 10_000
"""Circles of a board; cost."""
_TOWARDS_VIEWER: Place = (0.0, 0.0, -1.0)
_UNIT_TOLERANCE = 1e-3
_FLAT_SHARE = 1e-6
"""Height over a board's extent, up to which it is planar; numerical."""


@dataclass(frozen=True, slots=True)
class BoardCircle:
    """One circle of a board, or concentric ones in one plane."""

    name: str
    center_mm: Place
    """in the board's frame"""
    radii_mm: tuple[float, ...]
    """the largest first"""
    normal: Place = _TOWARDS_VIEWER
    """unit, towards the side from which it is seen"""


@dataclass(frozen=True, slots=True)
class Grid:
    """Circles on a lattice.

    Circle (r, c) is at (c s, r s) in the pattern `symmetric`, at ((2 c + r mod 2) s, r s) in `asymmetric`, and at
    ((c + (r mod 2) / 2) s, r s sqrt(3) / 2) in `hexagonal`, with s the spacing.
    """

    pattern: Pattern
    rows: int
    columns: int
    spacing_mm: float

    def __post_init__(self) -> None:
        _arguments.one_of(PATTERNS, "grid.pattern", self.pattern, TargetError)
        for key in ("rows", "columns"):
            expected = "a whole number of at least 1"
            if _arguments.whole(f"grid.{key}", getattr(self, key), expected, TargetError) < 1:
                raise TargetError(f"grid.{key}: expected {expected}, got {getattr(self, key)}.")
        if self.rows * self.columns < 2:
            raise TargetError("grid.rows, grid.columns: a board has two circles or more; a lone one is kind: circle.")
        if self.rows * self.columns > MOST_CIRCLES:
            raise TargetError(
                f"grid.rows, grid.columns: expected at most {MOST_CIRCLES} circles, got {self.rows} x {self.columns}."
            )
        _arguments.length_mm("grid.spacing_mm", self.spacing_mm, "a positive length in mm", TargetError)

    @property
    def order(self) -> int:
        """Number of turns that map the endless lattice on itself: 4 of a square one, 6 of a hexagonal one."""
        return 6 if self.pattern == "hexagonal" else 4

    @property
    def basis_mm(self) -> FloatArray:
        """(2, 2) the vectors between neighbors, one a row; the second is the first turned by a step of `order`."""
        step = {
            "symmetric": ((1.0, 0.0), (0.0, 1.0)),
            "asymmetric": ((1.0, 1.0), (-1.0, 1.0)),
            "hexagonal": ((1.0, 0.0), (0.5, math.sqrt(0.75))),
        }[self.pattern]
        return self.spacing_mm * np.array(step)

    @property
    def neighbor_mm(self) -> float:
        """Distance of the nearest neighbors."""
        return self.spacing_mm * (math.sqrt(2.0) if self.pattern == "asymmetric" else 1.0)

    def node(self, row: int, column: int) -> tuple[int, int]:
        """Return the coordinates of circle (row, column) in `basis_mm`."""
        if self.pattern == "symmetric":
            return column, row
        if self.pattern == "hexagonal":
            return column - row // 2, row
        across = 2 * column + row % 2
        return (across + row) // 2, (row - across) // 2

    def place_mm(self, row: int, column: int) -> tuple[float, float]:
        """Return x and y of circle (row, column)."""
        x, y = np.array(self.node(row, column)) @ self.basis_mm
        return float(x), float(y)


@dataclass(frozen=True)
class BoardLayout:
    """The circles of a board, and the grid on which they lie, if any."""

    circles: tuple[BoardCircle, ...]
    grid: Grid | None = None
    nodes: tuple[tuple[int, int], ...] | None = None
    """of a grid: the coordinates of each circle in `Grid.basis_mm`"""
    side: Literal["auto", "front", "back"] = "auto"
    """of a planar list: the side from which it is seen; `back` and `auto` allow that its axes run the other way"""

    def __post_init__(self) -> None:
        number = len(self.circles)
        if not 2 <= number <= MOST_CIRCLES:
            raise TargetError(f"circles: a board has 2 to {MOST_CIRCLES} circles, got {number}.")
        names = [circle.name for circle in self.circles]
        twice = next((name for name in names if names.count(name) > 1), None) if len(set(names)) < number else None
        if twice is not None:
            raise TargetError(f"circles: two circles are named {twice!r}; a name stands for one.")
        _check_apart(self)

    @classmethod
    def on_grid(
        cls,
        radius_mm: float,
        grid: Grid,
        marks: Mapping[tuple[int, int], Sequence[float]] | None = None,
        omit: Iterable[tuple[int, int]] = (),
    ) -> BoardLayout:
        """Return a grid of circles of `radius_mm`.

        Parameters
        ----------
        radius_mm
            Of all circles but the marks.
        grid
            The lattice.
        marks
            Radii, the largest first, of the circles (row, column) that are not like the others.
        omit
            The circles (row, column) that are not there.

        Raises
        ------
        TargetError
            For circles that overlap, places outside of the grid, or a mark that is like all others.
        """
        marked = {_on_grid("marks", at, grid): _radii(radii) for at, radii in (marks or {}).items()}
        left_out = {_on_grid("omit", at, grid) for at in omit}
        both = sorted(left_out & set(marked))
        if both:
            raise TargetError(f"marks, omit: circle {list(both[0])} is in both; leave it out of one.")
        usual = _radii([radius_mm])
        like_others = next((at for at, radii in marked.items() if radii == usual), None)
        if like_others is not None:
            raise TargetError(
                f"marks: circle {list(like_others)} has the grid's own radius of {usual[0]:g} mm and so marks "
                "nothing; give the radius that it has, or remove it from marks."
            )
        circles, nodes = [], []
        for row in range(grid.rows):
            for column in range(grid.columns):
                if (row, column) not in left_out:
                    x, y = grid.place_mm(row, column)
                    radii = marked.get((row, column), usual)
                    circles.append(BoardCircle(f"r{row}c{column}", (x, y, 0.0), radii))
                    nodes.append(grid.node(row, column))
        return cls(tuple(circles), grid, tuple(nodes))

    def __len__(self) -> int:
        return len(self.circles)

    @property
    def names(self) -> tuple[str, ...]:
        """Of the circles, in their order."""
        return tuple(circle.name for circle in self.circles)

    @cached_property
    def centers_mm(self) -> FloatArray:
        """(n, 3) in the board's frame."""
        return np.array([circle.center_mm for circle in self.circles])

    @cached_property
    def normals(self) -> FloatArray:
        """(n, 3) unit vectors in the board's frame."""
        return np.array([circle.normal for circle in self.circles])

    @cached_property
    def radius_mm(self) -> FloatArray:
        """(n,) the largest radius of each."""
        return np.array([circle.radii_mm[0] for circle in self.circles])

    @cached_property
    def is_ring(self) -> BoolArray:
        """(n,) which have another circle inside."""
        return np.array([len(circle.radii_mm) > 1 for circle in self.circles])

    @property
    def radii_mm(self) -> tuple[float, ...]:
        """All radii of the board, the largest first, each once."""
        return tuple(sorted({radius for circle in self.circles for radius in circle.radii_mm}, reverse=True))

    @cached_property
    def usual_radius_mm(self) -> float:
        """The largest radius of most circles."""
        values, numbers = np.unique(self.radius_mm, return_counts=True)
        return float(values[len(numbers) - 1 - np.argmax(numbers[::-1])])

    @cached_property
    def node_of(self) -> IntArray:
        """(n, 2) the coordinates of each circle in `Grid.basis_mm`; of a list (0, 2)."""
        return np.array(self.nodes if self.nodes is not None else (), dtype=np.int64).reshape(-1, 2)

    @cached_property
    def index_of_node(self) -> dict[tuple[int, int], int]:
        """The circle at each node of a grid."""
        return {(a, b): i for i, (a, b) in enumerate(self.node_of.tolist())}

    @cached_property
    def seen_from_behind(self) -> BoardLayout:
        """The same list with its circles seen from the other side."""
        circles = tuple(
            replace(circle, normal=(-circle.normal[0], -circle.normal[1], -circle.normal[2]))
            for circle in self.circles
        )
        return replace(self, circles=circles)

    @cached_property
    def front_axes(self) -> FloatArray:
        """(2, 3) of a planar layout: unit vectors to the right and down as one looks at its front.

        The first is the board's x as far as it lies in the plane; where x runs away from the viewer, it is y.
        """
        normal = self.normals[0]
        along = np.array([1.0, 0.0, 0.0]) if abs(normal[0]) < 1.0 - _UNIT_TOLERANCE else np.array([0.0, 1.0, 0.0])
        right = along - (along @ normal) * normal
        right /= np.linalg.norm(right)
        return np.stack([right, np.cross(right, normal)])

    @property
    def is_planar(self) -> bool:
        """Whether all circles lie in one plane and face one side."""
        normal = self.normals[0]
        heights = (self.centers_mm - self.centers_mm[0]) @ normal
        extent = float(np.ptp(self.centers_mm, axis=0).max())
        return bool(
            np.abs(heights).max() <= _FLAT_SHARE * extent and (self.normals @ normal > 1.0 - _UNIT_TOLERANCE).all()
        )


def _radii(radii: Sequence[float]) -> tuple[float, ...]:
    checked = tuple(
        _arguments.length_mm("radius_mm", radius, "a positive radius in mm (not a diameter)", TargetError)
        for radius in radii
    )
    if not 1 <= len(checked) <= MAX_RADII or any(a <= b for a, b in pairwise(checked)):
        raise TargetError(f"radii_mm: expected 1 to {MAX_RADII} radii in mm, the largest first, got {list(checked)}.")
    return checked


def _on_grid(key: str, at: object, grid: Grid) -> tuple[int, int]:
    expected = f"[row, column] with 0 <= row < {grid.rows} and 0 <= column < {grid.columns}"
    parts = _arguments.parts(key, at, expected, TargetError)
    if len(parts) != 2:
        raise TargetError(f"{key}: expected {expected}, got {_arguments.shown(at)}.")
    row, column = (_arguments.whole(key, part, expected, TargetError) for part in parts)
    if not (0 <= row < grid.rows and 0 <= column < grid.columns):
        raise TargetError(f"{key}: expected {expected}, got [{row}, {column}].")
    return row, column


def _check_apart(layout: BoardLayout) -> None:
    """Refuse circles of one plane that overlap, and those at one place."""
    centers, normals, radius = layout.centers_mm, layout.normals, layout.radius_mm
    order = np.argsort(centers[:, 0], kind="stable")
    reach = 2.0 * float(radius.max())
    for at, i in enumerate(order.tolist()):
        after = order[at + 1 :]
        near = after[: int(np.searchsorted(centers[after, 0], centers[i, 0] + reach))]
        offset = centers[near] - centers[i]
        apart = np.linalg.norm(offset, axis=1)
        is_in_plane = (np.abs(offset @ normals[i]) < 0.1 * radius[i]) & (normals[near] @ normals[i] > 0.9)
        bad = near[is_in_plane & (apart < radius[near] + radius[i])]
        if len(bad):
            first, second = sorted((i, int(bad[0])))
            distance = float(np.linalg.norm(centers[first] - centers[second]))
            raise TargetError(
                f"circles {layout.circles[first].name} and {layout.circles[second].name} overlap: their centers are "
                f"{distance:g} mm apart, their radii {radius[first]:g} and {radius[second]:g} mm; "
                "give a radius (not a diameter), or a wider spacing."
            )
