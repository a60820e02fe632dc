"""Lone circles of which something is known: each takes the candidate that the hints speak for.

Hints are a common plane of all circles, a rough normal, the vertical of horizontal surfaces and the side that a
surface faces; the log likelihoods of those given add up.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from circlepose._typing import FloatArray
from circlepose.disambiguation.hint_likelihoods import (
    Choice,
    choose,
    common_plane,
    facing,
    rough_normal,
    up_direction,
)
from circlepose.results import Candidate, CircleResult, Flag, SettledBy
from circlepose.targets.hints import facing_direction
from circlepose.targets.target import Target

_FLATNESS_RAD = np.radians(0.3)
_FLATNESS_MM = 0.1
"""No board is flat, and no lens is known, to better than about this."""
_STRANGE = -12.5
"""Log likelihood, that of 5 spreads, below which a hint does not hold for the circle and tells nothing."""
_UNTOLD = 0.45
"""From this chance of being wrong on nothing has told the candidates apart."""


def settled_by_hints(circles: list[CircleResult], target: Target) -> list[CircleResult]:
    """Return `circles` with the likelier candidate first by all hints of `target`, and its chance of being wrong.

    Each method's circles are settled among themselves. Circles with one candidate stay as they are.
    """
    settled = list(circles)
    for method in dict.fromkeys(circle.method for circle in circles):
        index = [i for i, c in enumerate(circles) if c.method == method and len(c.candidates) == 2]
        if not index or not _hints_at(target, len(index)):
            continue
        by_plane, by_hints = _scores([circles[i] for i in index], target)
        choice = choose(by_plane + by_hints)
        settled_by = _settled_by(choice, by_plane, by_hints)
        for i, chosen, wrong, what in zip(index, choice.chosen, choice.wrong, settled_by, strict=True):
            circle = circles[i]
            first, second = circle.candidates
            flags = tuple(f for f in circle.flags if f is not Flag.AMBIGUOUS or wrong >= _UNTOLD)
            settled[i] = replace(
                circle,
                candidates=(first, second) if chosen == 0 else (second, first),
                ambiguity=float(wrong),
                settled_by=what,
                flags=flags,
            )
    return settled


def _hints_at(target: Target, number: int) -> bool:
    """Tell whether there is any hint for `number` circles with two candidates."""
    own = (target.normal_hint, target.up_hint, target.facing)
    return any(hint is not None for hint in own) or (target.same_plane and number > 1)


def _settled_by(choice: Choice, by_plane: FloatArray, by_hints: FloatArray) -> list[SettledBy]:
    """Return what settled the choice of each circle: of plane and hints, which both may be given, the stronger."""
    plane, hints = (np.abs(scores[:, 0] - scores[:, 1]) for scores in (by_plane, by_hints))
    return [
        SettledBy.NONE if wrong >= _UNTOLD else SettledBy.COMMON_PLANE if more else SettledBy.HINT
        for wrong, more in zip(choice.wrong, plane > hints, strict=True)
    ]


def _scores(circles: list[CircleResult], target: Target) -> tuple[FloatArray, FloatArray]:
    """Return the log likelihoods (m, 2) of the candidates by the common plane, and by the other hints."""
    normals = np.stack([[c.normal for c in circle.candidates] for circle in circles])
    errors = np.array([[_errors(circle, candidate) for candidate in circle.candidates] for circle in circles])
    sigma_rad = np.hypot(errors[..., 0], _FLATNESS_RAD)
    by_plane, scores = np.zeros((2, *sigma_rad.shape))
    if target.same_plane and len(circles) > 1:
        centers = np.stack([[c.center for c in circle.candidates] for circle in circles])
        by_plane = common_plane(centers, normals, sigma_rad, np.hypot(errors[..., 1], _FLATNESS_MM))
    # Either candidate is as likely, so both get the same spread.
    own_deg = np.degrees(sigma_rad.mean(axis=-1, keepdims=True))
    if target.normal_hint is not None:
        spread = np.hypot(target.normal_hint.spread_deg, own_deg)
        scores = scores + _bounded(rough_normal(normals, np.array(target.normal_hint.direction), spread))
    if target.up_hint is not None:
        spread = np.hypot(target.up_hint.spread_deg, own_deg)
        scores = scores + _bounded(up_direction(normals, np.array(target.up_hint.direction), spread))
    if target.facing is not None:
        scores = scores + facing(normals, np.array(facing_direction(target.facing)), sigma_rad)
    return by_plane, scores


def _bounded(log_likelihoods: FloatArray) -> FloatArray:
    return np.asarray(np.logaddexp(log_likelihoods, _STRANGE))


def _errors(circle: CircleResult, candidate: Candidate) -> tuple[float, float]:
    """Return standard errors of a candidate's normal (rad, per axis) and of its centre across the plane (mm).

    From its covariance, where it has one, else from the scatter of the circle's edge.
    """
    if candidate.covariance is not None:
        tilt = float(np.sqrt(np.trace(candidate.covariance[3:, 3:]) / 2.0))
        return tilt, float(np.sqrt(candidate.normal @ candidate.covariance[:3, :3] @ candidate.normal))
    assert circle.ellipse is not None
    assert circle.residual_px is not None
    assert circle.contour is not None
    a, b = float(circle.ellipse.semi_major), float(circle.ellipse.semi_minor)
    axes = max(circle.residual_px, 0.02) / np.sqrt(len(circle.contour) / 4.0) / a
    # cos(tilt) = b/a, whose error becomes the tilt's over sin(tilt), or its own root near frontal.
    tilt = float(axes / max(np.sqrt(max(1.0 - (b / a) ** 2, 0.0)), np.sqrt(axes)))
    return tilt, float(np.linalg.norm(candidate.center)) * axes
