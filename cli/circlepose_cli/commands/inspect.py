"""`circlepose inspect`: which circles are found in an image, which are not taken and why."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from circlepose_cli.console import debugging
from circlepose_cli.options import declared
from circlepose_cli.options.declared import PolarityChoice, ReportFormat
from circlepose_cli.options.parse import parse_interval


def inspect(
    image: Annotated[Path, typer.Argument(metavar="IMAGE", help="Photograph to look at.", show_default=False)],
    picture: Annotated[
        Path | None,
        typer.Option(
            "--picture", metavar="FILE", help="Draw there what is kept, in green, and what is refused, in red."
        ),
    ] = None,
    polarity: declared.Polarity = None,
    major_px: declared.MajorPx = None,
    minor_px: declared.MinorPx = None,
    rings: Annotated[
        bool, typer.Option("--rings", help="Keep circles within others of the same centre, as of ring targets.")
    ] = False,
    report_format: Annotated[
        ReportFormat, typer.Option("--format", help="Plain words, or JSON.")
    ] = ReportFormat.TEXT,
    overwrite: declared.Overwrite = False,
    verbose: declared.Verbose = False,
) -> None:
    """Show which circles are found, and why others not.

    Needs no calibration and no radius. Prints the circles with their scores, how many other contours were rejected
    why, and axis intervals that hold the circles found.
    """
    if verbose:
        debugging.show_tracebacks(True)
    major = parse_interval("--major-px", major_px)
    minor = parse_interval("--minor-px", minor_px)

    from circlepose.diagnostics.inspection import draw_inspection  # noqa: PLC0415
    from circlepose.diagnostics.inspection import inspect as inspect_image  # noqa: PLC0415
    from circlepose.io.images.reader import read_image, write_image  # noqa: PLC0415 - needs NumPy and OpenCV
    from circlepose.io.output_conflicts import Outputs  # noqa: PLC0415
    from circlepose.targets.target import AxisIntervals  # noqa: PLC0415
    from circlepose_cli.reports.inspect import report_json, report_text  # noqa: PLC0415

    Outputs([picture]).refuse(image, "the image to look at")
    pixels = read_image(image)
    inspection = inspect_image(
        pixels, AxisIntervals(major, minor), (polarity or PolarityChoice.ANY).value, rings=rings
    )
    if picture is not None:
        write_image(picture, draw_inspection(pixels, inspection), drawn=True, overwrite=overwrite)
    report = report_json if report_format is ReportFormat.JSON else report_text
    typer.echo(report(str(image), inspection))
