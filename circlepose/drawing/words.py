"""Poses in the words of a picture: as many digits as the standard deviations allow, ambiguity as a sentence."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence

import numpy as np

from circlepose._typing import FloatArray
from circlepose.results import Candidate, CircleResult, Flag, SettledBy

_SETTLED_BY = {
    SettledBy.VANISHING_LINE: "the vanishing line",
    SettledBy.GENERATRIX: "the generatrix",
    SettledBy.JOINT_FIT: "the joint fit",
    SettledBy.COMMON_PLANE: "the common plane",
    SettledBy.HINT: "the hint",
}
DOUBTFUL_FROM = 0.05
"""From this ambiguity on a choice is shown as doubtful: one in twenty such poses is the wrong one."""
_EVEN = 0.45
"""From this ambiguity on both poses are said to be equally possible."""
SURE = 0.0005
"""Below this ambiguity nothing is said of the other pose."""
ROW_NAMES = ("instance", "center, mm", "normal", "sigma of center, mm", "of normal", "choice")


def is_ambiguous(circle: CircleResult) -> bool:
    """Whether nothing settles which of two poses is right."""
    return Flag.AMBIGUOUS in circle.flags


def is_doubtful(circle: CircleResult) -> bool:
    """Whether the pose may well be the other one."""
    return is_ambiguous(circle) or circle.ambiguity >= DOUBTFUL_FROM


def choice(circle: CircleResult) -> str:
    """Return what is known of the choice between the candidates."""
    if not circle.candidates:
        return f"{circle.status}: {without_advice(circle.reason)}" if circle.reason else f"{circle.status}"
    if len(circle.candidates) == 1:
        return "one pose possible"
    if is_ambiguous(circle):
        other = "" if circle.ambiguity >= _EVEN else f", {percent(circle.ambiguity)} chance of the other"
        return f"ambiguous: two poses possible{other}"
    cue = _SETTLED_BY.get(circle.settled_by)
    doubt = f"{percent(circle.ambiguity)} chance of the other pose"
    if is_doubtful(circle):
        return f"{doubt}, by {cue}" if cue else doubt
    settled = f"settled by {cue}" if cue else ""
    return ", ".join(part for part in (settled, doubt if circle.ambiguity >= SURE else "") if part) or "settled"


def without_advice(reason: str) -> str:
    """Return a reason without what to set, which is another option at each edge of the program."""
    return "; ".join(part for part in reason.split("; ") if not part.startswith("set "))


def percent(share: float) -> str:
    """Return a share of 1 in percent, with a decimal where it is small."""
    return f"{100.0 * share:.0f} %" if share >= 0.0095 else f"{100.0 * share:.1f} %"


def caption(circles: Sequence[CircleResult]) -> tuple[str, ...]:
    """Return the lines about the circles of one target."""
    first = circles[0]
    lines = [f"instance {first.instance}: {', '.join(f'{c.circle} of radius {c.radius_mm:g} mm' for c in circles)}"]
    lines.extend(f"{circle.circle}: {choice(circle)}" for circle in circles if circle.pose is None)
    posed = [(circle.circle, _pose(circle.pose)) for circle in circles if circle.pose is not None]
    for each in zip(*(own for _, own in posed), strict=True):
        is_same = len(set(each)) == 1
        lines.extend(
            [each[0]] if is_same else [f"{name}: {line}" for (name, _), line in zip(posed, each, strict=True)]
        )
    lines.extend(dict.fromkeys(choice(circle) for circle in circles if circle.candidates))
    said = flags(circles)
    return (*lines, said) if said else tuple(lines)


def flags(circles: Sequence[CircleResult]) -> str:
    """Return the flags of circles, but for `ambiguous`, which `choice` says."""
    names = dict.fromkeys(str(flag) for circle in circles for flag in circle.flags if flag is not Flag.AMBIGUOUS)
    return f"flags: {', '.join(names)}" if names else ""


def row(circles: Sequence[CircleResult]) -> tuple[str, ...]:
    """Return the cells of `ROW_NAMES` for one target: of its first circle that has a pose."""
    circle = next((c for c in circles if c.candidates), circles[0])
    pose = circle.pose
    if pose is None:
        return (f"{circle.instance}", "", "", "", "", choice(circle))
    each = "" if pose.sigma_mm is None else vector(pose.sigma_mm, significant=2)
    turn = "" if pose.sigma_deg is None else f"{pose.sigma_deg:.2g} deg"
    return (f"{circle.instance}", center(pose), normal(pose, most=4), each, turn, choice(circle))


def center(pose: Candidate) -> str:
    """Return the center, mm, with two digits of its largest standard deviation."""
    return vector(pose.center, decimals=decimals(None if pose.sigma_mm is None else float(pose.sigma_mm.max())))


def normal(pose: Candidate, most: int = 5) -> str:
    """Return the normal with two digits of its standard deviation, or `most` decimals."""
    sigma = None if pose.sigma_deg is None else math.radians(pose.sigma_deg)
    return vector(pose.normal, decimals=max(3, decimals(sigma, usual=3, most=most)))


def sigmas(pose: Candidate) -> str:
    """Return the standard deviations of a pose, or why there are none."""
    if pose.sigma_mm is None or pose.sigma_deg is None:
        return "sigma unknown"
    return f"sigma {vector(pose.sigma_mm, significant=2)} mm, {pose.sigma_deg:.2g} deg"


def counted(number: int, noun: str) -> str:
    """Return a number of things."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def summary(circles: Sequence[CircleResult]) -> str:
    """Return how many targets there are, by which method, and how the candidates of all were chosen."""
    targets: dict[int, CircleResult] = {}
    for circle in circles:
        targets.setdefault(circle.instance, circle)
    kinds = Counter(map(_kind_of_choice, targets.values()))
    said = ", ".join(words if len(kinds) == 1 else f"{n} {words}" for words, n in kinds.most_common())
    return f"{counted(len(targets), 'target')}, measured by {circles[0].method}: {said}"


def _kind_of_choice(circle: CircleResult) -> str:
    """Return `choice` in the words that targets have in common."""
    if not circle.candidates:
        return "without a pose"
    if is_doubtful(circle) and not is_ambiguous(circle):
        return f"with a chance of {percent(DOUBTFUL_FROM)} or more of the other pose"
    return choice(circle).split(",")[0].replace("ambiguous: two poses possible", "ambiguous (two poses possible)")


def _pose(pose: Candidate) -> tuple[str, ...]:
    """Return three lines of a caption."""
    return (f"center {center(pose)} mm", f"normal {normal(pose)}", sigmas(pose))


def decimals(sigma: float | None, usual: int = 2, most: int = 4) -> int:
    """Return how many decimals show two digits of `sigma`, up to `most`; `usual` where it is not known."""
    if sigma is None or not sigma > 0.0 or not math.isfinite(sigma):
        return usual
    return int(np.clip(1 - math.floor(math.log10(sigma)), 0, most))


def vector(values: FloatArray, *, decimals: int = 0, significant: int | None = None) -> str:
    """Return numbers (n,) in parentheses, with as many decimals, or significant digits."""
    if significant is not None:
        return f"({', '.join(f'{value:.{significant}g}' for value in values.tolist())})"
    return f"({', '.join(f'{value + 0.0:.{decimals}f}' for value in values.tolist())})"
