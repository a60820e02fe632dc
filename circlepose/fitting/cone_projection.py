"""Where the rims of viewing cones are seen in the raw image: pixels, ellipses, and how far points are off them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from circlepose._typing import BoolArray, FloatArray
from circlepose.camera.camera import Camera
from circlepose.fitting.cone_fit import rim_distances_px
from circlepose.fitting.direct import Contours
from circlepose.fitting.direct_batch import fit_each
from circlepose.geometry.ellipse import Ellipse, rim_distance, unit_circle

_PLACES = 90


def image_ellipses(camera: Camera, factors: FloatArray) -> tuple[Ellipse, BoolArray]:
    """Return the ellipses (m,) in the raw image of the rims of cones with `factors` (m, 3, 3), and which have one.

    Under a distorting lens, those that fit best.
    """
    if camera.is_free_of_distortion:
        return Ellipse.from_factor(camera.camera_matrix @ factors)
    outlines = rim_pixels(camera, factors, _PLACES)
    seen = np.isfinite(outlines).all(axis=(1, 2))
    outlines[~seen] = unit_circle(_PLACES).T
    ellipses, found = fit_each(outlines)
    return ellipses, found & seen


def residuals_px(
    camera: Camera, factors: FloatArray, ellipses: Ellipse, contours: Sequence[FloatArray]
) -> list[FloatArray]:
    """Return how far the points of each of m contours (n, 2) are from a rim, px, to first order, positive outside.

    The rims are those of cones with `factors` (m, 3, 3), whose images the `ellipses` (m,) are, about.
    """
    every = Contours.of(list(contours))
    if camera.is_free_of_distortion:
        residuals = rim_distance(ellipses[every.owner], every.points[:, None])[:, 0]
    else:
        residuals = rim_distances_px(factors, every.owner, *camera.rays_with_jacobian(every.points))
    return np.split(residuals, every.starts[1:])


def rim_pixels(camera: Camera, factor: FloatArray, number: int) -> FloatArray:
    """Return `number` pixels (..., number, 2) of the rim of the cone with `factor` (..., 3, 3); NaN where unseen."""
    unit = np.stack([*unit_circle(number), np.ones(number)], axis=-1)
    return camera.project(unit @ np.swapaxes(factor, -1, -2))
