"""`circlepose render`: photographs of a described scene, with their exact truth."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from circlepose.io.text.escaping import quoted
from circlepose_cli.console import process
from circlepose_cli.options import declared


def render(
    scene: Annotated[
        Path,
        typer.Argument(metavar="SCENE.yaml", help="Scene file, such as configs/scenes/cd.yaml.", show_default=False),
    ],
    output: Annotated[
        Path,
        typer.Option(
            "--output",
            "-o",
            metavar="DIR",
            help="Folder for images, camera.yml, target.yaml, truth.csv; of boards also truth_boards.csv.",
        ),
    ],
    overwrite: declared.Overwrite = False,
    verbose: declared.Verbose = False,
) -> None:
    """Render a scene of circles, with its truth.

    Writes a folder that `estimate` can measure, and prints the files in it.
    """
    process.begin(verbose=verbose)
    from circlepose.io.scenes.produce import render_to_folder  # noqa: PLC0415 - needs NumPy and OpenCV

    for path in render_to_folder(scene, output, overwrite=overwrite):
        typer.echo(quoted(str(path)))
