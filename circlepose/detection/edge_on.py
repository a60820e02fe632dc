"""Contours of circles seen nearly edge-on (slivers): their two edges blur into one, so the levels are fitted."""

from __future__ import annotations

from collections import Counter

import numpy as np

from circlepose._typing import FloatArray, Image
from circlepose.detection.contour import WANTED_SIGN, Contour, Rejection
from circlepose.detection.occluded import partial_rim
from circlepose.detection.options import DEFAULT, DetectionOptions
from circlepose.detection.verification import Candidates
from circlepose.geometry.ellipse import Ellipse, rim_distance, signed_distance
from circlepose.imaging.pyramid import Reduced
from circlepose.imaging.subpixel_edges import sample
from circlepose.photometry.thin.fit import ThinEllipse, fit_thin_ellipse
from circlepose.targets import Polarity
from circlepose.targets.target import AxisIntervals


def find_slivers(
    levels: Image,
    rough: Ellipse,
    intervals: AxisIntervals,
    polarity: Polarity,
    options: DetectionOptions = DEFAULT,
) -> tuple[list[Contour], Counter[Rejection]]:
    """Fit the thin ellipses of the batch `rough` to `levels` (h, w).

    Returns those that are circles seen edge-on, most evidence first, and how many were rejected why.
    """
    rejected: Counter[Rejection] = Counter()
    found: list[Contour] = []
    for i in np.argsort(-rough.semi_major, kind="stable")[: options.most_slivers]:
        if any(_lies_on(rough[i], other.ellipse) for other in found):
            rejected[Rejection.DUPLICATE] += 1
            continue
        contour = _sliver(levels, rough[i], intervals, options)
        reason = contour if isinstance(contour, Rejection) else _why_not(contour, intervals, polarity)
        if reason is None and isinstance(contour, Contour):
            found.append(contour)
        elif reason is not None:
            rejected[reason] += 1
    return sorted(found, key=lambda contour: -contour.evidence), rejected


def _sliver(
    levels: Image, rough: Ellipse, intervals: AxisIntervals, options: DetectionOptions
) -> Contour | Rejection:
    """Return the contour of the sliver near `rough`, or why there is none.

    Without an interval of its length it must taper as an ellipse does, which other thin things do not.
    """
    contour = _from_both_sides(levels, rough, options)
    if contour is not None and intervals.major_px is not None:
        return contour
    if contour is not None:
        own = fit_thin_ellipse(levels, contour.ellipse, seen=contour.points, options=options.photometry)
        return contour if own is not None and _tapers(own, options) else Rejection.NOT_ELLIPTICAL
    fitted = _fit_whole(levels, rough, intervals, options)
    if intervals.major_px is None and isinstance(fitted, ThinEllipse) and not _tapers(fitted, options):
        return Rejection.NOT_ELLIPTICAL
    return _from_levels(fitted, options)


def _tapers(fitted: ThinEllipse, options: DetectionOptions) -> bool:
    """Return whether a sliver certainly gets thinner towards its tips as an ellipse does."""
    sigma = fitted.taper_sigma * max(fitted.structure, 1.0)
    worst = options.worst_taper if fitted.rim_used >= options.least_taper_rim else options.worst_partial_taper
    offset = abs(fitted.taper - options.taper)
    is_certain = fitted.structure <= options.most_structure and sigma <= worst
    return is_certain and offset <= options.taper_slack + options.taper_sigmas * sigma


def _from_both_sides(levels: Image, rough: Ellipse, options: DetectionOptions) -> Contour | None:
    """Return the contour of a sliver wide enough to have an edge on either side, hidden in part or not, or None."""
    rim = partial_rim(Reduced(levels), rough, options)
    if rim is None:
        return None
    if not options.least_wide_px <= rim.ellipse.semi_minor <= options.widest_ratio * rim.ellipse.semi_major:
        return None
    sides = rim.on_rim.reshape(2, -1).mean(axis=1)
    if sides.min() < options.least_side or sides.mean() < options.least_sides:
        return None
    # Next to a covered sample an edge may be that of the cover.
    sure = rim.on_rim & np.roll(rim.on_rim, 1) & np.roll(rim.on_rim, -1)
    if not np.any(sure):
        return None
    step = float(np.mean(rim.edges.step[0][rim.on_rim]))
    residual = rim_distance(rim.ellipse, rim.edges.points[0][sure])
    share = float(rim.on_rim.mean())
    return Contour(
        points=rim.edges.points[0][sure],
        ellipse=rim.ellipse,
        polarity=1 if step > 0.0 else -1,
        step=abs(step),
        rim_used=share,
        residual_px=float(np.sqrt(np.mean(residual**2))),
        evidence=share * _perimeter(rim.ellipse) * abs(step),
        score=float(Candidates.of_partial(Reduced(levels), [rim], options).quality[0]) * share,
    )


def _fit_whole(
    levels: Image, fragment: Ellipse, intervals: AxisIntervals, options: DetectionOptions
) -> ThinEllipse | Rejection:
    """Fit the sliver that `fragment` is part of, or return why not: a line must end at the tips of the fit."""
    start = fragment
    for _ in range(options.extensions):
        line = _whole_line(levels, start, options)
        if line is None:
            return Rejection.WEAK_EDGE
        longest = 2.0 * float(line.semi_major)
        if intervals.major_px is not None and not (
            intervals.major_px[0] / options.length_slack <= longest <= intervals.major_px[1] * options.length_slack
        ):
            return Rejection.MAJOR_AXIS
        fitted = fit_thin_ellipse(levels, line, grow=True, options=options.photometry)
        if fitted is None:
            return Rejection.NOT_ELLIPTICAL
        start = fitted.ellipse
        whole = _whole_line(levels, start, options)
        if whole is not None and whole.semi_major <= options.tip_slack * start.semi_major:
            return fitted
    return Rejection.NOT_ELLIPTICAL


def _whole_line(levels: Image, fragment: Ellipse, options: DetectionOptions) -> Ellipse | None:
    """Extend a fragment of a thin line, given as an ellipse, to where the line ends on either side.

    None when the levels on the line do not differ from those on both sides: then it is an edge between two areas.
    """
    cos, sin = np.cos(fragment.angle), np.sin(fragment.angle)
    beside = float(fragment.semi_minor) + options.beside_px
    farthest = int(min(options.line_search * float(fragment.semi_major), np.hypot(*levels.shape)))
    u = np.arange(-farthest, farthest + 1, dtype=np.float64)
    v = np.array([-beside - 1.0, -beside, -1.0, 0.0, 1.0, beside, beside + 1.0])
    along, across = np.meshgrid(u, v, indexing="ij")
    where = fragment.center + np.stack([cos * along - sin * across, sin * along + cos * across], axis=-1)
    level, inside = sample(levels, where)
    left, right = level[:, :2].mean(axis=1), level[:, 5:].mean(axis=1)
    ridge = level[:, 2:5].mean(axis=1) - (left + right) / 2.0
    core = np.abs(u) < 0.5 * fragment.semi_major
    typical = float(np.median(ridge[core]))
    if max(_scatter(left[core]), _scatter(right[core])) > options.most_clutter * abs(typical):
        return None
    if abs(typical) < options.least_ridge * abs(float(np.median((left - right)[core]))) + 1e-9:
        return None
    if fragment.semi_minor > options.fragment_px:
        return fragment
    smooth = np.convolve(ridge, np.full(options.line_smoothing, 1.0 / options.line_smoothing), mode="same")
    on_line = (smooth * np.sign(typical) > options.line_share * abs(typical)) & inside.all(axis=1)
    middle = len(u) // 2
    before, after = np.flatnonzero(~on_line[:middle]), np.flatnonzero(~on_line[middle:])
    first = u[before[-1]] if len(before) else u[0]
    last = u[middle + after[0]] if len(after) else u[-1]
    shift = (first + last) / 2.0
    return Ellipse(
        center=fragment.center + shift * np.array([cos, sin]),
        semi_major=np.maximum((last - first) / 2.0, fragment.semi_major),
        semi_minor=fragment.semi_minor,
        angle=fragment.angle,
    )


def _scatter(levels: FloatArray) -> float:
    """Return the robust standard deviation of `levels` along a line."""
    return 1.4826 * float(np.median(np.abs(levels - np.median(levels))))


def _why_not(contour: Contour, intervals: AxisIntervals, polarity: Polarity) -> Rejection | None:
    if not intervals.holds_major(2.0 * float(contour.ellipse.semi_major)):
        return Rejection.MAJOR_AXIS
    if not intervals.holds_minor(2.0 * float(contour.ellipse.semi_minor)):
        return Rejection.MINOR_AXIS
    return Rejection.POLARITY if WANTED_SIGN[polarity] * contour.polarity < 0.0 else None


def _from_levels(fitted: ThinEllipse | Rejection, options: DetectionOptions) -> Contour | Rejection:
    if isinstance(fitted, Rejection):
        return fitted
    if fitted.rms_levels > options.worst_sliver_rms * fitted.peak_levels:
        return Rejection.RAGGED
    return Contour(
        points=fitted.seen_points(options.sliver_samples),
        ellipse=fitted.ellipse,
        polarity=-1 if fitted.contrast > 0.0 else 1,
        step=fitted.peak_levels,
        rim_used=fitted.rim_used,
        residual_px=fitted.error_px,
        evidence=_perimeter(fitted.ellipse) * fitted.peak_levels,
        score=fitted.rim_used / (1.0 + (fitted.rms_levels / (options.worst_sliver_rms * fitted.peak_levels)) ** 2),
    )


def _perimeter(ellipse: Ellipse) -> float:
    return float(ellipse.perimeter)


def _lies_on(fragment: Ellipse, sliver: Ellipse) -> bool:
    """Return whether `fragment` is part of a sliver that was found."""
    return bool(signed_distance(sliver, fragment.center[None])[0] < 2.0)
