"""Gray image -> contours that are worth a pose, each verified on the gray levels along its rim.

The search goes from coarse to fine: a reduced image shows large circles at little cost, and they are not sought again
in finer ones. Edges are located in the full image, but only along candidates.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import partial

import numpy as np

from circlepose._batching import in_parts, joined
from circlepose._typing import BoolArray, FloatArray, Image, IntArray
from circlepose.detection import EXTRACTIONS
from circlepose.detection.contour import Contour, DetectionResult, Rejection
from circlepose.detection.duplicates import inside_others, repeats, same
from circlepose.detection.edge_on import find_slivers
from circlepose.detection.hypotheses import rough_ellipses, without_repeats
from circlepose.detection.occluded import PartialRim, in_runs, partial_rims
from circlepose.detection.offset_fit import fit_offsets
from circlepose.detection.options import DEFAULT, DetectionOptions
from circlepose.detection.unexplained_edges import unexplained_tiles
from circlepose.detection.verification import REASONS, Candidates, are_hopeless
from circlepose.geometry.ellipse import Ellipse, rim_distance
from circlepose.imaging.gray import eight_bit, has_low_range
from circlepose.imaging.pyramid import pyramid
from circlepose.imaging.subpixel_edges import RimEdges, edges_along
from circlepose.photometry.thin.fit import are_thin
from circlepose.targets import Polarity
from circlepose.targets.target import AxisIntervals

_EMPTY = Ellipse(np.empty((0, 2)), np.empty(0), np.empty(0), np.empty(0))


@dataclass(frozen=True, slots=True, eq=False)
class _Selection:
    """Which candidates are rims of the kind wanted."""

    kept: list[int]
    """their indices, most evidence first"""
    reasons: dict[int, Rejection]
    """why each of the others is rejected, by its index"""


def find_contours(
    grey: Image,
    intervals: AxisIntervals,
    polarity: Polarity = "any",
    keep_concentric: bool = False,
    enough: int | None = None,
    extraction: str = EXTRACTIONS[0],
    options: DetectionOptions = DEFAULT,
) -> DetectionResult:
    """Find the contours in an image that may be rims of circles.

    Parameters
    ----------
    grey
        (h, w) levels without gaps, of any depth.
    intervals
        The lengths that the axes of a contour's ellipse can have, px. Circles seen nearly edge-on (slivers) are
        sought where the interval of the minor axis admits them, or where there are fewer than `enough` contours
        otherwise (none at all without `enough`). Without an interval of the major axis a sliver must taper to its
        tips as an ellipse does, as every thin line would be one.
    polarity
        `dark`: darker inside; `bright`; or `any`.
    keep_concentric
        Also return contours inside others of the same center, for rings.
    enough
        End the search when this many contours have more evidence than any smaller circle could have.
    extraction
        A name of `circlepose.detection.EXTRACTIONS`.
    options
        The numbers of the detection.

    Returns
    -------
    The contours, most evidence first, and how many were rejected for which reason.
    """
    levels = grey if grey.dtype == np.uint8 and not has_low_range(grey) else grey.astype(np.float32)
    range_ = float(np.ptp(levels[::8]))
    slivers_wanted = intervals.minor_px is not None and intervals.minor_px[0] < 2.0 * options.photometry.thin.thin_px
    has_length = intervals.major_px is not None
    rejected: Counter[Rejection] = Counter()
    found: Candidates | None = None
    selection = _Selection([], {})
    thin = []

    def select(candidates: Candidates) -> _Selection:
        least_step = options.least_step_share * range_ + 1e-9
        return _selected(candidates, intervals, polarity, least_step, keep_concentric, options)

    images = pyramid(eight_bit(grey))
    # Of rings the other side of a wall may be so close to a known rim that only the full image shows both.
    may_pass_over = not keep_concentric and extraction == EXTRACTIONS[0]
    for level in reversed(range(len(images))):
        scale = 2.0**level
        known = _EMPTY if found is None else found.ellipse[_settled(found, selection.reasons, options)]
        may_explain = level == 0 and len(known) > 0 and may_pass_over
        tiles = unexplained_tiles(images[1], known, 2.0, options) if may_explain else None
        if tiles is not None and not tiles.any():
            break
        hypotheses = rough_ellipses(
            images[level], scale, intervals, known, extraction, tiles, lines=has_length, options=options
        )
        rough = hypotheses.ellipse
        if has_length:
            are_lines = are_thin(rough, options=options.photometry)
            if level < options.line_levels:
                thin.append(rough[are_lines])
            rough = rough[~are_lines]
        half_width_px = options.first_half_width_px + options.half_width_per_scale * scale
        new, dropped = _verified(levels, rough, half_width_px, options)
        rejected.update(hypotheses.rejected + dropped)
        if new is not None:
            found = new if found is None else joined([found, new])
            selection = select(found)
        if enough is not None and found is not None and not slivers_wanted:
            # No circle that is missed at this scale has more evidence.
            most = np.pi * options.certain_px * scale * range_
            if _least_evident(found, _whole(found, selection, options), enough) > most:
                break
    if found is not None:
        hidden = _partial_rims(levels, found, selection, enough, options)
        if hidden:
            found = joined([found, Candidates.of_partial(hidden, options)])
            selection = select(found)
        rejected.update(selection.reasons.values())
    contours = [found.contour(i) for i in selection.kept] if found is not None else []
    if slivers_wanted or len(contours) < (int(not keep_concentric) if enough is None else enough):
        if not has_length:
            others = _EMPTY if found is None else found.ellipse[selection.kept]
            thin = _lines(images, intervals, others, extraction, options)
        slivers, dropped = find_slivers(levels, _distinct(thin), intervals, polarity, options)
        rejected.update(dropped)
        contours = slivers + _apart_from(contours, slivers, options)
    return DetectionResult(
        contours=tuple(sorted(contours, key=lambda c: -c.evidence)),
        rejected=rejected,
        refused=_EMPTY if found is None else found.ellipse[list(selection.reasons)],
        refused_why=tuple(selection.reasons.values()),
        is_complete=level == 0,
    )


def _distinct(thin: list[Ellipse]) -> Ellipse:
    """Return the lines found at all scales, the finest first, without repeats."""
    return without_repeats(joined(thin[::-1]), 1.0) if thin else _EMPTY


def _apart_from(contours: list[Contour], slivers: list[Contour], options: DetectionOptions) -> list[Contour]:
    """Return the contours that are not the edge of one of the `slivers`."""
    return [c for c in contours if not any(same(c.ellipse, s.ellipse, options) for s in slivers)]


def _lines(
    images: list[Image], intervals: AxisIntervals, known: Ellipse, extraction: str, options: DetectionOptions
) -> list[Ellipse]:
    """Return what in `images`, from full size on, may be part of a circle seen edge-on, off the rims `known`."""
    thin = []
    for level in reversed(range(min(options.line_levels, len(images)))):
        rough = rough_ellipses(
            images[level], 2.0**level, intervals, known, extraction, lines=True, options=options
        ).ellipse
        thin.append(
            rough[
                rough.semi_minor < np.minimum(options.photometry.thin.thin_px, options.line_ratio * rough.semi_major)
            ]
        )
    return thin


def _settled(found: Candidates, reasons: dict[int, Rejection], options: DetectionOptions) -> BoolArray:
    """Return (m,) which candidates are rims seen whole, or nearly, wanted or not."""
    unwanted = (Rejection.POLARITY, Rejection.INSIDE_ANOTHER, Rejection.MAJOR_AXIS, Rejection.MINOR_AXIS)
    settled = (found.share > options.whole_rim) & (found.ragged < 1.0)
    settled[[i for i, reason in reasons.items() if reason not in unwanted]] = False
    return settled


def _verified(
    levels: Image, rough: Ellipse, half_width_px: float, options: DetectionOptions
) -> tuple[Candidates | None, Counter[Rejection]]:
    """Locate edges along rough ellipses and move these to the edges, twice.

    Returns those that have edges, and how many were rejected why.
    """
    rejected: Counter[Rejection] = Counter()
    first_samples = options.samples if len(rough) <= options.few_hypotheses else options.first_samples
    passes = ((half_width_px, first_samples), (options.last_half_width_px, options.samples))
    for last, (half_width, samples) in enumerate(passes):
        if len(rough) == 0:
            return None, rejected
        edges, moved, left = in_parts(partial(_moved_to_edges, levels, half_width, samples, options), rough)
        near_px = np.maximum(options.near_px, options.near_share * moved.semi_major)
        on_it = edges.valid & (np.abs(left) <= near_px[:, None])
        is_small = moved.semi_major < options.small_semi_major_px
        least = np.where(is_small, options.least_edge_share_small, options.least_edge_share)
        alive = np.count_nonzero(on_it, axis=1) >= least * samples
        alive &= moved.semi_major < options.most_growth * (1.0 + rough.semi_major)
        rejected[Rejection.TOO_LITTLE_RIM] += int(np.count_nonzero(~alive))
        if not last:
            hopeless = alive & are_hopeless(moved, left, edges.step, on_it, options)
            rejected[Rejection.UNLIKE_A_RIM] += int(np.count_nonzero(hopeless))
            alive &= ~hopeless
        # Several hypotheses may have moved to one edge.
        ranked = np.flatnonzero(alive)
        ranked = ranked[np.argsort(-np.count_nonzero(edges.valid[ranked], axis=1), kind="stable")]
        again = repeats(moved, ranked, options)
        alive[again] = False
        rejected[Rejection.DUPLICATE] += len(again)
        rough, edges = moved[alive], edges[alive]
        if samples == options.samples and np.all(np.abs(edges.offset_px[edges.valid]) < options.settled_offset_px):
            # So close that the second pass would find the same edges.
            break
    return (Candidates.of(rough, edges, options=options) if len(rough) else None), rejected


def _moved_to_edges(
    levels: Image, half_width_px: float, samples: int, options: DetectionOptions, rough: Ellipse
) -> tuple[RimEdges, Ellipse, FloatArray]:
    """Return the edges along ellipses, the ellipses moved to them, and the remaining offsets (m, samples), px."""
    edges = edges_along(levels, rough, half_width_px, samples, quick=True)
    return edges, *fit_offsets(rough, edges.offset_px, edges.valid, options)


def _selected(
    found: Candidates,
    intervals: AxisIntervals,
    polarity: Polarity,
    least_step: float,
    keep_concentric: bool,
    options: DetectionOptions,
) -> _Selection:
    """Return which candidates are rims of the kind wanted, and why each other is not."""
    ranked = np.argsort(-found.evidence, kind="stable")
    why_not = found.why_not(intervals, polarity, least_step, options, of_rings=keep_concentric)

    def left(candidates: IntArray) -> IntArray:
        return candidates[why_not[candidates] < 0]

    kept = left(ranked)
    if len(kept):
        evidence = found.evidence[kept]
        typical = float(found.step[kept] @ evidence / evidence.sum())
        faint = found.step[kept] < options.least_step_of_typical * typical
        why_not[kept[faint]] = REASONS.index(Rejection.WEAK_EDGE)
        kept = left(kept)
        why_not[repeats(found.ellipse, kept, options)] = REASONS.index(Rejection.DUPLICATE)
        kept = left(kept)
        if not keep_concentric:
            why_not[inside_others(found.ellipse, kept, options)] = REASONS.index(Rejection.INSIDE_ANOTHER)
            kept = left(kept)
    return _Selection(kept.tolist(), {i: REASONS[why_not[i]] for i in ranked.tolist() if why_not[i] >= 0})


def _whole(found: Candidates, selection: _Selection, options: DetectionOptions) -> list[int]:
    """Return the indices of the kept candidates that are seen whole, most evidence first."""
    return [i for i in selection.kept if found.share[i] > options.whole_rim]


def _least_evident(found: Candidates, whole: list[int], enough: int | None) -> float:
    """Return the evidence of the last of the `enough` best of the candidates `whole`; 0 where there are fewer."""
    return float(found.evidence[whole[enough - 1]]) if enough is not None and len(whole) >= enough else 0.0


def _partial_rims(
    levels: Image, found: Candidates, selection: _Selection, enough: int | None, options: DetectionOptions
) -> list[PartialRim]:
    """Fit again the candidates that agree with the edges in part, where one could be among the `enough` best."""
    whole = _whole(found, selection, options)
    least = _least_evident(found, whole, enough)
    doubtful = []
    for i, reason in selection.reasons.items():
        if reason not in (Rejection.TOO_LITTLE_RIM, Rejection.RAGGED) or found.evidence[i] <= least:
            continue
        if in_runs(found.on_rim[i], options).mean() >= options.least_in_runs:
            doubtful.append(i)
        if len(doubtful) == options.most_partial:
            break
    if not doubtful:
        return []
    rims = partial_rims(levels, found.ellipse[doubtful], options)
    return [rim for rim in rims if rim is not None and not _is_explained(rim, found.ellipse[whole], options)]


def _is_explained(rim: PartialRim, whole: Ellipse, options: DetectionOptions) -> bool:
    """Return whether arcs of whole rims make up much of `rim`: it runs from one circle to its neighbor."""
    points = rim.edges.points[0][rim.on_rim]
    if len(whole) == 0 or len(points) == 0:
        return False
    near = np.abs(rim_distance(whole, np.broadcast_to(points, (len(whole), *points.shape)))) < options.explained_px
    return bool(near.any(axis=0).mean() > options.most_explained)
