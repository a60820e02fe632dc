"""`circlepose check`: poses against a baseline or the truth; exit code 4 where they differ."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from circlepose_cli.console import debugging
from circlepose_cli.options import declared


class CandidateChoice(StrEnum):
    """Which candidate is compared with the reference's chosen one."""

    CHOSEN = "chosen"
    BEST = "best"


def check(
    poses: Annotated[
        str,
        typer.Argument(metavar="POSES", help="Table made by estimate, or - for standard input.", show_default=False),
    ],
    against: Annotated[
        Path,
        typer.Option("--against", metavar="FILE", help="A table made by estimate before, or a truth as CSV."),
    ],
    position_mm: Annotated[
        float, typer.Option("--position-mm", metavar="MM", help="How far a centre may be from its reference.")
    ] = 0.5,
    normal_deg: Annotated[
        float, typer.Option("--normal-deg", metavar="DEG", help="How far a normal may be from its reference.")
    ] = 0.1,
    candidate: Annotated[
        CandidateChoice,
        typer.Option("--candidate", help="Compare the chosen candidate, or that nearest to the reference."),
    ] = CandidateChoice.CHOSEN,
    update: Annotated[
        bool, typer.Option("--update", help="Make POSES the baseline, whatever moved; a truth is refused.")
    ] = False,
    output_format: Annotated[
        declared.FormatChoice | None,
        typer.Option("--format", help="Default: table on a terminal, csv in a pipe."),
    ] = None,
    quiet: declared.Quiet = False,
    verbose: declared.Verbose = False,
) -> None:
    """Compare poses with a baseline or the truth.

    Prints what moved, the worst first, and what is missing, extra or of another status.

    Exit codes: 0 all within tolerance, or the baseline updated; 2 usage or an unusable file; 4 outside tolerance.
    """
    if verbose:
        debugging.show_tracebacks(True)
    from circlepose_cli.runs.check import Request, run  # noqa: PLC0415 - needs NumPy

    raise typer.Exit(
        run(
            Request(
                poses=poses,
                against=against,
                position_mm=position_mm,
                normal_deg=normal_deg,
                candidate=candidate.value,
                update=update,
                output_format=output_format,
                quiet=quiet,
            )
        )
    )
