"""`circlepose estimate`: the options of the command; `run` does the work."""

from __future__ import annotations

import typer

from circlepose_cli import debugging, options
from circlepose_cli.options import ExtractionChoice, LayoutChoice, MethodChoice, StdinChoice
from circlepose_cli.overrides import target_overrides
from circlepose_cli.threads import one_thread


def estimate(
    inputs: options.Inputs,
    stdin: options.Stdin = StdinChoice.AUTO,
    nul: options.Nul = False,
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
    method: options.Method = MethodChoice.CHEN_HUANG,
    refine: options.Refine = True,
    extraction: options.Extraction = ExtractionChoice.EDGES,
    scale_calib: options.ScaleCalib = False,
    force_calib: options.ForceCalib = False,
    recursive: options.Recursive = False,
    output_format: options.Format = None,
    layout: options.Layout = LayoutChoice.POSES,
    reference: options.ReferenceFile = None,
    output: options.OutputPlace = None,
    overlay: options.Overlay = None,
    overwrite: options.Overwrite = False,
    jobs: options.Jobs = None,
    cluster: options.Cluster = None,
    timeout: options.Timeout = None,
    resume: options.Resume = False,
    quiet: options.Quiet = False,
    verbose: options.Verbose = False,
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

    from circlepose_cli.run import Request, run  # noqa: PLC0415 - needs NumPy and OpenCV

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
                timeout_s=options.check_timeout(timeout),
                resume=resume,
                quiet=quiet,
                verbose=verbose,
            )
        )
    )
