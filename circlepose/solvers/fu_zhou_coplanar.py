"""Pose from two coplanar concentric circles, which has one solution.

Fu & Zhou, Solving the Pose Ambiguity via a Simple Concentric Circle Constraint (2019), section 3.2. It shows which
candidate of either circle alone is right.

Conics are of the normalized image plane (f = 1, the paper's K is I), of any scale and sign. There a conic is the
matrix Q of the circle's viewing cone, a point is a ray and a line is the normal of the plane through it and the
camera. So all of this turns with the camera, and holds for cones that no single image plane holds too.

Where the two conics cannot be of concentric circles at all (they cross, or lie side by side) the answer is NaN.
Where they may be, `concentricity` measures how well they fit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from circlepose._numerics import cross
from circlepose._typing import BoolArray, FloatArray
from circlepose.geometry.cone import SIGNATURE, cone_from_factor, factor_from_cone, plane_basis
from circlepose.geometry.cone_perturbation import MODES, grown
from circlepose.geometry.conic import polar

ComplexArray = np.ndarray[tuple[int, ...], np.dtype[np.complex128]]

_DIFFERENCE = 1e-6
"""Step of a rim's modes for numeric derivatives."""
_REAL = 1e-6
"""Relative imaginary part that rounding may leave of a real eigenvalue."""


def pose_from_coplanar_circles(
    conic_outer: FloatArray, conic_inner: FloatArray, radius_outer: FloatArray | float
) -> tuple[FloatArray, FloatArray]:
    """Solve the pose of two coplanar concentric circles from the conics of their images.

    Parameters
    ----------
    conic_outer, conic_inner
        (..., 3, 3) of both circles, of any scale and sign.
    radius_outer
        (...) of the outer circle.

    Returns
    -------
    The center (..., 3) in the unit of the radius, and the unit normal (..., 3) towards the camera; camera frame. NaN
    where the conics cannot be of concentric circles. Source: Fu & Zhou (2019), section 3.2: imaged center, vanishing
    line (eq. 7), imaged circular points, rotation (eq. 8), translation (eq. 9).
    """
    point = imaged_center(conic_outer, conic_inner)
    line = vanishing_line(conic_outer, point)
    rotation = rotation_from_circular_points(imaged_circular_points(line, conic_outer))
    return translation(point, radius_outer, conic_outer), rotation[..., :, 2]


def imaged_center(conic_1: FloatArray, conic_2: FloatArray) -> FloatArray:
    """Return the image of the common center: the isolated eigenvector of C1^-1 C2.

    Noise splits the double eigenvalue, and the values need not show which one is isolated. But the eigenvectors are a
    self-polar triangle, and one of its vertices lies within both conics: the center.

    Parameters
    ----------
    conic_1, conic_2
        (..., 3, 3) of both circles.

    Returns
    -------
    (..., 3) homogeneous, a unit vector towards the circle. NaN where the conics cannot be of concentric circles.
    Source: Fu & Zhou (2019), section 3.2.
    """
    pencil = _pencil(conic_1, conic_2)
    return np.where(pencil.nested[..., None], pencil.center, np.nan)


def concentricity(conic_1: FloatArray, conic_2: FloatArray) -> FloatArray:
    """Return the split of the double eigenvalue of C1^-1 C2, relative to its mean.

    Parameters
    ----------
    conic_1, conic_2
        (..., 3, 3) of both circles.

    Returns
    -------
    (...) 0 for concentric circles, and for conics that agree. Circles in one plane with centers e apart give about
    e^2/(R1^2 - R2^2). Infinite where no center is imaged.
    """
    pencil = _pencil(conic_1, conic_2)
    split = np.abs(pencil.double[..., 0] - pencil.double[..., 1]) / np.abs(pencil.double.mean(axis=-1))
    return np.where(pencil.nested, split, np.inf)


def radius_ratio(conic_1: FloatArray, conic_2: FloatArray) -> FloatArray:
    """Return the ratio of the circles' radii: the root of the isolated eigenvalue over the double one.

    In the circles' plane C_i ~ diag(1, 1, -R_i^2), so C1^-1 C2 ~ diag(1, 1, R2^2/R1^2).

    Parameters
    ----------
    conic_1, conic_2
        (..., 3, 3) of both circles.

    Returns
    -------
    (...) R2/R1; NaN where the conics cannot be of concentric circles.
    """
    pencil = _pencil(conic_1, conic_2)
    ratio = pencil.isolated / np.real(pencil.double.mean(axis=-1))
    return np.sqrt(np.where(pencil.nested & (ratio > 0.0), ratio, np.nan))


def vanishing_line(conic: FloatArray, imaged_center: FloatArray) -> FloatArray:
    """Return the vanishing line of a circle's plane, the polar of its imaged center: l ~ C o.

    Parameters
    ----------
    conic
        (..., 3, 3) of the circle.
    imaged_center
        (..., 3) o.

    Returns
    -------
    (..., 3) with l . o < 0, so that it points towards the camera. Source: Fu & Zhou (2019), eq. 7.
    """
    line = polar(conic, imaged_center)
    facing = np.einsum("...i,...i->...", line, imaged_center)
    return line * np.where(facing > 0.0, -1.0, 1.0)[..., None]


def imaged_circular_points(line: FloatArray, conic: FloatArray) -> ComplexArray:
    """Return where the vanishing line meets the conic.

    Parameters
    ----------
    line
        (..., 3) the vanishing line.
    conic
        (..., 3, 3) of the circle.

    Returns
    -------
    Two complex conjugate points (..., 2, 3). The first, I, has Re I x Im I along the line's vector. NaN where the
    line cuts the conic in real points, so that it is no vanishing line. Source: Fu & Zhou (2019), section 3.2.
    """
    length = np.linalg.norm(line, axis=-1, keepdims=True)
    e1, e2 = plane_basis(line / length)
    basis = np.stack([e1, e2], axis=-1)
    block = np.swapaxes(basis, -1, -2) @ conic @ basis
    a, b, c = block[..., 0, 0], block[..., 0, 1], block[..., 1, 1]
    discriminant = a * c - b**2
    root = np.sqrt(np.where(discriminant > 0.0, discriminant, np.nan)) * np.sign(c)
    # a + 2 b z + c z^2 = 0 for the points e1 + z e2.
    first = c[..., None] * e1 + (-b + 1j * root)[..., None] * e2
    return np.stack([first, np.conj(first)], axis=-2)


def rotation_from_circular_points(points: ComplexArray) -> FloatArray:
    """Return the rotation (..., 3, 3), plane to camera, from the imaged circular points (..., 2, 3) (eq. 8).

    Columns r1 ~ Re I and r2 ~ Im I of the first point I, and r3 = r1 x r2: the plane's normal, towards the camera
    for points from `imaged_circular_points` and a line from `vanishing_line`. With noise Re I and Im I are not
    quite perpendicular and of one length; the nearest pair that is gets taken, within their plane, so r3 is the
    unit vector of the vanishing line all the same. r1 and r2 turn with the phase of I: a circle has no roll.
    """
    pair = np.stack([points[..., 0, :].real, points[..., 0, :].imag], axis=-1)
    gram = np.swapaxes(pair, -1, -2) @ pair
    area = np.linalg.norm(cross(pair[..., 0], pair[..., 1]), axis=-1)[..., None, None]
    trace = np.trace(gram, axis1=-2, axis2=-1)[..., None, None]
    # gram^(-1/2) of a 2 x 2 matrix; the adjugate is trace I - gram.
    inverse_root = ((trace + area) * np.eye(2) - gram) / (area * np.sqrt(trace + 2.0 * area))
    across = pair @ inverse_root
    return np.concatenate([across, cross(across[..., 0], across[..., 1])[..., None]], axis=-1)


def translation(imaged_center: FloatArray, radius: FloatArray | float, conic: FloatArray) -> FloatArray:
    """Return the circle's center t = s o on the ray o of its imaged center.

    For a unit direction e in the circle's plane, (R/s)^2 = -(o'Co)/(e'Ce). The e at right angles to the line of sight
    is used: along it the size in the image does not change with the tilt, to first order.

    Parameters
    ----------
    imaged_center
        (..., 3) o.
    radius
        (...) R.
    conic
        (..., 3, 3) of the circle, C.

    Returns
    -------
    (..., 3) in the unit of the radius, camera frame. Source: Fu & Zhou (2019), eq. 9.
    """
    point = imaged_center
    normal = normal_from_imaged_center(conic, point)
    across = cross(normal, point)
    length = np.linalg.norm(across, axis=-1, keepdims=True)
    frontal = length <= 1e-9 * np.linalg.norm(point, axis=-1, keepdims=True)
    across = np.where(frontal, plane_basis(normal)[0], across / np.where(frontal, 1.0, length))
    size = np.einsum("...i,...ij,...j->...", across, conic, across)
    depth = -np.einsum("...i,...ij,...j->...", point, conic, point)
    ratio = size / depth
    return (np.asarray(radius) * np.sqrt(np.where(ratio > 0.0, ratio, np.nan)))[..., None] * point


def normal_from_imaged_center(conic: FloatArray, imaged_center: FloatArray) -> FloatArray:
    """Return the unit normal of a circle from its conic and its imaged center: N(Q o).

    Parameters
    ----------
    conic
        (..., 3, 3) of the circle.
    imaged_center
        (..., 3) o.

    Returns
    -------
    (..., 3) towards the camera, camera frame. Source: Fu & Zhou (2019), eq. 10.
    """
    line = vanishing_line(conic, imaged_center)
    return line / np.linalg.norm(line, axis=-1, keepdims=True)


def pose_with_covariance(
    factors: FloatArray, modes_covariances: FloatArray, radius_outer: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the pose of `pose_from_coplanar_circles` and its covariance, to first order.

    Parameters
    ----------
    factors
        (2, 3, 3) of both circles' cones, the outer one first.
    modes_covariances
        (2, 5, 5) of the modes of the cones (`geometry.cone_perturbation`), independent of each other.
    radius_outer
        Of the outer circle.

    Returns
    -------
    Center (3,), normal (3,) and their covariance (5, 5): of the center (unit of the radius, squared) and of two tilts
    (rad^2) of the normal, towards the vectors of `cone.plane_basis(normal)`. NaN where the cones cannot be of
    concentric circles.
    """

    def poses(changed: FloatArray) -> tuple[FloatArray, FloatArray]:
        cones = cone_from_factor(changed)
        return pose_from_coplanar_circles(cones[..., 0, :, :], cones[..., 1, :, :], radius_outer)

    # (10, 2, 5): each mode of each rim in turn.
    steps = _DIFFERENCE * np.eye(2 * MODES).reshape(2 * MODES, 2, MODES)
    center, normal = poses(factors)
    ahead, behind = poses(grown(factors, steps)), poses(grown(factors, -steps))
    by_center = (ahead[0] - behind[0]) / (2.0 * _DIFFERENCE)
    by_tilt = (ahead[1] - behind[1]) @ np.stack(plane_basis(normal), axis=-1) / (2.0 * _DIFFERENCE)
    slopes = np.concatenate([by_center, by_tilt], axis=-1).reshape(2, MODES, 5)
    return center, normal, np.einsum("kpi,kpq,kqj->ij", slopes, modes_covariances, slopes)


def log_odds(candidates: FloatArray, candidate_sigma_rad: float, normal: FloatArray, tilts: FloatArray) -> float:
    """Return the log odds of the first of two candidates over the second, given the normal from both circles.

    Only the position of that normal along the line between the candidates counts, with the errors along that line.

    Parameters
    ----------
    candidates
        (2, 3) unit normals of one circle alone.
    candidate_sigma_rad
        Standard deviation of each along the line between them, rad.
    normal
        (3,) unit normal from both circles.
    tilts
        (2, 2) covariance, rad^2, of its tilts towards the vectors of `cone.plane_basis(normal)`.
    """
    apart = candidates[0] - candidates[1]
    squared = float(apart @ apart)
    if squared == 0.0:
        return 0.0
    along = np.stack(plane_basis(normal)) @ apart
    variance = float(along @ tilts @ along) / squared + candidate_sigma_rad**2
    return float(apart @ (normal - candidates.mean(axis=0))) / variance


@dataclass(frozen=True, slots=True, eq=False)
class _Pencil:
    """Eigenvalues and the eigenvector of interest of C1^-1 C2."""

    isolated: FloatArray
    """(...)"""
    double: ComplexArray
    """(..., 2) the two that are equal for concentric circles"""
    center: FloatArray
    """(..., 3) unit eigenvector of the isolated one"""
    nested: BoolArray
    """(...) whether it is real and lies within both conics"""


def _pencil(conic_1: FloatArray, conic_2: FloatArray) -> _Pencil:
    # In the frame in which conic 1 is the unit circle no digits are lost to small or far conics.
    factor = factor_from_cone(conic_1)
    other = np.swapaxes(factor, -1, -2) @ conic_2 @ factor
    other = other * np.where(np.linalg.det(other) > 0.0, -1.0, 1.0)[..., None, None]
    values, vectors = np.linalg.eig(SIGNATURE[:, None] * other)
    squared = np.abs(vectors) ** 2
    # Eigenvectors come as unit vectors; x'C1x < 0 within conic 1.
    side = np.einsum("i,...ij->...j", SIGNATURE, squared)
    order = np.argsort(side, axis=-1)
    values = np.take_along_axis(values, order, axis=-1)
    vector = np.take_along_axis(vectors, order[..., None, :1], axis=-1)[..., 0]
    isolated, inner = np.real(values[..., 0]), np.real(vector)
    nested = (
        (np.take_along_axis(side, order[..., :1], axis=-1)[..., 0] < 0.0)
        & (np.abs(np.imag(values[..., 0])) <= _REAL * np.abs(isolated))
        & (np.einsum("...i,...ij,...j->...", inner, other, inner) < 0.0)
    )
    inner = inner * np.where(inner[..., 2:] < 0.0, -1.0, 1.0)
    center = np.einsum("...ij,...j->...i", factor, inner)
    return _Pencil(
        isolated=isolated,
        double=np.asarray(values[..., 1:], dtype=np.complex128),
        center=center / np.linalg.norm(center, axis=-1, keepdims=True),
        nested=np.asarray(nested, dtype=np.bool_),
    )
