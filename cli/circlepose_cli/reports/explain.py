"""What is said of one image: in plain words, and as JSON."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from circlepose.diagnostics.explain import ExplainedCircle, Explanation, segments_left_out
from circlepose.diagnostics.residuals import LevelResiduals
from circlepose.io.tables.json_records import image_record
from circlepose.io.text.escaping import printable
from circlepose.measurement.rim import EdgeRim, FittedRim
from circlepose.results import SETTLED_BY_MEANING, Candidate, CircleResult, CovarianceTerms, Flag
from circlepose.solvers.mirror_view import MirrorView, mirror_view
from circlepose.uncertainty.systematic import TERMS, shares

SCHEMA = "circlepose.diagnostics.explain/1"
_INDENT = 12
_TERM_MEANING = {"image": "the image's noise", "camera": "the camera", "radius": "the radius"}
_EVEN = 1.5
"""Up to which `correlation` the residuals are those of independent pixels."""
_UNEQUAL = 0.05


def report_text(explanation: Explanation, camera: str, target: str) -> str:
    """Return the report in plain words; `camera` and `target` are where these came from."""
    result = explanation.result
    width, height = result.image_size or (0, 0)
    rows: list[tuple[str, str | None]] = [
        ("image", f"{result.image}, {width} x {height} px: {result.status}"),
        ("", result.reason),
        ("camera", camera),
        ("target", target),
        ("contours", f"{explanation.contours} worth a pose; {sum(explanation.rejected.values())} not used"),
    ]
    rows += [("", f"{number:6d}  {reason}") for reason, number in explanation.rejected.items()]
    for circle in explanation.circles:
        rows += [("", None), *_circle_rows(circle, refine=explanation.refine)]
        rows += _view_rows(_mirror_view(circle.result, explanation.circles))
    return "\n".join(
        f"{name:<{_INDENT}}{printable(words)}".rstrip() if words is not None else ""
        for name, words in rows
        if words != ""
    )


def _circle_rows(circle: ExplainedCircle, *, refine: bool) -> Iterator[tuple[str, str | None]]:
    result = circle.result
    yield f"#{result.instance} {result.circle}", f"radius {result.radius_mm:g} mm, {result.method}: {result.status}"
    yield "", result.reason
    yield (
        "contour",
        "none of its own: the rim was sought where another circle of the target predicts it"
        if circle.contour is None
        else circle.contour.kept_because,
    )
    yield "edges", _edges(circle)
    yield "levels", _levels(circle, refine=refine)
    for words in _left_out(circle):
        yield "left out", words
    for number, candidate in enumerate(result.candidates):
        yield f"pose {number}", _pose(candidate, chosen=number == result.chosen)
    if result.candidates:
        yield "ambiguity", f"{_small(result.ambiguity)}, the probability that the chosen pose is the wrong one"
        yield "settled by", f"{result.settled_by}: {SETTLED_BY_MEANING[result.settled_by]}"
        for name, words in zip(("", "", "", ""), _cues(result), strict=False):
            yield name, words
        for name, words in zip(("uncertainty", ""), _uncertainty(result, refine=refine), strict=False):
            yield name, words
    if result.flags:
        yield "flags", ", ".join(result.flags)


def _mirror_view(big: CircleResult, circles: Sequence[ExplainedCircle]) -> MirrorView | None:
    """Return how far the view of a coaxial target is from the one in which both pairs fit; None for other circles."""
    others = (circle.result for circle in circles if circle.result.instance == big.instance)
    small = next((result for result in others if result.circle == "small"), None)
    if big.circle != "big" or small is None or not (big.candidates and small.candidates):
        return None
    pose, other = big.candidates[big.chosen], small.candidates[small.chosen]
    return mirror_view(pose.center, pose.normal, big.radius_mm, other.center, small.radius_mm)


def _view_rows(view: MirrorView | None) -> Iterator[tuple[str, str | None]]:
    if view is not None:
        tilt, mirror = math.degrees(view.tilt_rad), math.degrees(view.mirror_tilt_rad)
        yield (
            "view",
            f"tilted by {tilt:.1f} deg, {abs(tilt - mirror):.1f} deg from the view in which both pairs of candidates "
            f"fit equally: {mirror:.1f} deg at this distance of {view.distance:.0f} mm",
        )


def _edges(circle: ExplainedCircle) -> str:
    edges = circle.edges
    axes = (
        f"semi-axes {float(edges.ellipse.semi_major):.2f} and {float(edges.ellipse.semi_minor):.2f} px, to "
        f"{edges.axis_error_px:.3f} px"
    )
    if isinstance(edges, FittedRim):
        return f"none: its sides are too close, a thin ellipse was fitted to its gray levels; {axes}"
    source = "located along the predicted rim" if edges.is_located_anew else "of the contour"
    return (
        f"{len(edges.points)} {source}, {edges.rim_used:.0%} of the rim, "
        f"{edges.cone.rms_px:.3f} px rms from a cone's rim; {axes}"
    )


def _levels(circle: ExplainedCircle, *, refine: bool) -> str:
    levels = circle.levels
    if levels is None:
        return "none looked at"
    contrast = abs(levels.contrast_levels)
    parts = [
        f"blur {levels.sigma_px:.2f} px",
        f"contrast {contrast:.1f} levels",
        f"noise and misfit {levels.noise_levels:.2f} levels",
        f"{'brighter' if levels.contrast_levels > 0.0 else 'darker'} inside",
        f"{levels.rim_used:.0%} of the rim",
    ]
    unequal = math.hypot(*levels.unequal)
    if unequal > _UNEQUAL:
        parts.insert(1, f"its variance {unequal:.0%} unequal by direction")
    if levels.correlation > _EVEN:
        parts.append(
            f"neighbouring residuals add up ({levels.correlation:.1f} times the variance of independent ones)"
        )
    if not refine:
        parts.append("not used: --no-refine")
    elif isinstance(circle.rim, EdgeRim) and circle.rim.level_fit is not None:
        parts.append(f"not used: {circle.rim.level_fit.reason}")
    elif not levels.is_used:
        parts.append("not used: the rim was fitted as a thin ellipse")
    return ", ".join(parts)


def _left_out(circle: ExplainedCircle) -> Iterator[str]:
    levels = circle.levels
    if levels is None:
        return
    reasons = _reasons(levels)
    if not any(reasons.values()):
        yield f"nothing of the {len(levels.pixels)} pixels in the band of {levels.half_width_px:.1f} px each way"
        return
    total = len(levels.pixels)
    yield ", ".join(f"{number / total:.1%} {reason}" for reason, number in reasons.items() if number)
    where = segments_left_out(circle)
    if where:
        yield f"the rim itself at {', '.join(f'{a:.0f} to {b:.0f} deg' for a, b in where)} from the major axis' end"


def _reasons(levels: LevelResiduals) -> dict[str, int]:
    return {
        "unlike the rest of the rim (hidden, touched or crossed)": int(levels.crosses.sum()),
        "beside the rim (another edge, texture)": int(levels.beside.sum()),
        "clipped": int(levels.clipped.sum()),
    }


def _pose(candidate: Candidate, *, chosen: bool) -> str:
    center = "({:.3f}, {:.3f}, {:.3f}) mm".format(*candidate.center)
    normal = "({:.4f}, {:.4f}, {:.4f})".format(*candidate.normal)
    if candidate.covariance is not None:
        sigma = np.sqrt(np.diagonal(candidate.covariance))
        center += " +- ({:.2g}, {:.2g}, {:.2g})".format(*sigma[:3])
        normal += f" +- {math.degrees(float(np.hypot(*sigma[3:]))):.2g} deg"
    return f"centre {center}, normal {normal}{', chosen' if chosen else ''}"


def _cues(result: CircleResult) -> Iterator[str]:
    """Say what a ring target's second circle shows of each candidate."""
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


def _small(probability: float) -> str:
    return "below 0.0001" if 0.0 < probability < 1e-4 else f"{probability:.2g}"


def _uncertainty(result: CircleResult, *, refine: bool) -> tuple[str, ...]:
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
        f"{what}: mostly {_TERM_MEANING[_dominating(terms, index)]} (share of the variance: {_listed(terms, index)})"
        for index, what in enumerate(("position", "normal"))
    )


def _dominating(terms: CovarianceTerms, index: int) -> str:
    parts = shares(terms)
    return max(parts, key=lambda name: parts[name][index])


def _listed(terms: CovarianceTerms, index: int) -> str:
    parts = shares(terms)
    return ", ".join(f"{name} {parts[name][index]:.1%}" for name in TERMS if parts[name][index] > 0.0)


def report_record(explanation: Explanation) -> dict[str, Any]:
    """Return the report as plain values for JSON."""
    return {
        "schema": SCHEMA,
        **image_record(explanation.result),
        "contours": explanation.contours,
        "rejected": dict(explanation.rejected),
        "stages": [
            {**_stages(circle), "mirror_view": _view_record(_mirror_view(circle.result, explanation.circles))}
            for circle in explanation.circles
        ],
    }


def _stages(circle: ExplainedCircle) -> dict[str, Any]:
    contour, edges, levels, result = circle.contour, circle.edges, circle.levels, circle.result
    terms = result.candidates[result.chosen].covariance_terms if result.candidates else None
    return {
        "instance": result.instance,
        "circle": result.circle,
        "contour": None
        if contour is None
        else {
            "rim_used": contour.rim_used,
            "step_levels": contour.step,
            "residual_px": contour.residual_px,
            "evidence": contour.evidence,
        },
        "edges": {
            "places": len(edges.points),
            "rim_used": edges.rim_used,
            "residual_px": edges.cone.rms_px,
            "axis_error_px": edges.axis_error_px,
        },
        "levels": None if levels is None else _levels_record(circle, levels),
        "dominating": None if terms is None else {"position": _dominating(terms, 0), "normal": _dominating(terms, 1)},
    }


def _view_record(view: MirrorView | None) -> dict[str, float] | None:
    if view is None:
        return None
    return {"tilt_deg": math.degrees(view.tilt_rad), "both_pairs_fit_at_deg": math.degrees(view.mirror_tilt_rad)}


def _levels_record(circle: ExplainedCircle, levels: LevelResiduals) -> dict[str, Any]:
    return {
        "converged": levels.converged,
        "blur_px": levels.sigma_px,
        "blur_unequal": list(levels.unequal),
        "noise_levels": levels.noise_levels,
        "contrast_levels": levels.contrast_levels,
        "correlation": levels.correlation,
        "rim_used": levels.rim_used,
        "reach_px": levels.half_width_px,
        "pixels": len(levels.pixels),
        "pixels_at_rim_left_out": int(levels.crosses.sum()),
        "pixels_beside_left_out": int(levels.beside.sum()),
        "pixels_clipped": int(levels.clipped.sum()),
        "stretches_left_out_deg": [list(each) for each in segments_left_out(circle)],
    }
