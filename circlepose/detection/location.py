"""Rough ellipses -> candidates: the edges along them are located, and they are moved to these.

In the full image first. What noise, blur or roughness hides there is looked for in the image reduced by halves.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from circlepose._batching import in_parts, joined, rows
from circlepose._typing import FloatArray, Image, IntArray
from circlepose.detection.contour import Rejection
from circlepose.detection.duplicates import repeats
from circlepose.detection.offset_fit import fit_offsets
from circlepose.detection.options import DetectionOptions
from circlepose.detection.verification import REASONS, Candidates, are_hopeless, are_unclear
from circlepose.geometry.ellipse import Ellipse
from circlepose.imaging.pyramid import Reduced
from circlepose.imaging.subpixel_edges import RimEdges, edges_along

_RECONSIDERED = [
    REASONS.index(reason)
    for reason in (
        Rejection.WEAK_EDGE,
        Rejection.TOO_LITTLE_RIM,
        Rejection.RAGGED,
        Rejection.UNLIKE_A_RIM,
        Rejection.BLURRED,
    )
]
"""Reasons that may not hold in a reduced image."""


@dataclass(frozen=True, slots=True, eq=False)
class Located:
    """Ellipses with the edges along them."""

    found: Candidates | None
    """those that have edges"""
    rejected: Counter[Rejection]
    """how many have none, by reason"""
    unclear: list[Ellipse]
    """(batches, px of the image) those among them that may have edges in a reduced image"""


def located(image: Reduced, rough: Ellipse, half_width_px: float, options: DetectionOptions) -> Located:
    """Locate edges along rough ellipses, px of `image`, and move these to the edges, twice."""
    rejected: Counter[Rejection] = Counter()
    unclear: list[Ellipse] = []
    first_samples = options.samples if len(rough) <= options.few_hypotheses else options.first_samples
    passes = ((half_width_px, first_samples), (options.last_half_width_px, options.samples))
    for last, (half_width, samples) in enumerate(passes):
        if len(rough) == 0:
            return Located(None, rejected, unclear)
        edges, moved, left = in_parts(partial(_moved_to_edges, image.levels, half_width, samples, options), rough)
        near_px = np.maximum(options.near_px, options.near_share * moved.semi_major)
        on_it = edges.valid & (np.abs(left) <= near_px[:, None])
        is_small = moved.semi_major < options.small_semi_major_px
        least = np.where(is_small, options.least_edge_share_small, options.least_edge_share)
        alive = np.count_nonzero(on_it, axis=1) >= least * samples
        alive &= moved.semi_major < options.most_growth * (1.0 + rough.semi_major)
        rejected[Rejection.TOO_LITTLE_RIM] += int(np.count_nonzero(~alive))
        if not last:
            hopeless = alive & are_hopeless(image, moved, left, edges, on_it, options)
            rejected[Rejection.UNLIKE_A_RIM] += int(np.count_nonzero(hopeless))
            alive &= ~hopeless
        if not alive.all():
            unclear.append(rough[~alive & are_unclear(image, edges, options)])
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
    found = Candidates.of(image, rough, edges, options=options) if len(rough) else None
    return Located(found, rejected, unclear)


def located_in_reduced(
    image: Reduced, first: Located, why_not: Callable[[Candidates], IntArray], options: DetectionOptions
) -> list[Candidates]:
    """Look in ever smaller images for the rims that noise, blur or roughness hides in `image`.

    In the smaller one all are less, and so is what can be seen of a shape: each is judged in the first that shows it.
    """
    again: list[Candidates] = []
    drowned, rough = _pending(image, first, why_not, options)
    while True:
        drowned, rough = (_large_enough(image, each, options) for each in (drowned, rough))
        if not drowned and not rough:
            return again
        image = image.half
        next_drowned: list[Ellipse] = []
        next_rough: list[Ellipse] = []
        for each, is_rough in ((drowned, False), (rough, True)):
            if not each:
                continue
            now = located(image, image.ellipse(joined(each)), options.reduced_half_width_px, options)
            more_drowned, more_rough = _pending(image, now, why_not, options)
            next_drowned += more_drowned
            next_rough += more_rough
            if now.found is None:
                continue
            found = now.found
            if is_rough:
                # In the smaller image the edges of a cover are near the rim, too: a rough rim is seen all around.
                is_whole = found.share >= options.whole_rim
                next_rough.append(found.ellipse[~is_whole])
                found = rows(found, np.flatnonzero(is_whole))
            if len(found.share):
                again.append(found)
        drowned, rough = next_drowned, next_rough


def _pending(
    image: Reduced, now: Located, why_not: Callable[[Candidates], IntArray], options: DetectionOptions
) -> tuple[list[Ellipse], list[Ellipse]]:
    """Return the ellipses, px of the full image, that noise or blur, and those that roughness may hide in `image`."""
    drowned, rough = [image.full(each) for each in now.unclear], []
    if now.found is not None:
        found = now.found
        is_drowned = (found.noise_share > options.noisy_share) | found.is_wide
        is_large = found.ellipse.semi_minor >= options.rough_px * image.scale
        is_large &= (found.edges.valid.mean(axis=1) >= options.whole_rim) & ~found.is_polygon
        is_large &= (found.ragged >= options.half_ragged) | (found.share < options.whole_rim)
        if (is_drowned | is_large).any():
            is_open = np.isin(why_not(found), _RECONSIDERED)
            drowned.append(found.ellipse[is_open & is_drowned])
            rough.append(found.ellipse[is_open & is_large & ~is_drowned])
    return drowned, rough


def _large_enough(image: Reduced, ellipses: list[Ellipse], options: DetectionOptions) -> list[Ellipse]:
    """Return those of the `ellipses`, px of the full image, that are large enough in the next smaller image."""
    least_px = options.least_reduced_px * 2 * image.scale
    left = [each[each.semi_minor >= least_px] for each in ellipses if len(each)]
    return [each for each in left if len(each)]


def _moved_to_edges(
    levels: Image, half_width_px: float, samples: int, options: DetectionOptions, rough: Ellipse
) -> tuple[RimEdges, Ellipse, FloatArray]:
    """Return the edges along ellipses, the ellipses moved to them, and the remaining offsets (m, samples), px."""
    edges = edges_along(levels, rough, half_width_px, samples, quick=True)
    return edges, *fit_offsets(rough, edges.offset_px, edges.valid, options)
