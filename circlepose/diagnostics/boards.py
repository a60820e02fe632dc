"""A board of a result, circle by circle: where each is on the board, and how it counts in the pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from circlepose._typing import FloatArray
from circlepose.board_result import BoardCircleFit, BoardResult
from circlepose.results import CircleResult, ImageResult


@dataclass(frozen=True, slots=True, eq=False)
class BoardView:
    """A board with the circles of its layout."""

    board: BoardResult
    circles: tuple[CircleResult, ...]
    """all of the layout, by the board's pose"""
    centers_mm: FloatArray
    """(n, 3) of them, in the board's frame"""

    @property
    def radii_mm(self) -> FloatArray:
        """(n,) of the circles."""
        return np.array([circle.radius_mm for circle in self.circles])

    @property
    def fits(self) -> tuple[BoardCircleFit | None, ...]:
        """How each circle fits the pose; None for those not seen."""
        by_name = {fit.name: fit for fit in self.board.circles}
        return tuple(by_name.get(circle.circle) for circle in self.circles)

    @property
    def spacing_mm(self) -> float:
        """Median distance of the circles from their nearest neighbors: the spacing of a grid."""
        distances = np.asarray(cKDTree(self.centers_mm).query(self.centers_mm, k=2)[0])
        return float(np.median(distances[:, 1]))

    def extreme(self, among: list[int]) -> list[int]:
        """Return which of the circles `among` are the farthest along the diagonals of the board: four, or fewer."""
        if not among:
            return []
        place = self.centers_mm[among, :2]
        ends = (place @ np.array([[-1.0, 1.0, -1.0, 1.0], [-1.0, -1.0, 1.0, 1.0]])).argmax(axis=0)
        return list(dict.fromkeys(among[end] for end in ends.tolist()))


def board_views(result: ImageResult) -> tuple[BoardView, ...]:
    """Return the boards of a result; of several methods with the circles of the first."""
    method = result.circles[0].method if result.circles else ""
    views = []
    for board in result.boards:
        own = tuple(c for c in result.circles if c.instance == board.instance and c.method == method and c.candidates)
        centers = np.array([circle.candidates[board.chosen].center for circle in own]).reshape(-1, 3)
        views.append(BoardView(board, own, (centers - board.pose.translation) @ board.pose.rotation))
    return tuple(views)
