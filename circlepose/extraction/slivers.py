"""Contours of circles seen nearly edge-on: a sliver has no edge to place on either side, only levels."""

from __future__ import annotations

from collections import Counter

import numpy as np

from circlepose._typing import Image
from circlepose.conic import Ellipse, signed_distance
from circlepose.extraction.contour import Contour, Rejection
from circlepose.extraction.rim import sample
from circlepose.fitting.thin_ellipse import ThinEllipse, fit_thin_ellipse
from circlepose.target import AxisIntervals, Polarity

_MOST = 12
"""Slivers tried in one image, the longest first."""
_WORST_RMS = 0.2
"""Largest rms residual, as a share of the sliver's highest level, with which it is believed."""
_PLACES = 64
_FRAGMENT_PX = 3.0
"""Semi-minor axis up to which noise breaks the edge of a line into pieces."""
_STRETCH = 6.0
_BESIDE_PX = 5.0
_SMOOTH = 15
_LINE_SHARE = 0.4
_EXTENSIONS = 4
_TIP_SLACK = 1.06


def find_slivers(
    levels: Image, rough: Ellipse, intervals: AxisIntervals, polarity: Polarity, rejected: Counter[Rejection]
) -> list[Contour]:
    """Fit the thin ellipses of the batch `rough` to `levels` (h, w); return those that hold, most evidence first."""
    found: list[Contour] = []
    for i in np.argsort(-rough.semi_major, kind="stable")[:_MOST]:
        if any(_lies_on(rough[i], other.ellipse) for other in found):
            rejected[Rejection.DUPLICATE] += 1
            continue
        fitted = _fit_whole(levels, rough[i])
        reason = _why_not(fitted, intervals, polarity)
        if reason is None and fitted is not None:
            found.append(_contour(fitted))
        if reason is not None:
            rejected[reason] += 1
    return sorted(found, key=lambda contour: -contour.evidence)


def _fit_whole(levels: Image, fragment: Ellipse) -> ThinEllipse | None:
    """Fit the sliver that `fragment` is part of; None while the line still goes on beyond its tips."""
    start = fragment
    for _ in range(_EXTENSIONS):
        start = _whole_line(levels, start)
        fitted = fit_thin_ellipse(levels, start)
        if fitted is None:
            return None
        start = fitted.ellipse
        if _whole_line(levels, start).semi_major <= _TIP_SLACK * start.semi_major:
            return fitted
    return None


def _whole_line(levels: Image, fragment: Ellipse) -> Ellipse:
    """Stretch an ellipse that stands for a fragment of a thin line to where the line ends on either side."""
    if fragment.semi_minor > _FRAGMENT_PX:
        return fragment
    cos, sin = np.cos(fragment.angle), np.sin(fragment.angle)
    u = np.arange(-_STRETCH * fragment.semi_major, _STRETCH * fragment.semi_major)
    v = np.array([-_BESIDE_PX - 1.0, -_BESIDE_PX, -1.0, 0.0, 1.0, _BESIDE_PX, _BESIDE_PX + 1.0])
    along, across = np.meshgrid(u, v, indexing="ij")
    where = fragment.center + np.stack([cos * along - sin * across, sin * along + cos * across], axis=-1)
    level, inside = sample(levels, where)
    ridge = level[:, 2:5].mean(axis=1) - level[:, [0, 1, 5, 6]].mean(axis=1)
    smooth = np.convolve(ridge, np.full(_SMOOTH, 1.0 / _SMOOTH), mode="same")
    typical = float(np.median(smooth[np.abs(u) < 0.5 * fragment.semi_major]))
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


def _why_not(fitted: ThinEllipse | None, intervals: AxisIntervals, polarity: Polarity) -> Rejection | None:
    if fitted is None:
        return Rejection.NOT_ELLIPTICAL
    if not intervals.holds_major(2.0 * float(fitted.ellipse.semi_major)):
        return Rejection.MAJOR_AXIS
    if not intervals.holds_minor(2.0 * float(fitted.ellipse.semi_minor)):
        return Rejection.MINOR_AXIS
    if fitted.rms_levels > _WORST_RMS * fitted.peak_levels:
        return Rejection.RAGGED
    wanted = {"any": 0.0, "dark": -1.0, "bright": 1.0}[polarity]
    return Rejection.POLARITY if wanted * fitted.contrast < 0.0 else None


def _contour(fitted: ThinEllipse) -> Contour:
    perimeter = np.pi * float(fitted.ellipse.semi_major + fitted.ellipse.semi_minor)
    return Contour(
        points=fitted.ellipse.points(_PLACES),
        ellipse=fitted.ellipse,
        polarity=-1 if fitted.contrast > 0.0 else 1,
        step=fitted.peak_levels,
        rim_used=1.0,
        residual_px=fitted.error_px,
        evidence=perimeter * fitted.peak_levels,
    )


def _lies_on(fragment: Ellipse, sliver: Ellipse) -> bool:
    """Tell whether `fragment` is part of a sliver that was found."""
    return bool(signed_distance(sliver, fragment.center[None])[0] < 2.0)
