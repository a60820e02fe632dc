"""`circlepose completion`: what a shell needs to complete commands, options and their choices."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer

REQUEST = "_CIRCLEPOSE_COMPLETE"
"""environment variable by which a shell's script asks for completions"""


class Shell(StrEnum):
    """Shells with a script."""

    BASH = "bash"
    ZSH = "zsh"
    FISH = "fish"


def completion(
    shell: Annotated[Shell, typer.Argument(metavar="SHELL", help="bash, zsh or fish.", show_default=False)],
) -> None:
    """Print the completion script of a shell.

    Write it where the shell looks for such scripts, and open a new shell. The script of zsh needs a folder of
    functions: fpath+=~/.zfunc; autoload -Uz compinit; compinit in ~/.zshrc.
    """
    from typer.completion import get_completion_script  # type: ignore[attr-defined]  # noqa: PLC0415 - rarely needed

    typer.echo(get_completion_script(prog_name="circlepose", complete_var=REQUEST, shell=shell))


def know_shells() -> None:
    """Prepare to answer a shell's request: Typer does it only for an application with its own options for it."""
    from typer.completion import completion_init  # type: ignore[attr-defined]  # noqa: PLC0415 - only a shell asks

    completion_init()
