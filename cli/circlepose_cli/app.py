"""The command `circlepose`: its commands, and how each way of ending becomes an exit code.

0 all done; 1 a bug; 2 usage, configuration, calibration or output; 3 some images failed;
4 outside tolerance; 130 interrupted.
"""

from __future__ import annotations

import errno
import os
import sys
import traceback
from collections.abc import Sequence
from typing import Annotated

import typer

from circlepose._version import __version__
from circlepose.errors import CircleposeError
from circlepose.io.text.escaping import printable, redacted
from circlepose_cli.commands.camera import camera
from circlepose_cli.commands.check import check
from circlepose_cli.commands.completion import REQUEST, completion, know_shells
from circlepose_cli.commands.demo import demo
from circlepose_cli.commands.estimate import estimate
from circlepose_cli.commands.examples import EXAMPLES
from circlepose_cli.commands.explain import explain
from circlepose_cli.commands.inspect import inspect
from circlepose_cli.commands.plan import plan
from circlepose_cli.commands.print import print_
from circlepose_cli.commands.render import render
from circlepose_cli.commands.schema import schema
from circlepose_cli.commands.statuses import statuses
from circlepose_cli.commands.study import study
from circlepose_cli.console import process
from circlepose_cli.console.installation import broken_package
from circlepose_cli.console.streams import standard_streams
from circlepose_cli.options.help import GroupedCommand
from circlepose_cli.options.plain_messages import PlainGroup

BUG = 1
ENVIRONMENT = 2

app = typer.Typer(
    name="circlepose",
    cls=PlainGroup,
    help="Center (mm) and unit normal of every circle of known radius, from calibrated photographs.",
    # Rich help makes the start as slow as importing OpenCV.
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    add_completion=False,
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for command in (demo, estimate, check, inspect, explain, camera, plan, print_, render, statuses, schema, completion):
    # The name of a built-in function ends in a _ as ours.
    name = command.__name__.removesuffix("_")
    app.command(name, cls=GroupedCommand, epilog=EXAMPLES.get(name))(command)
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
        bool,
        typer.Option("--version", "-V", help="Print the version and end.", is_eager=True, callback=_print_version),
    ] = False,
    help_wanted: Annotated[
        bool, typer.Option("--help", "-h", help="Show this message and end.", is_eager=True, callback=_print_help)
    ] = False,
) -> None:
    pass


def main(args: Sequence[str] | None = None) -> int:
    """Run the command line `args` (default: those of the process) and return the exit code."""
    if REQUEST in os.environ:
        know_shells()
    process.show_tracebacks(bool(os.environ.get("CIRCLEPOSE_DEBUG")))
    process.forget_odd_sizes()
    with standard_streams():
        try:
            try:
                app(args=args, prog_name="circlepose")
            finally:
                sys.stdout.flush()
        except SystemExit as end:
            return end.code if isinstance(end.code, int) else 0
        except CircleposeError as error:
            _report(str(error))
            return error.exit_code
        except OSError as error:
            _report(_system_failure(error))
            return ENVIRONMENT
        except MemoryError:
            _report("memory ran out; give a smaller --jobs, or smaller images.")
            return ENVIRONMENT
        except Exception as error:
            broken = broken_package(error)
            _report(broken or _bug_report(error))
            return ENVIRONMENT if broken else BUG
    raise AssertionError("Typer ends with SystemExit")


def _report(message: str) -> None:
    if process.tracebacks_shown():
        traceback.print_exc()
    # A line end in a name must not begin a line that looks like one of ours.
    lines = [printable(line) for line in redacted(message).split("\n")]
    shown = [lines[0], *(line if line.startswith(" ") else f"  {line}" for line in lines[1:])]
    print("circlepose: " + "\n".join(shown), file=sys.stderr)


def _system_failure(error: OSError) -> str:
    """Return a sentence on what the system refused."""
    if error.errno in (errno.EMFILE, errno.ENFILE):
        return "too many files are open; raise the limit (ulimit -n), or give a smaller --jobs."
    if error.errno == errno.ENOENT and not error.filename:
        return "the working directory no longer exists; change to another."
    where = f"{error.filename}: " if error.filename else ""
    return f"{where}{error.strerror or error}."


def _bug_report(error: Exception) -> str:
    what = f"{type(error).__name__}: {error}" if type(error) is not RuntimeError else str(error)
    return (
        f"internal error: {what}\n"
        "This is a bug: please report it with the command line, the version "
        f"({__version__}) and what --verbose shows."
    )
