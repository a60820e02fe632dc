"""The terms of a pose's covariance that the errors of the camera and of the radius add to the image's noise.

The pixels of a rim are measured, so the pose compensates an error of the camera or of the radius. With the
rim's points X(pose) projected by the camera to q, and n the direction across the rim in the image, the pose moves by
dx = -(A'A)^-1 A'B dk for an error dk of the camera, where A = n . dq/dpose and B = n . dq/dk: least squares over the
rim, and without a remainder for a lone circle and no distortion. Both errors are the same in every image, so they do
not average out. Pure NumPy.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from circlepose._typing import FloatArray
from circlepose.camera.camera import EXACT, Camera
from circlepose.geometry.cone import factor_from_circle, plane_basis, principal_frame
from circlepose.results import Candidate, CircleResult, CovarianceTerms
from circlepose.targets.target import Target
from circlepose.uncertainty.pose_covariance import is_first_order

TERMS = ("image", "camera", "radius")
_SAMPLES = 64
_SAME_NORMAL = 1e-9
_SAME_AXIS = 1e-6
"""Distance of a center from the other's axis, as a share of its depth, below which both are on one."""


def with_all_terms(circles: Iterable[CircleResult], camera: Camera, target: Target) -> list[CircleResult]:
    """Add the terms of the camera's and the radius' own errors to the covariances of `circles`, of one image.

    Circles of one target whose candidates share a normal and its axis were measured together, and move together. A
    covariance goes where, with all terms, first order does not hold any more.
    """
    results = list(circles)
    if camera.sigma == EXACT and target.radius_sigma_mm == 0.0:
        return results
    return [
        replace(
            circle,
            candidates=tuple(
                _with_terms(
                    candidate, circle, [o for o in results if _same_target(o, circle)], number, camera, target
                )
                for number, candidate in enumerate(circle.candidates)
            ),
        )
        for circle in results
    ]


def camera_term(
    camera: Camera, center: FloatArray, normal: FloatArray, rims: Sequence[tuple[float, float]]
) -> FloatArray:
    """Return the covariance (5, 5) that `camera.sigma` gives a pose; see `camera_slopes`."""
    moves = camera_slopes(camera, center, normal, rims) * camera_deviations(camera)
    return np.asarray(moves @ moves.T)


def camera_deviations(camera: Camera) -> FloatArray:
    """Return the standard deviations (3,) of the focal length, as a share, and of the principal point, px."""
    relative = camera.sigma.focal_px / float(np.sqrt(camera.camera_matrix[0, 0] * camera.camera_matrix[1, 1]))
    return np.array([relative, camera.sigma.center_px, camera.sigma.center_px])


def camera_slopes(
    camera: Camera, center: FloatArray, normal: FloatArray, rims: Sequence[tuple[float, float]]
) -> FloatArray:
    """Return how a measured pose changes with the camera that it is measured with, the pixels staying as they are.

    Parameters
    ----------
    camera
        The camera, its lens model included.
    center, normal
        (3,) the pose.
    rims
        Radius of each circle that the pose was measured by, and how far its center is from `center` along `normal`;
        in the unit of `center`. One circle, or all rings of a target.

    Returns
    -------
    (5, 3): center (three) and two tilts (rad) towards the vectors of `cone.plane_basis(normal)`, per relative change
    of the focal length, per px of the principal point along x and along y.
    """
    by_pose, by_camera = (
        np.concatenate(parts)
        for parts in zip(*(rim_slopes(camera, center, normal, radius, along) for radius, along in rims), strict=True)
    )
    return compensation(by_pose, by_camera, float(np.linalg.norm(center)))


def compensation(by_pose: FloatArray, by_camera: FloatArray, distance: float) -> FloatArray:
    """Return how a pose moves (p, 3) so that rims stay where they are seen, per change of the camera.

    Parameters
    ----------
    by_pose, by_camera
        (n, p) and (n, 3): how samples of the rims move with the pose, a place before its angles, and with the camera.
    distance
        Of the place, in its unit.
    """
    # In shares of the distance all parameters are of one kind.
    scale = np.array([distance] * 3 + [1.0] * (by_pose.shape[1] - 3))
    return np.asarray(-np.linalg.lstsq(by_pose * scale, by_camera, rcond=None)[0] * scale[:, None])


def radius_term(center: FloatArray, relative_sigma: float) -> FloatArray:
    """Return the covariance (5, 5) that an error of the radius, as a share of it, brings: the distance scales."""
    moved = np.array([*center, 0.0, 0.0]) * relative_sigma
    return np.outer(moved, moved)


def shares(terms: CovarianceTerms) -> dict[str, tuple[float, float]]:
    """Return the share of each term in the variances of the position and of the normal."""
    total = terms.total
    position, tilt = float(np.trace(total[:3, :3])), float(np.trace(total[3:, 3:]))
    parts = {name: getattr(terms, name) for name in TERMS}
    return {
        name: (0.0, 0.0)
        if term is None
        else (float(np.trace(term[:3, :3])) / position, float(np.trace(term[3:, 3:])) / tilt)
        for name, term in parts.items()
    }


def _with_terms(
    candidate: Candidate,
    circle: CircleResult,
    together: Sequence[CircleResult],
    number: int,
    camera: Camera,
    target: Target,
) -> Candidate:
    if candidate.covariance is None:
        return candidate
    center, normal = candidate.center, candidate.normal
    rims = [rim for other in together if (rim := _rim_of(other, number, candidate)) is not None]
    relative = target.radius_sigma_mm / target.radii_mm[0]
    moves = None if camera.sigma == EXACT else camera_slopes(camera, center, normal, rims) * camera_deviations(camera)
    terms = CovarianceTerms(
        image=candidate.covariance,
        camera=None if moves is None else np.asarray(moves @ moves.T),
        radius=None if relative == 0.0 else radius_term(center, relative),
        camera_moves=moves,
    )
    total = terms.total
    axis = principal_frame(_factor(candidate, circle)).rotation[:, 2]
    if not (np.all(np.isfinite(total)) and is_first_order(axis, normal, total)):
        return replace(candidate, covariance=None)
    return replace(candidate, covariance=total, covariance_terms=terms)


def _factor(candidate: Candidate, circle: CircleResult) -> FloatArray:
    return factor_from_circle(candidate.center, candidate.normal, circle.radius_mm)


def _same_target(one: CircleResult, other: CircleResult) -> bool:
    return one.instance == other.instance and one.method == other.method


def _rim_of(circle: CircleResult, number: int, candidate: Candidate) -> tuple[float, float] | None:
    """Return radius and position along the axis of a circle that shares its pose with `candidate`, or None."""
    if number >= len(circle.candidates):
        return None
    other = circle.candidates[number]
    away = other.center - candidate.center
    along = float(away @ candidate.normal)
    aside = float(np.linalg.norm(away - along * candidate.normal))
    is_one = float(np.linalg.norm(other.normal - candidate.normal)) < _SAME_NORMAL
    if not is_one or aside > _SAME_AXIS * float(np.linalg.norm(candidate.center)):
        return None
    return circle.radius_mm, along


def rim_slopes(
    camera: Camera, center: FloatArray, normal: FloatArray, radius: float, along: float
) -> tuple[FloatArray, FloatArray]:
    """Return how the rim moves across itself, in px, with the pose (n, 5) and with the camera (n, 3).

    Weighted by the length of the rim that each sample represents.
    """
    basis = np.stack(plane_basis(normal))
    angle = np.linspace(0.0, 2.0 * np.pi, _SAMPLES, endpoint=False)
    cos, sin = np.cos(angle)[:, None], np.sin(angle)[:, None]
    in_plane = radius * (cos * basis[0] + sin * basis[1])
    pixels, jacobians = camera.project_with_jacobian(center + along * normal + in_plane)
    tangent = np.einsum("nij,nj->ni", jacobians, radius * (cos * basis[1] - sin * basis[0]))
    # Its length is that of the rim per sample.
    across = np.stack([tangent[:, 1], -tangent[:, 0]], axis=-1)
    across = across / np.sqrt(np.linalg.norm(across, axis=-1, keepdims=True))
    # A tilt turns the normal to a vector of the basis, and the plane with it.
    tilted = along * basis - (in_plane @ basis.T)[..., None] * normal
    by_point = np.einsum("ni,nij->nj", across, jacobians)
    by_pose = np.concatenate([by_point, np.einsum("nj,nkj->nk", by_point, tilted)], axis=-1)
    # fx and fy together, by a share of themselves: all distances from the principal point grow by it.
    by_focal = np.einsum("ni,ni->n", across, pixels - camera.camera_matrix[:2, 2])
    return _finite(by_pose, np.column_stack([by_focal, across]))


def _finite(by_pose: FloatArray, by_camera: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Leave out samples outside the valid field of the lens model."""
    seen = np.all(np.isfinite(by_pose), axis=1) & np.all(np.isfinite(by_camera), axis=1)
    return by_pose[seen], by_camera[seen]
