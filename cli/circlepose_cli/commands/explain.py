"""`circlepose explain`; its options are in `options.requests`, its work in `runs.explain`."""

from __future__ import annotations

import typer

from circlepose_cli.console import process
from circlepose_cli.options.groups import takes
from circlepose_cli.options.requests import ExplainRequest


@takes(ExplainRequest)
def explain(request: ExplainRequest) -> None:
    """Explain what the poses in an image rest on.

    Prints the stages with their numbers: contours found and rejected, edges, grey levels, what was left out and why,
    the candidates, and which term of the uncertainty dominates. --picture draws it.

    Exit codes: 0 measured, 2 usage or calibration, 3 the image failed; the report says why.
    """
    process.begin(verbose=request.verbose)
    from circlepose_cli.runs.explain import run  # noqa: PLC0415 - needs NumPy and OpenCV

    raise typer.Exit(run(request))
