"""`circlepose demo`; its work is in `runs.demo`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from circlepose_cli.console import process
from circlepose_cli.options import declared


def demo(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder to make.")] = Path("circlepose-demo"),
    verbose: declared.Verbose = False,
) -> None:
    """Write an example image and measure it.

    Needs no photograph, no calibration and no network. Writes a rendered image of two discs with its camera, target
    and true poses into DIR, measures it, and draws the result over the image.
    """
    process.begin(verbose=verbose)
    from circlepose_cli.runs.demo import run  # noqa: PLC0415 - needs NumPy and OpenCV

    raise typer.Exit(run(folder))
