"""A board of a result, circle by circle: where each is on the board, and how it counts in the pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from circlepose._typing import FloatArray
from circlepose.board_result import BoardCircleFit, BoardResult
from circlepose.camera.camera import Camera, circle_contour
from circlepose.results import CircleResult, ImageResult

_STEP = 0.05
"""Radii; of difference quotients."""
_RIM_POINTS = 72


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

    @property
    def side(self) -> float:
        """-1 for a board whose z axis points to the viewer, who has its x axis the other way, or else 1."""
        pose = self.board.pose
        middle = pose.translation + pose.rotation @ self.centers_mm.mean(axis=0)
        return 1.0 if float(pose.rotation[:, 2] @ middle) >= 0.0 else -1.0

    def worst(self, number: int) -> list[int]:
        """Return up to `number` circles, those first that misfit the most in standard deviations of their rims."""
        sigmas = {i: fit.sigmas for i, fit in enumerate(self.fits) if fit is not None}
        return sorted(sigmas, key=lambda i: -sigmas[i])[:number]

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


@dataclass(frozen=True, slots=True)
class Unseen:
    """Circles of a board that were not seen, as indices, by where the pose puts their rims."""

    outside: tuple[int, ...]
    """outside the image, or where the lens model sees nothing"""
    cut: tuple[int, ...]
    """cut by the image's border"""
    within: tuple[int, ...]
    """wholly within the image"""


def unseen(view: BoardView, camera: Camera, image_size: tuple[int, int]) -> Unseen:
    """Return which circles of a board were not seen, and where they should be.

    Parameters
    ----------
    view
        The board.
    camera
        Of the image that was measured.
    image_size
        Its width and height, px.
    """
    places: dict[str, list[int]] = {"outside": [], "cut": [], "within": []}
    for i, (circle, fit) in enumerate(zip(view.circles, view.fits, strict=True)):
        if fit is not None:
            continue
        pose = circle.candidates[view.board.chosen]
        rim = circle_contour(camera, pose.center, pose.normal, circle.radius_mm, _RIM_POINTS)
        with np.errstate(invalid="ignore"):
            inside = ((rim >= -0.5) & (rim <= np.array(image_size) - 0.5)).all(axis=1)
        places["within" if inside.all() else "cut" if inside.any() else "outside"].append(i)
    return Unseen(**{name: tuple(found) for name, found in places.items()})


def front_mm(view: BoardView) -> FloatArray:
    """Return the places (n, 2) of a board's circles in its plane, mm, as the viewer has them: x right, y down."""
    return view.centers_mm[:, :2] * [view.side, 1.0]


def residuals_mm(view: BoardView, camera: Camera) -> tuple[FloatArray, FloatArray]:
    """Return the residuals of the circles on the board.

    Parameters
    ----------
    view
        The board.
    camera
        Of the image that was measured.

    Returns
    -------
    The residuals (n, 2) in mm and in the axes of `front_mm`, NaN for circles that were not seen; and how large a mm
    of the board is at each circle (n,), px.
    """
    pose = view.board.pose
    centers = pose.translation + view.centers_mm @ pose.rotation.T
    step = _STEP * view.radii_mm[:, None]
    axes = pose.rotation[:, :2].T * np.array([[view.side], [1.0]])
    ends = [(camera.project(centers + step * axis), camera.project(centers - step * axis)) for axis in axes]
    jacobian = np.stack([(after - before) / (2.0 * step) for after, before in ends], axis=-1)
    determinant = np.abs(np.linalg.det(jacobian))
    found = np.full((len(view.circles), 2), np.nan)
    for i, fit in enumerate(view.fits):
        if fit is not None and determinant[i] > 0.0:
            found[i] = np.linalg.solve(jacobian[i], fit.residual_px)
    return found, np.sqrt(determinant)
