"""Hints on lone circles: what is known of the scene, as likelihoods of the two candidates. Pure NumPy.

A hint gives log likelihoods (m, 2) for m circles with two candidates each. Those of independent hints are added;
`decide` turns the sum into a choice with the probability that it is wrong. `sigma_rad` (m, 2) is the angular
standard error of a candidate's normal, per axis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from circlepose._numerics import angle_between, logistic
from circlepose._typing import FloatArray, IntArray, frozen
from circlepose.errors import ArgumentError


@dataclass(frozen=True, slots=True, eq=False)
class Decision:
    """Which candidate of each circle to use."""

    chosen: IntArray
    """(m,) index of the candidate"""
    ambiguity: FloatArray
    """(m,) probability that it is the wrong one, at most 0.5"""


def decide(log_likelihoods: FloatArray) -> Decision:
    """Choose the likelier candidate of each circle.

    Parameters
    ----------
    log_likelihoods
        (m, 2) of the candidates, by all hints together. Before them both are equally likely.
    """
    odds = log_likelihoods[:, 0] - log_likelihoods[:, 1]
    return Decision(np.where(odds >= 0.0, 0, 1), frozen(logistic(-np.abs(odds))))


def rough_normal(normals: FloatArray, direction: FloatArray, spread_deg: FloatArray | float) -> FloatArray:
    """Return log likelihoods (m, 2) where the surfaces face a direction, roughly.

    Parameters
    ----------
    normals
        (m, 2, 3) unit normals of the candidates, camera frame.
    direction
        (3,) of any length, camera frame.
    spread_deg
        Standard deviation of the angle per axis, deg, of all circles or of each (m, 1). It includes the errors of the
        normals.

    Returns
    -------
    Of a Gaussian in the angle, up to a constant.
    """
    return _gaussian(_angles(normals, direction), spread_deg)


def up_direction(normals: FloatArray, up: FloatArray, spread_deg: FloatArray | float) -> FloatArray:
    """Return log likelihoods (m, 2) where the surfaces are horizontal, roughly.

    Parameters
    ----------
    normals, spread_deg
        See `rough_normal`.
    up
        (3,) the vertical in the camera frame, either way: a floor shows its upper side, a ceiling the lower one.

    Returns
    -------
    Of a Gaussian in the angle to the nearer of both directions, up to a constant.
    """
    angles = _angles(normals, up)
    return _gaussian(np.minimum(angles, np.pi - angles), spread_deg)


def facing(normals: FloatArray, side: FloatArray, sigma_rad: FloatArray) -> FloatArray:
    """Return log likelihoods (m, 2) where the surfaces face a side of the line of sight.

    The right candidate is the one turned further to that side, unless errors have exchanged the two. They are
    mirrored about the line of sight, so an error that moves one to the side moves the other away from it.

    Parameters
    ----------
    normals
        (m, 2, 3) unit normals of the candidates, camera frame.
    side
        (3,) direction of the side, camera frame: (-1, 0, 0) is left.
    sigma_rad
        (m, 2) standard error of each normal per axis, rad.

    Returns
    -------
    Logarithms of the probabilities that the one or the other is turned further.

    Raises
    ------
    ArgumentError
        For arrays of another shape, or errors that are not positive.
    """
    from scipy.special import log_ndtr  # noqa: PLC0415 - takes longer to import than all the rest, and is rare

    check_candidates(normals, sigma_rad)
    towards = normals @ (np.asarray(side, dtype=np.float64) / np.linalg.norm(side))
    lead = (towards[:, 0] - towards[:, 1]) / np.sum(sigma_rad, axis=-1)
    return np.stack([log_ndtr(lead), log_ndtr(-lead)], axis=-1)


def check_candidates(normals: FloatArray, sigma_rad: FloatArray) -> None:
    """Raise `ArgumentError` where these are not two candidates of each circle, with their errors."""
    if np.ndim(normals) != 3 or np.shape(normals)[1:] != (2, 3):
        raise ArgumentError(
            f"normals: expected two candidates of m circles, (m, 2, 3), got shape {np.shape(normals)}."
        )
    if np.shape(sigma_rad) != np.shape(normals)[:2] or not np.all(np.asarray(sigma_rad) > 0.0):
        raise ArgumentError("sigma_rad: expected a positive angle for each candidate, (m, 2).")


def _gaussian(angles: FloatArray, spread_deg: FloatArray | float) -> FloatArray:
    return np.asarray(-0.5 * (angles / np.radians(spread_deg)) ** 2)


def _angles(normals: FloatArray, direction: FloatArray) -> FloatArray:
    unit = np.asarray(direction, dtype=np.float64) / np.linalg.norm(direction)
    return angle_between(normals, unit)
