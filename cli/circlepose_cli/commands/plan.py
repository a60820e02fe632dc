"""`circlepose plan`; its options are in `options.plan`, its work in `runs.plan`."""

from __future__ import annotations

import typer

from circlepose_cli.console import process
from circlepose_cli.options.groups import takes
from circlepose_cli.options.plan import PlanRequest


@takes(PlanRequest)
def plan(request: PlanRequest) -> None:
    """Predict the accuracy of a camera and a target.

    Prints standard deviations of position and normal, and the chance of a wrong pose, over distance, tilt and place
    in the image; with --sigma-mm or --sigma-deg how far away, or how small, the target may be.

    Exit codes: 0 done, 2 usage or calibration, 4 no view is as accurate as wanted.
    """
    process.begin(verbose=request.verbose)
    from circlepose_cli.runs.plan import run  # noqa: PLC0415 - needs NumPy and OpenCV

    raise typer.Exit(run(request))
