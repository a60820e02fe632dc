"""An image -> the measured rims of its circles, as many as the target asks for."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

from circlepose._typing import Image
from circlepose.camera.camera import Camera
from circlepose.detection.contour import Contour, Rejection
from circlepose.detection.detect import find_contours
from circlepose.geometry.ellipse import Ellipse
from circlepose.measurement.acceptance import are_of
from circlepose.measurement.edge_fit import fit_rims
from circlepose.measurement.nested_rims import MeasuredRim, chosen, listed
from circlepose.measurement.options import DEFAULT, MeasurementOptions
from circlepose.measurement.rim import Rim
from circlepose.results import Failure, NestedRim
from circlepose.solvers.registry import solve
from circlepose.targets.target import AxisIntervals, Target

_ALL = 1_000_000


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredContours:
    """The contours of one image and the rims that were measured from them."""

    contours: tuple[Contour, ...]
    """those that detection kept, most evidence first"""
    rims: tuple[Rim, ...]
    """of the contours in use, in the same order"""
    rejected: Counter[Rejection]
    """how many contours were not used, by reason"""
    nested: tuple[tuple[NestedRim, ...], ...] = ()
    """of each rim of a lone circle, the concentric ones of which it was chosen; empty where it is alone"""

    def without(self, circles: Ellipse, options: MeasurementOptions) -> MeasuredContours:
        """Return what is left of the rims without those of `circles` (k) in the image."""
        is_other = are_of(Ellipse.batch([rim.ellipse for rim in self.rims]), circles, options)
        kept = tuple(rim for rim, other in zip(self.rims, is_other.tolist(), strict=True) if not other)
        unused = Counter({Rejection.WORLD_BOARD: len(self.rims) - len(kept)})
        return replace(self, rims=kept, rejected=self.rejected + unused)


def measure_lone_circles(
    levels: Image,
    camera: Camera,
    target: Target,
    intervals: AxisIntervals,
    *,
    extraction: str,
    refine: bool,
    are_starts: bool,
    options: MeasurementOptions = DEFAULT,
) -> MeasuredContours:
    """Measure the rims of as many lone circles as the target asks for, the most evident first.

    The search stops at as many contours as are asked for. Where some of these are not the target's, it is repeated
    without a limit.

    Parameters
    ----------
    levels
        (h, w) gray image without gaps.
    camera
        The calibration for this image size.
    target
        A target of kind `circle`, with its polarity, count and depth range.
    intervals
        The lengths that the axes of its image can have, px.
    extraction
        A name of `circlepose.detection.EXTRACTIONS`.
    refine, are_starts
        See `fit_rims`.
    options
        The numbers of the measurement.
    """

    def measured(enough: int | None) -> tuple[MeasuredContours, bool]:
        found = find_contours(
            levels, intervals, target.polarity, enough=enough, extraction=extraction, options=options.detection
        )
        fit = partial(fit_rims, levels, camera, refine=refine, are_starts=are_starts, options=options)
        rims, nested, unused = _selected(found.contours, fit, camera, target, options)
        beyond_count = len(found.contours) - len(rims) - unused.total()
        rejected = found.rejected + unused + Counter({Rejection.BEYOND_COUNT: beyond_count})
        return MeasuredContours(found.contours, rims, rejected, nested), found.is_complete

    first, is_complete = measured(target.count)
    if is_complete or target.count is None or len(first.rims) == target.count:
        return first
    return measured(_ALL)[0]


def measure_rings(
    levels: Image,
    camera: Camera,
    intervals: AxisIntervals,
    *,
    extraction: str,
    refine: bool,
    options: MeasurementOptions = DEFAULT,
) -> MeasuredContours:
    """Measure all rims of an image, of either polarity, those inside others of the same center too."""
    found = find_contours(
        levels, intervals, "any", keep_concentric=True, extraction=extraction, options=options.detection
    )
    fits = list(fit_rims(levels, camera, found.contours, refine=refine, options=options))
    measured = [fit for fit in fits if not isinstance(fit, Failure)]
    rims = tuple(rim for rim in measured if rim.cone.rms_px <= options.most_residual_px)
    unused = {Rejection.NO_POSE: len(fits) - len(measured), Rejection.RESIDUAL: len(measured) - len(rims)}
    return MeasuredContours(found.contours, rims, found.rejected + Counter(unused))


def _selected(
    contours: Sequence[Contour],
    fit: Callable[[Sequence[Contour]], Iterator[Rim | Failure]],
    camera: Camera,
    target: Target,
    options: MeasurementOptions,
) -> tuple[tuple[Rim, ...], tuple[tuple[NestedRim, ...], ...], Counter[Rejection]]:
    """Return the first rims that can be the target's, as many as it asks for, and why those before are not.

    With each its concentric ones.
    """
    rims: list[Rim] = []
    nested: list[tuple[NestedRim, ...]] = []
    unused: list[Rejection] = []

    def judged(contour: Contour, fitted: Rim | Failure) -> MeasuredRim:
        return MeasuredRim(contour, fitted, _why_not(fitted, camera, target, options))

    for contour, fitted in zip(contours, fit(contours), strict=True):
        outermost = judged(contour, fitted)
        concentric = [outermost]
        if contour.nested:
            concentric += map(judged, contour.nested, fit(contour.nested))
        taken = chosen(concentric)
        if taken.why_not is not None or isinstance(taken.fit, Failure):
            unused.append(taken.why_not or Rejection.NO_POSE)
            continue
        rims.append(taken.fit)
        nested.append(listed(concentric, taken, camera, target.radii_mm[0]) if contour.nested else ())
        if len(rims) == target.count:
            break
    return tuple(rims), tuple(nested), Counter(unused)


def _why_not(fit: Rim | Failure, camera: Camera, target: Target, options: MeasurementOptions) -> Rejection | None:
    """Return why a rim cannot be the target's; None where it can."""
    if isinstance(fit, Failure):
        return Rejection.NO_POSE
    if fit.cone.rms_px > options.most_residual_px:
        return Rejection.RESIDUAL
    return None if _in_depth_range(fit, camera, target) else Rejection.DEPTH


def _in_depth_range(rim: Rim, camera: Camera, target: Target) -> bool:
    """Whether a candidate pose of the rim is within the target's depth range."""
    if target.depth_range_mm is None:
        return True
    nearest, farthest = target.depth_range_mm
    solutions = solve("chen-huang", rim.cone.factor, camera.rays(rim.points), target.radii_mm[0])
    return not isinstance(solutions, Failure) and any(nearest <= z <= farthest for z in solutions.centers[:, 2])
