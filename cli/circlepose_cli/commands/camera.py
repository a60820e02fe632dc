"""`circlepose camera`: what a calibration file says, in plain words, or the same camera in another form."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

import typer

from circlepose.io.calibration.writers import WrittenForm
from circlepose_cli.console import process
from circlepose_cli.console.terminal import fitted
from circlepose_cli.options import declared
from circlepose_cli.options.declared import ReportFormat
from circlepose_cli.options.help import Group


def camera(
    calibration: Annotated[Path, typer.Argument(metavar="FILE", help="Calibration file.", show_default=False)],
    camera_name: declared.CameraName = None,
    target_file: Annotated[
        Path | None,
        typer.Option("--target", metavar="FILE", help="Target to be measured: warn of views that are ambiguous."),
    ] = None,
    report_format: declared.Report = ReportFormat.TEXT,
    to: Annotated[
        WrittenForm | None,
        typer.Option("--to", help="Convert the camera to this form of calibration.", rich_help_panel=Group.OUTPUT),
    ] = None,
    output: Annotated[
        str | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="With --to: write to this file, whole or not at all, not to standard output.",
            rich_help_panel=Group.OUTPUT,
        ),
    ] = None,
    overwrite: declared.Overwrite = False,
    verbose: declared.Verbose = False,
) -> None:
    """Explain a calibration file, or convert it.

    Prints lens model, field of view, distortion in px and what looks wrong. With --to it writes the same camera in
    another tool's form; what the form cannot hold exactly is refused.
    """
    process.begin(verbose=verbose)
    if to is not None or output is not None or overwrite:
        from circlepose_cli.runs.convert import ConvertRequest, run  # noqa: PLC0415 - needs NumPy

        run(ConvertRequest(calibration, camera_name, to, output, overwrite, target_file, report_format))
        return
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
