"""Distances and angles of the circles of an image, with the standard deviations of both. Pure NumPy.

The errors of two circles are joint. The camera and the scale of the target are the same for both, so that their
errors move both together. The noise of the image is independent for lone circles. Circles of one board move as one
body, so that it changes nothing between them.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from circlepose._typing import BoolArray, FloatArray, IntArray
from circlepose.geometry.cone import plane_basis
from circlepose.results import Candidate, CircleResult, ImageResult

_PARAMETERS = 5
"""of a pose: center, and two tilts"""
_CAMERA = 3
_BLOCK = 50_000
"""Pairs at a time; memory."""
_LEAST = 1e-12
"""Length below which a direction is none; of distances as a share of the larger one from the camera; numerical."""


@dataclass(frozen=True, slots=True, eq=False)
class PlacedCircles:
    """The chosen poses of n circles, camera frame, with all that their covariance is the sum of."""

    circles: tuple[CircleResult, ...]
    centers: FloatArray
    """(n, 3) mm"""
    normals: FloatArray
    """(n, 3) unit"""
    image: FloatArray
    """(n, 5, 5) term of the image, as `Candidate.covariance`; NaN where there is none"""
    camera_moves: FloatArray
    """(n, 5, 3) as `CovarianceTerms.camera_moves`; 0 where the camera is exact"""
    radius_moves: FloatArray
    """(n, 5) how the pose moves with one standard deviation of the scale; 0 where that is exact"""
    body: IntArray
    """(n,) number of the rigid body; circles of one number were measured together"""
    is_board: BoolArray
    """(n,) whether the body is a board, whose circles have no errors of their own"""

    def __len__(self) -> int:
        return len(self.circles)


@dataclass(frozen=True, slots=True, eq=False)
class CirclePairs:
    """All p pairs of the circles of an image, the first of a pair before the second; NaN where nothing is known."""

    first: IntArray
    """(p,) indices of the circles"""
    second: IntArray
    """(p,)"""
    distance_mm: FloatArray
    """(p,) of the centers"""
    sigma_mm: FloatArray
    """(p,) its standard deviation"""
    angle_deg: FloatArray
    """(p,) of the normals"""
    sigma_deg: FloatArray
    """(p,) its standard deviation, along the direction in which the normals differ"""


def placed_circles(result: ImageResult) -> PlacedCircles:
    """Return the circles of an image that have a pose, by their chosen candidates."""
    circles = tuple(circle for circle in result.circles if circle.pose is not None)
    poses = [circle.candidates[circle.chosen] for circle in circles]
    boards = {board.instance for board in result.boards}
    bodies: dict[tuple[int, str], int] = {}
    return PlacedCircles(
        circles,
        centers=np.array([pose.center for pose in poses]).reshape(-1, 3),
        normals=np.array([pose.normal for pose in poses]).reshape(-1, 3),
        image=np.array([_image_term(pose) for pose in poses]).reshape(-1, _PARAMETERS, _PARAMETERS),
        camera_moves=np.array([_camera_moves(pose) for pose in poses]).reshape(-1, _PARAMETERS, _CAMERA),
        radius_moves=np.array([_radius_moves(pose) for pose in poses]).reshape(-1, _PARAMETERS),
        body=np.array([bodies.setdefault((each.instance, each.method), len(bodies)) for each in circles], np.intp),
        is_board=np.array([circle.instance in boards for circle in circles], np.bool_),
    )


def circle_pairs(placed: PlacedCircles) -> CirclePairs:
    """Return distance and angle of each two circles by one method, to first order in their errors.

    The angle of two normals that are nearly parallel is mostly noise; its deviation is that of their difference along
    its own direction, and where they are parallel to the last bit the largest in any direction. Circles of one ring
    target have NaN as deviations: how their errors go together is not kept.
    """
    first, second = np.triu_indices(len(placed), k=1)
    methods = np.array([circle.method for circle in placed.circles])
    alike = methods[first] == methods[second]
    first, second = first[alike], second[alike]
    starts = range(0, max(len(first), 1), _BLOCK)
    blocks = [_pairs_of(placed, first[i : i + _BLOCK], second[i : i + _BLOCK]) for i in starts]
    return CirclePairs(
        *(np.concatenate([getattr(block, field.name) for block in blocks]) for field in fields(CirclePairs))
    )


def _pairs_of(placed: PlacedCircles, first: IntArray, second: IntArray) -> CirclePairs:
    apart = placed.centers[first] - placed.centers[second]
    distance = np.linalg.norm(apart, axis=1)
    far = np.linalg.norm(placed.centers, axis=1)
    some = distance > _LEAST * np.maximum(far[first], far[second])
    # d distance / d pose of the first; of the second it is the opposite.
    along = np.where(some[:, None], apart / np.where(some, distance, 1.0)[:, None], 0.0)
    slopes = np.zeros((len(first), 1, _PARAMETERS))
    slopes[:, 0, :3] = along
    variance = _variance(placed, first, second, slopes, -slopes)[:, 0, 0]

    normals = placed.normals[first], placed.normals[second]
    angle = 2.0 * np.arctan2(
        np.linalg.norm(normals[0] - normals[1], axis=1), np.linalg.norm(normals[0] + normals[1], axis=1)
    )
    by_first, by_second = _normal_slopes(*normals)
    spread = _variance(placed, first, second, by_first, by_second)
    return CirclePairs(
        first,
        second,
        distance_mm=distance,
        sigma_mm=np.where(some, _root(variance), np.nan),
        angle_deg=np.degrees(angle),
        sigma_deg=np.degrees(_angle_deviation(spread, angle)),
    )


def _normal_slopes(first: FloatArray, second: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return d (second - first) / d pose of each, (p, 2, 5): as seen along two arcs, with the angle and across it.

    The first arc leads from the first normal to the second. The rate at which a normal turns is the tangent of its
    arc, which is another at each end.
    """
    axis = np.cross(first, second)
    sine = np.linalg.norm(axis, axis=1, keepdims=True)
    # Parallel normals: any direction will do.
    across = np.where(sine > _LEAST, axis / np.where(sine > _LEAST, sine, 1.0), plane_basis(first)[0])
    slopes = []
    for normal, sign in ((first, -1.0), (second, 1.0)):
        tangents = np.stack([np.cross(across, normal), across], axis=1)
        own = np.zeros((len(normal), 2, _PARAMETERS))
        own[:, :, 3:] = sign * tangents @ np.swapaxes(np.stack(plane_basis(normal), axis=-2), -1, -2)
        slopes.append(own)
    return slopes[0], slopes[1]


def _angle_deviation(spread: FloatArray, angle: FloatArray) -> FloatArray:
    """Return the deviation of angles (p,) whose difference has the covariance `spread` (p, 2, 2), rad."""
    (xx, xy), (_, yy) = np.moveaxis(spread, 0, -1)
    largest = 0.5 * (xx + yy) + np.hypot(0.5 * (xx - yy), xy)
    return _root(np.where(angle > _LEAST, xx, largest))


def _variance(
    placed: PlacedCircles, first: IntArray, second: IntArray, by_first: FloatArray, by_second: FloatArray
) -> FloatArray:
    """Return the covariance (p, m, m) of what changes with two poses by slopes (p, m, 5) each."""
    camera = by_first @ placed.camera_moves[first] + by_second @ placed.camera_moves[second]
    radius = by_first @ placed.radius_moves[first][..., None] + by_second @ placed.radius_moves[second][..., None]
    image = _spread(by_first, placed.image[first]) + _spread(by_second, placed.image[second])
    together = (placed.body[first] == placed.body[second])[:, None, None]
    rigid = together & placed.is_board[first][:, None, None]
    # The poses of one board have one error, which turns and moves all of it; a covariance that is missing stays so.
    image = np.where(rigid, 0.0 * image, np.where(together, np.nan, image))
    camera = np.where(rigid, 0.0, camera)
    return np.asarray(image + camera @ np.swapaxes(camera, -1, -2) + radius @ np.swapaxes(radius, -1, -2))


def _spread(slopes: FloatArray, covariance: FloatArray) -> FloatArray:
    return np.asarray(slopes @ covariance @ np.swapaxes(slopes, -1, -2))


def _root(variance: FloatArray) -> FloatArray:
    return np.sqrt(np.maximum(variance, 0.0))


def _image_term(pose: Candidate) -> FloatArray:
    if pose.covariance is None:
        return np.full((_PARAMETERS, _PARAMETERS), np.nan)
    return pose.covariance if pose.covariance_terms is None else pose.covariance_terms.image


def _camera_moves(pose: Candidate) -> FloatArray:
    terms = pose.covariance_terms
    if terms is None or terms.camera is None:
        return np.zeros((_PARAMETERS, _CAMERA))
    # Without them nobody knows how two circles move together.
    return np.full((_PARAMETERS, _CAMERA), np.nan) if terms.camera_moves is None else terms.camera_moves


def _radius_moves(pose: Candidate) -> FloatArray:
    """Return the root of the term of the radius: a larger circle is farther away, along its line of sight."""
    moves = np.zeros(_PARAMETERS)
    terms = pose.covariance_terms
    if terms is not None and terms.radius is not None:
        away = pose.center / np.linalg.norm(pose.center)
        moves[:3] = away * np.sqrt(max(float(away @ terms.radius[:3, :3] @ away), 0.0))
    return moves
