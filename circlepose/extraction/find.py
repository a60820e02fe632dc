"""Grey image -> contours that are worth a pose, each verified on the grey levels along its rim."""

from __future__ import annotations

from collections import Counter

import numpy as np

from circlepose._typing import BoolArray, Image
from circlepose.conic import Ellipse, rim_distance
from circlepose.extraction import EXTRACTIONS
from circlepose.extraction.candidates import rough_ellipses
from circlepose.extraction.contour import Contour, Extraction, Rejection
from circlepose.extraction.grey import eight_bit
from circlepose.extraction.partial import PartialRim, in_runs, partial_rim
from circlepose.extraction.rim import RimEdges, edges_along
from circlepose.extraction.slivers import find_slivers
from circlepose.extraction.verify import Candidates
from circlepose.fitting.direct import Contours, fit_ellipses
from circlepose.fitting.thin_ellipse import THIN_PX, are_thin
from circlepose.target import AxisIntervals, Polarity

_FIRST_REACH_PX = 4.0
_LAST_REACH_PX = 2.5
_PLACES = 72
"""Places along the rim at which a candidate is verified."""
_LEAST_EDGES = 0.27
"""Share of the places along a candidate that must have an edge."""
_LEAST_STEP = 0.012
"""Lowest edge, as a share of the grey range in use."""
_LEAST_KIN = 0.2
"""Edges weaker than this share of the typical one of the image's circles are none of the kind."""
_LEAST_IN_RUNS = 0.3
"""Share of a candidate's rim that must agree in long runs to look for the rest of a partly hidden one."""
_WHOLE = 0.8
_EXPLAINED_PX = 1.0
_MOST_EXPLAINED = 0.3
"""Share of a partly hidden rim that may stand on the edges of rims that are seen whole, or nearly."""
_MOST_PARTIAL = 6
"""Candidates of one image so looked at, the most evident first."""


def find_contours(
    grey: Image,
    intervals: AxisIntervals,
    polarity: Polarity = "any",
    keep_concentric: bool = False,
    enough: int | None = None,
    extraction: str = EXTRACTIONS[0],
) -> Extraction:
    """Find all contours in `grey` (h, w) whose ellipse's axes lie within `intervals`, most evidence first.

    `keep_concentric` also returns contours inside others of the same centre (rings). Slivers, circles seen
    nearly edge-on, are looked for when the minor axis may be that small by its own interval, or when there are
    fewer than `enough` contours otherwise; in both cases only where a length to expect is given, as every thin
    line would be one.
    """
    rough, rejected = rough_ellipses(eight_bit(grey), intervals, extraction)
    levels = grey.astype(np.float32) if grey.dtype != np.uint8 else grey
    rough = _without_repeats(rough)
    # Only where there is a length to expect: every thin line would be a circle seen edge-on.
    thin = are_thin(rough) if intervals.major_px is not None else np.zeros(len(rough), dtype=np.bool_)
    contours = _find_open(levels, rough[~thin], intervals, polarity, keep_concentric, enough, rejected)
    if (intervals.minor_px is not None and intervals.minor_px[0] < 2.0 * THIN_PX) or (
        enough is not None and len(contours) < enough
    ):
        slivers = find_slivers(levels, rough[thin], intervals, polarity, rejected)
        contours = [*slivers, *(c for c in contours if not any(_same(c.ellipse, s.ellipse) for s in slivers))]
    return Extraction(tuple(sorted(contours, key=lambda c: -c.evidence)), rejected)


def _find_open(
    levels: Image,
    rough: Ellipse,
    intervals: AxisIntervals,
    polarity: Polarity,
    keep_concentric: bool,
    enough: int | None,
    rejected: Counter[Rejection],
) -> list[Contour]:
    """Contours with an inside wider than the blur, verified on the edge along their rims."""
    for reach in (_FIRST_REACH_PX, _LAST_REACH_PX):
        if len(rough) == 0:
            return []
        edges = edges_along(levels, rough, reach, _PLACES)
        rough, alive = _refit(edges, rejected)
        edges = edges[alive]
    if len(rough) == 0:
        return []
    least_step = _LEAST_STEP * float(np.ptp(levels[::8, ::8])) + 1e-9
    found = Candidates.of(rough, edges)
    kept, reasons = _selected(found, intervals, polarity, least_step, keep_concentric)
    partial = _partial_rims(levels, found, kept, reasons, enough)
    if partial:
        found = found.joined_with(Candidates.of_partial(partial))
        kept, reasons = _selected(found, intervals, polarity, least_step, keep_concentric)
    rejected.update(reasons.values())
    return [found.contour(i) for i in kept]


def _refit(edges: RimEdges, rejected: Counter[Rejection]) -> tuple[Ellipse, BoolArray]:
    """Fit the ellipses again to the edges along them; returns those that have one, and which these are (m,)."""
    number, places = edges.valid.shape
    contours = Contours(edges.points.reshape(-1, 2), np.arange(number) * places)
    weights = edges.valid.astype(np.float64)
    for _ in range(3):
        fitted, found = fit_ellipses(contours, np.maximum(weights, 1e-9).reshape(-1))
        residual = rim_distance(fitted, edges.points)
        scale = 1.5 * np.median(np.where(edges.valid, np.abs(residual), 1e6), axis=1)
        scale = np.clip(scale, 0.1, 1.0)[:, None]
        weights = edges.valid / (1.0 + (residual / scale) ** 2) ** 2
    found &= edges.valid.sum(axis=1) >= _LEAST_EDGES * places
    rejected[Rejection.TOO_LITTLE_RIM] += int(np.sum(~found))
    return fitted[found], found


def _selected(
    found: Candidates, intervals: AxisIntervals, polarity: Polarity, least_step: float, keep_concentric: bool
) -> tuple[list[int], dict[int, Rejection]]:
    """Return the candidates that are rims of the kind wanted, most evidence first, and why each other is not."""
    reasons: dict[int, Rejection] = {}
    kept: list[int] = []
    for i in np.argsort(-found.evidence, kind="stable").tolist():
        reason = found.why_not(i, intervals, polarity, least_step)
        if reason is None:
            kept.append(i)
        else:
            reasons[i] = reason
    if kept:
        typical = float(np.average(found.step[kept], weights=found.evidence[kept]))
        reasons |= {i: Rejection.WEAK_EDGE for i in kept if found.step[i] < _LEAST_KIN * typical}
    repeated = _repeated(found.ellipse, [i for i in kept if i not in reasons], keep_concentric)
    reasons |= repeated
    return [i for i in kept if i not in reasons], reasons


def _partial_rims(
    levels: Image, found: Candidates, kept: list[int], reasons: dict[int, Rejection], enough: int | None
) -> list[PartialRim]:
    """Look again at candidates that agree with the edges in part, where one could be among the `enough` best."""
    whole = [i for i in kept if found.share[i] > _WHOLE]
    least = found.evidence[whole[enough - 1]] if enough is not None and len(whole) >= enough else 0.0
    doubtful = [
        i
        for i, reason in reasons.items()
        if reason in (Rejection.TOO_LITTLE_RIM, Rejection.RAGGED)
        and found.evidence[i] > least
        and in_runs(found.on_rim[i]).mean() >= _LEAST_IN_RUNS
    ]
    rims = (partial_rim(levels, found.ellipse[i], _PLACES) for i in doubtful[:_MOST_PARTIAL])
    return [rim for rim in rims if rim is not None and not _is_explained(rim, found.ellipse[whole])]


def _is_explained(rim: PartialRim, whole: Ellipse) -> bool:
    """Tell whether arcs of whole rims make up a good part of `rim`: it runs from one circle to its neighbour."""
    points = rim.edges.points[0][rim.on_rim]
    if len(whole) == 0 or len(points) == 0:
        return False
    near = np.abs(rim_distance(whole, np.broadcast_to(points, (len(whole), *points.shape)))) < _EXPLAINED_PX
    return bool(near.any(axis=0).mean() > _MOST_EXPLAINED)


def _same(first: Ellipse, others: Ellipse) -> BoolArray:
    """Tell which of the batch `others` (or whether the one) is the same edge: everything within 1.5 px or 3 %."""
    near = np.maximum(1.5, 0.03 * first.semi_major)
    return np.asarray(
        (np.linalg.norm(others.center - first.center, axis=-1) < near)
        & (np.abs(others.semi_major - first.semi_major) < near)
        & (np.abs(others.semi_minor - first.semi_minor) < near)
    )


def _concentric(ellipse: Ellipse, i: int, others: list[int]) -> BoolArray:
    """Tell which of `others` has the centre of ellipse i and is a larger copy of it, nearly."""
    ratio = ellipse.semi_major[i] / ellipse.semi_major[others]
    near = np.linalg.norm(ellipse.center[others] - ellipse.center[i], axis=1) < 0.1 * ellipse.semi_minor[others] + 1.0
    alike = np.abs(ellipse.semi_minor[i] - ratio * ellipse.semi_minor[others]) < 0.15 * ellipse.semi_major[i]
    return near & alike & (ratio > 0.1)


def _without_repeats(ellipse: Ellipse) -> Ellipse:
    """Drop rough ellipses that repeat another: the two borders of one edge, or the same edge at two scales."""
    key = np.concatenate(
        [ellipse.center, ellipse.semi_major[:, None], ellipse.semi_minor[:, None]],
        axis=1,
    )
    _, first = np.unique(np.round(key / 2.0).astype(np.int64), axis=0, return_index=True)
    return ellipse[np.sort(first)]


def _repeated(ellipse: Ellipse, ranked: list[int], keep_concentric: bool) -> dict[int, Rejection]:
    """Tell which repeat an edge ranked higher or, unless `keep_concentric`, are inside others of the same centre."""
    reasons: dict[int, Rejection] = {}
    kept: list[int] = []
    for i in ranked:
        if kept and np.any(_same(ellipse[i], ellipse[kept])):
            reasons[i] = Rejection.DUPLICATE
        else:
            kept.append(i)
    if not keep_concentric:
        for i in kept:
            larger = [j for j in kept if ellipse.semi_major[j] > ellipse.semi_major[i]]
            if np.any(_concentric(ellipse, i, larger)):
                reasons[i] = Rejection.INSIDE_ANOTHER
    return reasons
