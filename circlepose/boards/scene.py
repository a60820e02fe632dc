"""The rims of an image as boards need them: what each says of its cone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from circlepose._typing import BoolArray, FloatArray, IntArray
from circlepose.boards.constellation import Sighting
from circlepose.boards.pose import BoardRims
from circlepose.camera.camera import Camera
from circlepose.fitting.observations import Observations
from circlepose.geometry.cone_perturbation import MODES
from circlepose.geometry.ellipse import Ellipse
from circlepose.measurement.rim import Rim, modes_covariance
from circlepose.rings.evidence import evidence_of_rim
from circlepose.targets.board import BoardLayout


class Scene:
    """The rims of an image with what each says of its cone, computed where it is asked for."""

    def __init__(
        self,
        rims: Sequence[Rim],
        camera: Camera,
        image_size: tuple[int, int],
        seen: Sighting,
        is_ring: BoolArray | None = None,
    ) -> None:
        self.rims, self.camera, self.image_size, self.seen, self.is_ring = rims, camera, image_size, seen, is_ring
        self.ellipse = Ellipse.batch([rim.ellipse for rim in rims])
        self.rays = camera.rays(self.ellipse.center)
        self._evidence: dict[int, tuple[FloatArray, FloatArray]] = {}

    def board_rims(self, layout: BoardLayout, members: IntArray, circles: IntArray) -> BoardRims:
        """Return the rims `members` (k,) as those of the layout's `circles` (k,), by their largest radii."""
        evidence = [self.evidence(i) for i in members.tolist()]
        return BoardRims(
            layout.centers_mm[circles],
            layout.normals[circles],
            layout.radius_mm[circles],
            np.stack([self.rims[i].cone.factor for i in members.tolist()]),
            np.stack([coefficients for coefficients, _ in evidence]),
            np.stack([information for _, information in evidence]),
        )

    def others(self, taken: set[int]) -> IntArray:
        """Return the indices of the rims that are not `taken`."""
        return np.array([i for i in range(len(self.rims)) if i not in taken], np.int64)

    def evidence(self, i: int) -> tuple[FloatArray, FloatArray]:
        """Return coefficients (5,) and information (5, 5) of the modes of rim i."""
        if i not in self._evidence:
            rim = self.rims[i]
            covariance = modes_covariance(rim)
            if covariance is not None and np.all(np.linalg.eigvalsh(covariance) > 0.0):
                self._evidence[i] = np.zeros(MODES), np.asarray(np.linalg.inv(covariance))
            else:
                found = evidence_of_rim(rim, 1.0, Observations.of(self.camera, rim.points))
                self._evidence[i] = found.coefficients, found.information
        return self._evidence[i]
