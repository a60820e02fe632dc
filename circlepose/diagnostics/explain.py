"""One image, stage by stage: what was found and left out, and what each circle's pose rests on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from circlepose._typing import FloatArray, Image
from circlepose.camera.camera import Camera
from circlepose.detection import EXTRACTIONS
from circlepose.detection.axis_intervals import axis_intervals
from circlepose.detection.contour import Contour
from circlepose.detection.detect import find_contours
from circlepose.diagnostics.residuals import LevelResiduals, level_residuals
from circlepose.geometry.cone import factor_from_circle
from circlepose.geometry.ellipse import Ellipse, signed_distance
from circlepose.imaging.float_levels import without_gaps
from circlepose.imaging.gray import to_grey
from circlepose.measurement.edge_fit import Rim, fit_rim
from circlepose.pipeline import estimate
from circlepose.results import CircleResult, ImageResult, Status
from circlepose.targets.target import Target

_SAME_PX = 3.0
_LEAST_OUT = 2
"""Pixels of a stretch that have to be left out for it to count as left out."""


@dataclass(frozen=True, slots=True, eq=False)
class ExplainedCircle:
    """What the pose of one circle rests on; each stage None where it was not gone through, or not by this rim."""

    result: CircleResult
    contour: Contour | None
    """from which it was started"""
    edges: Rim | None
    """the edges placed along the rim, before any level was fitted"""
    levels: LevelResiduals | None
    """around the rim of the chosen pose"""


@dataclass(frozen=True, slots=True, eq=False)
class Explanation:
    """What `explain` found."""

    result: ImageResult
    """as `estimate` returns it"""
    contours: int
    """how many were worth a pose"""
    circles: tuple[ExplainedCircle, ...]
    """those with an image, in the order of the result"""
    refine: bool
    """whether edges were placed again and levels fitted"""

    @property
    def rejected(self) -> Mapping[str, int]:
        """How many contours were not used, by reason."""
        return self.result.rejected


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
    name: str = "",
) -> Explanation:
    """Measure one image as `circlepose.estimate` does, and look at each stage again.

    Parameters and errors are those of `estimate`, of whose `method` one is taken.
    """
    result = estimate(
        image,
        camera,
        target,
        method=method,
        refine=refine,
        extraction=extraction,
        scale_calibration=scale_calibration,
        force_calibration=force_calibration,
        name=name,
    )
    if result.status is Status.SIZE_MISMATCH:
        return Explanation(result, 0, (), refine)
    camera = camera_of(result, camera)
    measured = to_grey(image)
    grey = without_gaps(measured)
    contours = _contours(grey, camera, target, extraction)
    seen = [circle for circle in result.circles if circle.ellipse is not None]
    ellipses = [circle.ellipse for circle in seen if circle.ellipse is not None]
    posed = [number for number, circle in enumerate(seen) if circle.candidates]
    evaluated = level_residuals(measured, camera, [ellipses[i] for i in posed], [_factor(seen[i]) for i in posed])
    levels = dict(zip(posed, evaluated, strict=True))
    circles = []
    for number, (circle, ellipse) in enumerate(zip(seen, ellipses, strict=True)):
        contour = _nearest(contours, ellipse)
        edges = None if contour is None else fit_rim(grey, camera, contour, refine=refine)
        circles.append(ExplainedCircle(circle, contour, edges, levels.get(number)))
    return Explanation(result, len(contours), tuple(circles), refine)


def camera_of(result: ImageResult, camera: Camera) -> Camera:
    """Return the camera for the image that was measured, which may have been resized."""
    size = result.image_size
    return camera if size is None or camera.image_size in (None, size) else camera.scaled_to(size)


def rim_places(ellipse: Ellipse, pixels: FloatArray) -> FloatArray:
    """Return where along the rim of an image ellipse `pixels` (..., 2) are, deg from 0 to 360.

    The eccentric angle: from the end of the major axis, on the right, turning as the hands of a clock do.
    """
    homogeneous = np.concatenate([pixels, np.ones((*pixels.shape[:-1], 1))], axis=-1)
    factor = ellipse.factor + np.diag([0.0, 1e-9, 0.0])
    unit = homogeneous @ np.linalg.inv(factor).T
    return np.asarray(np.degrees(np.arctan2(unit[..., 1], unit[..., 0])) % 360.0)


def stretches_left_out(circle: ExplainedCircle) -> list[tuple[float, float]]:
    """Return where nothing of the rim itself is in use, as (from, to) along it in deg (`rim_places`)."""
    levels, ellipse = circle.levels, circle.result.ellipse
    if levels is None or ellipse is None:
        return []
    number = int(np.clip(np.pi * float(ellipse.semi_major + ellipse.semi_minor) / 4.0, 24, 120))
    stretch = np.minimum((rim_places(ellipse, levels.pixels) / 360.0 * number).astype(np.int64), number - 1)
    at_rim = np.abs(levels.distance_px) <= levels.sigma_px
    out = np.bincount(stretch[at_rim & ~levels.in_use], minlength=number)
    used = np.bincount(stretch[at_rim & levels.in_use], minlength=number)
    return _runs((out >= _LEAST_OUT) & (out > used))


def _runs(marked: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]) -> list[tuple[float, float]]:
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


def _contours(grey: Image, camera: Camera, target: Target, extraction: str) -> tuple[Contour, ...]:
    lone = target.kind == "circle"
    intervals = axis_intervals(target, camera, (int(grey.shape[1]), int(grey.shape[0])))
    return find_contours(
        grey,
        intervals,
        target.polarity if lone else "any",
        keep_concentric=not lone,
        enough=target.count if lone else None,
        extraction=extraction,
    ).contours


def _factor(circle: CircleResult) -> FloatArray:
    chosen = circle.candidates[circle.chosen]
    return factor_from_circle(chosen.center, chosen.normal, circle.radius_mm)


def _nearest(contours: Sequence[Contour], ellipse: Ellipse) -> Contour | None:
    """Return the contour whose ellipse is `ellipse`, about; None where the rim was found in another way."""
    tips = ellipse.points(16)
    reach = _SAME_PX + 0.05 * float(ellipse.semi_minor)
    close = [c for c in contours if float(np.linalg.norm(c.ellipse.center - ellipse.center)) < reach]
    off = [float(np.max(np.abs(signed_distance(c.ellipse, tips)))) for c in close]
    return close[int(np.argmin(off))] if off and min(off) < reach else None
