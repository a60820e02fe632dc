"""The command `circlepose`: its commands, and how each way of ending becomes an exit code.

0 all done; 1 a bug; 2 usage, configuration, calibration or output; 3 some images failed;
4 outside tolerance; 130 interrupted.
"""

from __future__ import annotations

import os
import sys
import traceback
from collections.abc import Sequence
from typing import Annotated

import typer

from circlepose import __version__
from circlepose.errors import CircleposeError
from circlepose.files.names import printable, redacted
from circlepose_cli import debugging
from circlepose_cli.camera import camera
from circlepose_cli.check import check
from circlepose_cli.estimate import estimate
from circlepose_cli.explain import explain
from circlepose_cli.inspect import inspect
from circlepose_cli.render import render
from circlepose_cli.statuses import statuses
from circlepose_cli.study import study

BUG = 1
ENVIRONMENT = 2

app = typer.Typer(
    name="circlepose",
    help="Centre (mm) and unit normal of every circle of known radius, from calibrated photographs.",
    # Rich help makes the start as slow as importing OpenCV.
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    add_completion=False,
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for command in (estimate, check, inspect, explain, camera, render, statuses):
    app.command()(command)
app.add_typer(study)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"circlepose {__version__}")
        raise typer.Exit


def _print_help(context: typer.Context, wanted: bool) -> None:
    if wanted:
        typer.echo(context.get_help())
        raise typer.Exit


# Typer's own help option imports Pydantic to convert its absence before it comes to a command's help.
@app.callback(add_help_option=False)
def _options(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version and end.", is_eager=True, callback=_print_version)
    ] = False,
    help_wanted: Annotated[
        bool, typer.Option("--help", "-h", help="Show this message and end.", is_eager=True, callback=_print_help)
    ] = False,
) -> None:
    pass


def main(args: Sequence[str] | None = None) -> int:
    """Run the command line `args` (default: those of the process) and return the exit code."""
    stdout = sys.stdout
    debugging.show_tracebacks(bool(os.environ.get("CIRCLEPOSE_DEBUG")))
    try:
        app(args=args, prog_name="circlepose")
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 0
    except CircleposeError as error:
        code = error.exit_code
        _tell(str(error))
    except OSError as error:
        code = ENVIRONMENT
        _tell(f"{error.filename or 'standard output'}: {error.strerror or error}.")
    except Exception as error:
        code = BUG
        _tell(_bug_report(error))
    # Typer replaces the stream when its reader has gone, as `| head` does: that is no failure.
    reader_gone = sys.stdout is not stdout
    sys.stdout = stdout
    return 0 if reader_gone or not _flushed() else code


def _tell(message: str) -> None:
    if debugging.tracebacks_shown():
        traceback.print_exc()
    # A line end in a name must not begin a line that looks like one of ours.
    lines = [printable(line) for line in redacted(message).split("\n")]
    shown = [lines[0], *(line if line.startswith(" ") else f"  {line}" for line in lines[1:])]
    print("circlepose: " + "\n".join(shown), file=sys.stderr)


def _bug_report(error: Exception) -> str:
    what = f"{type(error).__name__}: {error}" if type(error) is not RuntimeError else str(error)
    return (
        f"internal error: {what}\n"
        "This is a bug: please report it with the command line, the version "
        f"({__version__}) and what --verbose shows."
    )


def _flushed() -> bool:
    """Send what is left to standard output; tell whether its reader is still there."""
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        # The interpreter flushes once more when it ends.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return False
    return True
