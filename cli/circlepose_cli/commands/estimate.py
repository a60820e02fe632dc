"""`circlepose estimate`; its options are in `options.requests`, its work in `runs.estimate`."""

from __future__ import annotations

import typer

from circlepose_cli.console import process
from circlepose_cli.options.groups import takes
from circlepose_cli.options.requests import EstimateRequest


@takes(EstimateRequest)
def estimate(request: EstimateRequest) -> None:
    """Measure the circles in images.

    Prints their poses: centre in mm and unit normal in the camera frame, both candidates, the better first.

    The target is, in this order: --target or --radius-mm; the target.yaml beside the image; target: in the
    calibration file. Exit codes: 0 all measured, 2 usage or calibration, 3 some images failed, 130 interrupted.
    """
    process.begin(verbose=request.verbose)
    from circlepose_cli.runs.estimate import run  # noqa: PLC0415 - needs NumPy and OpenCV

    raise typer.Exit(run(request))
