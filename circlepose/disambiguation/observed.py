"""Candidate poses as observations of a plane: two tilts and a height each, with their covariance. Pure NumPy.

A plane is a unit normal n and a point p on it. A candidate (center c, normal u) that lies in it deviates from it by
its errors alone: by two tilts of u from n, towards the vectors of `cone.plane_basis(u)`, and by the height n.(c - p).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from circlepose._numerics import cross
from circlepose._typing import FloatArray, IntArray
from circlepose.disambiguation.options import DisambiguationOptions
from circlepose.geometry.cone import plane_basis
from circlepose.results import Candidate, CircleResult


@dataclass(frozen=True, slots=True, eq=False)
class Observed:
    """k candidates each of m circles."""

    centers: FloatArray
    """(m, k, 3) mm, camera frame"""
    normals: FloatArray
    """(m, k, 3) unit"""
    bases: FloatArray
    """(m, k, 2, 3) the vectors towards which the tilts are"""
    covariances: FloatArray
    """(m, k, 3, 3) of two tilts (rad) and the height (mm), with the allowance for flatness"""
    information: FloatArray
    """(m, k, 3, 3) their inverse"""
    log_peaks: FloatArray
    """(m, k) logarithm of the density at no deviation, rad^-2 mm^-1"""

    def subset(self, index: IntArray | slice) -> Observed:
        """Return the circles of `index`."""
        return Observed(
            self.centers[index],
            self.normals[index],
            self.bases[index],
            self.covariances[index],
            self.information[index],
            self.log_peaks[index],
        )

    def deviations(self, normals: FloatArray, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the deviations (h, m, k, 3) from h planes, and their slopes (h, m, k, 3, 3).

        Parameters
        ----------
        normals, points
            (h, 3) unit normals, and points (mm) on the planes.

        Returns
        -------
        Tilts (rad) and height (mm), and their derivatives by two tilts of the plane about its point, towards the
        vectors of `cone.plane_basis`, and by a shift of the plane along its normal.
        """
        frames = np.concatenate([np.stack(plane_basis(normals), axis=-2), normals[:, None]], axis=1)
        # Products of matrices, as einsum is slow for as many: components along the frames, (h, m, k, 2, 3).
        tilted = np.moveaxis(self.bases @ frames.reshape(-1, 3).T, -1, 0)
        tilted = np.moveaxis(tilted.reshape(len(frames), 3, *self.bases.shape[:3]), 1, -1)
        away = np.moveaxis(self.centers @ frames.reshape(-1, 3).T, -1, 0)
        away = np.moveaxis(away.reshape(len(frames), 3, *self.centers.shape[:2]), 1, -1)
        away = away - np.einsum("hsx,hx->hs", frames, points)[:, None, None]
        across = -tilted[..., 2]
        sine = np.linalg.norm(across, axis=-1)
        cosine = np.moveaxis(self.normals @ normals.T, -1, 0)
        values = np.empty((*sine.shape, 3))
        values[..., :2] = across * (np.arctan2(sine, cosine) / np.maximum(sine, 1e-300))[..., None]
        values[..., 2] = away[..., 2]
        slopes = np.zeros((*sine.shape, 3, 3))
        slopes[..., :2, :2] = -tilted[..., :2]
        slopes[..., 2, :2] = away[..., :2]
        slopes[..., 2, 2] = -1.0
        return values, slopes


def moved(normals: FloatArray, points: FloatArray, steps: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return planes (h, 3) and (h, 3) after steps (h, 3): two tilts (rad) and a shift along the normal (mm)."""
    turns = np.stack(plane_basis(normals), axis=-2)
    turned = normals + np.einsum("hsx,hs->hx", turns, steps[:, :2])
    return turned / np.linalg.norm(turned, axis=-1, keepdims=True), points + steps[:, 2:] * normals


def observed(circles: Sequence[CircleResult], options: DisambiguationOptions) -> Observed:
    """Return the candidates of circles that all have as many."""
    centers = np.array([[candidate.center for candidate in circle.candidates] for circle in circles])
    normals = np.array([[candidate.normal for candidate in circle.candidates] for circle in circles])
    covariances = np.array(
        [[deviation_covariance(circle, each, options) for each in circle.candidates] for circle in circles]
    )
    return observations(centers, normals, covariances + flatness(options))


def flatness(options: DisambiguationOptions) -> FloatArray:
    """Return the covariance (3, 3) of the tilts (rad) and the height (mm) of circles in an uneven surface."""
    return np.diag([np.radians(options.flatness_deg)] * 2 + [options.flatness_mm]) ** 2


def observations(centers: FloatArray, normals: FloatArray, covariances: FloatArray) -> Observed:
    """Return candidates (m, k, 3), (m, k, 3) with covariances (m, k, 3, 3) of their deviations from a plane."""
    bases = np.stack(plane_basis(normals), axis=-2)
    information, determinants = inverse(covariances)
    log_peaks = -0.5 * np.log(determinants) - 1.5 * np.log(2.0 * np.pi)
    return Observed(centers, normals, bases, covariances, information, log_peaks)


def deviation_covariance(circle: CircleResult, candidate: Candidate, options: DisambiguationOptions) -> FloatArray:
    """Return the covariance (3, 3) of a candidate's tilts (rad) and of its center across its plane (mm)."""
    if candidate.covariance is None:
        tilt, height = standard_errors(circle, candidate, options)
        return np.diag([tilt, tilt, height]) ** 2
    slopes = deviation_slopes(candidate.normal)
    return np.asarray(slopes @ candidate.covariance @ slopes.T)


def deviation_slopes(normal: FloatArray) -> FloatArray:
    """Return the derivatives (3, 5) of two tilts and the height by a pose: center (three) and two tilts."""
    slopes = np.zeros((3, 5))
    slopes[0, 3] = slopes[1, 4] = 1.0
    slopes[2, :3] = normal
    return slopes


def standard_errors(
    circle: CircleResult, candidate: Candidate, options: DisambiguationOptions
) -> tuple[float, float]:
    """Return standard errors of a candidate's normal (rad, per axis) and of its center across the plane (mm).

    From its covariance, where it has one, else from the scatter of the circle's edge.
    """
    if candidate.covariance is not None:
        tilt = float(np.sqrt(np.trace(candidate.covariance[3:, 3:]) / 2.0))
        return tilt, float(np.sqrt(candidate.normal @ candidate.covariance[:3, :3] @ candidate.normal))
    assert circle.ellipse is not None
    assert circle.residual_px is not None
    assert circle.contour is not None
    a, b = float(circle.ellipse.semi_major), float(circle.ellipse.semi_minor)
    axes = max(circle.residual_px, options.least_residual_px) / np.sqrt(len(circle.contour) / 4.0) / a
    # cos(tilt) = b/a, whose error becomes the tilt's over sin(tilt), or its own root near frontal.
    tilt = float(axes / max(np.sqrt(max(1.0 - (b / a) ** 2, 0.0)), np.sqrt(axes)))
    return tilt, float(np.linalg.norm(candidate.center)) * axes


def misfits(values: FloatArray, information: FloatArray) -> FloatArray:
    """Return the squares (...) of values (..., 3), standardized by their information (..., 3, 3)."""
    return np.asarray(np.sum((information @ values[..., None])[..., 0] * values, axis=-1))


def inverse(matrices: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return inverses and determinants of symmetric matrices (..., 3, 3): faster than LAPACK for many small ones."""
    first, second, third = matrices[..., 0], matrices[..., 1], matrices[..., 2]
    cofactors = np.stack([cross(second, third), cross(third, first), cross(first, second)], axis=-2)
    determinants = np.einsum("...i,...i->...", first, cofactors[..., 0, :])
    return cofactors / determinants[..., None, None], determinants
