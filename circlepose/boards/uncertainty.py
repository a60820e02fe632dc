"""What the errors of the camera and of the layout's scale add to the covariance of a board's pose.

As `uncertainty.systematic` does for one circle: the pixels of all rims are measured, and the pose compensates for the
camera by least squares over them. Pure NumPy.
"""

from __future__ import annotations

import numpy as np

from circlepose._typing import FloatArray
from circlepose.board_result import BoardTerms
from circlepose.boards.pose import BoardRims, RigidPose, circle_derivatives, circles_at
from circlepose.camera.camera import EXACT, Camera
from circlepose.uncertainty.systematic import camera_deviations, compensation, rim_slopes

_MOST_RIMS = 60
"""Rims of a board that the camera's errors are followed through; the others move alike; cost."""


def board_terms(
    image: FloatArray, camera: Camera, rims: BoardRims, pose: RigidPose, relative_sigma: float
) -> BoardTerms:
    """Return the terms of a board's covariance.

    Parameters
    ----------
    image
        (6, 6) the term of the image.
    camera
        With the standard deviations of its focal length and principal point.
    rims
        Those that the pose rests on.
    pose
        Of the board.
    relative_sigma
        Standard deviation of all its lengths together, as a share.
    """
    moved = np.array([*pose.translation, 0.0, 0.0, 0.0]) * relative_sigma
    moves = None if camera.sigma == EXACT else _camera_moves(camera, rims, pose)
    return BoardTerms(
        # An inverse is symmetric to rounding alone.
        image=0.5 * (image + image.T),
        camera=None if moves is None else np.asarray(moves @ moves.T),
        radius=None if relative_sigma == 0.0 else np.outer(moved, moved),
        camera_moves=moves,
    )


def _camera_moves(camera: Camera, rims: BoardRims, pose: RigidPose) -> FloatArray:
    """Return how the pose moves (6, 3) with one standard deviation of each parameter of the camera."""
    every = -(-len(rims) // _MOST_RIMS)
    some = rims[np.arange(0, len(rims), every)]
    centers, normals, radii = circles_at(some, pose)
    chains = circle_derivatives(some, pose)
    by_pose, by_camera = [], []
    for center, normal, radius, chain in zip(centers, normals, radii.tolist(), chains, strict=True):
        own, lens = rim_slopes(camera, center, normal, radius, 0.0)
        by_pose.append(own @ chain)
        by_camera.append(lens)
    distance = max(float(np.linalg.norm(pose.translation)), 1e-9)
    moves = compensation(np.concatenate(by_pose), np.concatenate(by_camera), distance)
    return np.asarray(moves * camera_deviations(camera))
