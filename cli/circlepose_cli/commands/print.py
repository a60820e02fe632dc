"""`circlepose print`; its options are in `options.requests`, its work in `runs.print`."""

from __future__ import annotations

import typer

from circlepose_cli.console import process
from circlepose_cli.options.groups import takes
from circlepose_cli.options.requests import PrintRequest


@takes(PrintRequest)
def print_(request: PrintRequest) -> None:
    """Draw a target in true size, to be printed.

    Writes the sheet as SVG, PDF or DXF and, beside it, the target file that fits it. A board that looks the same
    after a turn gets a mark that settles its roll. With --paper a sheet that is larger is cut into tiles.
    """
    process.begin(verbose=request.verbose)
    from circlepose_cli.runs.print import run  # noqa: PLC0415 - needs NumPy

    raise typer.Exit(run(request))
