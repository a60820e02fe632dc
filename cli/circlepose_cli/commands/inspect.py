"""`circlepose inspect`; its options are in `options.requests`."""

from __future__ import annotations

import sys

import typer

from circlepose_cli.console import process
from circlepose_cli.console.terminal import fitted
from circlepose_cli.options.declared import ReportFormat
from circlepose_cli.options.groups import takes
from circlepose_cli.options.requests import InspectRequest


@takes(InspectRequest)
def inspect(request: InspectRequest) -> None:
    """Show which circles are found, and why others not.

    Needs no calibration and no radius. Prints the circles with their scores, how many other contours were rejected
    why, and axis intervals that hold the circles found.
    """
    process.begin(verbose=request.verbose)
    from circlepose.diagnostics.inspection import inspect as inspect_image  # noqa: PLC0415
    from circlepose.io.images.reader import read_image, write_image  # noqa: PLC0415 - needs NumPy and OpenCV
    from circlepose.io.output_conflicts import Outputs  # noqa: PLC0415
    from circlepose.targets.target import AxisIntervals  # noqa: PLC0415
    from circlepose_cli.reports.inspect import report_json, report_text  # noqa: PLC0415

    Outputs([request.picture]).refuse(request.image, "the image to look at")
    pixels = read_image(request.image)
    intervals = AxisIntervals(request.major_px, request.minor_px)
    inspection = inspect_image(
        pixels,
        intervals,
        request.polarity or "any",
        rings=request.rings,
        min_score=request.min_score,
        max_residual_px=request.max_residual_px,
    )
    if request.picture is not None:
        from circlepose.drawing.inspection import draw_inspection  # noqa: PLC0415 - drawing is rarely asked for

        drawn = draw_inspection(pixels, inspection, request.image.name)
        write_image(request.picture, drawn, drawn=True, overwrite=request.overwrite)
    if request.report_format is ReportFormat.JSON:
        typer.echo(report_json(str(request.image), inspection))
    else:
        typer.echo(fitted(report_text(str(request.image), inspection), sys.stdout))
