"""Lone circles: measured, and settled by each other or placed on their boards."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from circlepose._typing import Image
from circlepose.boards.results import MeasuredBoards, measure_boards
from circlepose.camera.camera import Camera
from circlepose.detection.contour import Rejection
from circlepose.disambiguation.settle import settled
from circlepose.geometry.ellipse import Ellipse
from circlepose.imaging.color_mixes import ColorMix
from circlepose.measurement.color_views import measure_circles
from circlepose.measurement.nested_rims import with_nested_rims
from circlepose.measurement.poses import results_of_rims
from circlepose.measurement.trace import Trace
from circlepose.pipeline.options import EstimateOptions
from circlepose.results import CircleResult, Plane
from circlepose.targets.board import BoardLayout
from circlepose.targets.target import AxisIntervals, Target


@dataclass(frozen=True, slots=True, eq=False)
class LoneCircles:
    """The lone circles of an image, or the boards that they make up."""

    circles: list[CircleResult]
    boards: MeasuredBoards | None
    planes: tuple[Plane, ...]
    trace: Trace
    rejected: Counter[Rejection]
    remark: str
    """what is special of the pixels, and what else lies on the lattice of a board"""


def lone_circles(
    channels: Image,
    views: tuple[ColorMix | None, ...],
    camera: Camera,
    target: Target,
    intervals: AxisIntervals,
    methods: tuple[str, ...],
    *,
    extraction: str,
    refine: bool,
    keep_fits: bool,
    others: Ellipse | None,
    options: EstimateOptions,
) -> LoneCircles:
    """Measure the circles of a target of kind circle or board; `others` are circles in the image that are not its."""
    numbers, layout = options.measurement, target.layout
    lone = target if layout is None else _circles_of(target, layout)
    measured = measure_circles(
        channels,
        views,
        camera,
        lone,
        intervals,
        extraction=extraction,
        refine=refine,
        # The other methods, and rings, use the edges themselves.
        are_starts=methods == ("chen-huang",),
        keep_fits=keep_fits,
        others=others,
        options=numbers,
    )
    trace = Trace(
        camera,
        channels,
        measured.gray,
        measured.contours,
        measured.starts,
        measured.rims,
        measured.fits,
        measured.mixes,
    )
    instances = range(len(trace.rims))
    circles = results_of_rims(trace.rims, camera, methods, lone.radii_mm[0], instances, "disc", options=numbers)
    circles = with_nested_rims(circles, measured.nested, numbers.detection)
    boards, planes, remarks = None, tuple[Plane, ...](), [measured.remark]
    if layout is None:
        planar = settled(circles, target, camera, options=options.disambiguation)
        circles, planes = planar.circles, planar.planes
    else:
        boards = measure_boards(trace.rims, circles, camera, target, measured.gray, options=options.boards)
        circles = list(boards.circles)
        remarks.append(boards.remark)
    return LoneCircles(circles, boards, planes, trace, measured.rejected, "; ".join(filter(None, remarks)))


def _circles_of(target: Target, layout: BoardLayout) -> Target:
    """Return the target of a board's circles by themselves."""
    intervals, polarity = target.axis_intervals, target.polarity
    return Target.circle(layout.usual_radius_mm, count="all", polarity=polarity, axis_intervals=intervals)
