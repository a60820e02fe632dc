"""Why an image has none of the circles looked for, in one sentence."""

from __future__ import annotations

from collections import Counter

from circlepose.detection.contour import Rejection


def why_none(rejected: Counter[Rejection]) -> str:
    """Return the reason that stopped the most promising contours, the later stages first, as a sentence."""
    reasons = [Rejection.DEPTH, Rejection.NO_POSE, Rejection.POLARITY, Rejection.NOT_IN_TARGET, Rejection.RESIDUAL]
    reasons += [
        Rejection.LOW_SCORE,
        Rejection.BY_CHANCE,
        Rejection.MAJOR_AXIS,
        Rejection.MINOR_AXIS,
        Rejection.WITHOUT_EDGE,
    ]
    reasons += [
        Rejection.HOLLOW,
        Rejection.RAGGED,
        Rejection.POLYGON,
        Rejection.BLURRED,
        Rejection.FAINT,
        Rejection.WEAK_EDGE,
    ]
    reasons += [Rejection.TOO_LITTLE_RIM, Rejection.UNLIKE_A_RIM, Rejection.NOT_ELLIPTICAL]
    # Dots are what the image shows where there are more of them than of contours that nearly are a rim.
    dots_first = rejected[Rejection.TOO_SMALL] > rejected[Rejection.TOO_LITTLE_RIM]
    reasons.insert(reasons.index(Rejection.TOO_LITTLE_RIM) + int(not dots_first), Rejection.TOO_SMALL)
    others = f"; {number} left out as the world board's" if (number := rejected[Rejection.WORLD_BOARD]) else ""
    for reason in reasons:
        if rejected[reason]:
            return f"no contour is the target's image; {rejected[reason]} came close: {reason}{others}"
    return f"no contour is the target's image{others}"
