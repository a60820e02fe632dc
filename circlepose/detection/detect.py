"""Gray image -> contours that are worth a pose, each verified on the gray levels along its rim.

The search goes from coarse to fine (`coarse_to_fine`); edges are located in the full image, but only along candidates
(`location`). Rims of which something hides a part get a second look (`second_look`); what is round by chance is
dropped (`surroundings`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from circlepose._batching import joined, rows
from circlepose._typing import FloatArray, Image
from circlepose.detection import EXTRACTIONS
from circlepose.detection.chosen import Chosen, Wanted, chosen, least_evident, typical_step, whole
from circlepose.detection.coarse_to_fine import Search, search, slivers_wanted
from circlepose.detection.contour import Contour, DetectionResult, Rejection
from circlepose.detection.duplicates import nested_in, same
from circlepose.detection.edge_on import find_slivers
from circlepose.detection.hypotheses import rough_ellipses, without_repeats
from circlepose.detection.levels_around import are_solid
from circlepose.detection.options import DEFAULT, DetectionOptions
from circlepose.detection.second_look import second_look
from circlepose.detection.surroundings import Surroundings, chance_scores
from circlepose.detection.verification import Candidates
from circlepose.geometry.ellipse import NO_ELLIPSES, Ellipse, rim_distance
from circlepose.imaging.pyramid import Reduced, pyramid
from circlepose.imaging.stretch import COARSE, in_edge_levels
from circlepose.targets import Polarity
from circlepose.targets.target import AxisIntervals


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
    levels, size = in_edge_levels(grey)
    images = pyramid(levels)
    own = grey if levels is grey else grey.astype(np.float32)
    full, range_ = Reduced(own), float(np.ptp(own[::8]))
    least_step = options.least_step_share * min(range_, COARSE * size) + 1e-9
    wanted = Wanted(intervals, polarity, keep_concentric, enough, least_step, options)
    has_length = intervals.major_px is not None
    found, thin = _found(full, images, range_, wanted, extraction)
    # Where round things are there by chance, lines are, too.
    is_missing = len(found.contours) < (int(not keep_concentric) if enough is None else enough)
    wants_slivers = slivers_wanted(wanted) or (is_missing and not found.rejected[Rejection.BY_CHANCE])
    if wants_slivers and not has_length:
        known = Ellipse.batch([contour.ellipse for contour in found.contours])
        thin = tuple(_lines(images, intervals, known, extraction, options))
    asked = options.asked_score
    if asked is not None and asked < options.least_score:
        # All that any lower score takes is found in one way, so that less asked for takes more.
        lenient, _ = _found(full, images, range_, replace(wanted, options=options.lenient), extraction, options)
        doubtful = _unlike(lenient.contours, found.contours, options)
        found = replace(lenient, contours=found.contours + doubtful)
    if asked is not None:
        least = asked * (options.ring_leniency if keep_concentric else 1.0)
        low = [contour for contour in found.contours if contour.score < least]
        found = found.without(low, Rejection.LOW_SCORE)
    contours, rejected = found.contours, found.rejected
    if wants_slivers:
        slivers, dropped = find_slivers(own, _distinct(thin), intervals, polarity, options)
        contours, rejected = (*slivers, *_apart_from(contours, slivers, options)), rejected + dropped
    return replace(found, contours=tuple(sorted(contours, key=lambda c: -c.evidence)), rejected=rejected)


def _found(
    full: Reduced,
    images: list[Image],
    range_: float,
    wanted: Wanted,
    extraction: str,
    usual: DetectionOptions | None = None,
) -> tuple[DetectionResult, tuple[Ellipse, ...]]:
    """Return the contours in `images`, and what may be circles seen edge-on.

    What is outside of the `usual` bounds is scored in proportion to them.
    """
    options = wanted.options
    state, rejected = search(full, images, range_, wanted, extraction, lines=wanted.intervals.major_px is not None)
    if state.found is None:
        return DetectionResult((), rejected, NO_ELLIPSES, (), state.is_complete), state.thin
    found, kept, untried = _seen_in_part(full, state.found, state, wanted)
    rejected[Rejection.BUDGET] += untried
    most = np.ones(len(found.share))
    if state.surroundings is not None:
        kept, most = _not_by_chance(full, found, kept, state.surroundings, options)
    if usual is not None:
        # What the usual bounds do not admit is doubtful, whatever its score.
        most = np.minimum(most, np.nextafter(usual.least_score, 0.0) * found.share_of_bounds(usual))
    rejected.update(kept.reasons.values())
    result = DetectionResult(
        contours=_contours(found, kept, most, options),
        rejected=rejected,
        refused=found.ellipse[list(kept.reasons)],
        refused_why=tuple(kept.reasons.values()),
        is_complete=state.is_complete,
    )
    return result, state.thin


def _seen_in_part(full: Reduced, found: Candidates, state: Search, wanted: Wanted) -> tuple[Candidates, Chosen, int]:
    """Add the rims that are found at a second look, if any; returns also how many candidates were not tried."""
    first, options = state.chosen, wanted.options
    # What is rough may be two things: see `second_look`.
    # In a smaller image a cover is closer to the rim and looks smooth: as many px count as in the full one.
    is_rough = np.maximum(found.ragged, found.ragged_in_full(options)) >= options.half_ragged
    smooth = [i for i in whole(found, first, options) if not is_rough[i]]
    rough: list[int] = []
    parted: list[int] = []
    if is_rough.any():
        fits = wanted.why_not(found) < 0
        rough = np.flatnonzero(is_rough & fits).tolist()
        if rough:
            most = np.where(is_rough, options.clean_thin_rim, options.whole_rim)
            parted = np.flatnonzero(fits & (found.share < most)).tolist()
    # Only these could be among the `enough` best, and none so faint beside the others counts.
    least = least_evident(found, smooth, wanted.enough)
    least_step = options.least_step_of_typical * typical_step(found, first.kept)
    doubtful = [
        i
        for i, reason in first.reasons.items()
        if reason in (Rejection.TOO_LITTLE_RIM, Rejection.RAGGED)
        and found.evidence[i] > least
        and found.step[i] >= least_step
    ]
    second = second_look(full, found, parted + doubtful, smooth, rough, wanted.why_not, options)
    if second.found:
        left = np.setdiff1d(np.arange(len(found.share)), second.beaten)
        found = joined([rows(found, left), *second.found])
        first = chosen(found, wanted)
    return found, first, len(set(second.untried) - set(parted))


def _not_by_chance(
    full: Reduced, found: Candidates, kept: Chosen, surroundings: Surroundings, options: DetectionOptions
) -> tuple[Chosen, FloatArray]:
    """Return those kept without what is round by chance among the `surroundings`, and the largest scores (m,)."""
    own = found.ellipse[kept.kept]
    # A solid disc that is seen whole, and not tiny, is neither a letter nor a marker's cell.
    is_evident = (own.semi_minor >= options.evident_px) & (found.score[kept.kept] >= options.evident_score)
    is_evident |= (own.semi_minor >= options.chance_px) & (found.share[kept.kept] >= options.whole_rim)
    is_evident &= are_solid(full, own, found.edges.polarity[kept.kept], options)
    # Noise has edges, too, that count beside a contour hardly higher.
    is_evident |= found.noise_share[kept.kept] > options.most_noise_around
    most = np.ones(len(found.share))
    most[kept.kept] = chance_scores(own, found.score[kept.kept], surroundings, is_evident, options)
    dropped = [i for i in kept.kept if most[i] < options.least_score]
    left = [i for i in kept.kept if i not in dropped]
    return Chosen(left, kept.reasons | dict.fromkeys(dropped, Rejection.BY_CHANCE)), most


def _contours(found: Candidates, kept: Chosen, most: FloatArray, options: DetectionOptions) -> tuple[Contour, ...]:
    """Return the candidates kept, each with those nested in it, scored by `most` (m,) at most."""
    inner = [i for i, reason in kept.reasons.items() if reason is Rejection.INSIDE_ANOTHER]
    nested = nested_in(found.ellipse, found.edges.polarity, kept.kept, inner, options) if inner else {}
    contours = []
    for i in kept.kept:
        contour = found.contour(i)
        if most[i] < contour.score or i in nested:
            inside = tuple(found.contour(k) for k in nested.get(i, ()))
            contour = replace(contour, score=min(contour.score, float(most[i])), nested=inside)
        contours.append(contour)
    return tuple(contours)


def _unlike(
    doubtful: tuple[Contour, ...], sure: tuple[Contour, ...], options: DetectionOptions
) -> tuple[Contour, ...]:
    """Return those of the `doubtful` contours that do not have most of their edges from rims of the `sure` ones."""
    if not sure:
        return doubtful
    rims = Ellipse.batch([contour.ellipse for contour in sure])

    def shared(contour: Contour) -> float:
        apart = np.abs(rim_distance(rims, contour.points))
        return float(np.mean((apart <= options.same_px).any(axis=0)))

    return tuple(contour for contour in doubtful if shared(contour) < options.least_shared)


def _distinct(thin: Sequence[Ellipse]) -> Ellipse:
    """Return the lines found at all scales, the finest first, without repeats."""
    return without_repeats(joined(thin[::-1]), 1.0) if thin else NO_ELLIPSES


def _apart_from(contours: Sequence[Contour], slivers: list[Contour], options: DetectionOptions) -> list[Contour]:
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
