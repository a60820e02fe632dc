"""The pose of a board, and where it puts the circles. Pure NumPy."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from circlepose._typing import FloatArray
from circlepose.boards.homography import homography_rows
from circlepose.geometry.cone import plane_basis

FREE = 6
"""Parameters of a rigid pose."""


@dataclass(frozen=True, slots=True, eq=False)
class RigidPose:
    """Takes the board's coordinates into the camera frame: x -> R x + t."""

    rotation: FloatArray
    """(3, 3) R"""
    translation: FloatArray
    """(3,) t, mm"""

    def moved(self, step: FloatArray) -> RigidPose:
        """Return the pose after a step (6,): a translation, mm, and a rotation vector in camera axes, rad."""
        return RigidPose(rotation_of(step[3:]) @ self.rotation, self.translation + step[:3])


@dataclass(frozen=True, slots=True, eq=False)
class BoardRims:
    """The measured rims of k circles of a board, and their places on it."""

    centers_mm: FloatArray
    """(k, 3) on the board"""
    normals: FloatArray
    """(k, 3) on the board, unit"""
    radius_mm: FloatArray
    """(k,)"""
    factor: FloatArray
    """(k, 3, 3) of the measured cones, camera frame"""
    coefficients: FloatArray
    """(k, 5) of the modes about these factors, most likely"""
    information: FloatArray
    """(k, 5, 5) inverse of their covariance"""

    def __len__(self) -> int:
        return len(self.radius_mm)

    def __getitem__(self, which: object) -> BoardRims:
        """Return those rims that `which` (mask or indices) names."""
        return BoardRims(*(getattr(self, name)[which] for name in self.__slots__))

    def grown(self, growth: float) -> BoardRims:
        """Return the same rims of circles whose radii are larger by the share `growth`."""
        return replace(self, radius_mm=self.radius_mm * (1.0 + growth))


def circles_at(rims: BoardRims, pose: RigidPose, growth: float = 0.0) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return centers (k, 3), normals (k, 3) and radii (k,) of the circles in the camera frame, mm."""
    return (
        rims.centers_mm @ pose.rotation.T + pose.translation,
        rims.normals @ pose.rotation.T,
        rims.radius_mm * (1.0 + growth),
    )


def mirrored(pose: RigidPose, center: FloatArray, normal: FloatArray) -> RigidPose:
    """Return the pose of a board with the other tilt that looks alike from afar.

    The board is turned about `center` (3,), on the board, until its `normal` (3,) is reflected on the line of sight.
    """
    middle = pose.rotation @ center + pose.translation
    sight = middle / np.linalg.norm(middle)
    own = pose.rotation @ normal
    other = 2.0 * (own @ sight) * sight - own
    axis = np.cross(own, other)
    sine, cosine = float(np.linalg.norm(axis)), float(own @ other)
    vector = axis * (np.arctan2(sine, cosine) / sine) if sine > 1e-12 else np.zeros(3)
    turn = rotation_of(vector)
    return RigidPose(turn @ pose.rotation, middle - turn @ pose.rotation @ center)


def pose_of_plane(points_mm: FloatArray, rays: FloatArray, normal: FloatArray) -> RigidPose | None:
    """Return the pose of a planar board from the rays of its centers, as a start: it takes imaged centers for these.

    Parameters
    ----------
    points_mm
        (k, 3) in the board's frame, all in one plane.
    rays
        (k, 3) in the camera frame.
    normal
        (3,) of the plane, towards the viewer.

    Returns
    -------
    None with fewer than four points, or those of one line, or where no pose has them all in front of the camera.
    """
    first, second = plane_basis(normal)
    # In a frame with x, y in the plane and z away from the viewer.
    basis = np.stack([first, second, -normal])
    if np.linalg.det(basis) < 0.0:
        basis = np.stack([second, first, -normal])
    middle = points_mm.mean(axis=0)
    flat = (points_mm - middle) @ basis.T
    extent = float(np.abs(flat[:, :2]).max())
    ahead = rays[:, 2] > 1e-6
    if np.count_nonzero(ahead) < 4 or extent == 0.0:
        return None
    x, y = flat[ahead, 0] / extent, flat[ahead, 1] / extent
    u, v = rays[ahead, 0] / rays[ahead, 2], rays[ahead, 1] / rays[ahead, 2]
    rows = homography_rows(x, y, u, v)
    _, values, vectors = np.linalg.svd(rows, full_matrices=len(rows) < 9)
    if len(values) < 8 or values[7] < 1e-9 * values[0]:
        return None
    found = vectors[-1].reshape(3, 3)
    found = found * np.sign(float(np.median(found[2] @ np.stack([x, y, np.ones_like(x)]))))
    scale = np.sqrt(np.linalg.norm(found[:, 0]) * np.linalg.norm(found[:, 1]))
    across, down, place = found.T / scale
    left, _, right = np.linalg.svd(np.stack([across, down, np.cross(across, down)], axis=1))
    rotation = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right @ basis
    translation = place * extent - rotation @ middle
    if place[2] <= 0.0:
        return None
    return RigidPose(rotation, translation)


def rotation_of(vector: FloatArray) -> FloatArray:
    """Return the rotation (3, 3) about a vector (3,) by its length, rad."""
    angle = float(np.linalg.norm(vector))
    cross = cross_matrix(vector)
    if angle < 1e-8:
        return np.asarray(np.eye(3) + cross + 0.5 * cross @ cross)
    return np.asarray(np.eye(3) + np.sin(angle) / angle * cross + (1.0 - np.cos(angle)) / angle**2 * cross @ cross)


def rotation_between(
    normal: FloatArray, offset: FloatArray, seen_normal: FloatArray, seen_offset: FloatArray
) -> FloatArray:
    """Return the rotation (3, 3) of `normal` to `seen_normal`, and of `offset` as near to `seen_offset` as it can be.

    All (3,), the normals of unit length.
    """
    return _frame(seen_normal, seen_offset) @ _frame(normal, offset).T


def _frame(normal: FloatArray, offset: FloatArray) -> FloatArray:
    across = offset - (offset @ normal) * normal
    length = float(np.linalg.norm(across))
    if length < 1e-9 * float(np.linalg.norm(offset)):
        across = np.cross(normal, [1.0, 0.0, 0.0] if abs(normal[0]) < 0.9 else [0.0, 1.0, 0.0])
        length = float(np.linalg.norm(across))
    x = across / length
    return np.stack([x, np.cross(normal, x), normal], axis=1)


def circle_derivatives(rims: BoardRims, pose: RigidPose) -> FloatArray:
    """Return d circle's pose (center, two tilts) / d pose of the board, (k, 5, 6)."""
    return place_derivatives(rims.centers_mm @ pose.rotation.T, rims.normals @ pose.rotation.T)


def place_derivatives(arm: FloatArray, normals: FloatArray) -> FloatArray:
    """Return (..., 5, 6) how a place and two tilts of a normal move with the pose of the body that they are on.

    `arm` (..., 3) leads from the body's origin to the place, `normals` (..., 3) are unit; all in the camera frame.
    """
    derivatives = np.zeros((*arm.shape[:-1], 5, FREE))
    derivatives[..., :3, :3] = np.eye(3)
    # d x arm = -[arm] d.
    derivatives[..., :3, 3:] = -cross_matrix(arm)
    tilts = np.stack(plane_basis(normals), axis=-2)
    derivatives[..., 3:, 3:] = -tilts @ cross_matrix(normals)
    return derivatives


def cross_matrix(vectors: FloatArray) -> FloatArray:
    """Return (..., 3, 3) the matrices [v] with [v] x = v x x."""
    x, y, z = np.moveaxis(np.asarray(vectors), -1, 0)
    zero = np.zeros_like(x)
    return np.stack(
        [
            np.stack([zero, -z, y], axis=-1),
            np.stack([z, zero, -x], axis=-1),
            np.stack([-y, x, zero], axis=-1),
        ],
        axis=-2,
    )
