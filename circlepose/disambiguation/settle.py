"""Lone circles with hints: each takes the candidate that the hints make likelier.

Hints are a common plane of all circles, a rough normal, the vertical of horizontal surfaces and the side that a
surface faces. The log likelihoods of those given are added.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from circlepose._typing import FloatArray
from circlepose.disambiguation.common_plane import common_plane
from circlepose.disambiguation.hint_likelihoods import Decision, decide, facing, rough_normal, up_direction
from circlepose.disambiguation.options import DEFAULT, DisambiguationOptions
from circlepose.results import Candidate, CircleResult, Flag, SettledBy
from circlepose.targets.hints import facing_direction
from circlepose.targets.target import Target


def settled_by_hints(
    circles: list[CircleResult], target: Target, *, options: DisambiguationOptions = DEFAULT
) -> list[CircleResult]:
    """Order the candidates of lone circles by all hints on their target.

    The circles of each method are settled among themselves.

    Parameters
    ----------
    circles
        The circles of one image.
    target
        The target, with its hints.
    options
        The numbers of the hints.

    Returns
    -------
    The circles in their order, the likelier candidate of each first, with the probability that it is the wrong one.
    Circles with one candidate are unchanged.
    """
    settled = list(circles)
    for method in dict.fromkeys(circle.method for circle in circles):
        index = [i for i, c in enumerate(circles) if c.method == method and len(c.candidates) == 2]
        if not index or not _has_hints(target, len(index)):
            continue
        by_plane, by_hints = _log_likelihoods([circles[i] for i in index], target, options)
        decision = decide(by_plane + by_hints)
        settled_by = _settled_by(decision, by_plane, by_hints, options)
        for i, chosen, wrong, cue in zip(index, decision.chosen, decision.ambiguity, settled_by, strict=True):
            circle = circles[i]
            first, second = circle.candidates
            flags = tuple(f for f in circle.flags if f is not Flag.AMBIGUOUS or wrong >= options.undecided)
            settled[i] = replace(
                circle,
                candidates=(first, second) if chosen == 0 else (second, first),
                ambiguity=float(wrong),
                settled_by=cue,
                flags=flags,
            )
    return settled


def _has_hints(target: Target, number: int) -> bool:
    """Whether there is any hint on `number` circles with two candidates."""
    own = (target.normal_hint, target.up_hint, target.facing)
    return any(hint is not None for hint in own) or (target.same_plane and number > 1)


def _settled_by(
    decision: Decision, by_plane: FloatArray, by_hints: FloatArray, options: DisambiguationOptions
) -> list[SettledBy]:
    """Return what settled the choice of each circle: the stronger one of the plane and the other hints."""
    plane, hints = (np.abs(scores[:, 0] - scores[:, 1]) for scores in (by_plane, by_hints))
    return [
        SettledBy.NONE if wrong >= options.undecided else SettledBy.COMMON_PLANE if more else SettledBy.HINT
        for wrong, more in zip(decision.ambiguity, plane > hints, strict=True)
    ]


def _log_likelihoods(
    circles: list[CircleResult], target: Target, options: DisambiguationOptions
) -> tuple[FloatArray, FloatArray]:
    """Return the log likelihoods (m, 2) of the candidates by the common plane, and by the other hints."""
    normals = np.stack([[c.normal for c in circle.candidates] for circle in circles])
    errors = np.array(
        [[_errors(circle, candidate, options) for candidate in circle.candidates] for circle in circles]
    )
    sigma_rad = np.hypot(errors[..., 0], np.radians(options.flatness_deg))
    by_plane, scores = np.zeros((2, *sigma_rad.shape))
    if target.same_plane and len(circles) > 1:
        centers = np.stack([[c.center for c in circle.candidates] for circle in circles])
        sigma_mm = np.hypot(errors[..., 1], options.flatness_mm)
        by_plane = common_plane(centers, normals, sigma_rad, sigma_mm, options=options)
    # Both candidates are equally likely before, so they get the same spread.
    own_deg = np.degrees(sigma_rad.mean(axis=-1, keepdims=True))
    if target.normal_hint is not None:
        spread = np.hypot(target.normal_hint.spread_deg, own_deg)
        likelihoods = rough_normal(normals, np.array(target.normal_hint.direction), spread)
        scores = scores + np.logaddexp(likelihoods, options.least_log_likelihood)
    if target.up_hint is not None:
        spread = np.hypot(target.up_hint.spread_deg, own_deg)
        likelihoods = up_direction(normals, np.array(target.up_hint.direction), spread)
        scores = scores + np.logaddexp(likelihoods, options.least_log_likelihood)
    if target.facing is not None:
        scores = scores + facing(normals, np.array(facing_direction(target.facing)), sigma_rad)
    return by_plane, scores


def _errors(circle: CircleResult, candidate: Candidate, options: DisambiguationOptions) -> tuple[float, float]:
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
