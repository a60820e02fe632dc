"""`circlepose camera`: what a calibration file says, in plain words."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

import typer

from circlepose_cli.console import process
from circlepose_cli.console.terminal import fitted
from circlepose_cli.options import declared
from circlepose_cli.options.declared import ReportFormat


def camera(
    calibration: Annotated[Path, typer.Argument(metavar="FILE", help="Calibration file.", show_default=False)],
    camera_name: declared.CameraName = None,
    target_file: Annotated[
        Path | None,
        typer.Option("--target", metavar="FILE", help="Target to be measured: warn of views that are ambiguous."),
    ] = None,
    report_format: declared.Report = ReportFormat.TEXT,
    verbose: declared.Verbose = False,
) -> None:
    """Explain a calibration file.

    Prints lens model, field of view, distortion in px and what looks wrong.
    """
    process.begin(verbose=verbose)
    from circlepose.io.calibration.reader import read_camera_file  # noqa: PLC0415 - needs NumPy
    from circlepose.io.target_file import read_target, target_from_mapping  # noqa: PLC0415
    from circlepose_cli.reports.camera import describe, report_record, report_text  # noqa: PLC0415

    camera_file = read_camera_file(calibration, camera_name)
    target = None
    if target_file is not None:
        target = read_target(target_file)
    elif camera_file.target is not None:
        target = target_from_mapping(camera_file.target, f"{camera_file.path}: target")
    report = describe(camera_file, target)
    if report_format is ReportFormat.JSON:
        typer.echo(json.dumps(report_record(report), indent=2, allow_nan=False))
    else:
        typer.echo(fitted(report_text(report), sys.stdout))
