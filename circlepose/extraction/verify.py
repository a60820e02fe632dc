"""What the edges along a candidate say of it: whether it is the rim of a circle's image, and with what evidence."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Self

import numpy as np

from circlepose._typing import BoolArray, FloatArray
from circlepose.conic import Ellipse, rim_distance
from circlepose.extraction.contour import WANTED_SIGN, Contour, Rejection
from circlepose.extraction.partial import PartialRim
from circlepose.extraction.rim import RimEdges
from circlepose.fitting.thin_ellipse import are_thin
from circlepose.target import AxisIntervals, Polarity

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
    evidence: FloatArray

    @classmethod
    def of(cls, ellipse: Ellipse, edges: RimEdges, on_rim: BoolArray | None = None) -> Self:
        """Measure ellipses on their edges; `on_rim` says which of these were fitted to, where it was a part only."""
        residual = rim_distance(ellipse, edges.points)
        tolerance = np.maximum(_TOLERANCE_PX, _TOLERANCE_SHARE * ellipse.semi_major)[:, None]
        which = edges.valid & (np.abs(residual) <= tolerance) if on_rim is None else on_rim
        share = which.mean(axis=1)
        count = np.maximum(which.sum(axis=1), 1)
        rms_px = np.sqrt(np.sum(np.where(which, residual, 0.0) ** 2, axis=1) / count)
        step = np.abs(np.sum(np.where(which, edges.step, 0.0), axis=1)) / count
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
            evidence=share * perimeter * step / (1.0 + (rms_px / 0.5) ** 2),
        )

    @classmethod
    def of_partial(cls, rims: list[PartialRim]) -> Self:
        """Measure rims that were fitted to the places that agree with each other."""
        ellipse = joined_ellipses([rim.ellipse[None] for rim in rims])
        return cls.of(ellipse, RimEdges.joined([rim.edges for rim in rims]), np.stack([rim.on_rim for rim in rims]))

    def joined_with(self, other: Self) -> Self:
        """Return both batches as one."""
        ellipse = joined_ellipses([self.ellipse, other.ellipse])
        arrays = [f.name for f in fields(self) if f.name not in ("ellipse", "edges")]
        joined = {name: np.concatenate([getattr(self, name), getattr(other, name)]) for name in arrays}
        return type(self)(ellipse=ellipse, edges=RimEdges.joined([self.edges, other.edges]), **joined)

    def why_not(self, i: int, intervals: AxisIntervals, polarity: Polarity, least_step: float) -> Rejection | None:
        """Return why candidate i is no rim of those wanted, or None when it is one."""
        major, minor = 2.0 * float(self.ellipse.semi_major[i]), 2.0 * float(self.ellipse.semi_minor[i])
        if major < _LEAST_AXES_PX[0] or (intervals.minor_px is None and minor < _LEAST_AXES_PX[1]):
            return Rejection.TOO_SHORT
        if not intervals.holds_major(major):
            return Rejection.MAJOR_AXIS
        if not intervals.holds_minor(minor):
            return Rejection.MINOR_AXIS
        if self._is_sliver(i, intervals):
            return Rejection.NOT_ELLIPTICAL
        if self.share[i] < self._least_rim(i):
            return Rejection.TOO_LITTLE_RIM
        if self.ragged[i] > (_CLOSE if self.is_partial[i] else 1.0):
            return Rejection.RAGGED
        if self.step[i] < least_step:
            return Rejection.WEAK_EDGE
        return Rejection.POLARITY if WANTED_SIGN[polarity] * self.edges.polarity[i] < 0.0 else None

    def _least_rim(self, i: int) -> float:
        if self.is_partial[i]:
            return _LEAST_PARTIAL_RIM
        return _LEAST_RIM if self.ragged[i] < 0.5 else _CLEAN_RIM

    def _is_sliver(self, i: int, intervals: AxisIntervals) -> bool:
        # Where slivers are looked for, they have a way of their own.
        wanted = intervals.major_px is not None
        return bool(are_thin(self.ellipse[i])) and (wanted or self.share[i] < _CLEAN_THIN or self.ragged[i] > 0.5)

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
        )


def joined_ellipses(batches: list[Ellipse]) -> Ellipse:
    """Return the ellipses of all batches as one."""
    return Ellipse(*(np.concatenate([getattr(e, field.name) for e in batches]) for field in fields(Ellipse)))
