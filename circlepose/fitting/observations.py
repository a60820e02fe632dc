"""Image points with their rays, and how far they are from the rims of viewing cones, in px.

The distance is first order in f(y) = |(y1, y2)| / y3 - 1, where y = A^-1 x are the coordinates of a ray x in the
cone's factor A. There the rim is the unit circle and f is nearly linear across it, so first order goes a long way.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from circlepose._typing import BoolArray, FloatArray, IntArray
from circlepose.camera.camera import Camera


@dataclass(frozen=True, slots=True, eq=False)
class Observations:
    """Image points with their rays, which a distorting lens makes costly: they are computed once."""

    pixels: FloatArray
    """(n, 2) px, raw image"""
    rays: FloatArray
    """(n, 3) unit length, camera frame"""
    jacobians: FloatArray
    """(n, 3, 2) d ray / d pixel, 1/px"""

    @classmethod
    def of(cls, camera: Camera, pixels: FloatArray) -> Self:
        """Compute the rays of `pixels` (n, 2), px of the raw image; NaN outside the lens model's valid field."""
        return cls(pixels, *camera.rays_with_jacobian(pixels))

    def __getitem__(self, which: BoolArray) -> Self:
        """Return the points that the mask `which` (n,) selects."""
        return type(self)(self.pixels[which], self.rays[which], self.jacobians[which])

    def __len__(self) -> int:
        return len(self.pixels)


def rim_distance_px(factor: FloatArray, rays: FloatArray, jacobians: FloatArray) -> FloatArray:
    """Return the first-order signed distance of rays to the rim of a viewing cone, in px of the raw image.

    Parameters
    ----------
    factor
        (..., 3, 3) factors of cones in the camera frame, any length unit; see `geometry.cone`.
    rays
        (n, 3) rays of image points, any length, camera frame.
    jacobians
        (n, 3, 2) d ray / d pixel, 1/px.

    Returns
    -------
    (..., n) px, positive outside the rim: f / |grad f| with f = |(y1, y2)| / y3 - 1, y = A^-1 x (Sampson, 1982, in
    the factor's coordinates). Each cone has a distance to each ray.
    """
    _, growth, per_px = rim_growth(np.asarray(np.linalg.inv(factor))[..., None, :, :], rays, jacobians)
    return np.asarray(growth / per_px)


def rim_distances_px(factors: FloatArray, owner: IntArray, rays: FloatArray, jacobians: FloatArray) -> FloatArray:
    """Return the distance (n,), px, of each ray to the rim of its own cone: see `rim_distance_px`.

    Parameters
    ----------
    factors
        (m, 3, 3) factors of cones in the camera frame.
    owner
        (n,) index of the cone of each ray.
    rays, jacobians
        (n, 3) and (n, 3, 2), as for `rim_distance_px`.
    """
    _, growth, per_px = rim_growth(np.asarray(np.linalg.inv(factors))[owner], rays, jacobians)
    return np.asarray(growth / per_px)


def rim_growth(
    inverse: FloatArray, rays: FloatArray, jacobians: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return where rays lie about a cone's rim, in the factor's own coordinates y = A^-1 x.

    Parameters
    ----------
    inverse
        (3, 3) A^-1, (n, 3, 3) for a cone each, or (..., 1, 3, 3) for several cones and all rays.
    rays, jacobians
        (n, 3) and (n, 3, 2), as for `rim_distance_px`.

    Returns
    -------
    The coordinates y (..., n, 3), the growth f (..., n), as a share of the rim's size, and its derivative |grad f|
    (..., n) per px across the rim. The modes of `geometry.cone_perturbation` are the harmonics of f.
    """
    y = (inverse @ rays[:, :, None])[..., 0]
    slopes = inverse @ jacobians
    y0, y1, y2 = y[..., 0], y[..., 1], y[..., 2]
    radius = np.hypot(y0, y1)
    ratio = radius / y2
    along = (y0[..., None] * slopes[..., 0, :] + y1[..., None] * slopes[..., 1, :]) / (radius * y2)[..., None]
    gradient = along - (ratio / y2)[..., None] * slopes[..., 2, :]
    return y, ratio - 1.0, np.hypot(gradient[..., 0], gradient[..., 1])
