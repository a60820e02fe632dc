"""The report on one image in plain words."""

from __future__ import annotations

import math
from collections.abc import Iterator

from circlepose.detection.contour import mix_in_words
from circlepose.diagnostics.boards import board_views
from circlepose.diagnostics.explain import ExplainedCircle, Explanation, segments_left_out
from circlepose.diagnostics.residuals import LevelResiduals
from circlepose.io.text.escaping import printable
from circlepose.measurement.rim import EdgeRim, FittedRim
from circlepose.results import SETTLED_BY_MEANING, CircleResult, SettledBy, Status
from circlepose_cli.reports.explain.boards import board_rows
from circlepose_cli.reports.explain.poses import (
    cue_lines,
    mirror_view_of,
    pose_line,
    small,
    uncertainty_lines,
    view_rows,
)

INDENT = 12
"""where the words begin, behind what they are about"""
_EVEN = 1.5
"""Up to which `correlation` the residuals are those of independent pixels."""
_UNEQUAL = 0.05


def report_text(explanation: Explanation, camera: str, target: str, circle: str | None = None) -> str:
    """Return the report in plain words; `camera` and `target` are where these came from.

    Of boards it has a line for each circle, unless `circle` is the name of one; else all that is known of that one,
    or of each.
    """
    result = explanation.result
    width, height = result.image_size or (0, 0)
    rows: list[tuple[str, str | None]] = [
        ("image", f"{result.image}, {width} x {height} px: {result.status}"),
        ("", result.reason),
        ("", result.remark if result.status is Status.OK else ""),
        ("camera", camera),
        ("target", target),
        ("contours", f"{explanation.contours} worth a pose; {sum(explanation.rejected.values())} not used"),
    ]
    rows += [("", f"{number:6d}  {reason}") for reason, number in explanation.rejected.items()]
    boards = board_views(result)
    for view in boards:
        rows += [("", None), *board_rows(view, explanation.camera, (width, height), has_table=circle is None)]
    if circle is not None and not explanation.named(circle):
        rows += [("", None), (circle, "was not seen" if boards else "was not measured")]
    for each in explanation.named(circle) if circle is not None or not boards else ():
        rows += [("", None), *_circle_rows(each, refine=explanation.refine, is_of_board=bool(boards))]
        rows += view_rows(mirror_view_of(each.result, explanation.circles))
    return "\n".join(
        f"{name:<{INDENT}}{printable(words)}".rstrip() if words is not None else ""
        for name, words in rows
        if words != ""
    )


def _circle_rows(circle: ExplainedCircle, *, refine: bool, is_of_board: bool) -> Iterator[tuple[str, str | None]]:
    result = circle.result
    yield f"#{result.instance} {result.circle}", f"radius {result.radius_mm:g} mm, {result.method}: {result.status}"
    yield "", result.reason
    yield (
        "contour",
        "none: the rim was predicted from the target, or found as a sliver"
        if circle.contour is None
        else circle.contour.kept_because,
    )
    for name, words in zip(("nested rims", *("",) * len(result.nested_rims)), _nested(result), strict=False):
        yield name, words
    if result.color_mix is not None:
        yield "color mix", f"{mix_in_words(result.color_mix)}: its levels were measured, as gray shows less"
    yield "edges", _edges(circle)
    yield "levels", _levels(circle, refine=refine)
    for words in _left_out(circle):
        yield "left out", words
    for number, candidate in enumerate(result.candidates):
        yield f"pose {number}", pose_line(candidate, chosen=number == result.chosen)
    if result.candidates:
        yield from _choice(result, is_of_board=is_of_board)
        for name, words in zip(("", "", "", ""), cue_lines(result), strict=False):
            yield name, words
        for name, words in zip(("uncertainty", ""), uncertainty_lines(result, refine=refine), strict=False):
            yield name, words
    if result.flags:
        yield "flags", ", ".join(result.flags)


def _choice(result: CircleResult, *, is_of_board: bool) -> Iterator[tuple[str, str]]:
    """Yield what is known of the choice between the candidates."""
    if len(result.candidates) == 1:
        yield "ambiguity", "none: one pose is possible"
        return
    yield "ambiguity", f"{small(result.ambiguity)}, the probability that the chosen pose is the wrong one"
    is_board_fit = is_of_board and result.settled_by is SettledBy.JOINT_FIT
    meaning = "one pose fitted to all rims of the board" if is_board_fit else SETTLED_BY_MEANING[result.settled_by]
    yield "settled by", f"{result.settled_by}: {meaning}"


def _nested(result: CircleResult) -> Iterator[str]:
    """Yield the concentric rims of which one was taken."""
    for rim in result.nested_rims:
        side = "darker" if rim.polarity > 0 else "brighter"
        depth = "no pose" if rim.distance_mm is None else f"it would be {rim.distance_mm:.0f} mm away"
        choice = "taken" if rim.is_taken else "could be it, too" if rim.is_admitted else "outside of what is declared"
        major, minor = float(rim.ellipse.semi_major), float(rim.ellipse.semi_minor)
        yield f"semi-axes {major:.1f} and {minor:.1f} px, {side} inside, {depth}: {choice}"


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
        parts.append(f"residuals are correlated ({levels.correlation:.1f} times the variance of independent ones)")
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
        yield f"none of the {len(levels.pixels)} pixels in the band of {levels.half_width_px:.1f} px each way"
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
