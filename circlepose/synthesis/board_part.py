"""A board of a scene: a layout of circles, posed and painted. A frozen value, mm."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from circlepose._typing import BoolArray, FloatArray, frozen
from circlepose.errors import SceneError
from circlepose.synthesis.surfaces import Circle, Paint
from circlepose.targets import Kind
from circlepose.targets.board import BoardLayout

_UNIT_TOLERANCE = 1e-6
"""Of a rotation's R'R from the identity; numerical."""


@dataclass(frozen=True, eq=False)
class BoardPart:
    """Circles of one rigid layout: the target of kind `board`."""

    translation: FloatArray
    """(3,) mm, the board's origin in the camera frame"""
    rotation: FloatArray
    """(3, 3) from the board's axes to the camera's"""
    layout: BoardLayout
    paints: tuple[Paint, ...]
    """from each radius of a circle inwards to the next; a circle of fewer radii takes the first ones"""

    def __post_init__(self) -> None:
        at, turn = np.array(self.translation, dtype=np.float64), np.array(self.rotation, dtype=np.float64)
        if at.shape != (3,) or turn.shape != (3, 3) or not (np.all(np.isfinite(at)) and np.all(np.isfinite(turn))):
            raise SceneError("board: expected a translation of 3 finite numbers and a rotation of 3 x 3.")
        if np.abs(turn.T @ turn - np.eye(3)).max() > _UNIT_TOLERANCE or np.linalg.det(turn) < 0.0:
            raise SceneError("board: expected a rotation, got a matrix that is none.")
        object.__setattr__(self, "translation", frozen(at))
        object.__setattr__(self, "rotation", frozen(turn))
        most = max(len(circle.radii_mm) for circle in self.layout.circles)
        if len(self.paints) < most:
            raise SceneError(f"board: levels: expected {most}, a circle has as many radii; got {len(self.paints)}.")
        if not self._is_seen.any():
            raise SceneError("board: all of its circles face away from the camera; turn it.")

    @property
    def kind(self) -> Kind:
        """Kind of the target."""
        return "board"

    @property
    def circles(self) -> tuple[Circle, ...]:
        """The truth of each circle's largest radius, in the layout's order, also of those that face away."""
        return tuple(rims[0] for rims in self._rims)

    @property
    def seen_rims(self) -> tuple[tuple[Circle, ...], ...]:
        """The circles that face the camera, each with all its radii, the largest first."""
        return tuple(rims for rims, seen in zip(self._rims, self._is_seen.tolist(), strict=True) if seen)

    @cached_property
    def _centers(self) -> FloatArray:
        """(n, 3) mm, camera frame."""
        return np.asarray(self.layout.centers_mm @ self.rotation.T + self.translation)

    @cached_property
    def _rims(self) -> tuple[tuple[Circle, ...], ...]:
        normals = self.layout.normals @ self.rotation.T
        towards = np.where(np.einsum("ij,ij->i", normals, self._centers)[:, None] <= 0.0, normals, -normals)
        return tuple(
            tuple(Circle(circle.name, center, normal, radius) for radius in circle.radii_mm)
            for circle, center, normal in zip(self.layout.circles, self._centers, towards, strict=True)
        )

    @cached_property
    def _is_seen(self) -> BoolArray:
        """(n,) whether the camera is on the side from which a circle is seen."""
        layout = self.layout
        facing = np.einsum("ij,ij->i", layout.normals @ self.rotation.T, self._centers) < 0.0
        # The axes of a planar list may run either way; it is seen from the side that the file means.
        either = layout.grid is None and layout.is_planar and layout.side != "front"
        return np.ones(len(layout), dtype=np.bool_) if either else np.asarray(facing)
