"""Which candidates of two coaxial circles in different planes belong together: Fu & Zhou (2019), section 3.3.

The candidates of the two circles are paired one to one, so that their normals agree best. Of the right pair the
generatrix, rim to rim in the plane that holds the axis and the camera, has the part's known length
sqrt(h^2 + (R - r)^2) at both ends of the diameters there. Of the wrong pair the small circle's centre is off the
big one's axis by some e in that plane, and the generatrices are about

    sqrt(h'^2 + (R - r - e)^2)  and  sqrt(h'^2 + (R - r + e)^2)

(CC1 in their fig. 5 is one of the two). One is too short and the other too long by about as much, so compare the
ends, never their mean: it hardly differs between the pairs. Where the length is not known, ends of one length or
e = 0 show the right pair as well. In two kinds of view the wrong pair has the right length at both ends
(`disambiguation.mirror_view`); in one of them e is 0, too, and nothing distinguishes the pairs.

Lengths are in the unit of the centres; the frame is any that has the camera in its origin. Normals point towards
the camera, so both circles must be seen from the same side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from circlepose._numerics import cross, student_log_likelihood
from circlepose._typing import FloatArray, IntArray
from circlepose.errors import ArgumentError
from circlepose.geometry.cone import plane_basis

_NO_DIRECTION = 1e-12
_DIFFERENCE = 1e-6
"""Step of numeric derivatives, in shares of the distance and in rad."""
_DIFFER = np.array([1.0, -1.0])


def pair_candidates(normals_big: FloatArray, normals_small: FloatArray) -> IntArray:
    """Return, for each candidate of the big circle, its partner among the small circle's: indices (..., k).

    `normals_big` (..., k, 3), `normals_small` (..., l, 3): unit normals of the one or two candidates. Two and two are
    paired one to one, as their normals agree better: by the larger sum of cosines. For exact cones that is always the
    right assignment. With a and b the angles between the common normal and the bisectors of the two cones, it leads
    by 4 cos(a - b) sin(a) sin(b), and both angles are acute and lie on the same side. Where a circle has one
    candidate, the nearest normal counts.
    """
    cosines = normals_big @ np.swapaxes(normals_small, -1, -2)
    if cosines.shape[-2:] != (2, 2):
        return np.asarray(np.argmax(cosines, axis=-1), dtype=np.int64)
    straight = cosines[..., 0, 0] + cosines[..., 1, 1]
    crossed = cosines[..., 0, 1] + cosines[..., 1, 0]
    return np.where((straight >= crossed)[..., None], np.array([0, 1]), np.array([1, 0]))


def generatrix_length(
    center_big: FloatArray,
    normal_big: FloatArray,
    radius_big: FloatArray | float,
    center_small: FloatArray,
    normal_small: FloatArray,
    radius_small: FloatArray | float,
) -> FloatArray:
    """Return the rim to rim distance (...) at the near end: GCC of their table 2. Arguments as `generatrix_ends`."""
    return generatrix_ends(center_big, normal_big, radius_big, center_small, normal_small, radius_small)[..., 0]


def generatrix_ends(
    center_big: FloatArray,
    normal_big: FloatArray,
    radius_big: FloatArray | float,
    center_small: FloatArray,
    normal_small: FloatArray,
    radius_small: FloatArray | float,
) -> FloatArray:
    """Return the rim to rim distances (..., 2) at the end of the diameters nearer to the camera, and at the far end.

    The diameters are those in the plane of symmetry, which holds the camera and the axis. Centres and unit normals
    (..., 3), radii (...). Candidates that are not quite coaxial have not quite the same plane: the one between is
    taken, so that the ends correspond. Near and far are the big circle's.
    """
    axis = _mean_axis(normal_big, normal_small)
    across, other = cross(center_big, normal_big), cross(center_small, normal_small)
    across = across + np.where(np.sum(across * other, axis=-1, keepdims=True) < 0.0, -other, other)
    length = np.linalg.norm(across, axis=-1, keepdims=True)
    along_sight = length <= _NO_DIRECTION * np.linalg.norm(center_big, axis=-1, keepdims=True)
    # Looked at along the axis every plane through it is one of symmetry.
    across = np.where(along_sight, plane_basis(axis)[0], across / np.where(along_sight, 1.0, length))
    apart = center_big - center_small
    arm_big = np.asarray(radius_big)[..., None] * _unit(cross(across, normal_big))
    arm_small = np.asarray(radius_small)[..., None] * _unit(cross(across, normal_small))
    near, far = apart + (arm_big - arm_small), apart - (arm_big - arm_small)
    return np.stack([np.linalg.norm(near, axis=-1), np.linalg.norm(far, axis=-1)], axis=-1)


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredCircle:
    """A candidate pose of a circle measured by its own rim alone."""

    center: FloatArray
    """(3,)"""
    normal: FloatArray
    """(3,) unit"""
    radius: float
    covariance: FloatArray
    """(5, 5) of the centre and two tilts, as of `pose.Candidate`"""


def ends_covariance(big: MeasuredCircle, small: MeasuredCircle, radius_share: float) -> FloatArray:
    """Return the covariance (2, 2) of `generatrix_ends` of a pair, to first order.

    `radius_share` is the standard deviation of the small circle's radius, as a share of it: it scales its distance.
    """

    def ends(changes: FloatArray) -> FloatArray:
        first, second = _changed(big, changes[:, :5]), _changed(small, changes[:, 5:10])
        scale = 1.0 + changes[:, 10:]
        return generatrix_ends(*first, big.radius, second[0] * scale, second[1], small.radius * scale[:, 0])

    distance = float(np.linalg.norm(big.center))
    steps = np.diag(np.array([distance, distance, distance, 1.0, 1.0] * 2 + [1.0]) * _DIFFERENCE)
    slopes = (ends(steps) - ends(-steps)) / (2.0 * np.diag(steps)[:, None])
    covariance = np.zeros((11, 11))
    covariance[:5, :5], covariance[5:10, 5:10] = big.covariance, small.covariance
    covariance[10, 10] = radius_share**2
    return np.asarray(slopes.T @ covariance @ slopes)


def pair_misfit(
    ends: FloatArray, covariance: FloatArray, expected: float | None, expected_sigma: float
) -> tuple[float, float]:
    """Return the chi-square of the generatrices at both ends (2,) of a pair, and the pair's log likelihood.

    Both ends are `expected`, which is known to `expected_sigma`; where it is None, both are of one length.
    `covariance` (2, 2) is that of `ends`. The likelihood is Student's t, as of a joint fit: errors may be larger than
    their covariance says.
    """
    if expected is None:
        away, spread = np.array([ends[0] - ends[1]]), np.array([[_DIFFER @ covariance @ _DIFFER]])
    else:
        away, spread = ends - expected, covariance + expected_sigma**2
    squared = float(away @ np.linalg.solve(spread, away))
    return squared, student_log_likelihood(squared, len(away)) - 0.5 * float(np.linalg.slogdet(spread)[1])


def height_from_generatrix(
    generatrix: FloatArray | float, radius_big: FloatArray | float, radius_small: FloatArray | float
) -> FloatArray:
    """Return the distance h (...) of the two planes: h^2 = generatrix^2 - (R - r)^2.

    Raises
    ------
    ArgumentError
        When a generatrix is shorter than the difference of the radii.
    """
    difference = np.abs(np.asarray(radius_big, dtype=np.float64) - np.asarray(radius_small, dtype=np.float64))
    length = np.asarray(generatrix, dtype=np.float64)
    if np.any(length < difference):
        raise ArgumentError("generatrix: expected a length of at least the difference of the radii.")
    return np.sqrt((length - difference) * (length + difference))


def _mean_axis(normal_big: FloatArray, normal_small: FloatArray) -> FloatArray:
    return _unit(np.asarray(normal_big) + np.asarray(normal_small))


def _changed(circle: MeasuredCircle, changes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return centres (n, 3) and unit normals (n, 3) after small `changes` (n, 5) of centre and tilts."""
    normals = circle.normal + changes[:, 3:] @ np.stack(plane_basis(circle.normal))
    return circle.center + changes[:, :3], _unit(normals)


def _unit(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))
