"""What the report on one image says of a circle's poses: numbers, cues, uncertainty, the view."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from circlepose.diagnostics.explain import ExplainedCircle
from circlepose.results import Candidate, CircleResult, CovarianceTerms, Flag
from circlepose.solvers.mirror_view import MirrorView, mirror_view
from circlepose.uncertainty.systematic import TERMS, shares

_TERM_MEANING = {"image": "the image's noise", "camera": "the camera", "radius": "the radius"}


def mirror_view_of(big: CircleResult, circles: Sequence[ExplainedCircle]) -> MirrorView | None:
    """Return how far the view of a coaxial target is from the one in which both pairs fit; None for other circles."""
    others = (circle.result for circle in circles if circle.result.instance == big.instance)
    small = next((result for result in others if result.circle == "small"), None)
    if big.circle != "big" or small is None or not (big.candidates and small.candidates):
        return None
    pose, other = big.candidates[big.chosen], small.candidates[small.chosen]
    return mirror_view(pose.center, pose.normal, big.radius_mm, other.center, small.radius_mm)


def view_rows(view: MirrorView | None) -> Iterator[tuple[str, str | None]]:
    """Yield a row on how far the view is from the one in which both pairs of candidates fit."""
    if view is not None:
        tilt, mirror = math.degrees(view.tilt_rad), math.degrees(view.mirror_tilt_rad)
        yield (
            "view",
            f"tilted by {tilt:.1f} deg, {abs(tilt - mirror):.1f} deg from the view in which both pairs of candidates "
            f"fit equally: {mirror:.1f} deg at this distance of {view.distance:.0f} mm",
        )


def pose_line(candidate: Candidate, *, chosen: bool) -> str:
    """Return centre and normal of a candidate, with their standard deviations where they are known."""
    center = "({:.3f}, {:.3f}, {:.3f}) mm".format(*candidate.center)
    normal = "({:.4f}, {:.4f}, {:.4f})".format(*candidate.normal)
    if candidate.covariance is not None:
        sigma = np.sqrt(np.diagonal(candidate.covariance))
        center += " +- ({:.2g}, {:.2g}, {:.2g})".format(*sigma[:3])
        normal += f" +- {math.degrees(float(np.hypot(*sigma[3:]))):.2g} deg"
    return f"centre {center}, normal {normal}{', chosen' if chosen else ''}"


def cue_lines(result: CircleResult) -> Iterator[str]:
    """Yield what a ring target's second circle shows of each candidate."""
    if result.vanishing_normal is not None and result.vanishing_sigma_deg is not None:
        normal = "({:.4f}, {:.4f}, {:.4f})".format(*result.vanishing_normal)
        distances = _by_pose(_distance(candidate) for candidate in result.candidates)
        yield f"vanishing line: normal {normal} +- {result.vanishing_sigma_deg:.2g} deg; away from {distances}"
    lengths = _by_pose(_ends(candidate) for candidate in result.candidates)
    if lengths:
        expected = result.generatrix_expected_mm
        given = "both ends alike" if expected is None else f"{expected:.2f} mm"
        yield f"generatrix: expected {given}, measured at the near and the far end {lengths}"
    heights = _by_pose(_height(candidate) for candidate in result.candidates)
    if heights:
        yield f"height of the other circles in front of the largest: {heights}"


def _by_pose(words: Iterable[str | None]) -> str:
    return ", ".join(f"pose {number}: {each}" for number, each in enumerate(words) if each is not None)


def _distance(candidate: Candidate) -> str | None:
    if candidate.vanishing_distance_deg is None:
        return None
    return f"{candidate.vanishing_distance_deg:.2g} deg{_in_sigmas(candidate)}"


def _height(candidate: Candidate) -> str | None:
    if candidate.height_mm is None or candidate.height_sigma_mm is None:
        return None
    return f"{candidate.height_mm:.3f} +- {candidate.height_sigma_mm:.2g} mm"


def _in_sigmas(candidate: Candidate) -> str:
    sigmas = candidate.vanishing_distance_sigmas
    return "" if sigmas is None else f" or {sigmas:.1f} sigma"


def _ends(candidate: Candidate) -> str | None:
    if candidate.generatrix_ends_mm is None:
        return None
    sigmas = candidate.generatrix_ends_sigma_mm
    if sigmas is None:
        return "{:.2f} and {:.2f} mm".format(*candidate.generatrix_ends_mm)
    near, far = (f"{end:.2f} +- {sigma:.2g}" for end, sigma in zip(candidate.generatrix_ends_mm, sigmas, strict=True))
    return f"{near} and {far} mm"


def small(probability: float) -> str:
    """Return a probability with two digits, or that it is below 0.0001."""
    return "below 0.0001" if 0.0 < probability < 1e-4 else f"{probability:.2g}"


def uncertainty_lines(result: CircleResult, *, refine: bool) -> tuple[str, ...]:
    """Return which term of the covariance dominates, or why there is no covariance."""
    chosen = result.candidates[result.chosen]
    if chosen.covariance is None:
        why = {
            Flag.EDGES_ONLY: "errors of edges go together",
            Flag.NEAR_RIGHT: "the tilt is not determined",
            Flag.NEAR_DEGENERATE: "the image is nearly a segment",
        }
        if not refine:
            return ("no covariance: --no-refine looks at no levels",)
        known = [words for flag, words in why.items() if flag in result.flags]
        return (f"no covariance{f': {known[0]}' if known else ''}",)
    terms = chosen.covariance_terms
    if terms is None:
        return ("the image's noise alone; --camera-sigma and --radius-sigma-mm add what dominates in practice",)
    return tuple(
        f"{what}: mostly {_TERM_MEANING[dominating(terms, index)]} (share of the variance: {_listed(terms, index)})"
        for index, what in enumerate(("position", "normal"))
    )


def dominating(terms: CovarianceTerms, index: int) -> str:
    """Return the name of the largest term of the variance; `index` 0 is the position, 1 the normal."""
    parts = shares(terms)
    return max(parts, key=lambda name: parts[name][index])


def _listed(terms: CovarianceTerms, index: int) -> str:
    parts = shares(terms)
    return ", ".join(f"{name} {parts[name][index]:.1%}" for name in TERMS if parts[name][index] > 0.0)
