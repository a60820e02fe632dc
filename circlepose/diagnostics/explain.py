"""One image, stage by stage: what was found, what was left out, and what the pose of each circle is based on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from circlepose._typing import BoolArray, FloatArray, Image
from circlepose.camera.camera import Camera
from circlepose.detection import EXTRACTIONS
from circlepose.detection.contour import Contour
from circlepose.diagnostics.residuals import LevelResiduals, level_residuals, residuals_of_fit
from circlepose.geometry.cone import factor_from_circle
from circlepose.geometry.ellipse import Ellipse
from circlepose.measurement.color_views import levels_in
from circlepose.measurement.options import MeasurementOptions
from circlepose.measurement.rim import EdgeRim, Rim
from circlepose.measurement.trace import Trace
from circlepose.pipeline import ESTIMATE_OPTIONS, EstimateOptions, estimate_with_trace
from circlepose.results import CircleResult, ImageResult
from circlepose.targets.target import Target

_LEAST_LEFT_OUT = 2
"""Pixels of a segment that must be left out for the segment to count as left out."""


@dataclass(frozen=True, slots=True, eq=False)
class ExplainedCircle:
    """What the pose of one circle is based on."""

    result: CircleResult
    rim: Rim
    """the rim that the pose was solved from"""
    start: Rim
    """the rim at which the fit to the gray levels began"""
    levels: LevelResiduals | None
    """around the rim of the chosen pose; None where next to no pixel counts, or there is no pose"""

    @property
    def contour(self) -> Contour | None:
        """The contour that was measured; None where the rim was sought at a predicted place."""
        return self.rim.contour

    @property
    def edges(self) -> Rim:
        """The rim by its edges, before its levels were fitted; a thin rim has none, and was fitted as a whole."""
        return self.rim if isinstance(self.rim, EdgeRim) else self.start


@dataclass(frozen=True, slots=True, eq=False)
class Explanation:
    """What `explain` found."""

    result: ImageResult
    """as `estimate` returns it"""
    contours: int
    """how many detection kept"""
    circles: tuple[ExplainedCircle, ...]
    """in the order of the result"""
    refine: bool
    """whether the rims were fitted to the gray levels"""
    camera: Camera
    """the calibration for the size of the image"""

    @property
    def rejected(self) -> Mapping[str, int]:
        """How many contours were not used, by reason."""
        return self.result.rejected

    def named(self, circle: str | None) -> tuple[ExplainedCircle, ...]:
        """Return the circles of this name; None for all."""
        return tuple(each for each in self.circles if circle is None or each.result.circle == circle)


def explain(
    image: Image,
    camera: Camera,
    target: Target,
    *,
    method: str = "chen-huang",
    refine: bool = True,
    extraction: str = EXTRACTIONS[0],
    scale_calibration: bool = False,
    force_calibration: bool = False,
    min_score: float | None = None,
    max_residual_px: float | None = None,
    name: str = "",
    options: EstimateOptions = ESTIMATE_OPTIONS,
) -> Explanation:
    """Measure one image as `circlepose.estimate` does, and return what its stages handed on.

    Parameters
    ----------
    image, camera, target, method, refine, extraction, scale_calibration, force_calibration, min_score, \
    max_residual_px, name, options
        As for `circlepose.estimate`.

    Returns
    -------
    The result of the estimate, and for each circle its contour, edges, gray levels and what was left out; lengths in
    px of the raw image. Without `refine` the levels are fitted only to be compared with the pose.

    Raises
    ------
    ArgumentError
        As `circlepose.estimate`.
    """
    result, trace = estimate_with_trace(
        image,
        camera,
        target,
        method=method,
        refine=refine,
        extraction=extraction,
        scale_calibration=scale_calibration,
        force_calibration=force_calibration,
        min_score=min_score,
        max_residual_px=max_residual_px,
        name=name,
        options=options,
    )
    numbered = [(circle, number) for circle in result.circles if (number := trace.number_of(circle)) is not None]
    residuals = _residuals(numbered, trace, options.measurement)
    circles = tuple(
        ExplainedCircle(circle, trace.rims[number], trace.starts[number], levels)
        for (circle, number), levels in zip(numbered, residuals, strict=True)
    )
    return Explanation(result, len(trace.contours), circles, refine, trace.camera)


def _residuals(
    numbered: list[tuple[CircleResult, int]], trace: Trace, options: MeasurementOptions
) -> list[LevelResiduals | None]:
    """Return the residuals of each circle about its chosen pose, by the fit of its rim, whose number is beside it."""
    factors = {i: _factor(circle) for i, (circle, _) in enumerate(numbered) if circle.candidates}
    fits = {i: fit for i in factors if (fit := trace.fits[numbered[i][1]]) is not None}
    unfitted = [i for i in factors if i not in fits]
    found: dict[int, LevelResiduals | None] = {i: residuals_of_fit(fit, factors[i]) for i, fit in fits.items()}
    for mix in {trace.mixes[numbered[i][1]] for i in unfitted}:
        own = [i for i in unfitted if trace.mixes[numbered[i][1]] == mix]
        fitted_now = level_residuals(
            trace.levels if mix is None and trace.levels is not None else levels_in(trace.channels, mix),
            trace.camera,
            [trace.rims[numbered[i][1]].ellipse for i in own],
            [factors[i] for i in own],
            options=options,
        )
        found.update(zip(own, fitted_now, strict=True))
    return [found.get(i) for i in range(len(numbered))]


def camera_of(result: ImageResult, camera: Camera) -> Camera:
    """Return the camera for the image that was measured, which may have been resized."""
    size = result.image_size
    return camera if size is None or camera.image_size in (None, size) else camera.scaled_to(size)


def rim_places(ellipse: Ellipse, pixels: FloatArray) -> FloatArray:
    """Return the eccentric angle (...) of `pixels` (..., 2) along the rim of an image ellipse, deg from 0 to 360.

    From the end of the major axis on the right, clockwise as one looks at the image.
    """
    homogeneous = np.concatenate([pixels, np.ones((*pixels.shape[:-1], 1))], axis=-1)
    factor = ellipse.factor + np.diag([0.0, 1e-9, 0.0])
    unit = homogeneous @ np.linalg.inv(factor).T
    return np.asarray(np.degrees(np.arctan2(unit[..., 1], unit[..., 0])) % 360.0)


def segments_left_out(circle: ExplainedCircle) -> list[tuple[float, float]]:
    """Return where nothing of the rim itself is in use, as (from, to) in deg along it, see `rim_places`."""
    levels, ellipse = circle.levels, circle.result.ellipse
    if levels is None or ellipse is None:
        return []
    number = int(np.clip(np.pi * float(ellipse.semi_major + ellipse.semi_minor) / 4.0, 24, 120))
    segment = np.minimum((rim_places(ellipse, levels.pixels) / 360.0 * number).astype(np.int64), number - 1)
    at_rim = np.abs(levels.distance_px) <= levels.sigma_px
    out = np.bincount(segment[at_rim & ~levels.in_use], minlength=number)
    used = np.bincount(segment[at_rim & levels.in_use], minlength=number)
    return _runs((out >= _LEAST_LEFT_OUT) & (out > used))


def _runs(marked: BoolArray) -> list[tuple[float, float]]:
    """Return the runs of equal parts of a circle that are `marked` (n,), deg; one may pass 360."""
    number = len(marked)
    if marked.all():
        return [(0.0, 360.0)]
    starts = np.flatnonzero(marked & ~np.roll(marked, 1))
    ends = np.flatnonzero(marked & ~np.roll(marked, -1))
    per = 360.0 / number
    # A run that passes the end ends at the first end.
    after = [ends[ends >= start][0] if (ends >= start).any() else ends[0] + number for start in starts]
    return [(float(start * per), float((end + 1) * per)) for start, end in zip(starts, after, strict=True)]


def _factor(circle: CircleResult) -> FloatArray:
    chosen = circle.candidates[circle.chosen]
    return factor_from_circle(chosen.center, chosen.normal, circle.radius_mm)
