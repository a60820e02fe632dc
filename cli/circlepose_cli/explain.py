"""`circlepose explain`: what the poses in one image rest on."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from circlepose_cli import debugging, options
from circlepose_cli.options import ExtractionChoice, ReportFormat
from circlepose_cli.overrides import target_overrides
from circlepose_cli.threads import one_thread


def explain(
    image: Annotated[str, typer.Argument(metavar="IMAGE", help="One image, or the URL of one.", show_default=False)],
    calib: options.Calib = None,
    camera_name: options.CameraName = None,
    target: options.TargetFile = None,
    radius_mm: options.RadiusMm = None,
    radius_sigma_mm: options.RadiusSigmaMm = None,
    camera_sigma: options.CameraSigma = None,
    count: options.Count = None,
    polarity: options.Polarity = None,
    depth_range_mm: options.DepthRange = None,
    major_px: options.MajorPx = None,
    minor_px: options.MinorPx = None,
    coplanar: options.Coplanar = None,
    normal: options.Normal = None,
    normal_spread_deg: options.NormalSpread = None,
    up: options.Up = None,
    up_spread_deg: options.UpSpread = None,
    facing: options.Facing = None,
    refine: options.Refine = True,
    extraction: options.Extraction = ExtractionChoice.EDGES,
    scale_calib: options.ScaleCalib = False,
    force_calib: options.ForceCalib = False,
    picture: Annotated[
        Path | None,
        typer.Option(
            "--picture",
            metavar="FILE",
            help="Draw the band around each rim, its residuals and the profile across the edge, as PNG.",
        ),
    ] = None,
    report_format: Annotated[
        ReportFormat, typer.Option("--format", help="Plain words, or JSON.")
    ] = ReportFormat.TEXT,
    overwrite: options.Overwrite = False,
    quiet: options.Quiet = False,
    verbose: options.Verbose = False,
) -> None:
    """Explain what the poses in an image rest on.

    Prints the stages with their numbers: contours found and rejected, edges, grey levels, what was left out and why,
    the candidates, and which term of the uncertainty dominates. --picture draws it.

    Exit codes: 0 measured, 2 usage or calibration, 3 the image failed; the report says why.
    """
    if verbose:
        debugging.show_tracebacks(True)
    overrides = target_overrides(
        count=count,
        polarity=polarity,
        depth_range_mm=depth_range_mm,
        major_px=major_px,
        minor_px=minor_px,
        coplanar=coplanar,
        normal=normal,
        normal_spread_deg=normal_spread_deg,
        up=up,
        up_spread_deg=up_spread_deg,
        facing=facing,
        radius_sigma_mm=radius_sigma_mm,
        camera_sigma=camera_sigma,
    )
    one_thread()

    from circlepose_cli.explain_run import Request, run  # noqa: PLC0415 - needs NumPy and OpenCV

    raise typer.Exit(
        run(
            Request(
                image=image,
                calib=calib,
                camera_name=camera_name,
                target_file=target,
                radius_mm=radius_mm,
                overrides=overrides,
                refine=refine,
                extraction=extraction,
                scale_calibration=scale_calib,
                force_calibration=force_calib,
                picture=picture,
                overwrite=overwrite,
                report_format=report_format,
                quiet=quiet,
            )
        )
    )
