"""Whether a candidate is the rim of a circle's image, judged by the edges along it, and with what evidence."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from circlepose._batching import joined
from circlepose._typing import BoolArray, FloatArray, IntArray
from circlepose.detection.contour import WANTED_SIGN, Contour, Rejection
from circlepose.detection.occluded import PartialRim
from circlepose.detection.options import DEFAULT, DetectionOptions
from circlepose.geometry.ellipse import Ellipse, rim_distance
from circlepose.imaging.subpixel_edges import RimEdges
from circlepose.photometry.thin.fit import are_thin
from circlepose.targets import Polarity
from circlepose.targets.target import AxisIntervals

REASONS = tuple(Rejection)


@dataclass(frozen=True, slots=True, eq=False)
class Candidates:
    """A batch of m ellipses with the edges along them."""

    ellipse: Ellipse
    edges: RimEdges
    on_rim: BoolArray
    """(m, k) the samples whose edge lies on the ellipse"""
    is_partial: BoolArray
    """(m,) fitted only to the samples that agree with each other"""
    share: FloatArray
    """(m,) of the rim that lies on the ellipse"""
    rms_px: FloatArray
    """(m,) rms distance of those edges from the ellipse"""
    step: FloatArray
    """(m,) height of the edge, levels"""
    ragged: FloatArray
    """(m,) rms distance as a share of the largest that passes"""
    quality: FloatArray
    """(m,) how well the rim suits a circle's image, 0 to 1: see `_quality`"""
    evidence: FloatArray
    """(m,) levels x px: see `Contour.evidence`"""

    @classmethod
    def of(
        cls,
        ellipse: Ellipse,
        edges: RimEdges,
        on_rim: BoolArray | None = None,
        options: DetectionOptions = DEFAULT,
    ) -> Self:
        """Measure ellipses on their edges; `on_rim` (m, k) selects those that were fitted to, if not all."""
        residual = rim_distance(ellipse, edges.points)
        tolerance = np.maximum(options.rim_tolerance_px, options.rim_tolerance_share * ellipse.semi_major)[:, None]
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
            ragged=rms_px / (options.ragged_px + options.ragged_share * ellipse.semi_major),
            quality=_quality(ellipse.semi_minor, rms_px, uneven, options),
            evidence=share * perimeter * step / (1.0 + (rms_px / options.evidence_rms_px) ** 2),
        )

    @classmethod
    def of_partial(cls, rims: list[PartialRim], options: DetectionOptions = DEFAULT) -> Self:
        """Measure rims that were fitted to the samples that agree with each other."""
        ellipse = joined([rim.ellipse[None] for rim in rims])
        return cls.of(ellipse, joined([rim.edges for rim in rims]), np.stack([rim.on_rim for rim in rims]), options)

    def why_not(
        self,
        intervals: AxisIntervals,
        polarity: Polarity,
        least_step: float,
        options: DetectionOptions = DEFAULT,
        *,
        of_rings: bool = False,
    ) -> IntArray:
        """Return (m,) why each candidate is rejected, as the index into `REASONS`, or -1 where it is not.

        Of several reasons the first counts. Rims `of_rings` are checked against each other later, so less quality and
        score will do.
        """
        major, minor = 2.0 * self.ellipse.semi_major, 2.0 * self.ellipse.semi_minor
        small = major < options.least_major_px
        if intervals.minor_px is None:
            small |= minor < options.least_minor_px
        lenience = options.ring_leniency if of_rings else 1.0
        which = [
            (small, Rejection.TOO_SHORT),
            (~_holds(major, intervals.major_px), Rejection.MAJOR_AXIS),
            (~_holds(minor, intervals.minor_px), Rejection.MINOR_AXIS),
            (self._are_slivers(intervals, options), Rejection.NOT_ELLIPTICAL),
            (self.share < self._least_rim(options), Rejection.TOO_LITTLE_RIM),
            (self.ragged > np.where(self.is_partial, options.half_ragged, 1.0), Rejection.RAGGED),
            (self.step < least_step, Rejection.WEAK_EDGE),
            (self.quality < lenience * options.least_quality, Rejection.UNLIKE_A_RIM),
            (self.quality * self.share < lenience * options.least_score, Rejection.TOO_LITTLE_RIM),
            (WANTED_SIGN[polarity] * self.edges.polarity < 0.0, Rejection.POLARITY),
        ]
        reasons = np.full(len(major), -1, dtype=np.int64)
        for holds, reason in reversed(which):
            reasons[holds] = REASONS.index(reason)
        return reasons

    def _least_rim(self, options: DetectionOptions) -> FloatArray:
        whole = np.where(self.ragged < options.half_ragged, options.least_rim, options.clean_rim)
        return np.where(self.is_partial, options.least_partial_rim, whole)

    def _are_slivers(self, intervals: AxisIntervals, options: DetectionOptions) -> BoolArray:
        # Where slivers are sought, `edge_on` finds them.
        wanted = intervals.major_px is not None
        is_clean = (self.share >= options.clean_thin_rim) & (self.ragged <= options.half_ragged)
        return are_thin(self.ellipse, options=options.photometry) & (wanted | ~is_clean)

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


def are_hopeless(
    ellipse: Ellipse, residual: FloatArray, step: FloatArray, on_rim: BoolArray, options: DetectionOptions = DEFAULT
) -> BoolArray:
    """Return (m,) which rims differ so much from a circle's that a second pass cannot help.

    From the `residual` (m, k), px, and the `step` (m, k), levels, of the edges `on_rim` (m, k).
    """
    rms_px, _, uneven = _measured(residual, step, on_rim)
    is_whole = on_rim.mean(axis=1) >= options.whole_rim
    least = np.where(is_whole, options.hopeless_quality, options.hopeless_partial_quality)
    return np.asarray(_quality(ellipse.semi_minor, rms_px, uneven, options) < least)


def _measured(residual: FloatArray, step: FloatArray, which: BoolArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return (m,) the rms residual, the mean step and the spread of the step as a share of it, where `which`."""
    count = np.maximum(np.count_nonzero(which, axis=1), 1)
    rms_px = np.sqrt(np.sum(np.where(which, residual, 0.0) ** 2, axis=1) / count)
    mean = np.abs(np.sum(np.where(which, step, 0.0), axis=1)) / count
    spread = np.where(which, np.abs(step) - mean[:, None], 0.0)
    return rms_px, mean, np.sqrt(np.sum(spread**2, axis=1) / count) / np.maximum(mean, 1e-9)


def _quality(semi_minor: FloatArray, rms_px: FloatArray, uneven: FloatArray, options: DetectionOptions) -> FloatArray:
    """Return (m,) how little the edges stray from the ellipse and how even they are, 1 at best.

    Things that are round by chance are small, stray from an ellipse in proportion to their size, and have an edge of
    varying height. A large ellipse with many edges on it is not one by chance: its two sides may have different
    backgrounds.
    """
    stray = rms_px / (options.stray_px + options.stray_share * np.minimum(semi_minor, options.stray_widest_px))
    return np.asarray(
        1.0 / (1.0 + stray**2) / (1.0 + (uneven / (options.uneven + options.uneven_per_px * semi_minor)) ** 2)
    )


def _holds(length_px: FloatArray, interval: tuple[float, float] | None) -> BoolArray:
    if interval is None:
        return np.ones(len(length_px), dtype=np.bool_)
    return (interval[0] <= length_px) & (length_px <= interval[1])
