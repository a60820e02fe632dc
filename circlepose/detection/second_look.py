"""The second look at candidates that agree with their edges in part: rims of which something hides the rest.

Several candidates may start from arcs of one circle. They are tried in rounds, the most evident first, at most one of
each circle in a round; those on the edges of a rim that was found are not tried any more. After rounds without a rim
those left, which are less evident, hold none either.

A rim that strays all around and one of which a cover hides a part look alike: of both an ellipse passes near all
edges. Where a part of the edges lies on one ellipse much more closely than all, it is a cover: by chance n
independent edges of a rough rim do so with about the n-5th power of the ratio.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from circlepose._batching import joined, rows
from circlepose._typing import BoolArray, FloatArray, IntArray
from circlepose.detection.occluded import PartialRim, in_runs, partial_rims
from circlepose.detection.options import DEFAULT, DetectionOptions
from circlepose.detection.verification import Candidates
from circlepose.geometry.ellipse import Ellipse, rim_distance
from circlepose.imaging.pyramid import Reduced
from circlepose.imaging.subpixel_edges import edges_along


@dataclass(frozen=True, slots=True, eq=False)
class SecondLook:
    """What a second look found."""

    found: list[Candidates]
    """the rims, wanted or not"""
    untried: list[int]
    """the candidates for which the budget did not suffice"""
    beaten: list[int]
    """the rough rims whose edges a found one explains better"""


def second_look(
    full: Reduced,
    candidates: Candidates,
    doubtful: list[int],
    whole: list[int],
    rough: list[int],
    why_not: Callable[[Candidates], IntArray],
    options: DetectionOptions = DEFAULT,
) -> SecondLook:
    """Fit again the `doubtful` of the `candidates`, most evidence first, to the edges that agree.

    Rims made of arcs of the circles seen `whole` are dropped, as are those made of arcs of the `rough` ones that they
    do not explain better. `why_not` says of rims (m,) why each is not wanted, -1 where it is.
    """
    smooth = candidates.ellipse[whole]
    waiting = [i for i in doubtful if _may_be_a_rim(candidates, i, smooth, options)]
    found: list[Candidates] = []
    beaten: set[int] = set()
    tried = fruitless = 0
    while waiting and tried < options.most_partial and fruitless < options.most_fruitless:
        now = _one_of_each(candidates, waiting, options.partial_at_once, options)
        tried += len(now)
        waiting = [i for i in waiting if i not in now]
        fruitless += len(now)
        for scale in np.unique(candidates.scale[now]).tolist():
            start = candidates.ellipse[[i for i in now if candidates.scale[i] == scale]]
            new = _in_finer(full, _in_part(full, int(scale), start, smooth, options)[0], smooth, options)
            if new is not None:
                wanted = why_not(new) < 0
                left, lost = _compared(new, wanted, candidates, rough, options)
                beaten.update(lost)
                found.append(rows(new, left))
                kept = new.ellipse[left[wanted[left]]]
                fruitless = 0 if len(kept) else fruitless
                waiting = [i for i in waiting if not _lies_on(candidates, i, kept, options).any()]
    return SecondLook(found, waiting, sorted(beaten))


def _in_part(
    full: Reduced, scale: int, start: Ellipse, smooth: Ellipse, options: DetectionOptions
) -> tuple[Candidates | None, IntArray]:
    """Return the rims near the ellipses `start`, px, on which long runs of edges lie in an image at `scale`.

    Returns also of which of `start` each is.
    """
    image = full.reduced_to(scale)
    own = image.ellipse(start)
    found = partial_rims(image, own, options)
    # Before a ground of light and dark a rim has edges of either sign.
    is_open = np.array([rim is None or rim.on_rim.mean() < options.whole_rim for rim in found])
    mixed = np.flatnonzero(is_open & (own.semi_minor >= options.chance_px))
    mixed = mixed[_have_both_signs(image, own[mixed], options)]
    for k, either in zip(mixed.tolist(), partial_rims(image, own[mixed], options, of_either_sign=True), strict=True):
        if either is not None and _is_fuller(either, found[k], options):
            found[k] = either
    known = image.ellipse(smooth)
    rims = {
        i: rim
        for i, rim in enumerate(found)
        if rim is not None and not _is_explained(rim.edges.points[0][rim.on_rim], known, options)
    }
    new = Candidates.of_partial(image, list(rims.values()), options) if rims else None
    return new, np.array(list(rims), np.int64)


def _have_both_signs(image: Reduced, ellipse: Ellipse, options: DetectionOptions) -> BoolArray:
    """Return (m,) which ellipses, px of `image`, have edges of either sign along a good part of them."""
    if len(ellipse) == 0:
        return np.zeros(0, np.bool_)
    edges = edges_along(
        image.levels, ellipse, options.last_half_width_px, options.samples, quick=True, of_either_sign=True
    )
    other = edges.valid & (edges.step * edges.polarity[:, None] < 0.0)
    return np.asarray(other.mean(axis=1) >= 1.0 - options.whole_rim)


def _is_fuller(either: PartialRim, one: PartialRim | None, options: DetectionOptions) -> bool:
    """Return whether the edges of `either` sign show the rest of a rim of which those of `one` sign are a part."""
    share = either.on_rim.mean()
    more = 0.0 if one is None else one.on_rim.mean() + 1.0 - options.whole_rim
    return bool(share >= options.least_rim and share > more)


def _in_finer(
    full: Reduced, rims: Candidates | None, smooth: Ellipse, options: DetectionOptions
) -> Candidates | None:
    """Look for rims again in ever finer images, up to the first in which noise or blur hides them.

    There the edges of a cover are farther from the rim, in px, and it must be as smooth.
    """
    if rims is None or rims.scale[0] == 1.0:
        return rims
    finest: list[Candidates] = []
    coarse: Candidates | None = rims
    while coarse is not None:
        # A finer image has about twice the noise.
        may = (coarse.scale > 1.0) & (2.0 * coarse.noise_share <= options.noisy_share)
        finest.append(rows(coarse, np.flatnonzero(~may)))
        coarse = rows(coarse, np.flatnonzero(may))
        if len(coarse.scale) == 0:
            break
        finer, of = _in_part(full, int(coarse.scale[0]) // 2, coarse.ellipse, smooth, options)
        if finer is not None:
            is_hidden = finer.is_wide | (finer.noise_share > options.noisy_share)
            finest.append(rows(coarse, of[is_hidden]))
            finer = rows(finer, np.flatnonzero(~is_hidden))
        coarse = finer
    found = joined(finest)
    return found if len(found.scale) else None


def _compared(
    new: Candidates, wanted: BoolArray, candidates: Candidates, rough: list[int], options: DetectionOptions
) -> tuple[IntArray, list[int]]:
    """Return which of the rims `new` are not of arcs of `rough` ones, and which of these they explain better."""
    kept = np.ones(len(wanted), np.bool_)
    beaten: list[int] = []
    if not rough:
        return np.flatnonzero(kept), beaten
    near_px = np.maximum(options.same_px, options.rim_tolerance_sigmas * candidates.rms_px[rough])
    others = candidates.ellipse[rough]
    for k in range(len(wanted)):
        distance = np.abs(rim_distance(others, new.edges.points[k][new.on_rim[k]]))
        shares = np.mean(distance < near_px[:, None], axis=1) >= options.least_shared
        is_closer = wanted[k] & (new.stray_px[k] <= options.closer_ratio * candidates.stray_px[rough])
        beaten += np.array(rough)[shares & is_closer].tolist()
        kept[k] = not (shares & ~is_closer).any()
    return np.flatnonzero(kept), beaten


def _one_of_each(candidates: Candidates, waiting: list[int], most: int, options: DetectionOptions) -> list[int]:
    """Return the first of the candidates `waiting`, up to `most`, of which none lies on the edges of another."""
    chosen: list[int] = []
    for i in waiting:
        if not chosen or not _lies_on(candidates, i, candidates.ellipse[chosen], options).any():
            chosen.append(i)
            if len(chosen) == most:
                break
    return chosen


def _lies_on(candidates: Candidates, i: int, ellipse: Ellipse, options: DetectionOptions) -> BoolArray:
    """Return on which of the ellipses (m,) most of the edges of candidate `i` lie."""
    points = candidates.edges.points[i][candidates.on_rim[i]]
    if len(ellipse) == 0 or len(points) == 0:
        return np.zeros(len(ellipse), np.bool_)
    distance = np.abs(rim_distance(ellipse, points))
    return np.asarray(np.mean(distance < options.same_px * candidates.scale[i], axis=1) >= options.same_rim_share)


def _may_be_a_rim(candidates: Candidates, i: int, whole: Ellipse, options: DetectionOptions) -> bool:
    """Return whether candidate `i` has long runs of edges, alike enough, that are not those of circles seen whole."""
    if candidates.quality[i] < options.hopeless_partial_quality:
        return False
    runs = in_runs(candidates.on_rim[i], options)
    if runs.mean() < options.least_in_runs:
        return False
    return not _is_explained(candidates.edges.points[i][runs], whole, options)


def _is_explained(points: FloatArray, whole: Ellipse, options: DetectionOptions) -> bool:
    """Return whether many of the edges (n, 2) lie on whole rims: they run from one circle to its neighbor."""
    if len(whole) == 0 or len(points) == 0:
        return False
    # Only rims whose boxes come near.
    low, high = points.min(axis=0), points.max(axis=0)
    reach = whole.semi_major[:, None] + options.explained_px
    near = whole[np.all((whole.center > low - reach) & (whole.center < high + reach), axis=1)]
    if len(near) == 0:
        return False
    distance = np.abs(rim_distance(near, points))
    return bool((distance < options.explained_px).any(axis=0).mean() > options.most_explained)
