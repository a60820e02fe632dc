"""What the edges along a candidate say of it: whether it is the rim of a circle's image, and with what evidence."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from circlepose._batching import joined
from circlepose._typing import BoolArray, FloatArray, IntArray
from circlepose.detection.contour import WANTED_SIGN, Contour, Rejection
from circlepose.detection.occluded import PartialRim
from circlepose.geometry.conic import Ellipse, rim_distance
from circlepose.imaging.subpixel_edges import RimEdges
from circlepose.photometry.thin.fit import are_thin
from circlepose.targets import Polarity
from circlepose.targets.target import AxisIntervals

REASONS = tuple(Rejection)

_LEAST_RIM = 0.55
_LEAST_PARTIAL_RIM = 0.42
_CLOSE = 0.5
"""Of a rim that lies on its ellipse in long runs, and half as ragged as a whole one may be."""
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
_LEAST_AXES_PX = (6.0, 3.0)
_STRAY_PX = 0.08
_STRAY_SHARE = 0.015
_STRAY_WIDEST_PX = 15.0
"""rms distance from the ellipse (px, plus share of the semi-minor axis up to the last) that halves the quality."""
_UNEVEN = 0.15
_UNEVEN_PER_PX = 0.02
"""Spread of the edge's height along the rim, as a share of it (plus per px of the semi-minor axis), that does too."""
_LEAST_QUALITY = 0.3
_LEAST_SCORE = 0.32
_LENIENCE = 0.5
_HOPELESS = 0.15
_HOPELESS_PART = 0.1
"""Quality below which a closer look is not worth it, at a rim seen whole, or nearly, and at another."""


@dataclass(frozen=True, slots=True, eq=False)
class Candidates:
    """A batch of m ellipses with the edges along them."""

    ellipse: Ellipse
    edges: RimEdges
    on_rim: BoolArray
    """(m, k) the places whose edge lies on the ellipse"""
    is_partial: BoolArray
    """(m,) fitted to those places only that agree with each other"""
    share: FloatArray
    """(m,) of the rim that lies on the ellipse"""
    rms_px: FloatArray
    step: FloatArray
    """(m,) grey levels"""
    ragged: FloatArray
    """(m,) rms distance as a share of what is let pass"""
    quality: FloatArray
    """(m,) how well what is seen of the rim suits a circle's image, 0 to 1: see `_quality`"""
    evidence: FloatArray

    @classmethod
    def of(cls, ellipse: Ellipse, edges: RimEdges, on_rim: BoolArray | None = None) -> Self:
        """Measure ellipses on their edges; `on_rim` says which of these were fitted to, where it was a part only."""
        residual = rim_distance(ellipse, edges.points)
        tolerance = np.maximum(_TOLERANCE_PX, _TOLERANCE_SHARE * ellipse.semi_major)[:, None]
        which = edges.valid & (np.abs(residual) <= tolerance) if on_rim is None else on_rim
        share = which.mean(axis=1)
        rms_px, step, uneven = _measured(residual, edges.step, which)
        perimeter = np.pi * (ellipse.semi_major + ellipse.semi_minor)
        return cls(
            ellipse=ellipse,
            edges=edges,
            on_rim=which,
            is_partial=np.full(len(share), on_rim is not None),
            share=share,
            rms_px=rms_px,
            step=step,
            ragged=rms_px / (_RAGGED_PX + _RAGGED_SHARE * ellipse.semi_major),
            quality=_quality(ellipse.semi_minor, rms_px, uneven),
            evidence=share * perimeter * step / (1.0 + (rms_px / 0.5) ** 2),
        )

    @classmethod
    def of_partial(cls, rims: list[PartialRim]) -> Self:
        """Measure rims that were fitted to the places that agree with each other."""
        ellipse = joined([rim.ellipse[None] for rim in rims])
        return cls.of(ellipse, joined([rim.edges for rim in rims]), np.stack([rim.on_rim for rim in rims]))

    def why_not(
        self, intervals: AxisIntervals, polarity: Polarity, least_step: float, *, of_rings: bool = False
    ) -> IntArray:
        """Return (m,) why each candidate is no rim of those wanted, as its place in `REASONS`, or -1 where it is one.

        Of several reasons the first counts. Rims `of_rings` are held against each other later, so half
        the score does.
        """
        major, minor = 2.0 * self.ellipse.semi_major, 2.0 * self.ellipse.semi_minor
        small = major < _LEAST_AXES_PX[0]
        if intervals.minor_px is None:
            small |= minor < _LEAST_AXES_PX[1]
        lenience = _LENIENCE if of_rings else 1.0
        which = [
            (small, Rejection.TOO_SHORT),
            (~_holds(major, intervals.major_px), Rejection.MAJOR_AXIS),
            (~_holds(minor, intervals.minor_px), Rejection.MINOR_AXIS),
            (self._are_slivers(intervals), Rejection.NOT_ELLIPTICAL),
            (self.share < self._least_rim(), Rejection.TOO_LITTLE_RIM),
            (self.ragged > np.where(self.is_partial, _CLOSE, 1.0), Rejection.RAGGED),
            (self.step < least_step, Rejection.WEAK_EDGE),
            (self.quality < lenience * _LEAST_QUALITY, Rejection.UNLIKE_A_RIM),
            (self.quality * self.share < lenience * _LEAST_SCORE, Rejection.TOO_LITTLE_RIM),
            (WANTED_SIGN[polarity] * self.edges.polarity < 0.0, Rejection.POLARITY),
        ]
        reasons = np.full(len(major), -1, dtype=np.int64)
        for holds, reason in reversed(which):
            reasons[holds] = REASONS.index(reason)
        return reasons

    def _least_rim(self) -> FloatArray:
        whole = np.where(self.ragged < 0.5, _LEAST_RIM, _CLEAN_RIM)
        return np.where(self.is_partial, _LEAST_PARTIAL_RIM, whole)

    def _are_slivers(self, intervals: AxisIntervals) -> BoolArray:
        # Where slivers are looked for, they have a way of their own.
        wanted = intervals.major_px is not None
        return are_thin(self.ellipse) & (wanted | (self.share < _CLEAN_THIN) | (self.ragged > 0.5))

    def contour(self, i: int) -> Contour:
        """Return candidate i as a contour."""
        return Contour(
            points=self.edges.points[i][self.on_rim[i]],
            ellipse=self.ellipse[i],
            polarity=int(self.edges.polarity[i]),
            step=float(self.step[i]),
            rim_used=float(self.share[i]),
            residual_px=float(self.rms_px[i]),
            evidence=float(self.evidence[i]),
            score=float(self.share[i] * self.quality[i]),
        )


def are_hopeless(ellipse: Ellipse, residual: FloatArray, step: FloatArray, on_rim: BoolArray) -> BoolArray:
    """Tell (m,) which rims are so unlike a circle's that no closer look will mend it.

    From the `residual` (m, k) px and the `step` (m, k) of the edges along them, those counted that are `on_rim`.
    """
    rms_px, _, uneven = _measured(residual, step, on_rim)
    least = np.where(on_rim.mean(axis=1) >= _CLEAN_RIM, _HOPELESS, _HOPELESS_PART)
    return np.asarray(_quality(ellipse.semi_minor, rms_px, uneven) < least)


def _measured(residual: FloatArray, step: FloatArray, which: BoolArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return (m,) the rms residual, the mean step and the spread of the step as a share of it, where `which`."""
    count = np.maximum(np.count_nonzero(which, axis=1), 1)
    rms_px = np.sqrt(np.sum(np.where(which, residual, 0.0) ** 2, axis=1) / count)
    mean = np.abs(np.sum(np.where(which, step, 0.0), axis=1)) / count
    spread = np.where(which, np.abs(step) - mean[:, None], 0.0)
    return rms_px, mean, np.sqrt(np.sum(spread**2, axis=1) / count) / np.maximum(mean, 1e-9)


def _quality(semi_minor: FloatArray, rms_px: FloatArray, uneven: FloatArray) -> FloatArray:
    """Return (m,) how little the edges stray from the ellipse and how even they are, 1 at best.

    Things that are round by chance are small, and differ from an ellipse by a share of their size and in how their
    edge varies along it. A large ellipse that many edges lie on is none by chance: it may lie on half a table.
    """
    stray = rms_px / (_STRAY_PX + _STRAY_SHARE * np.minimum(semi_minor, _STRAY_WIDEST_PX))
    return np.asarray(1.0 / (1.0 + stray**2) / (1.0 + (uneven / (_UNEVEN + _UNEVEN_PER_PX * semi_minor)) ** 2))


def _holds(length_px: FloatArray, interval: tuple[float, float] | None) -> BoolArray:
    if interval is None:
        return np.ones(len(length_px), dtype=np.bool_)
    return (interval[0] <= length_px) & (length_px <= interval[1])
