"""`circlepose estimate`: the options of the command; `run` does the work."""

from __future__ import annotations

import typer

from circlepose_cli.console import debugging
from circlepose_cli.console.blas_threads import one_thread
from circlepose_cli.options import declared
from circlepose_cli.options.declared import ExtractionChoice, LayoutChoice, MethodChoice, StdinChoice
from circlepose_cli.options.parse import target_overrides


def estimate(
    inputs: declared.Inputs,
    stdin: declared.Stdin = StdinChoice.AUTO,
    nul: declared.Nul = False,
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
    method: declared.Method = MethodChoice.CHEN_HUANG,
    refine: declared.Refine = True,
    extraction: declared.Extraction = ExtractionChoice.EDGES,
    scale_calib: declared.ScaleCalib = False,
    force_calib: declared.ForceCalib = False,
    recursive: declared.Recursive = False,
    output_format: declared.Format = None,
    layout: declared.Layout = LayoutChoice.POSES,
    reference: declared.ReferenceFile = None,
    output: declared.OutputPlace = None,
    overlay: declared.Overlay = None,
    overwrite: declared.Overwrite = False,
    jobs: declared.Jobs = None,
    cluster: declared.Cluster = None,
    timeout: declared.Timeout = None,
    resume: declared.Resume = False,
    quiet: declared.Quiet = False,
    verbose: declared.Verbose = False,
) -> None:
    """Measure the circles in images.

    Prints their poses: centre in mm and unit normal in the camera frame, both candidates, the better first.

    The target is, in this order: --target or --radius-mm; the target.yaml beside the image; target: in the
    calibration file. Exit codes: 0 all measured, 2 usage or calibration, 3 some images failed, 130 interrupted.
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

    from circlepose_cli.runs.estimate import Request, run  # noqa: PLC0415 - needs NumPy and OpenCV

    raise typer.Exit(
        run(
            Request(
                inputs=tuple(inputs),
                stdin=stdin,
                nul=nul,
                recursive=recursive,
                calib=calib,
                camera_name=camera_name,
                target_file=target,
                radius_mm=radius_mm,
                overrides=overrides,
                method=method,
                refine=refine,
                extraction=extraction,
                scale_calibration=scale_calib,
                force_calibration=force_calib,
                output_format=output_format,
                layout=layout,
                reference=reference,
                output=output,
                overlay=overlay,
                overwrite=overwrite,
                jobs=jobs,
                cluster=cluster,
                timeout_s=declared.check_timeout(timeout),
                resume=resume,
                quiet=quiet,
                verbose=verbose,
            )
        )
    )
