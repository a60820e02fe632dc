"""Which of many candidates are rims of the kind wanted, each once, and why the others are not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from circlepose._batching import in_parts
from circlepose._typing import BoolArray, IntArray
from circlepose.detection.contour import Rejection
from circlepose.detection.duplicates import inside_others, neighbors, repeats
from circlepose.detection.options import DEFAULT, DetectionOptions
from circlepose.detection.verification import REASONS, Candidates
from circlepose.geometry.ellipse import rim_distance
from circlepose.targets import Polarity
from circlepose.targets.target import AxisIntervals


@dataclass(frozen=True, slots=True)
class Wanted:
    """What contours are looked for in an image."""

    intervals: AxisIntervals
    """of the axes, px"""
    polarity: Polarity
    keep_concentric: bool
    """whether contours inside others count, as of rings"""
    enough: int | None
    """how many are looked for; None for all"""
    least_step: float
    """least height of an edge, levels"""
    options: DetectionOptions = DEFAULT

    def why_not(self, candidates: Candidates) -> IntArray:
        """Return (m,) why each candidate by itself is rejected, as the index into `REASONS`; -1 where it is not."""
        return candidates.why_not(
            self.intervals, self.polarity, self.least_step, self.options, of_rings=self.keep_concentric
        )


@dataclass(frozen=True, slots=True, eq=False)
class Chosen:
    """Which candidates are rims of the kind wanted."""

    kept: list[int]
    """their indices, most evidence first"""
    reasons: dict[int, Rejection]
    """why each of the others is rejected, by its index"""


def chosen(found: Candidates, wanted: Wanted) -> Chosen:
    """Return which candidates are rims of the kind wanted, and why each other is not."""
    why_not, options = wanted.why_not(found), wanted.options
    ranked = np.argsort(-found.evidence, kind="stable")

    def left(candidates: IntArray) -> IntArray:
        return candidates[why_not[candidates] < 0]

    kept = left(ranked)
    if len(kept):
        # What is small, or seen in part, is round by chance more often the fainter it is; a large whole rim is not.
        faint = found.step[kept] < options.least_step_of_typical * typical_step(found, kept)
        is_small = found.ellipse.semi_minor[kept] < options.chance_px
        faint &= is_small | (found.share[kept] < options.whole_rim)
        why_not[kept[faint]] = REASONS.index(Rejection.FAINT)
        kept = left(kept)
        # What is smooth in a reduced image was seen to have corners in a finer one.
        cornered = np.flatnonzero(why_not == REASONS.index(Rejection.POLYGON))
        rough = kept[found.ragged[kept] >= options.half_ragged]
        if len(cornered) and len(rough):
            again = repeats(found.ellipse, np.concatenate([cornered, rough]), options)
            why_not[np.intersect1d(again, rough)] = REASONS.index(Rejection.POLYGON)
            kept = left(kept)
        why_not[repeats(found.ellipse, kept, options)] = REASONS.index(Rejection.DUPLICATE)
        kept = left(kept)
        repeated, noise = _borrowing(found, kept, wanted)
        why_not[repeated] = REASONS.index(Rejection.DUPLICATE)
        why_not[noise] = REASONS.index(Rejection.WEAK_EDGE)
        kept = left(kept)
        if not wanted.keep_concentric:
            why_not[inside_others(found.ellipse, kept, options)] = REASONS.index(Rejection.INSIDE_ANOTHER)
            kept = left(kept)
    return Chosen(kept.tolist(), {i: REASONS[why_not[i]] for i in ranked.tolist() if why_not[i] >= 0})


def _borrowing(found: Candidates, ranked: IntArray, wanted: Wanted) -> tuple[list[int], list[int]]:
    """Return which of the candidates `ranked`, most evidence first, have their edges from rims before them.

    Those that have most of them from there, and those whose other edges may be noise.
    """
    if len(ranked) < 2:
        return [], []
    options = wanted.options
    own = found.ellipse[ranked]
    reach = own.semi_major + options.same_px
    first, second = neighbors(own.center, 2.0 * float(reach.max(initial=0.0)))
    close = np.linalg.norm(own.center[first] - own.center[second], axis=1) < reach[first] + reach[second]
    before, after = first[close], second[close]
    if len(after) == 0:
        return [], []
    by_after = np.argsort(after, kind="stable")
    before, after = before[by_after], after[by_after]
    near_px = np.maximum(options.same_px, options.rim_tolerance_sigmas * found.noise_px[ranked])

    def are_off(before: IntArray, after: IntArray) -> BoolArray:
        distance = rim_distance(own[before], found.edges.points[ranked[after]])
        return np.asarray(np.abs(distance) > near_px[after, None])

    is_off = in_parts(are_off, before, after)
    at, begin = np.unique(after, return_index=True)
    on_rim = found.on_rim[ranked[at]]
    most_shared = 1.0 if wanted.keep_concentric else options.least_shared
    least_own = (1.0 - most_shared) * np.count_nonzero(on_rim, axis=1)
    is_own = on_rim & np.logical_and.reduceat(is_off, begin, axis=0)
    may_borrow = np.count_nonzero(is_own, axis=1) < least_own
    is_noisy = found.noise_share[ranked[at]] > options.noisy_share
    repeated: list[int] = []
    noise: list[int] = []
    left_out: set[int] = set()
    groups = np.append(begin, len(after))
    # Those left out lend no edges, so the others have as many of their own or more.
    for k in np.flatnonzero(may_borrow | is_noisy).tolist():
        i = int(ranked[at[k]])
        pairs = [j for j in range(groups[k], groups[k + 1]) if before[j] not in left_out]
        if pairs:
            is_own_now = on_rim[k] & is_off[pairs].all(axis=0)
            if np.count_nonzero(is_own_now) < least_own[k]:
                repeated.append(i)
                left_out.add(int(at[k]))
            elif is_noisy[k] and found.is_noise(i, is_own_now, options):
                noise.append(i)
                left_out.add(int(at[k]))
    return repeated, noise


def typical_step(found: Candidates, which: IntArray | list[int]) -> float:
    """Return the mean height of the edges of the candidates `which`, by their evidence; 0 without any."""
    evidence = found.evidence[which]
    return float(found.step[which] @ evidence / max(evidence.sum(), 1e-9))


def whole(found: Candidates, chosen: Chosen, options: DetectionOptions) -> list[int]:
    """Return the indices of the kept candidates that are seen whole, most evidence first."""
    return [i for i in chosen.kept if found.share[i] > options.whole_rim]


def least_evident(found: Candidates, whole: list[int], enough: int | None) -> float:
    """Return the evidence of the last of the `enough` best of the candidates `whole`; 0 where there are fewer."""
    return float(found.evidence[whole[enough - 1]]) if enough is not None and len(whole) >= enough else 0.0


def settled(found: Candidates, reasons: dict[int, Rejection], options: DetectionOptions) -> BoolArray:
    """Return (m,) which candidates are rims seen whole, or nearly, wanted or not."""
    unwanted = (Rejection.POLARITY, Rejection.INSIDE_ANOTHER, Rejection.MAJOR_AXIS, Rejection.MINOR_AXIS)
    is_settled = (found.share > options.whole_rim) & (found.ragged < 1.0)
    is_settled[[i for i, reason in reasons.items() if reason not in unwanted]] = False
    return is_settled
