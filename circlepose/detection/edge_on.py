"""Contours of circles seen nearly edge-on: a sliver has no edge to place on either side, only levels."""

from __future__ import annotations

from collections import Counter

import numpy as np

from circlepose._typing import FloatArray, Image
from circlepose.detection.contour import WANTED_SIGN, Contour, Rejection
from circlepose.detection.occluded import partial_rim
from circlepose.detection.verification import Candidates
from circlepose.geometry.conic import Ellipse, rim_distance, signed_distance
from circlepose.imaging.subpixel_edges import sample
from circlepose.photometry.thin.fit import ThinEllipse, fit_thin_ellipse
from circlepose.targets import Polarity
from circlepose.targets.target import AxisIntervals

_MOST = 12
"""Slivers tried in one image, the longest first."""
_WORST_RMS = 0.2
"""Largest rms residual, as a share of the sliver's highest level, with which it is believed."""
_PLACES = 64
_EDGE_PLACES = 72
_LEAST_WIDE_PX = 3.0
"""Semi-minor axis from which the edges of both sides can be placed."""
_WIDEST = 0.3
"""Axis ratio of what a fragment that looked thin may turn out to be."""
_LEAST_SIDE = 0.25
_LEAST_SIDES = 0.42
"""Share of each side, and of both, that must lie on the sliver's ellipse."""
_FRAGMENT_PX = 3.0
"""Semi-minor axis up to which noise breaks the edge of a line into pieces."""
_STRETCH = 6.0
_BESIDE_PX = 5.0
_SMOOTH = 15
_LINE_SHARE = 0.4
_LEAST_RIDGE = 0.5
"""Least height of a line over its surroundings, as a share of the difference between its two sides."""
_MOST_CLUTTER = 0.5
"""Scatter of the levels beside a line, as a share of its height, beyond which it is one of many things."""
_LENGTH_SLACK = 1.3
_EXTENSIONS = 4
_TIP_SLACK = 1.06
_TAPER = 0.5
"""`ThinEllipse.taper` of an ellipse."""
_TAPER_SLACK, _TAPER_SIGMAS, _WORST_TAPER = 0.08, 2.0, 0.07
"""A bar, or what two arcs bound, is at least 0.25 from it; sigma beyond which that would not be noticed."""
_LEAST_WHOLE, _WORST_TAPER_OF_PART = 0.85, 0.025
"""Share of the rim in use, and what is asked of less: leaving out stretches makes an ellipse of other things too."""
_MOST_STRUCTURE = 1.6


def find_slivers(
    levels: Image, rough: Ellipse, intervals: AxisIntervals, polarity: Polarity, rejected: Counter[Rejection]
) -> list[Contour]:
    """Fit the thin ellipses of the batch `rough` to `levels` (h, w); return those that hold, most evidence first."""
    found: list[Contour] = []
    for i in np.argsort(-rough.semi_major, kind="stable")[:_MOST]:
        if any(_lies_on(rough[i], other.ellipse) for other in found):
            rejected[Rejection.DUPLICATE] += 1
            continue
        contour = _sliver(levels, rough[i], intervals)
        reason = contour if isinstance(contour, Rejection) else _why_not(contour, intervals, polarity)
        if reason is None and isinstance(contour, Contour):
            found.append(contour)
        elif reason is not None:
            rejected[reason] += 1
    return sorted(found, key=lambda contour: -contour.evidence)


def _sliver(levels: Image, rough: Ellipse, intervals: AxisIntervals) -> Contour | Rejection:
    """Return the contour of the sliver that `rough` stands for, or why there is none.

    Where no length is expected its taper has to show that it is no other thin thing.
    """
    contour = _from_both_sides(levels, rough)
    if contour is not None and intervals.major_px is not None:
        return contour
    if contour is not None:
        own = fit_thin_ellipse(levels, contour.ellipse, seen=contour.points)
        return contour if own is not None and _tapers(own) else Rejection.NOT_ELLIPTICAL
    fitted = _fit_whole(levels, rough, intervals)
    if intervals.major_px is None and isinstance(fitted, ThinEllipse) and not _tapers(fitted):
        return Rejection.NOT_ELLIPTICAL
    return _from_levels(fitted)


def _tapers(fitted: ThinEllipse) -> bool:
    """Tell whether a sliver surely gets thinner towards its tips as an ellipse does."""
    sigma = fitted.taper_sigma * max(fitted.structure, 1.0)
    worst = _WORST_TAPER if fitted.rim_used >= _LEAST_WHOLE else _WORST_TAPER_OF_PART
    off = abs(fitted.taper - _TAPER)
    return fitted.structure <= _MOST_STRUCTURE and sigma <= worst and off <= _TAPER_SLACK + _TAPER_SIGMAS * sigma


def _from_both_sides(levels: Image, rough: Ellipse) -> Contour | None:
    """Return the contour of a sliver wide enough to have an edge on either side, hidden in part or not, or None."""
    rim = partial_rim(levels, rough, _EDGE_PLACES)
    if rim is None or not _LEAST_WIDE_PX <= rim.ellipse.semi_minor <= _WIDEST * rim.ellipse.semi_major:
        return None
    sides = rim.on_rim.reshape(2, -1).mean(axis=1)
    if sides.min() < _LEAST_SIDE or sides.mean() < _LEAST_SIDES:
        return None
    # Next to a place that is covered an edge may be that of the cover.
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
        score=float(Candidates.of_partial([rim]).quality[0]) * share,
    )


def _fit_whole(levels: Image, fragment: Ellipse, intervals: AxisIntervals) -> ThinEllipse | Rejection:
    """Fit the sliver that `fragment` is part of, or say why not; a line that goes on beyond its tips is none."""
    start = fragment
    for _ in range(_EXTENSIONS):
        line = _whole_line(levels, start)
        if line is None:
            return Rejection.WEAK_EDGE
        longest = 2.0 * float(line.semi_major)
        if intervals.major_px is not None and not (
            intervals.major_px[0] / _LENGTH_SLACK <= longest <= intervals.major_px[1] * _LENGTH_SLACK
        ):
            return Rejection.MAJOR_AXIS
        fitted = fit_thin_ellipse(levels, line, grow=True)
        if fitted is None:
            return Rejection.NOT_ELLIPTICAL
        start = fitted.ellipse
        whole = _whole_line(levels, start)
        if whole is not None and whole.semi_major <= _TIP_SLACK * start.semi_major:
            return fitted
    return Rejection.NOT_ELLIPTICAL


def _whole_line(levels: Image, fragment: Ellipse) -> Ellipse | None:
    """Stretch an ellipse that stands for a fragment of a thin line to where the line ends on either side.

    None when the levels on the line do not stand out from those on both sides: an edge between two areas.
    """
    cos, sin = np.cos(fragment.angle), np.sin(fragment.angle)
    beside = float(fragment.semi_minor) + _BESIDE_PX
    reach = int(min(_STRETCH * float(fragment.semi_major), np.hypot(*levels.shape)))
    u = np.arange(-reach, reach + 1, dtype=np.float64)
    v = np.array([-beside - 1.0, -beside, -1.0, 0.0, 1.0, beside, beside + 1.0])
    along, across = np.meshgrid(u, v, indexing="ij")
    where = fragment.center + np.stack([cos * along - sin * across, sin * along + cos * across], axis=-1)
    level, inside = sample(levels, where)
    left, right = level[:, :2].mean(axis=1), level[:, 5:].mean(axis=1)
    ridge = level[:, 2:5].mean(axis=1) - (left + right) / 2.0
    core = np.abs(u) < 0.5 * fragment.semi_major
    typical = float(np.median(ridge[core]))
    if max(_scatter(left[core]), _scatter(right[core])) > _MOST_CLUTTER * abs(typical):
        return None
    if abs(typical) < _LEAST_RIDGE * abs(float(np.median((left - right)[core]))) + 1e-9:
        return None
    if fragment.semi_minor > _FRAGMENT_PX:
        return fragment
    smooth = np.convolve(ridge, np.full(_SMOOTH, 1.0 / _SMOOTH), mode="same")
    on_line = (smooth * np.sign(typical) > _LINE_SHARE * abs(typical)) & inside.all(axis=1)
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
    """Return how much `levels` vary along a line, robustly."""
    return 1.4826 * float(np.median(np.abs(levels - np.median(levels))))


def _why_not(contour: Contour, intervals: AxisIntervals, polarity: Polarity) -> Rejection | None:
    if not intervals.holds_major(2.0 * float(contour.ellipse.semi_major)):
        return Rejection.MAJOR_AXIS
    if not intervals.holds_minor(2.0 * float(contour.ellipse.semi_minor)):
        return Rejection.MINOR_AXIS
    return Rejection.POLARITY if WANTED_SIGN[polarity] * contour.polarity < 0.0 else None


def _from_levels(fitted: ThinEllipse | Rejection) -> Contour | Rejection:
    if isinstance(fitted, Rejection):
        return fitted
    if fitted.rms_levels > _WORST_RMS * fitted.peak_levels:
        return Rejection.RAGGED
    return Contour(
        points=fitted.seen_points(_PLACES),
        ellipse=fitted.ellipse,
        polarity=-1 if fitted.contrast > 0.0 else 1,
        step=fitted.peak_levels,
        rim_used=fitted.rim_used,
        residual_px=fitted.error_px,
        evidence=_perimeter(fitted.ellipse) * fitted.peak_levels,
        score=fitted.rim_used / (1.0 + (fitted.rms_levels / (_WORST_RMS * fitted.peak_levels)) ** 2),
    )


def _perimeter(ellipse: Ellipse) -> float:
    return float(np.pi * (ellipse.semi_major + ellipse.semi_minor))


def _lies_on(fragment: Ellipse, sliver: Ellipse) -> bool:
    """Tell whether `fragment` is part of a sliver that was found."""
    return bool(signed_distance(sliver, fragment.center[None])[0] < 2.0)
