"""What one rim can be: its poses as each circle of a ring target, and where the other circles then are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from circlepose._typing import FloatArray
from circlepose.camera.camera import Camera
from circlepose.detection.contour import WANTED_SIGN
from circlepose.fitting.observations import Observations
from circlepose.geometry.cone import PrincipalFrame, principal_frame
from circlepose.measurement.poses import settled_frames
from circlepose.measurement.rim import Rim
from circlepose.results import Failure, Status
from circlepose.rings.options import RingOptions
from circlepose.rings.reprojection import misfits_px
from circlepose.solvers.fu_zhou_coaxial import height_from_generatrix
from circlepose.solvers.registry import Solutions, solve_chen_huang
from circlepose.targets.target import Target


@dataclass(frozen=True, slots=True, eq=False)
class SolvedRim:
    """A rim with the axes of its viewing cone. Its poses by Chen & Huang follow for any radius."""

    rim: Rim
    seen: Observations
    """the points of the rim, with their rays"""
    frame: PrincipalFrame
    """of the measured cone"""
    unit: Solutions
    """the candidate poses of a circle of radius 1, by Chen & Huang"""
    is_settled: bool
    """whether the cone was taken for a right or a degenerate one, which it may be"""

    def solutions(self, radius_mm: float) -> Solutions:
        """Return the candidate poses of a circle of `radius_mm`: centers are proportional to the radius."""
        return replace(self.unit, centers=radius_mm * self.unit.centers)


def solve_rims(rims: Sequence[Rim], camera: Camera, options: RingOptions) -> tuple[SolvedRim, ...]:
    """Return each rim with its rays, the principal frame of its cone and its poses, all computed at once.

    Parameters
    ----------
    rims
        (m) the measured rims.
    camera
        The calibration for this image size.
    options
        The numbers of ring targets.
    """
    if not rims:
        return ()
    frames = principal_frame(np.stack([rim.cone.factor for rim in rims]))
    settled = settled_frames(rims, frames, options.measurement)
    changed = settled.tan_half_major != frames.tan_half_major
    changed = changed | (settled.tan_half_minor != frames.tan_half_minor)
    return tuple(
        SolvedRim(rim, Observations.of(camera, rim.points), _frame(frames, k), unit, bool(changed[k]))
        for k, (rim, unit) in enumerate(zip(rims, solve_chen_huang(settled, 1.0), strict=True))
    )


def as_circle(solved: SolvedRim, target: Target, which: int) -> Solutions | Failure:
    """Return the poses of a rim as one circle of a target.

    Parameters
    ----------
    solved
        The rim.
    target
        The ring target, with its depth range and axis intervals.
    which
        The circle's number in `target.radii_mm`, 0 for the largest.

    Returns
    -------
    One or two candidates, mm, camera frame. It fails where none lies in the depth range, or where the axes would put
    those of the largest circle outside their intervals.
    """
    rim = solved.rim
    share = target.radii_mm[which] / target.radii_mm[0]
    axes = target.axis_intervals
    if axes is not None and not (
        axes.holds_major(2.0 * float(rim.ellipse.semi_major) / share)
        and axes.holds_minor(2.0 * float(rim.ellipse.semi_minor) / share)
    ):
        return Failure(Status.NO_POSE, "the axes of its image are outside their intervals")
    solutions = solved.solutions(target.radii_mm[which])
    if target.depth_range_mm is not None:
        nearest, farthest = target.depth_range_mm
        if not np.any((solutions.centers[:, 2] >= nearest) & (solutions.centers[:, 2] <= farthest)):
            return Failure(Status.NO_POSE, "its depth is outside its range")
    return solutions


def as_largest_circle(solved: SolvedRim, target: Target) -> Solutions | Failure:
    """Return the poses of a rim as the largest circle of a target, whose polarity is known. See `as_circle`."""
    if WANTED_SIGN[target.polarity] * solved.rim.polarity < 0:
        return Failure(Status.NO_POSE, "it is brighter or darker inside than asked for")
    return as_circle(solved, target, 0)


def other_heights(which: int, target: Target) -> FloatArray | None:
    """Return the heights (k,), mm, that another circle can have in front of the largest one; None for any height.

    Parameters
    ----------
    which
        The circle's number in `target.radii_mm`.
    target
        A coplanar target has the height 0. A coaxial one has two, in front and behind, if its generatrix is known.
    """
    if target.kind == "coplanar":
        return np.zeros(1)
    if target.generatrix_mm is None:
        return None
    height = height_from_generatrix(target.generatrix_mm, target.radii_mm[0], target.radii_mm[which])
    return np.array([float(height), -float(height)])


@dataclass(frozen=True, slots=True)
class Misfit:
    """How far a rim is from where a pose of the target puts it, at the best of the possible heights."""

    rms_px: float
    height_mm: float


def least_misfit(
    center: FloatArray, normal: FloatArray, which: int, seen: Observations, target: Target, options: RingOptions
) -> Misfit:
    """Return the distance of edges from another circle of a target, at the height where it is least.

    Parameters
    ----------
    center, normal
        (3,) pose of the largest circle, mm and unit vector, camera frame.
    which
        The other circle's number in `target.radii_mm`.
    seen
        The edges.
    target
        The ring target.
    options
        The numbers of ring targets.
    """
    radius = target.radii_mm[which]
    heights = other_heights(which, target)
    if heights is None:
        return free_height(center, normal, radius, seen, options.highest_radii * target.radii_mm[0], options)
    misfits = misfits_px(center + heights[:, None] * normal, normal, radius, seen.rays, seen.jacobians)
    best = int(np.argmin(misfits))
    return Misfit(float(misfits[best]), float(heights[best]))


def free_height(
    center: FloatArray, normal: FloatArray, radius: float, seen: Observations, highest: float, options: RingOptions
) -> Misfit:
    """Return the least distance of edges from a circle on an axis, up to `highest` from the center either way.

    Three rounds: all heights with few edges, then twice the heights around the best one with all edges.
    """
    step = 2.0 * highest / (options.heights_tried - 1)
    again = options.heights_tried_again
    few = slice(None, None, max(1, len(seen) // options.edges_tried))
    best, least = 0.0, np.inf
    for half_width, number, edges in (
        (highest, options.heights_tried, few),
        (step, again, slice(None)),
        (2.0 * step / (again - 1), again, slice(None)),
    ):
        heights = best + np.linspace(-half_width, half_width, number)
        centers = center + heights[:, None] * normal
        misfits = misfits_px(centers, normal, radius, seen.rays[edges], seen.jacobians[edges])
        best, least = float(heights[int(np.argmin(misfits))]), float(misfits.min())
    return Misfit(least, best)


def _frame(frames: PrincipalFrame, number: int) -> PrincipalFrame:
    """Return one of a batch of frames."""
    return PrincipalFrame(frames.rotation[number], frames.tan_half_major[number], frames.tan_half_minor[number])
