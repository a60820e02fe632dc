"""`circlepose explain`: what the poses in one image rest on."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from circlepose_cli.console import debugging
from circlepose_cli.console.blas_threads import one_thread
from circlepose_cli.options import declared
from circlepose_cli.options.declared import ExtractionChoice, ReportFormat
from circlepose_cli.options.parse import target_overrides


def explain(
    image: Annotated[str, typer.Argument(metavar="IMAGE", help="One image, or the URL of one.", show_default=False)],
    calib: declared.Calib = None,
    camera_name: declared.CameraName = None,
    target: declared.TargetFile = None,
    radius_mm: declared.RadiusMm = None,
    radius_sigma_mm: declared.RadiusSigmaMm = None,
    camera_sigma: declared.CameraSigma = None,
    count: declared.Count = None,
    polarity: declared.Polarity = None,
    depth_range_mm: declared.DepthRange = None,
    major_px: declared.MajorPx = None,
    minor_px: declared.MinorPx = None,
    coplanar: declared.Coplanar = None,
    normal: declared.Normal = None,
    normal_spread_deg: declared.NormalSpread = None,
    up: declared.Up = None,
    up_spread_deg: declared.UpSpread = None,
    facing: declared.Facing = None,
    refine: declared.Refine = True,
    extraction: declared.Extraction = ExtractionChoice.EDGES,
    scale_calib: declared.ScaleCalib = False,
    force_calib: declared.ForceCalib = False,
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
    overwrite: declared.Overwrite = False,
    quiet: declared.Quiet = False,
    verbose: declared.Verbose = False,
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

    from circlepose_cli.runs.explain import Request, run  # noqa: PLC0415 - needs NumPy and OpenCV

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
