"""Viewing cones and their rims in the raw image: pixels, ellipses, distances; and ellipses of the image -> cones."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from circlepose._typing import BoolArray, FloatArray
from circlepose.camera.camera import Camera
from circlepose.fitting.cone_fit import FORWARD
from circlepose.fitting.direct import Contours, fit_each
from circlepose.fitting.observations import rim_distances_px
from circlepose.geometry.cone import plane_basis
from circlepose.geometry.ellipse import Ellipse, rim_distance, unit_circle

_SAMPLES = 90
"""Points along a rim to which its ellipse in a distorted image is fitted."""


def image_ellipses(camera: Camera, factors: FloatArray) -> tuple[Ellipse, BoolArray]:
    """Return the ellipses of the rims of viewing cones in the raw image.

    Parameters
    ----------
    camera
        The calibration, for this image size.
    factors
        (m, 3, 3) factors of cones, camera frame.

    Returns
    -------
    The ellipses (m,), px, and which cones have one (m,). Exact without distortion; under a distorting lens the
    ellipse that fits the projected rim best.
    """
    if camera.is_free_of_distortion:
        return Ellipse.from_factor(camera.camera_matrix @ factors)
    outlines = rim_pixels(camera, factors, _SAMPLES)
    valid = np.isfinite(outlines).all(axis=(1, 2))
    outlines[~valid] = unit_circle(_SAMPLES).T
    ellipses, found = fit_each(outlines)
    return ellipses, found & valid


def residuals_px(
    camera: Camera, factors: FloatArray, ellipses: Ellipse, contours: Sequence[FloatArray]
) -> list[FloatArray]:
    """Return the first-order signed distances of contours to the rims of their viewing cones.

    Parameters
    ----------
    camera
        The calibration, for this image size.
    factors
        (m, 3, 3) factors of the cones, camera frame.
    ellipses
        (m,) their images, px: those of `image_ellipses`.
    contours
        m arrays (n, 2), px of the raw image.

    Returns
    -------
    m arrays (n,), px, positive outside.
    """
    every = Contours.of(list(contours))
    if camera.is_free_of_distortion:
        residuals = rim_distance(ellipses[every.owner], every.points[:, None])[:, 0]
    else:
        residuals = rim_distances_px(factors, every.owner, *camera.rays_with_jacobian(every.points))
    return np.split(residuals, every.starts[1:])


def rim_pixels(camera: Camera, factor: FloatArray, number: int) -> FloatArray:
    """Return points along the rims of viewing cones in the raw image.

    Parameters
    ----------
    camera
        The calibration, for this image size.
    factor
        (..., 3, 3) factors of cones, camera frame.
    number
        Points along each rim, evenly spaced in the factor's angle.

    Returns
    -------
    (..., number, 2) px; NaN where the camera does not see the point.
    """
    unit = np.stack([*unit_circle(number), np.ones(number)], axis=-1)
    return camera.project(unit @ np.swapaxes(factor, -1, -2))


def factor_from_ellipse(camera: Camera, ellipse: Ellipse) -> FloatArray | None:
    """Return the factor (3, 3) of the cone through one ellipse, px of the raw image: see `factors_from_ellipses`.

    None outside the lens model's valid field.
    """
    factors, valid = factors_from_ellipses(camera, ellipse[None])
    return factors[0] if valid[0] else None


def factors_from_ellipses(camera: Camera, ellipses: Ellipse) -> tuple[FloatArray, BoolArray]:
    """Return the factors of the viewing cones through ellipses, or segments, of the raw image.

    Parameters
    ----------
    camera
        The calibration, for this image size.
    ellipses
        (m,) px of the raw image.

    Returns
    -------
    The factors (m, 3, 3), camera frame, and which ellipses lie in the lens model's valid field (m,); of the others
    the factor has no meaning. Exact without distortion: K^-1 times the ellipse's factor. Else the lens is taken as
    linear over the ellipse, through the ends of its axes: good for small ones.
    """
    factor = ellipses.factor
    if camera.is_free_of_distortion:
        return np.asarray(np.linalg.inv(camera.camera_matrix) @ factor), np.ones(len(factor), dtype=np.bool_)
    factor = factor[:, :2]
    middle = factor[:, :, 2]
    ends = np.stack([middle + sign * factor[:, :, axis] for axis in (0, 1) for sign in (1.0, -1.0)], axis=1)
    rays = camera.rays(ends)
    valid = np.asarray(np.isfinite(rays).all(axis=(1, 2)))
    rays[~valid] = np.array([0.0, 0.0, 1.0])
    turn = np.broadcast_to(np.eye(3), (len(rays), 3, 3))
    sideways = np.any(rays[..., 2] <= FORWARD, axis=1)
    if sideways.any():
        axis = rays.sum(axis=1)
        axis = axis / np.linalg.norm(axis, axis=-1, keepdims=True)
        turn = np.where(sideways[:, None, None], np.stack([*plane_basis(axis), axis], axis=1), turn)
        rays = rays @ np.swapaxes(turn, 1, 2)
    plane = rays / rays[..., 2:]
    columns = [(plane[:, 0] - plane[:, 1]) / 2.0, (plane[:, 2] - plane[:, 3]) / 2.0, plane.mean(axis=1)]
    found = np.stack(columns, axis=-1)
    if sideways.any():
        found = np.swapaxes(turn, 1, 2) @ found
    found[~valid] = np.eye(3)
    return found, valid
