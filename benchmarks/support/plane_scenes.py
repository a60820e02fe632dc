"""Simulated scenes of lone circles, some of them in planes: both candidates of each, and the truth.

A rim is the true one plus a sample of its five modes, whose covariance follows from the noise of the edge. So the
candidates have the errors that their covariances state, and no image is needed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from circlepose._typing import FloatArray, IntArray
from circlepose.geometry.cone import factor_from_circle, plane_basis, principal_frame
from circlepose.geometry.cone_perturbation import grown, mode_shapes
from circlepose.geometry.ellipse import Ellipse
from circlepose.results import Candidate, CircleResult, Flag
from circlepose.solvers.chen_huang import poses_from_frame
from circlepose.uncertainty.pose_covariance import pose_covariances

FOCAL_PX = 1200.0
RADIUS_MM = 20.0
_SAMPLES = 48


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedScene:
    """Circles with two candidates each, in any order, and what is true of them."""

    circles: list[CircleResult]
    right: IntArray
    """(m,) index of the candidate with the smaller error of its normal"""
    planes: IntArray
    """(m,) index of the plane that a circle is in, -1 for none"""
    normals: FloatArray
    """(m, 3) true"""


def simulated(
    rng: np.random.Generator,
    in_planes: tuple[int, ...],
    strays: int,
    *,
    distance_mm: float = 800.0,
    extent_mm: float = 200.0,
    noise_px: float = 0.1,
    most_tilt_deg: float = 75.0,
) -> SimulatedScene:
    """Return a scene with `in_planes` circles in each plane and `strays` with poses of their own.

    Parameters
    ----------
    rng
        Source of all random numbers.
    in_planes, strays
        Number of circles in each plane, and in none.
    distance_mm, extent_mm
        Mean distance from the camera, and half the width of what the circles are spread over.
    noise_px
        Standard deviation of an edge at a pixel of the rim.
    most_tilt_deg
        Largest angle of a normal to the line of sight; normals are uniform on the sphere up to it.
    """
    centers, normals, planes = [], [], []
    for index, number in enumerate(in_planes):
        middle = np.array([*rng.uniform(-0.5, 0.5, 2) * extent_mm, distance_mm * rng.uniform(0.7, 1.3)])
        normal = _normal(rng, middle, most_tilt_deg)
        basis = np.stack(plane_basis(normal))
        centers.extend(middle + rng.uniform(-extent_mm, extent_mm, (number, 2)) @ basis)
        normals.extend([normal] * number)
        planes.extend([index] * number)
    for _ in range(strays):
        center = np.array([*rng.uniform(-extent_mm, extent_mm, 2), distance_mm * rng.uniform(0.7, 1.3)])
        centers.append(center)
        normals.append(_normal(rng, center, most_tilt_deg))
        planes.append(-1)
    order = [i for i in rng.permutation(len(centers)) if np.sum(normals[i] * centers[i]) < 0.0]
    measured = [_measured(rng, centers[i], normals[i], noise_px, number) for number, i in enumerate(order)]
    kept = [(i, *each) for i, each in zip(order, measured, strict=True) if each is not None]
    return SimulatedScene(
        [circle for _, circle, _ in kept],
        np.array([right for _, _, right in kept], dtype=np.int64),
        np.array([planes[i] for i, _, _ in kept], dtype=np.int64),
        np.reshape([normals[i] for i, _, _ in kept], (-1, 3)),
    )


def _normal(rng: np.random.Generator, center: FloatArray, most_tilt_deg: float) -> FloatArray:
    toward = -center / np.linalg.norm(center)
    cosine = rng.uniform(np.cos(np.radians(most_tilt_deg)), 1.0)
    turn = rng.uniform(0.0, 2.0 * np.pi)
    first, second = plane_basis(toward)
    return np.asarray(cosine * toward + np.sqrt(1.0 - cosine**2) * (np.cos(turn) * first + np.sin(turn) * second))


def _measured(
    rng: np.random.Generator, center: FloatArray, normal: FloatArray, noise_px: float, instance: int
) -> tuple[CircleResult, int] | None:
    """Return a circle with the noise of its rim, and the index of its right candidate; None if it has one alone."""
    factor = factor_from_circle(center, normal, RADIUS_MM)
    modes = _modes_covariance(factor, noise_px)
    measured = grown(factor, rng.multivariate_normal(np.zeros(5), modes, method="cholesky"))
    frame = principal_frame(measured)
    centers, normals = poses_from_frame(frame, RADIUS_MM)
    if len(centers) < 2:
        return None
    own = [
        pose_covariances(measured, frame.rotation[:, 2], modes, c, n, RADIUS_MM)
        for c, n in zip(centers, normals, strict=True)
    ]
    order = rng.permutation(2)
    candidates = tuple(
        Candidate(centers[k], normals[k], np.zeros(2), covariance=own[k] if np.all(np.isfinite(own[k])) else None)
        for k in order
    )
    major, minor = FOCAL_PX * float(frame.tan_half_major), FOCAL_PX * float(frame.tan_half_minor)
    circle = CircleResult(
        instance,
        "disc",
        "chen-huang",
        RADIUS_MM,
        candidates,
        flags=(Flag.AMBIGUOUS,),
        ellipse=Ellipse(np.zeros(2), np.array(major), np.array(minor), np.array(0.0)),
        residual_px=noise_px,
        contour=np.zeros((int(2.0 * np.pi * major) + 6, 2)),
    )
    right = int(np.argmax([candidate.normal @ normal for candidate in candidates]))
    return circle, right


def _modes_covariance(factor: FloatArray, noise_px: float) -> FloatArray:
    """Return the covariance (5, 5) of a rim's modes, by noise of the edge across the rim at each of its pixels."""
    angle = np.linspace(0.0, 2.0 * np.pi, _SAMPLES, endpoint=False)
    cos, sin, one = np.cos(angle), np.sin(angle), np.ones_like(angle)
    rays = np.stack([cos, sin, one], axis=-1) @ factor.T
    along = np.stack([-sin, cos, 0.0 * one], axis=-1) @ factor.T
    outward = np.stack([cos, sin, 0.0 * one], axis=-1) @ factor.T
    tangent, growth = (_pixels(rays, change) for change in (along, outward))
    length = np.linalg.norm(tangent, axis=-1)
    across = (growth[:, 0] * tangent[:, 1] - growth[:, 1] * tangent[:, 0]) / length
    slopes = mode_shapes(angle) * across[:, None]
    weights = length * (2.0 * np.pi / _SAMPLES) / noise_px**2
    return np.linalg.inv(np.einsum("n,ni,nj->ij", weights, slopes, slopes))


def _pixels(rays: FloatArray, change: FloatArray) -> FloatArray:
    """Return how pixels (n, 2) move as rays (n, 3) change."""
    return FOCAL_PX * (change[:, :2] - rays[:, :2] / rays[:, 2:] * change[:, 2:]) / rays[:, 2:]
