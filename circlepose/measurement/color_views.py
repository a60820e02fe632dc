"""Lone circles in several views of one image: its gray levels and the color mixes that show more.

Each view is searched and measured by itself, with neighbors and blur of its own. What several views show is reported
once, from the view with the most contrast over noise: the evidence of a contour over the noise of its view ranks all
contours of the image. Gray has a preference, as lenses and compression displace colors against each other.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from circlepose._typing import Image
from circlepose.camera.camera import Camera
from circlepose.detection.contour import WANTED_SIGN, Contour, Rejection
from circlepose.detection.duplicates import inside_others, repeats
from circlepose.geometry.ellipse import Ellipse, rim_distance
from circlepose.imaging.color_mixes import ColorMix
from circlepose.imaging.float_levels import without_gaps
from circlepose.imaging.gray import gray_of
from circlepose.imaging.noise import noise_of
from circlepose.imaging.subpixel_edges import edges_along
from circlepose.imaging.usable_pixels import UsablePixels, usable_pixels, without_odd_near
from circlepose.measurement.acceptance import are_of, why_no_disc
from circlepose.measurement.blurred_rims import fit_all_levels
from circlepose.measurement.intensity_fit import LevelFit, LevelFits
from circlepose.measurement.options import DEFAULT, MeasurementOptions
from circlepose.measurement.rim import FittedRim, Rim
from circlepose.measurement.selection import measure_lone_circles
from circlepose.results import NestedRim
from circlepose.targets import Polarity
from circlepose.targets.target import AxisIntervals, Target

_SIDE_PX = 2.5
"""px; how far from a rim its two sides are compared in gray; empirical"""
_SIDE_SAMPLES = 48
"""Samples along the rim at which they are compared."""
_SIDE_SIGMAS = 2.0
"""Mean step over the noise of a pixel from which a side is clearly darker in gray; statistical."""


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredCircles:
    """The lone circles of one image, as many as the target asks for, each in the view that shows it best."""

    contours: tuple[Contour, ...]
    """those that detection kept in any view"""
    starts: tuple[Rim, ...]
    """the rims before their fit to the levels"""
    rims: tuple[Rim, ...]
    fits: tuple[LevelFit | None, ...]
    mixes: tuple[ColorMix | None, ...]
    """in which each rim was measured; None for gray"""
    nested: tuple[tuple[NestedRim, ...], ...]
    """of each rim, the concentric ones of which it was chosen; empty where it is alone"""
    rejected: Counter[Rejection]
    gray: Image
    """(h, w) gray levels that were measured; NaN where a pixel is left out"""
    remark: str
    """what is special of the pixels, in words"""


def pixels_in(channels: Image, mix: ColorMix | None) -> UsablePixels:
    """Return the usable pixels of a view of `channels`: of a mix, or gray."""
    levels = levels_in(channels, mix)
    return usable_pixels(levels) if mix is None else UsablePixels(levels, without_gaps(levels))


def levels_in(channels: Image, mix: ColorMix | None) -> Image:
    """Return the levels (h, w) of a view of `channels`: of a mix, or gray."""
    return gray_of(channels) if mix is None else mix.levels(channels)


def measure_circles(
    channels: Image,
    views: Sequence[ColorMix | None],
    camera: Camera,
    target: Target,
    intervals: AxisIntervals,
    *,
    extraction: str,
    refine: bool,
    are_starts: bool,
    keep_fits: bool,
    others: Ellipse | None = None,
    options: MeasurementOptions = DEFAULT,
) -> MeasuredCircles:
    """Measure the lone circles of an image in each of its views, and merge them.

    Parameters
    ----------
    channels
        What `to_channels` returns.
    views
        None for gray, which is the first, and the color mixes.
    camera, target, intervals, extraction, refine, are_starts, options
        As of `measure_lone_circles`.
    keep_fits
        As of `fit_levels`.
    others
        (k) circles in the image that are not the target's.
    """
    views_of: list[_View] = []

    def measured(view: ColorMix | None, count: int | None) -> _View:
        pixels = pixels_in(channels, view)
        wanted = (count, target.polarity if view is None else "any")
        found = measure_lone_circles(
            pixels.whole,
            camera,
            target if wanted == (target.count, target.polarity) else replace(target, count=count, polarity=wanted[1]),
            intervals,
            extraction=extraction,
            refine=refine,
            are_starts=are_starts,
            options=options,
        )
        rims = found.rims if view is None else tuple(_named(rim, view) for rim in found.rims)
        pixels, fits = fit_rims_in(pixels, camera, rims, refine=refine, keep_fits=keep_fits, options=options)
        why_not = [why_no_disc(rim, options) for rim in fits.rims]
        if view is not None:
            why_not = _why_not_in_mix(why_not, fits.rims, views_of[0].pixels.whole, target.polarity, options)
        if others is not None:
            is_other = are_of(Ellipse.batch([rim.ellipse for rim in fits.rims]), others, options)
            why_not = [
                Rejection.WORLD_BOARD if other else reason
                for other, reason in zip(is_other.tolist(), why_not, strict=True)
            ]
        # Two contours of one rough or blurred rim may become the same rim.
        used = [i for i, reason in enumerate(why_not) if reason is None]
        ellipses = Ellipse.batch([fits.rims[i].ellipse for i in used])
        for again in repeats(ellipses, np.arange(len(used)), options.detection).tolist():
            why_not[used[again]] = Rejection.DUPLICATE
        used = [i for i, reason in enumerate(why_not) if reason is None]
        rejected = found.rejected + Counter(reason for reason in why_not if reason is not None)
        if target.count is not None:
            rejected[Rejection.BEYOND_COUNT] += len(used[target.count :])
        return _View(view, found.contours, pixels, rims, fits, found.nested, used[: target.count], rejected)

    # The others are found, too: fewer than both together is too few.
    enough = None if target.count is None else target.count + (0 if others is None else len(others))
    for view in views:
        own = measured(view, enough)
        if target.count is not None and len(own.used) < min(target.count, len(own.rims)):
            # What is no disc after all must not stand for one that is.
            own = measured(view, None)
        views_of.append(own)
    noise = [noise_of(each.pixels.whole) if len(views) > 1 else 1.0 for each in views_of]
    contours = [contour for each in views_of for contour in each.contours]
    rejected = sum((each.rejected for each in views_of), Counter[Rejection]())
    chosen = [(0, i) for i in views_of[0].used]
    if len(views) > 1:
        ranking, again = ranked(
            [[each.rims[i].contour for i in each.used] for each in views_of], noise, options=options
        )
        chosen = [(number, views_of[number].used[k]) for number, k in ranking]
        rejected[Rejection.DUPLICATE] += again
        rejected[Rejection.BEYOND_COUNT] += len(chosen[target.count :]) if target.count else 0
        chosen = chosen[: target.count]
    picked = [(views_of[number], i) for number, i in chosen]
    return MeasuredCircles(
        contours=tuple(contours),
        starts=tuple(view.rims[i] for view, i in picked),
        rims=tuple(view.fits.rims[i] for view, i in picked),
        fits=tuple(view.fits.fits[i] for view, i in picked),
        mixes=tuple(view.mix for view, _ in picked),
        nested=tuple(view.nested[i] for view, i in picked),
        rejected=rejected,
        gray=views_of[0].pixels.own,
        remark=views_of[0].pixels.remark,
    )


@dataclass(frozen=True, slots=True, eq=False)
class _View:
    """What was measured in one view."""

    mix: ColorMix | None
    contours: tuple[Contour, ...]
    """those that detection kept"""
    pixels: UsablePixels
    rims: tuple[Rim, ...]
    """before their fit to the levels"""
    fits: LevelFits
    nested: tuple[tuple[NestedRim, ...], ...]
    used: list[int]
    """the rims that may be circles, as many as asked for"""
    rejected: Counter[Rejection]


def _why_not_in_mix(
    why_not: Sequence[Rejection | None],
    rims: Sequence[Rim],
    gray: Image,
    polarity: Polarity,
    options: MeasurementOptions,
) -> list[Rejection | None]:
    """Return why each rim of a mix is not used: as it was, for its polarity in `gray`, or as it is not seen well."""
    other = of_other_polarity([rim.ellipse for rim in rims], gray, polarity)
    return [
        reason
        or (Rejection.POLARITY if is_other else None)
        or (None if isinstance(rim, FittedRim) or seen_well(rim, options) else Rejection.TOO_LITTLE_RIM)
        for reason, rim, is_other in zip(why_not, rims, other, strict=True)
    ]


def fit_rims_in(
    pixels: UsablePixels,
    camera: Camera,
    rims: Sequence[Rim],
    *,
    refine: bool,
    keep_fits: bool,
    options: MeasurementOptions = DEFAULT,
) -> tuple[UsablePixels, LevelFits]:
    """Fit the rims to the levels of their view where they are to be refined. Returns the pixels used, too."""
    if not refine:
        return pixels, LevelFits(list(rims), [None] * len(rims))
    pixels = without_odd_near(pixels, [rim.ellipse for rim in rims])
    fits = fit_all_levels(
        pixels.own,
        camera,
        rims,
        whole=pixels.whole,
        full_scale=pixels.full_scale,
        keep_fits=keep_fits,
        options=options,
    )
    return pixels, fits


def ranked(
    found: Sequence[Sequence[Contour | None]],
    noise: Sequence[float],
    *,
    are_rings: bool = False,
    options: MeasurementOptions = DEFAULT,
) -> tuple[list[tuple[int, int]], int]:
    """Return which contours of several views are circles of their own, the most contrast over noise first.

    Parameters
    ----------
    found
        The contours of each view, those of gray first.
    noise
        Of each view, levels.
    are_rings
        Whether those inside others of the same center are kept, too.
    options
        The numbers of the measurement.

    Returns
    -------
    View and number within the view of each, and how many others were left out.
    """
    entries = [(view, i, c) for view, contours in enumerate(found) for i, c in enumerate(contours) if c is not None]
    preference = [options.gray_preference, *[1.0] * (len(found) - 1)]
    entries.sort(key=lambda entry: -entry[2].evidence * preference[entry[0]] / noise[entry[0]])
    kept: list[tuple[int, int, Contour]] = []
    for view, i, contour in entries:
        others = [other.ellipse for its_view, _, other in kept if its_view != view]
        if not others or not _is_one_of(contour, Ellipse.batch(others), options, are_rings=are_rings):
            kept.append((view, i, contour))
    inside: set[int] = set()
    if kept and not are_rings:
        ellipses = Ellipse.batch([contour.ellipse for _, _, contour in kept])
        inside = set(inside_others(ellipses, np.arange(len(kept)), options.detection).tolist())
    chosen = [(view, i) for k, (view, i, _) in enumerate(kept) if k not in inside]
    return chosen, len(entries) - len(chosen)


def _is_one_of(contour: Contour, others: Ellipse, options: MeasurementOptions, *, are_rings: bool) -> bool:
    """Whether `contour` shows the same thing as one of `others` (m), in another view.

    Half of it or more runs along the other rim; or, of about the same size, each has the other's center well inside:
    an opaque disc and its shadow, or its bright side.
    """
    near = np.maximum(options.detection.same_px, options.detection.same_share * others.semi_major)[:, None]
    along = np.mean(np.abs(rim_distance(others, contour.points)) < near, axis=1) >= options.same_rim_share
    apart = np.linalg.norm(others.center - contour.ellipse.center, axis=1)
    minor, other = float(contour.ellipse.semi_minor), others.semi_minor
    overlap = apart < options.same_overlap_share * np.minimum(minor, other)
    alike = np.minimum(minor, other) > options.same_size_ratio * np.maximum(minor, other)
    return bool((along | (overlap & alike & (not are_rings))).any())


def seen_well(rim: Rim | Contour, options: MeasurementOptions = DEFAULT) -> bool:
    """Whether a rim is seen so well that it counts in a mix without a fit to the levels.

    Each mix is one more image in which arcs of other things may agree by chance.
    """
    return rim.score is not None and rim.score >= options.least_mix_score


def _named(rim: Rim, view: ColorMix) -> Rim:
    """Return a rim whose contour names the mix in which it was found."""
    return rim if rim.contour is None else replace(rim, contour=replace(rim.contour, color_mix=view.by_name))


def of_other_polarity(ellipses: Sequence[Ellipse], gray: Image, polarity: Polarity) -> list[bool]:
    """Return which rims are clearly darker or brighter inside, in gray, than asked for.

    A circle that only a color mix shows is neither.
    """
    if not ellipses or polarity == "any":
        return [False] * len(ellipses)
    edges = edges_along(gray, Ellipse.batch(ellipses), _SIDE_PX, _SIDE_SAMPLES)
    seen = edges.valid.sum(axis=1)
    step = np.where(edges.valid, edges.step, 0.0).sum(axis=1) / np.maximum(seen, 1)
    return (WANTED_SIGN[polarity] * step < -_SIDE_SIGMAS * noise_of(gray)).tolist()
