"""Whether a candidate is the rim of a circle's image, judged by the edges along it, and with what evidence."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from circlepose._batching import joined
from circlepose._typing import BoolArray, FloatArray, IntArray
from circlepose.detection.contour import WANTED_SIGN, Contour, Rejection
from circlepose.detection.levels_around import are_hollow, are_wide
from circlepose.detection.occluded import PartialRim
from circlepose.detection.options import DEFAULT, DetectionOptions
from circlepose.detection.polygons import are_polygons
from circlepose.geometry.ellipse import Ellipse, rim_distance
from circlepose.imaging.pyramid import Reduced
from circlepose.imaging.subpixel_edges import STEP_NOISE, RimEdges, edge_noise_px, noise_share
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
    noise_px: FloatArray
    """(m,) about the scatter of an edge by noise"""
    step: FloatArray
    """(m,) height of the edge, levels"""
    ragged: FloatArray
    """(m,) rms distance as a share of the largest that passes"""
    beside: FloatArray
    """(m,) of what is off the rim, the share close to it: a shape bends away slowly, what hides a rim cuts it"""
    quality: FloatArray
    """(m,) how well the rim suits a circle's image, 0 to 1: see `_quality`"""
    evidence: FloatArray
    """(m,) levels x px: see `Contour.evidence`"""
    noise_share: FloatArray
    """(m,) noise of the image in which the edges were located, over the height of the edge"""
    scale: FloatArray
    """(m,) px of the full image in one px of that image"""
    is_polygon: BoolArray
    """(m,) whether the edge has corners at equal angles"""
    is_stair: BoolArray
    """(m,) whether the edge may be a step that rounding or compression makes of a slope"""
    is_hollow: BoolArray
    """(m,) whether what is inside a small rim is as what is outside: a ring or a letter, not a disc"""
    is_wide: BoolArray
    """(m,) whether the edge is wider than the profiles: then its place is arbitrary, and a smaller image shows it"""

    @classmethod
    def of(
        cls,
        image: Reduced,
        ellipse: Ellipse,
        edges: RimEdges,
        on_rim: BoolArray | None = None,
        options: DetectionOptions = DEFAULT,
    ) -> Self:
        """Measure ellipses on the edges along them, both in px of `image`.

        `on_rim` (m, k) selects the edges that were fitted to, if not all. Their scatter is that beyond noise.
        """
        residual = rim_distance(ellipse, edges.points)
        share_of_noise = noise_share(image.noise, edges.step, edges.valid)
        # Only noise that is seen excuses an edge: compression leaves smooth blobs of a few levels and no noise.
        seen_share = noise_share(image.seen_noise, edges.step, edges.valid)
        noise_px = edge_noise_px(seen_share, edges.blur_px)
        tolerance = np.maximum(options.rim_tolerance_px, options.rim_tolerance_share * ellipse.semi_major)
        tolerance = np.maximum(tolerance, options.rim_tolerance_sigmas * noise_px)[:, None]
        which = edges.valid & (np.abs(residual) <= tolerance) if on_rim is None else on_rim
        share = which.mean(axis=1)
        # Outside of it alone: what hides a rim may have edges inside.
        close = edges.valid & (residual > 0.0) & (residual <= options.close_px) & ~which
        beside = close.sum(axis=1) / np.maximum((~which).sum(axis=1), 1)
        rms_px, step, uneven = _measured(residual, edges.step, which)
        stray_px, uneven = _beyond(rms_px, noise_px), _beyond(uneven, STEP_NOISE * seen_share)
        full = image.full(ellipse)
        return cls(
            ellipse=full,
            edges=edges.in_full_size(image.scale),
            on_rim=which,
            is_partial=np.full(len(share), on_rim is not None),
            share=share,
            rms_px=image.scale * rms_px,
            noise_px=image.scale * noise_px,
            step=step,
            beside=np.where(share < options.whole_rim, beside, 0.0),
            ragged=stray_px / (options.ragged_px + options.ragged_share * ellipse.semi_major),
            quality=_quality(ellipse.semi_minor, stray_px, uneven, options),
            evidence=share * full.perimeter * step / (1.0 + (stray_px / options.evidence_rms_px) ** 2),
            noise_share=share_of_noise,
            scale=np.full(len(share), float(image.scale)),
            is_polygon=_are_polygons(ellipse, residual, which, edges, options),
            is_stair=_are_stairs(image, step, options),
            is_hollow=are_hollow(image, ellipse, edges, which, options),
            is_wide=are_wide(image, ellipse, edges, step, options),
        )

    @classmethod
    def of_partial(cls, image: Reduced, rims: list[PartialRim], options: DetectionOptions = DEFAULT) -> Self:
        """Measure rims that were fitted in `image` to the samples that agree with each other."""
        ellipse = joined([rim.ellipse[None] for rim in rims])
        edges = joined([rim.edges for rim in rims])
        return cls.of(image, ellipse, edges, np.stack([rim.on_rim for rim in rims]), options)

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
            (self.is_wide, Rejection.BLURRED),
            (self.is_polygon, Rejection.POLYGON),
            (self.share < self._least_rim(options), Rejection.TOO_LITTLE_RIM),
            (self.ragged > np.where(self.is_partial, options.half_ragged, np.inf), Rejection.RAGGED),
            (self.is_hollow & (not of_rings), Rejection.HOLLOW),
            ((self.step < least_step) | self.is_stair | self._may_be_noise(options), Rejection.WEAK_EDGE),
            (self.quality < lenience * options.least_quality, Rejection.UNLIKE_A_RIM),
            (self.score < lenience * options.least_score, Rejection.TOO_LITTLE_RIM),
            (WANTED_SIGN[polarity] * self.edges.polarity < 0.0, Rejection.POLARITY),
        ]
        reasons = np.full(len(major), -1, dtype=np.int64)
        for holds, reason in reversed(which):
            reasons[holds] = REASONS.index(reason)
        return reasons

    @property
    def score(self) -> FloatArray:
        """(m,) see `Contour.score`."""
        return self.share * self.quality * (1.0 - self.beside)

    def share_of_bounds(self, options: DetectionOptions) -> FloatArray:
        """Return (m,) the least of 1, the share of the rim over its bound, and the quality over its."""
        over = np.minimum(self.share / self._least_rim(options), self.quality / options.least_quality)
        return np.minimum(over, 1.0)

    def _may_be_noise(self, options: DetectionOptions) -> BoolArray:
        """Return (m,) which edges are no higher than the highest that noise alone shows along an ellipse."""
        length = self.share * self.ellipse.perimeter / self.scale
        return self.noise_share * _by_noise(length, options) > 1.0

    def is_noise(self, i: int, which: BoolArray, options: DetectionOptions) -> bool:
        """Return whether the edges `which` (k,) of candidate i are no higher than noise."""
        count = np.count_nonzero(which)
        perimeter = float(self.ellipse.perimeter[i]) / self.scale[i]
        by_noise = self.noise_share[i] * self.step[i] * _by_noise(perimeter * count / len(which), options)
        return bool(by_noise * count > np.abs(self.edges.step[i][which]).sum())

    def _least_rim(self, options: DetectionOptions) -> FloatArray:
        whole = np.where(self.ragged < options.half_ragged, options.least_rim, options.clean_rim)
        return np.where(self.is_partial, options.least_partial_rim, whole)

    def _are_slivers(self, intervals: AxisIntervals, options: DetectionOptions) -> BoolArray:
        # Where slivers are sought, `edge_on` finds them.
        wanted = intervals.major_px is not None
        is_clean = (self.share >= options.clean_thin_rim) & (self.ragged <= options.half_ragged)
        return are_thin(self.ellipse, options=options.photometry) & (wanted | ~is_clean)

    def ragged_in_full(self, options: DetectionOptions) -> FloatArray:
        """Return (m,) the same as `ragged`, by px of the full image."""
        return np.asarray(self.stray_px / (options.ragged_px + options.ragged_share * self.ellipse.semi_major))

    @property
    def stray_px(self) -> FloatArray:
        """(m,) rms distance of the edges from the ellipse beyond noise."""
        return _beyond(self.rms_px, self.noise_px)

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
            score=float(self.score[i]),
            noise_px=float(self.noise_px[i]),
            ragged=float(self.ragged[i]),
            blur_px=float(self.edges.blur_px[i]) if self.scale[i] > 1.0 else 0.0,
        )


def are_hopeless(
    image: Reduced,
    ellipse: Ellipse,
    residual: FloatArray,
    edges: RimEdges,
    on_rim: BoolArray,
    options: DetectionOptions,
) -> BoolArray:
    """Return (m,) which rims differ so much from a circle's that a second pass cannot help.

    From the `residual` (m, k), px of `image`, of the `edges` `on_rim` (m, k).
    """
    seen_share = noise_share(image.seen_noise, edges.step, edges.valid)
    rms_px, _, uneven = _measured(residual, edges.step, on_rim)
    stray_px = _beyond(rms_px, edge_noise_px(seen_share, edges.blur_px))
    is_whole = on_rim.mean(axis=1) >= options.whole_rim
    least = np.where(is_whole, options.hopeless_quality, options.hopeless_partial_quality)
    return np.asarray(
        _quality(ellipse.semi_minor, stray_px, _beyond(uneven, STEP_NOISE * seen_share), options) < least
    )


def are_unclear(image: Reduced, edges: RimEdges, options: DetectionOptions = DEFAULT) -> BoolArray:
    """Return (m,) which rims have edges in `image` so noisy or so wide that a reduced image shows them better."""
    noisy = noise_share(image.noise, edges.step, edges.valid) > options.noisy_share
    return np.asarray(noisy | (edges.blur_px > options.wide_px))


def _are_polygons(
    ellipse: Ellipse, residual: FloatArray, on_rim: BoolArray, edges: RimEdges, options: DetectionOptions
) -> BoolArray:
    """Return (m,) which rims are polygons', by the edges on the ellipse, or by all of them where these close."""
    polygons = are_polygons(ellipse, residual, on_rim, edges.blur_px, options)
    closed = np.flatnonzero(on_rim.mean(axis=1) < options.clean_thin_rim)
    if len(closed):
        closed = closed[~polygons[closed] & (edges.valid[closed].mean(axis=1) >= options.whole_rim)]
    if len(closed):
        own = edges[closed.tolist()]
        polygons[closed] = are_polygons(ellipse[closed], residual[closed], own.valid, own.blur_px, options)
    return polygons


def _are_stairs(image: Reduced, step: FloatArray, options: DetectionOptions) -> BoolArray:
    """Return (m,) which edges, `step` levels high, may be of the stairs in which a slope without noise rises."""
    return np.asarray(step < min(options.stair_levels, options.stair_share * image.stairs_range))


def _beyond(measured: FloatArray, noise: FloatArray) -> FloatArray:
    """Return what is left of a `measured` scatter (m,) without that of the `noise` (m,)."""
    return np.sqrt(np.maximum(measured**2 - noise**2, 0.0))


def _measured(residual: FloatArray, step: FloatArray, which: BoolArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return (m,) the rms residual, the mean step and the spread of the step as a share of it, where `which`."""
    count = np.maximum(np.count_nonzero(which, axis=1), 1)
    rms_px = np.sqrt(np.sum(np.where(which, residual, 0.0) ** 2, axis=1) / count)
    mean = np.sum(np.where(which, np.abs(step), 0.0), axis=1) / count
    spread = np.where(which, np.abs(step) - mean[:, None], 0.0)
    return rms_px, mean, np.sqrt(np.sum(spread**2, axis=1) / count) / np.maximum(mean, 1e-9)


def _quality(semi_minor: FloatArray, rms_px: FloatArray, uneven: FloatArray, options: DetectionOptions) -> FloatArray:
    """Return (m,) how little the edges stray from the ellipse and how even they are, 1 at best.

    Things that are round by chance are small, stray from an ellipse in proportion to their size, and have an edge of
    varying height. A large ellipse with many edges on it is not one by chance: its two sides may have different
    backgrounds.
    """
    stray = rms_px / (options.stray_px + options.stray_share * semi_minor)
    return np.asarray(
        1.0 / (1.0 + stray**2) / (1.0 + (uneven / (options.uneven + options.uneven_per_px * semi_minor)) ** 2)
    )


def _by_noise(length_px: FloatArray, options: DetectionOptions) -> FloatArray:
    """Return the greatest height of edges by noise, over the noise, along `length_px` (m,) of an ellipse."""
    return options.noise_step + options.noise_sigmas * options.noise_step_scatter / np.sqrt(length_px + 1e-9)


def _holds(length_px: FloatArray, interval: tuple[float, float] | None) -> BoolArray:
    if interval is None:
        return np.ones(len(length_px), dtype=np.bool_)
    return (interval[0] <= length_px) & (length_px <= interval[1])
