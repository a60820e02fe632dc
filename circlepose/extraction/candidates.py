"""Edge chains -> rough ellipses, all chains of one image at once."""

from __future__ import annotations

from collections import Counter

import numpy as np

from circlepose._typing import BoolArray, FloatArray, Image
from circlepose.conic import Ellipse, rim_distance
from circlepose.extraction import EXTRACTIONS
from circlepose.extraction.arcs import arcs
from circlepose.extraction.coincidence import border_chains
from circlepose.extraction.contour import Rejection
from circlepose.extraction.edges import edge_chains, pyramid
from circlepose.extraction.grouping import joined_arcs
from circlepose.fitting.direct import Contours, fit_ellipses
from circlepose.target import AxisIntervals

_LEVELS = 2
"""Full and half size: grain that breaks an edge at full size is gone at half."""
_SHORTEST = 12
"""Points in the shortest chain of interest: the border of a circle 5 px across."""
_SLACK_PX = 4.0
"""How far an axis of a rough ellipse may be from that of the edge in the end."""
_ROUGH_RMS_PX = 1.0
_ROUGH_RMS_SHARE = 0.03
"""A chain may stray this far (px, or share of the minor axis) and still be worth a closer look."""
_TRIMS = 3
_LEAST_RIM = 0.35
_LONG_PX = 15.0
"""Semi-major axis from which a line may be a circle seen edge-on."""


def rough_ellipses(
    grey8: Image, intervals: AxisIntervals, extraction: str = EXTRACTIONS[0]
) -> tuple[Ellipse, Counter[Rejection]]:
    """Return the ellipses (batch, full-size px) that chains of edges suggest, and the chains passed over."""
    chains_of = border_chains if extraction == "coincidence" else edge_chains
    rejected: Counter[Rejection] = Counter()
    parts = []
    for level, image in enumerate(pyramid(grey8, _LEVELS)):
        scale = 2.0**level
        chains = chains_of(image, _SHORTEST)
        shortest, longest = _extents(intervals, scale, image)
        extents = [float(np.max(np.ptp(chain, axis=0))) for chain in chains]
        large = [chain for chain, extent in zip(chains, extents, strict=True) if extent >= shortest]
        rejected[Rejection.TOO_SHORT] += len(chains) - len(large)
        # A chain that is too long has merged with something, or is none; its arcs may still be of a rim.
        whole = [chain for chain, extent in zip(chains, extents, strict=True) if shortest <= extent <= longest]
        pieces = [arc for chain in large for arc in arcs(chain)]
        hypotheses = [*whole, *pieces, *joined_arcs(pieces, longest)]
        if hypotheses:
            found = _fit(Contours.of(hypotheses), rejected)
            # pyrDown keeps pixel centres: (0, 0) stays (0, 0).
            parts.append((found.center * scale, found.semi_major * scale, found.semi_minor * scale, found.angle))
    if not parts:
        return Ellipse(np.empty((0, 2)), np.empty(0), np.empty(0), np.empty(0)), rejected
    center, semi_major, semi_minor, angle = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    found = Ellipse(center, semi_major, semi_minor, angle)
    major_ok = _within(2.0 * found.semi_major, intervals.major_px)
    minor_ok = _within(2.0 * found.semi_minor, intervals.minor_px)
    rejected[Rejection.MAJOR_AXIS] += int(np.sum(~major_ok))
    rejected[Rejection.MINOR_AXIS] += int(np.sum(major_ok & ~minor_ok))
    return found[major_ok & minor_ok], rejected


def _extents(intervals: AxisIntervals, scale: float, image: Image) -> tuple[float, float]:
    """Return the smallest and largest extent (px of a reduced `image`) that a rim's chain can have."""
    if intervals.major_px is None:
        return 0.0, 1.5 * max(image.shape)
    low, high = intervals.major_px
    # An ellipse's box is at least major/sqrt(2) wide; a chain of part of a rim may be half that.
    return (0.35 * low - _SLACK_PX) / scale, (1.1 * high + 2.0 * _SLACK_PX) / scale


def _fit(chains: Contours, rejected: Counter[Rejection]) -> Ellipse:
    """Fit all chains, letting go of stray points over a few rounds."""
    weights = np.ones(len(chains.points))
    owner = chains.owner
    for _ in range(_TRIMS):
        ellipse, found = fit_ellipses(chains, weights)
        distance = np.abs(rim_distance(ellipse[owner], chains.points[:, None, :])[:, 0])
        spread = np.sqrt(chains.total(weights * distance**2) / np.maximum(chains.total(weights), 1e-9))
        scale = np.maximum(1.5 * spread, 0.7)[owner]
        weights = 1.0 / (1.0 + (distance / scale) ** 2) ** 2
    near = np.maximum(_ROUGH_RMS_PX, _ROUGH_RMS_SHARE * 2.0 * ellipse.semi_minor)
    on_rim = chains.total((distance < 2.0 * near[owner]).astype(np.float64))
    # A shorter arc says too little of the rest of the rim.
    perimeter = np.pi * (ellipse.semi_major + ellipse.semi_minor)
    good = (
        found & (on_rim >= _LEAST_RIM * perimeter) & ((ellipse.semi_minor >= 1.0) | (ellipse.semi_major >= _LONG_PX))
    )
    rejected[Rejection.NOT_ELLIPTICAL] += len(found) - int(np.sum(good))
    return ellipse[good]


def _within(length_px: FloatArray, interval: tuple[float, float] | None) -> BoolArray:
    if interval is None:
        return np.ones(len(length_px), dtype=np.bool_)
    return (length_px >= interval[0] - _SLACK_PX) & (length_px <= interval[1] + _SLACK_PX)
