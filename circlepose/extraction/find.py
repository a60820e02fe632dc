"""Grey image -> contours that are worth a pose, each verified on the grey levels along its rim."""

from __future__ import annotations

from collections import Counter

import numpy as np

from circlepose._typing import BoolArray, Image
from circlepose.conic import Ellipse, rim_distance
from circlepose.extraction import EXTRACTIONS
from circlepose.extraction.candidates import rough_ellipses
from circlepose.extraction.contour import WANTED_SIGN, Contour, Extraction, Rejection
from circlepose.extraction.grey import eight_bit
from circlepose.extraction.rim import RimEdges, ellipse_rim, locate_edges
from circlepose.extraction.slivers import find_slivers
from circlepose.fitting.direct import Contours, fit_ellipses
from circlepose.fitting.thin_ellipse import THIN_PX, are_thin
from circlepose.target import AxisIntervals, Polarity

_FIRST_REACH_PX = 4.0
_LAST_REACH_PX = 2.5
_PLACES = 72
"""Places along the rim at which a candidate is verified."""
_LEAST_RIM = 0.55
_LEAST_STEP = 0.012
"""Lowest edge, as a share of the grey range in use."""
_TOLERANCE_PX = 0.75
_TOLERANCE_SHARE = 0.008
"""An edge belongs to the rim when it is within this (px, or share of the semi-major axis) of the ellipse."""
_RAGGED_PX = 0.2
_RAGGED_SHARE = 0.004
"""Largest rms distance from the ellipse: pixel noise, and what lens distortion bends within a large one."""
_CLEAN_RIM = 0.8
"""Share of the rim wanted where the edge is half as ragged as it may be, or more."""
_CLEAN_THIN = 0.95
"""Share of the rim wanted of a thin ellipse, which any two neighbouring edges resemble."""
_LEAST_KIN = 0.2
"""Edges weaker than this share of the typical one of the image's circles are none of the kind."""
_LEAST_AXES_PX = (6.0, 3.0)


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
    contours = _find_open(levels, rough[~thin], intervals, polarity, keep_concentric, rejected)
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
    rejected: Counter[Rejection],
) -> list[Contour]:
    """Contours with an inside wider than the blur, verified on the edge along their rims."""
    for reach in (_FIRST_REACH_PX, _LAST_REACH_PX):
        if len(rough) == 0:
            return []
        edges = _edges_along(levels, rough, reach)
        rough, alive = _refit(edges, rejected)
        edges = _rows(edges, alive)
    return _verify(levels, rough, edges, intervals, polarity, keep_concentric, rejected)


def _edges_along(levels: Image, ellipse: Ellipse, reach_px: float) -> RimEdges:
    points, normals = ellipse_rim(ellipse, _PLACES)
    # In a small or thin ellipse the search must not come out on the other side.
    reach = np.minimum(reach_px, np.maximum(0.45 * ellipse.semi_minor + 0.5, 1.0))
    return locate_edges(levels, points, normals, reach)


def _rows(edges: RimEdges, which: BoolArray) -> RimEdges:
    return RimEdges(
        edges.points[which], edges.offset_px[which], edges.step[which], edges.valid[which], edges.polarity[which]
    )


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
    found &= edges.valid.sum(axis=1) >= 0.5 * _LEAST_RIM * places
    rejected[Rejection.TOO_LITTLE_RIM] += int(np.sum(~found))
    return fitted[found], found


def _verify(
    levels: Image,
    ellipse: Ellipse,
    edges: RimEdges,
    intervals: AxisIntervals,
    polarity: Polarity,
    keep_concentric: bool,
    rejected: Counter[Rejection],
) -> list[Contour]:
    if len(ellipse) == 0:
        return []
    residual = rim_distance(ellipse, edges.points)
    tolerance = np.maximum(_TOLERANCE_PX, _TOLERANCE_SHARE * ellipse.semi_major)[:, None]
    on_rim = edges.valid & (np.abs(residual) <= tolerance)
    share = on_rim.mean(axis=1)
    count = np.maximum(on_rim.sum(axis=1), 1)
    rms = np.sqrt(np.sum(np.where(on_rim, residual, 0.0) ** 2, axis=1) / count)
    step = np.abs(np.sum(np.where(on_rim, edges.step, 0.0), axis=1)) / count
    floor = _LEAST_STEP * float(np.ptp(levels[::8, ::8])) + 1e-9
    ragged = rms / (_RAGGED_PX + _RAGGED_SHARE * ellipse.semi_major)
    perimeter = np.pi * (ellipse.semi_major + ellipse.semi_minor)
    evidence = share * perimeter * step / (1.0 + (rms / 0.5) ** 2)
    # Where slivers are looked for, they have a way of their own.
    thin = are_thin(ellipse) & ((intervals.major_px is not None) | (share < _CLEAN_THIN) | (ragged > 0.5))
    kept: list[int] = []
    for i in np.argsort(-evidence, kind="stable"):
        reason = None
        if 2.0 * ellipse.semi_major[i] < _LEAST_AXES_PX[0] or (
            intervals.minor_px is None and 2.0 * ellipse.semi_minor[i] < _LEAST_AXES_PX[1]
        ):
            reason = Rejection.TOO_SHORT
        elif not intervals.holds_major(2.0 * float(ellipse.semi_major[i])):
            reason = Rejection.MAJOR_AXIS
        elif not intervals.holds_minor(2.0 * float(ellipse.semi_minor[i])):
            reason = Rejection.MINOR_AXIS
        elif thin[i]:
            reason = Rejection.NOT_ELLIPTICAL
        elif share[i] < (_LEAST_RIM if ragged[i] < 0.5 else _CLEAN_RIM):
            reason = Rejection.TOO_LITTLE_RIM
        elif ragged[i] > 1.0:
            reason = Rejection.RAGGED
        elif step[i] < floor:
            reason = Rejection.WEAK_EDGE
        elif WANTED_SIGN[polarity] * edges.polarity[i] < 0.0:
            reason = Rejection.POLARITY
        if reason is None:
            kept.append(int(i))
        else:
            rejected[reason] += 1
    if kept:
        typical = float(np.average(step[kept], weights=evidence[kept]))
        strong = [i for i in kept if step[i] >= _LEAST_KIN * typical]
        rejected[Rejection.WEAK_EDGE] += len(kept) - len(strong)
        kept = strong
    kept = _distinct(ellipse, kept, keep_concentric, rejected)
    return [
        Contour(
            points=edges.points[i][on_rim[i]],
            ellipse=ellipse[i],
            polarity=int(edges.polarity[i]),
            step=float(step[i]),
            rim_used=float(share[i]),
            residual_px=float(rms[i]),
            evidence=float(evidence[i]),
        )
        for i in kept
    ]


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


def _distinct(ellipse: Ellipse, ranked: list[int], keep_concentric: bool, rejected: Counter[Rejection]) -> list[int]:
    """Keep the first of each set of equal edges and, unless `keep_concentric`, the outermost of nested ones."""
    kept: list[int] = []
    for i in ranked:
        if kept and np.any(_same(ellipse[i], ellipse[kept])):
            rejected[Rejection.DUPLICATE] += 1
        else:
            kept.append(i)
    if keep_concentric:
        return kept
    outer = []
    for i in kept:
        larger = [j for j in kept if ellipse.semi_major[j] > ellipse.semi_major[i]]
        if np.any(_concentric(ellipse, i, larger)):
            rejected[Rejection.INSIDE_ANOTHER] += 1
        else:
            outer.append(i)
    return outer
