"""What extraction finds in an image, what it rejects and why, and axis intervals that hold what it found."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, replace

import numpy as np

from circlepose import _arguments
from circlepose._typing import Image
from circlepose.detection.contour import Contour, DetectionResult, Rejection
from circlepose.detection.detect import find_contours
from circlepose.detection.options import DEFAULT, DetectionOptions
from circlepose.imaging.color_mixes import color_mixes
from circlepose.imaging.float_levels import without_gaps
from circlepose.imaging.gray import gray_of, to_channels
from circlepose.imaging.noise import noise_of
from circlepose.imaging.usable_pixels import usable_pixels
from circlepose.measurement.color_views import of_other_polarity, ranked, seen_well
from circlepose.targets import POLARITIES, Polarity
from circlepose.targets.target import AxisIntervals

_FAMILY = 2.5
"""Circles of one kind differ by no more than this factor in size, from the typical one."""
_ROOM = 1.25
"""Room that suggested intervals leave on either side."""


@dataclass(frozen=True, slots=True, eq=False)
class Inspection:
    """The contours of one image."""

    image_size: tuple[int, int]
    """width, height in px"""
    extraction: DetectionResult
    suggested: AxisIntervals | None
    """intervals that hold the largest family of the contours kept; None where there are none"""
    remark: str = ""
    """what is special of the pixels of the image, such as a raw mosaic"""


def inspect(
    image: Image,
    intervals: AxisIntervals | None = None,
    polarity: Polarity = "any",
    *,
    rings: bool = False,
    min_score: float | None = None,
    max_residual_px: float | None = None,
) -> Inspection:
    """Look for all circles in `image`, as `estimate` takes it, without a calibration or a radius.

    Parameters
    ----------
    image
        As of `circlepose.estimate`.
    intervals
        Axes, in px, of the ellipses to look for; None for all.
    polarity
        `dark`, `bright` or `any`.
    rings
        Whether to keep those inside others of the same center, too.
    min_score
        As of `circlepose.estimate`.
    max_residual_px
        As of `circlepose.estimate`, but from an ellipse in the raw image: the lens is not known.

    Returns
    -------
    The contours found, those rejected with the reason, and axis intervals that hold the typical ones.

    Raises
    ------
    ArgumentError
        On misuse, naming the parameter.
    """
    if intervals is not None:
        _arguments.instance_of(AxisIntervals, "intervals", intervals, "such as AxisIntervals(major_px=(20.0, 200.0))")
    _arguments.one_of(POLARITIES, "polarity", polarity)
    rings = _arguments.truth("rings", rings)
    channels = to_channels(image)
    options = DEFAULT.with_least_score(_arguments.score("min_score", min_score))
    pixels = usable_pixels(gray_of(channels))
    found = _found_in_views(channels, pixels.whole, intervals or AxisIntervals(), polarity, options, rings=rings)
    most_px = _arguments.bound_px("max_residual_px", max_residual_px)
    if most_px is not None:
        rough = [contour for contour in found.contours if contour.residual_px > most_px]
        found = found.without(rough, Rejection.RESIDUAL)
    return Inspection(
        (int(channels.shape[1]), int(channels.shape[0])), found, suggested_intervals(found.contours), pixels.remark
    )


def _found_in_views(
    channels: Image,
    gray: Image,
    intervals: AxisIntervals,
    polarity: Polarity,
    options: DetectionOptions,
    *,
    rings: bool,
) -> DetectionResult:
    """Return what is found in gray, and the contours of the color mixes that gray does not show as well."""
    found = find_contours(gray, intervals, polarity, keep_concentric=rings, options=options)
    mixes = color_mixes(channels)
    if not mixes:
        return found
    views, noise, rejected = [list(found.contours)], [noise_of(gray)], found.rejected
    for mix in mixes:
        levels = without_gaps(mix.levels(channels))
        others = find_contours(levels, intervals, "any", keep_concentric=rings, options=options)
        is_other = of_other_polarity([contour.ellipse for contour in others.contours], gray, polarity)
        kept = [contour for contour, other in zip(others.contours, is_other, strict=True) if not other]
        partial = len(kept) - sum(seen_well(contour) for contour in kept)
        kept = [contour for contour in kept if seen_well(contour)]
        views.append([replace(contour, color_mix=mix.by_name) for contour in kept])
        noise.append(noise_of(levels))
        rejected = (
            rejected
            + others.rejected
            + Counter({Rejection.POLARITY: sum(is_other), Rejection.TOO_LITTLE_RIM: partial})
        )
    chosen, again = ranked(views, noise, are_rings=rings)
    rejected = rejected + Counter({Rejection.DUPLICATE: again})
    return replace(found, contours=tuple(views[view][i] for view, i in chosen), rejected=rejected)


def suggested_intervals(contours: tuple[Contour, ...]) -> AxisIntervals | None:
    """Return intervals (whole px) that hold the contours about as large as the typical one, with room to spare."""
    if not contours:
        return None
    major = np.array([2.0 * float(c.ellipse.semi_major) for c in contours])
    minor = np.array([2.0 * float(c.ellipse.semi_minor) for c in contours])
    score = np.array([c.score for c in contours])
    # The size that most of the score has around it.
    alike = np.abs(np.log(major[:, None] / major[None, :])) <= math.log(_FAMILY)
    family = alike[int(np.argmax(alike @ score))]
    return AxisIntervals(_with_room(major[family]), _with_room(minor[family]))


def _with_room(lengths: np.ndarray) -> tuple[float, float]:
    low, high = float(lengths.min()) / _ROOM, float(lengths.max()) * _ROOM
    return float(math.floor(low)), float(math.ceil(high))
