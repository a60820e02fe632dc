"""Views in which the wrong pair of two coaxial circles has the generatrix of the right one, in closed form.

Fu & Zhou (2019), proposition 2, takes CC1 /= NN1 for granted once the candidates differ. It holds except in two kinds
of view. In the plane through the camera and the axis, let N, M and N1, M1 be the ends of the two diameters, at
distances n, m and n1, m1 from the camera. The other candidate of a circle is its mirror image in the bisector of its
viewing cone, so C is on the ray of N at distance m, and C1 on the ray of N1 at distance m1. With d the angle between
the rays of N and N1, and e that between the rays of M and M1,

    NN1^2 = n^2 + n1^2 - 2 n n1 cos d        CC1^2 = m^2 + m1^2 - 2 m m1 cos d
    MM1^2 = m^2 + m1^2 - 2 m m1 cos e        DD1^2 = n^2 + n1^2 - 2 n n1 cos e

As NN1 = MM1 is the part's generatrix, CC1 = NN1 if and only if cos d = cos e, and so DD1 = NN1. The half angles s and
s1 of the two cones and the angle p between their bisectors give d = |p + s1 - s| and e = |p - s1 + s|: either p = 0
(`mirror_tilt`) or s = s1 (`equal_length_tilt`). docs/papers.md has the derivation of both tilts.

Heights are along the normal that points towards the camera: positive for a boss, whose small circle is nearer to the
camera's side, negative for a recess. The tilt is the angle between the normal and the line of sight of the big
circle's center; distances are those of that center. Pure NumPy; all arguments broadcast.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from circlepose._numerics import angle_between
from circlepose._typing import FloatArray
from circlepose.errors import ArgumentError


@dataclass(frozen=True, slots=True)
class MirrorView:
    """A view of a coaxial target, and the view from the same distance in which both pairs fit."""

    distance: float
    """of the big circle's center, in the unit of the radii"""
    tilt_rad: float
    """of this view"""
    mirror_tilt_rad: float
    """of the view from the same distance in which both pairs fit"""


def mirror_tilt(
    radius_big: FloatArray | float,
    radius_small: FloatArray | float,
    height: FloatArray | float,
    distance: FloatArray | float,
) -> FloatArray:
    """Return the tilt at which both cones share their bisector.

    There the mirror image of the whole target gives the same images: the pair is ambiguous for every method. With
    R, r, h and D,

        cos(tilt) = h (D^2 - R^2) / (D (h^2 - R^2 + r^2)),

    for shallow recesses about |h| D / (R^2 - r^2). A boss has such a view only if its top is nearly at the camera.

    Parameters
    ----------
    radius_big, radius_small
        (...) R and r, in one unit of length.
    height
        (...) h of the small circle over the big one's plane, negative for a recess.
    distance
        (...) D of the big circle's center from the camera.

    Returns
    -------
    (...) rad. NaN where there is no such tilt, and nearer than R. Source: docs/papers.md.

    Raises
    ------
    ArgumentError
        For radii or a distance that are not positive, and for a small radius above the big one.
    """
    big, small, high, far = _checked(radius_big, radius_small, height, distance)
    with np.errstate(divide="ignore", invalid="ignore"):
        cosine = high * (far**2 - big**2) / (far * (high**2 - big**2 + small**2))
    return _tilt(cosine, big, high, far)


def farthest_mirror_distance(radius_big: float, radius_small: float, depth: float) -> float | None:
    """Return the largest distance from which a recess has a `mirror_tilt`. There the tilt is 0.

    From nearer the tilt is larger, up to edge-on.

    Parameters
    ----------
    radius_big, radius_small
        R and r, in one unit of length.
    depth
        Of the recess, positive.

    Returns
    -------
    The distance. None for a recess deeper than sqrt(R^2 - r^2), which has no such view, and for one of no depth,
    which has it edge-on from any distance.

    Raises
    ------
    ArgumentError
        As `mirror_tilt`.
    """
    big, small, high, _ = (float(value) for value in _checked(radius_big, radius_small, depth, 1.0))
    left = big**2 - small**2 - high**2
    if high <= 0.0 or left <= 0.0:
        return None
    return (left + math.hypot(left, 2.0 * high * big)) / (2.0 * high)


def equal_length_tilt(
    radius_big: FloatArray | float,
    radius_small: FloatArray | float,
    height: FloatArray | float,
    distance: FloatArray | float,
) -> FloatArray:
    """Return the tilt at which both circles are seen under one angle.

    The angle is that in the plane through the camera and the axis. There the wrong pair has the right generatrix at
    both ends, but is not coaxial. The height y = D cos(tilt) of the camera over the big circle's plane solves

        2 h R y^2 - ((R - r) (D^2 + R r) + R h^2) y - h r (D^2 - R^2) = 0.

    Parameters
    ----------
    radius_big, radius_small, height, distance
        As `mirror_tilt`.

    Returns
    -------
    (...) rad; NaN where there is no such tilt. Source: docs/papers.md.

    Raises
    ------
    ArgumentError
        As `mirror_tilt`.
    """
    big, small, high, far = _checked(radius_big, radius_small, height, distance)
    power = far**2 - big**2
    linear = (big - small) * (far**2 + big * small) + big * high**2
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(linear**2 + 8.0 * high**2 * big * small * power)
        # The positive root; of its two forms the one that subtracts no like numbers.
        above = np.where(
            high > 0.0, (linear + root) / (4.0 * high * big), -2.0 * high * small * power / (linear + root)
        )
        cosine = above / far
    return _tilt(cosine, big, high, far)


def mirror_view(
    center_big: FloatArray, normal: FloatArray, radius_big: float, center_small: FloatArray, radius_small: float
) -> MirrorView | None:
    """Compare a view with the one from the same distance in which both pairs fit.

    Parameters
    ----------
    center_big, center_small
        (3,) in the camera frame.
    normal
        (3,) unit normal towards the camera.
    radius_big, radius_small
        In the unit of the centers.

    Returns
    -------
    Both tilts. None where no view from this distance has both pairs fit.
    """
    distance = float(np.linalg.norm(center_big))
    height = float((center_small - center_big) @ normal)
    mirror = float(mirror_tilt(radius_big, radius_small, height, distance))
    if np.isnan(mirror):
        return None
    tilt = float(angle_between(normal, -center_big / distance))
    return MirrorView(distance, tilt, mirror)


def _checked(
    radius_big: FloatArray | float,
    radius_small: FloatArray | float,
    height: FloatArray | float,
    distance: FloatArray | float,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    big, small, high, far = (
        np.asarray(value, dtype=np.float64) for value in (radius_big, radius_small, height, distance)
    )
    for name, value in (("radius_big", big), ("radius_small", small), ("distance", far)):
        if not np.all(value > 0.0):
            raise ArgumentError(f"{name}: expected a positive length.")
    if np.any(small > big):
        raise ArgumentError("radius_small: expected at most radius_big.")
    return big, small, high, far


def _tilt(cosine: FloatArray, radius_big: FloatArray, height: FloatArray, distance: FloatArray) -> FloatArray:
    # The camera must see both circles from their front.
    seen = (cosine > 0.0) & (cosine <= 1.0) & (cosine * distance > height) & (distance > radius_big)
    return np.asarray(np.arccos(np.where(seen, cosine, np.nan)))
