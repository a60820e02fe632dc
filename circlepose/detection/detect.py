"""Grey image -> contours that are worth a pose, each verified on the grey levels along its rim.

From coarse to fine: a reduced image shows large circles at little cost, and what it has shown is not looked for
again in the finer ones. Edges are placed in the full image, but only along candidates.
"""

from __future__ import annotations

from collections import Counter
from functools import partial

import numpy as np

from circlepose._batching import in_parts, joined
from circlepose._typing import BoolArray, FloatArray, Image, IntArray
from circlepose.detection import EXTRACTIONS
from circlepose.detection.contour import Extraction, Rejection
from circlepose.detection.duplicates import inside_others, repeats, same
from circlepose.detection.edge_on import find_slivers
from circlepose.detection.hypotheses import rough_ellipses, without_repeats
from circlepose.detection.occluded import PartialRim, in_runs, partial_rims
from circlepose.detection.offset_fit import fit_offsets
from circlepose.detection.unexplained_edges import unexplained_tiles
from circlepose.detection.verification import REASONS, Candidates, are_hopeless
from circlepose.geometry.conic import Ellipse, rim_distance
from circlepose.imaging.gray import eight_bit, has_low_range
from circlepose.imaging.pyramid import pyramid
from circlepose.imaging.subpixel_edges import RimEdges, edges_along
from circlepose.photometry.options import DEFAULT as PHOTOMETRY
from circlepose.photometry.thin.fit import are_thin
from circlepose.targets import Polarity
from circlepose.targets.target import AxisIntervals

_REACH_PX = 3.5
_REACH_PER_SCALE = 0.5
"""A rough ellipse from a reduced image is off by more."""
_LAST_REACH_PX = 2.5
_FIRST_PLACES = 36
_FEW, _AT_ONCE_PX = 8, 1.0
"""So many are looked at closely from the first; and how near all edges must be so that once is enough."""
_PLACES = 72
"""Places along the rim at which a candidate is verified."""
_LEAST_EDGES = 0.27
"""Share of the places along a candidate that must have an edge."""
_SMALL_PX = 12.0
_LEAST_SMALL = 0.5
"""The same of small ones, of which no hidden part is made up."""
_LONGEST = 4.0
"""Times its length before that an ellipse may have, moved to its edges."""
_NEAR_PX = 1.0
_NEAR_SHARE = 0.01
_LEAST_STEP = 0.012
"""Lowest edge, as a share of the grey range in use."""
_LEAST_KIN = 0.3
"""Edges weaker than this share of the typical one of the image's circles are none of the kind."""
_LEAST_IN_RUNS = 0.3
"""Share of a candidate's rim that must agree in long runs to look for the rest of a partly hidden one."""
_WHOLE = 0.8
_EXPLAINED_PX = 1.0
_MOST_EXPLAINED = 0.3
"""Share of a partly hidden rim that may stand on the edges of rims that are seen whole, or nearly."""
_MOST_PARTIAL = 6
"""Candidates of one image so looked at, the most evident first."""
_SEEN_PX = 20.0
"""A circle as large in a reduced image is found there."""
_LINE_RATIO = 0.25
"""Axis ratio of a rough ellipse that may be of a sliver; short ones are rough ones."""
_SLIVER_LEVELS = 2
"""Full and half size: the two sides of a sliver are one in smaller images."""


def find_contours(
    grey: Image,
    intervals: AxisIntervals,
    polarity: Polarity = "any",
    keep_concentric: bool = False,
    enough: int | None = None,
    extraction: str = EXTRACTIONS[0],
) -> Extraction:
    """Find all contours in `grey` (h, w) whose ellipse's axes lie within `intervals`, most evidence first.

    `keep_concentric` also returns contours inside others of the same centre (rings). With `enough` the search ends
    when as many have more evidence than any smaller circle could have. Slivers, circles seen
    nearly edge-on, are looked for when the minor axis may be that small by its own interval, or when there are
    fewer than `enough` contours otherwise (of all, none). Where no length to expect is given, only those are taken
    whose width falls off towards the tips as an ellipse's does, as every thin line would be one.
    """
    levels = grey if grey.dtype == np.uint8 and not has_low_range(grey) else grey.astype(np.float32)
    range_ = float(np.ptp(levels[::8]))
    slivers_wanted = intervals.minor_px is not None and intervals.minor_px[0] < 2.0 * PHOTOMETRY.thin.thin_px
    rejected: Counter[Rejection] = Counter()
    found: Candidates | None = None
    kept: list[int] = []
    reasons: dict[int, Rejection] = {}
    thin = []

    def select(candidates: Candidates) -> tuple[list[int], dict[int, Rejection]]:
        return _selected(candidates, intervals, polarity, _LEAST_STEP * range_ + 1e-9, keep_concentric)

    images = pyramid(eight_bit(grey))
    # Of rings the other side of a wall may stand so close to a known rim that only the full image shows both.
    may_pass_over = not keep_concentric and extraction == EXTRACTIONS[0]
    for level in reversed(range(len(images))):
        scale = 2.0**level
        known = _NONE if found is None else found.ellipse[_settled(found, reasons)]
        tiles = None
        if level == 0 and len(known) and may_pass_over:
            tiles = unexplained_tiles(images[1], known, 2.0)
            if not tiles.any():
                break
        has_length = intervals.major_px is not None
        rough = rough_ellipses(images[level], scale, intervals, known, rejected, extraction, tiles, lines=has_length)
        if has_length:
            are_lines = are_thin(rough)
            if level < _SLIVER_LEVELS:
                thin.append(rough[are_lines])
            rough = rough[~are_lines]
        new = _verified(levels, rough, _REACH_PX + _REACH_PER_SCALE * scale, rejected)
        if new is not None:
            found = new if found is None else joined([found, new])
            kept, reasons = select(found)
        if enough is not None and found is not None and not slivers_wanted:
            evident = found.evidence[[i for i in kept if found.share[i] > _WHOLE]]
            if len(evident) >= enough and evident[enough - 1] > np.pi * _SEEN_PX * scale * range_:
                break
    if found is not None:
        hidden = _partial_rims(levels, found, kept, reasons, enough)
        if hidden:
            found = joined([found, Candidates.of_partial(hidden)])
            kept, reasons = select(found)
        rejected.update(reasons.values())
    contours = [found.contour(i) for i in kept] if found is not None else []
    least = int(not keep_concentric) if enough is None else enough
    if slivers_wanted or len(contours) < least:
        if intervals.major_px is None:
            thin = _lines(images, intervals, _NONE if found is None else found.ellipse[kept], extraction)
        lines = without_repeats(joined(thin[::-1]), 1.0) if thin else _NONE
        slivers = find_slivers(levels, lines, intervals, polarity, rejected)
        contours = [*slivers, *(c for c in contours if not any(same(c.ellipse, s.ellipse) for s in slivers))]
    refused = _NONE if found is None else found.ellipse[list(reasons)]
    return Extraction(
        contours=tuple(sorted(contours, key=lambda c: -c.evidence)),
        rejected=rejected,
        refused=refused,
        refused_why=tuple(reasons.values()),
        is_complete=level == 0,
    )


def _lines(images: list[Image], intervals: AxisIntervals, known: Ellipse, extraction: str) -> list[Ellipse]:
    """Return what in `images`, from full size on, may be part of a circle seen edge-on, beside the rims `known`."""
    thin = []
    for level in reversed(range(min(_SLIVER_LEVELS, len(images)))):
        rough = rough_ellipses(images[level], 2.0**level, intervals, known, Counter(), extraction, lines=True)
        thin.append(rough[rough.semi_minor < np.minimum(PHOTOMETRY.thin.thin_px, _LINE_RATIO * rough.semi_major)])
    return thin


def _settled(found: Candidates, reasons: dict[int, Rejection]) -> BoolArray:
    """Tell (m,) which candidates are rims seen whole, or nearly, wanted or not."""
    unwanted = (Rejection.POLARITY, Rejection.INSIDE_ANOTHER, Rejection.MAJOR_AXIS, Rejection.MINOR_AXIS)
    settled = (found.share > _WHOLE) & (found.ragged < 1.0)
    settled[[i for i, reason in reasons.items() if reason not in unwanted]] = False
    return settled


_NONE = Ellipse(np.empty((0, 2)), np.empty(0), np.empty(0), np.empty(0))


def _verified(levels: Image, rough: Ellipse, reach_px: float, rejected: Counter[Rejection]) -> Candidates | None:
    """Place edges along rough ellipses and move these there, twice; returns those that have edges."""
    passes = ((reach_px, _PLACES if len(rough) <= _FEW else _FIRST_PLACES), (_LAST_REACH_PX, _PLACES))
    for last, (reach, places) in enumerate(passes):
        if len(rough) == 0:
            return None
        edges, moved, left = in_parts(partial(_moved_to_edges, levels, reach, places), rough)
        on_it = edges.valid & (np.abs(left) <= np.maximum(_NEAR_PX, _NEAR_SHARE * moved.semi_major)[:, None])
        least = np.where(moved.semi_major < _SMALL_PX, _LEAST_SMALL, _LEAST_EDGES)
        alive = np.count_nonzero(on_it, axis=1) >= least * places
        alive &= moved.semi_major < _LONGEST * (1.0 + rough.semi_major)
        rejected[Rejection.TOO_LITTLE_RIM] += int(np.count_nonzero(~alive))
        if not last:
            hopeless = alive & are_hopeless(moved, left, edges.step, on_it)
            rejected[Rejection.UNLIKE_A_RIM] += int(np.count_nonzero(hopeless))
            alive &= ~hopeless
        # Several hypotheses may have come to stand on one edge.
        ranked = np.flatnonzero(alive)
        again = repeats(moved, ranked[np.argsort(-np.count_nonzero(edges.valid[ranked], axis=1), kind="stable")])
        alive[again] = False
        rejected[Rejection.DUPLICATE] += len(again)
        rough, edges = moved[alive], edges[alive]
        if places == _PLACES and np.all(np.abs(edges.offset_px[edges.valid]) < _AT_ONCE_PX):
            # So close that the edges would be found in the same places again.
            break
    return Candidates.of(rough, edges) if len(rough) else None


def _moved_to_edges(
    levels: Image, reach_px: float, places: int, rough: Ellipse
) -> tuple[RimEdges, Ellipse, FloatArray]:
    """Return the edges along ellipses, these as the edges ask for, and what is left of the offsets (m, places)."""
    edges = edges_along(levels, rough, reach_px, places, quick=True)
    return edges, *fit_offsets(rough, edges.offset_px, edges.valid)


def _selected(
    found: Candidates, intervals: AxisIntervals, polarity: Polarity, least_step: float, keep_concentric: bool
) -> tuple[list[int], dict[int, Rejection]]:
    """Return the candidates that are rims of the kind wanted, most evidence first, and why each other is not."""
    ranked = np.argsort(-found.evidence, kind="stable")
    why_not = found.why_not(intervals, polarity, least_step, of_rings=keep_concentric)

    def left(candidates: IntArray) -> IntArray:
        return candidates[why_not[candidates] < 0]

    kept = left(ranked)
    if len(kept):
        evidence = found.evidence[kept]
        typical = float(found.step[kept] @ evidence / evidence.sum())
        why_not[kept[found.step[kept] < _LEAST_KIN * typical]] = REASONS.index(Rejection.WEAK_EDGE)
        kept = left(kept)
        why_not[repeats(found.ellipse, kept)] = REASONS.index(Rejection.DUPLICATE)
        kept = left(kept)
        if not keep_concentric:
            why_not[inside_others(found.ellipse, kept)] = REASONS.index(Rejection.INSIDE_ANOTHER)
            kept = left(kept)
    return kept.tolist(), {i: REASONS[why_not[i]] for i in ranked.tolist() if why_not[i] >= 0}


def _partial_rims(
    levels: Image, found: Candidates, kept: list[int], reasons: dict[int, Rejection], enough: int | None
) -> list[PartialRim]:
    """Look again at candidates that agree with the edges in part, where one could be among the `enough` best."""
    whole = [i for i in kept if found.share[i] > _WHOLE]
    least = found.evidence[whole[enough - 1]] if enough is not None and len(whole) >= enough else 0.0
    doubtful = []
    for i, reason in reasons.items():
        if reason not in (Rejection.TOO_LITTLE_RIM, Rejection.RAGGED) or found.evidence[i] <= least:
            continue
        if in_runs(found.on_rim[i]).mean() >= _LEAST_IN_RUNS:
            doubtful.append(i)
        if len(doubtful) == _MOST_PARTIAL:
            break
    if not doubtful:
        return []
    rims = partial_rims(levels, found.ellipse[doubtful], _PLACES)
    return [rim for rim in rims if rim is not None and not _is_explained(rim, found.ellipse[whole])]


def _is_explained(rim: PartialRim, whole: Ellipse) -> bool:
    """Tell whether arcs of whole rims make up a good part of `rim`: it runs from one circle to its neighbour."""
    points = rim.edges.points[0][rim.on_rim]
    if len(whole) == 0 or len(points) == 0:
        return False
    near = np.abs(rim_distance(whole, np.broadcast_to(points, (len(whole), *points.shape)))) < _EXPLAINED_PX
    return bool(near.any(axis=0).mean() > _MOST_EXPLAINED)
