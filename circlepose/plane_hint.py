"""Lone circles that are known to lie in one plane: each takes the candidate that agrees with the others'."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from circlepose.disambiguation.hints import Choice, choose, common_plane
from circlepose.pose import CircleResult, Flag

_FLATNESS_RAD = np.radians(0.3)
_FLATNESS_MM = 0.1
"""No board is flat, and no lens is known, to better than about this."""


_UNTOLD = 0.45
"""From this chance of being wrong on nothing has told the candidates apart."""


def settled_by_common_plane(circles: list[CircleResult]) -> list[CircleResult]:
    """Return `circles` with the candidate on their common plane first, and the chance that it is the wrong one.

    Each method's circles are settled among themselves. Circles with one candidate stay as they are.
    """
    settled = list(circles)
    for method in dict.fromkeys(circle.method for circle in circles):
        index = [i for i, c in enumerate(circles) if c.method == method and len(c.candidates) == 2]
        if len(index) < 2:
            continue
        choice = _choice([circles[i] for i in index])
        for i, chosen, wrong in zip(index, choice.chosen, choice.wrong, strict=True):
            circle = circles[i]
            first, second = circle.candidates
            flags = tuple(f for f in circle.flags if f is not Flag.AMBIGUOUS or wrong >= _UNTOLD)
            settled[i] = replace(
                circle,
                candidates=(first, second) if chosen == 0 else (second, first),
                ambiguity=float(wrong),
                flags=flags,
            )
    return settled


def _choice(circles: list[CircleResult]) -> Choice:
    centers = np.stack([[c.center for c in circle.candidates] for circle in circles])
    normals = np.stack([[c.normal for c in circle.candidates] for circle in circles])
    errors = [_errors(circle) for circle in circles]
    sigma_rad = np.repeat(np.array([e[0] for e in errors])[:, None], 2, axis=1)
    sigma_mm = np.repeat(np.array([e[1] for e in errors])[:, None], 2, axis=1)
    return choose(common_plane(centers, normals, sigma_rad, sigma_mm))


def _errors(circle: CircleResult) -> tuple[float, float]:
    """Return standard deviations of a circle's tilt (rad) and distance (mm), from the scatter of its edge."""
    assert circle.ellipse is not None
    assert circle.residual_px is not None
    assert circle.contour is not None
    a, b = float(circle.ellipse.semi_major), float(circle.ellipse.semi_minor)
    axes = max(circle.residual_px, 0.02) / np.sqrt(len(circle.contour) / 4.0) / a
    # cos(tilt) = b/a, whose error becomes the tilt's over sin(tilt), or its own root near frontal.
    tilt = axes / max(np.sqrt(max(1.0 - (b / a) ** 2, 0.0)), np.sqrt(axes))
    distance = float(np.linalg.norm(circle.candidates[0].center)) * axes
    return float(np.hypot(tilt, _FLATNESS_RAD)), float(np.hypot(distance, _FLATNESS_MM))
