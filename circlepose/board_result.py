"""Results of boards: one rigid pose from many circles."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from circlepose._typing import FloatArray
from circlepose.flags import Flag


def quaternion_of(rotation: FloatArray) -> FloatArray:
    """Return w, x, y, z of a rotation (3, 3), w not negative. Source: Bar-Itzhack (2000), the eigenvector of K."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = rotation
    k = np.array(
        [
            [xx + yy + zz, zy - yz, xz - zx, yx - xy],
            [zy - yz, xx - yy - zz, xy + yx, xz + zx],
            [xz - zx, xy + yx, yy - xx - zz, yz + zy],
            [yx - xy, xz + zx, yz + zy, zz - xx - yy],
        ]
    )
    found = np.linalg.eigh(k)[1][:, -1]
    return np.asarray(found if found[0] >= 0.0 else -found)


@dataclass(frozen=True, slots=True, eq=False)
class BoardTerms:
    """What a board's covariance is the sum of, by cause; each (6, 6) as `BoardPose.covariance`, None if exact."""

    image: FloatArray
    """noise of the image, and whatever else makes the rims misfit"""
    camera: FloatArray | None = None
    """error of the focal length and the principal point; the same error in every image of the camera"""
    radius: FloatArray | None = None
    """error of the layout's scale; the same error in every image of the board"""
    camera_moves: FloatArray | None = None
    """(6, 3) how the pose moves with one standard deviation of the focal length, of the principal point's x and of
    its y; `camera` is `camera_moves @ camera_moves.T`"""

    @property
    def total(self) -> FloatArray:
        """The sum of all terms, (6, 6)."""
        return sum((term for term in (self.camera, self.radius) if term is not None), self.image)


@dataclass(frozen=True, slots=True, eq=False)
class BoardPose:
    """One possible pose of a board: takes its coordinates into the camera frame."""

    rotation: FloatArray
    """(3, 3) of the board's axes in the camera frame"""
    translation: FloatArray
    """(3,) mm, the board's origin in the camera frame"""
    covariance: FloatArray
    """(6, 6) of the origin (mm) and of a rotation vector in camera axes about it (rad)"""
    terms: BoardTerms
    """its terms"""
    rms_px: float
    """rms distance of the rims' centers from where the pose puts them"""

    @property
    def quaternion(self) -> FloatArray:
        """(4,) w, x, y, z of the rotation, w not negative."""
        return quaternion_of(self.rotation)

    @property
    def transform(self) -> FloatArray:
        """(4, 4) from the board's frame to the camera's, mm."""
        transform = np.eye(4)
        transform[:3, :3], transform[:3, 3] = self.rotation, self.translation
        return transform

    @property
    def sigma_mm(self) -> FloatArray:
        """(3,) standard deviations of the origin along x, y and z, mm."""
        return np.sqrt(np.maximum(self.covariance.diagonal()[:3], 0.0))

    @property
    def sigma_deg(self) -> FloatArray:
        """(3,) standard deviations of the rotation about the camera's x, y and z, deg."""
        return np.degrees(np.sqrt(np.maximum(self.covariance.diagonal()[3:], 0.0)))


@dataclass(frozen=True, slots=True, eq=False)
class BoardCircleFit:
    """How a circle of a board fits the board's pose."""

    name: str
    is_used: bool
    """whether the pose rests on it; else it misfits too much"""
    residual_px: FloatArray
    """(2,) from where the pose puts the center of its image to where that is"""
    sigmas: float
    """root of its misfit's mean over the five modes, in standard deviations of the rim"""


@dataclass(frozen=True, slots=True, eq=False)
class BoardResult:
    """A board in an image."""

    instance: int
    """number of the board in the image, from 0"""
    candidates: tuple[BoardPose, ...]
    """one or two, the better first"""
    ambiguity: float
    """probability that the first is the wrong one; of the tilt alone, not of a roll that the layout leaves open"""
    circles: tuple[BoardCircleFit, ...]
    """those that were seen"""
    circles_in_layout: int
    flags: tuple[Flag, ...] = ()
    growth: float = 0.0
    """share by which the radii are larger than stated, by the distances of the circles; 0 where they are as stated"""
    chosen: int = field(default=0)
    misfits: tuple[str, ...] = ()
    """circles that are seen, but not where the layout puts them, or of another size"""

    @property
    def pose(self) -> BoardPose:
        """The chosen candidate."""
        return self.candidates[self.chosen]

    @property
    def circles_used(self) -> int:
        """Number of circles that the pose rests on."""
        return sum(circle.is_used for circle in self.circles)

    def __repr__(self) -> str:
        place = ", ".join(f"{value:.3f}" for value in self.pose.translation.tolist())
        turn = math.degrees(2.0 * math.acos(min(1.0, float(self.pose.quaternion[0]))))
        return (
            f"BoardResult({self.instance}, {self.circles_used} of {self.circles_in_layout} circles, "
            f"origin ({place}) mm, turned {turn:.2f} deg, ambiguity {self.ambiguity:.2g})"
        )
