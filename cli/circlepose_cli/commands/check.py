"""`circlepose check`; its options are in `options.requests`, its work in `runs.check`."""

from __future__ import annotations

import typer

from circlepose_cli.console import process
from circlepose_cli.options.groups import takes
from circlepose_cli.options.requests import CheckRequest


@takes(CheckRequest)
def check(request: CheckRequest) -> None:
    """Compare poses with a baseline or the truth.

    Prints what moved, the worst first, and what is missing, extra or of another status.

    Exit codes: 0 all within tolerance, or the baseline updated; 2 usage or an unusable file; 4 outside tolerance.
    """
    process.begin(verbose=request.verbose)
    from circlepose_cli.runs.check import run  # noqa: PLC0415 - needs NumPy

    raise typer.Exit(run(request))
