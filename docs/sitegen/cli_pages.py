"""The reference of the command line, from the program: a page a command, with its help and all its options."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import typer.main

from circlepose_cli.app import app
from sitegen.paths import write

WIDTH = "100"
INTRODUCTION = """# Command-line reference

Made from the program: each command's `--help`, and each of its options with an address of its own. The guide to the
same commands, with examples and the meaning of the columns, is [the command line](../../cli.md).

"""


def commands() -> Iterator[tuple[str, Any]]:
    """Yield name and command of each that can be typed, such as `circlepose study noise`."""
    yield from _below("circlepose", typer.main.get_command(app))


def _below(name: str, command: Any) -> Iterator[tuple[str, Any]]:
    yield name, command
    for part, below in getattr(command, "commands", {}).items():
        if not below.hidden:
            yield from _below(f"{name} {part}", below)


def records(command: Any) -> Iterator[tuple[str, str]]:
    """Yield each option as the help lists it: all its names with what follows them, and its meaning."""
    context = command.context_class(command, help_option_names=["-h", "--help"])
    for parameter in command.get_params(context):
        record = parameter.get_help_record(context) if parameter.param_type_name == "option" else None
        if record is not None:
            yield " ".join(record[0].split()), " ".join(record[1].split())


def help_text(name: str) -> str:
    """Return what `NAME --help` prints."""
    environment = {**os.environ, "COLUMNS": WIDTH, "NO_COLOR": "1", "TERM": "dumb"}
    typed = [sys.executable, "-m", *name.split(), "--help"]
    return subprocess.run(typed, env=environment, capture_output=True, text=True, check=True, encoding="utf-8").stdout


def page(name: str, command: Any, *, below: list[str]) -> str:
    """Return the page of one command: what its help prints, then each option, then the commands below it."""
    text = f"# {name}\n\n```text\n{help_text(name).strip()}\n```\n\n" + option_list(name, command)
    return text + ("\n```{toctree}\n:maxdepth: 1\n\n" + "\n".join(below) + "\n```\n" if below else "")


def option_list(name: str, command: Any) -> str:
    """Return all options of a command, each with an address of its own."""
    parts = [f"```{{program}} {name}\n```\n"]
    parts += [f"```{{option}} {spelled}\n```\n\n{escaped(meaning)}\n" for spelled, meaning in records(command)]
    return "\n".join(parts)


def escaped(text: str) -> str:
    """Return a plain sentence as Markdown that shows it as it is."""
    return re.sub(r"([\\`*_<>\[\]{}|#])", r"\\\1", text)


def write_pages() -> None:
    """Write a page for each command and one that lists them."""
    found = list(commands())
    names = [name for name, _ in found]
    for name, command in found[1:]:
        below = [file_name(other) for other in names if other.startswith(name + " ")]
        write(f"commands/{file_name(name)}.md", page(name, command, below=below))
    first = [file_name(name) for name in names if name.count(" ") == 1]
    text = page(*found[0], below=first).removeprefix("# circlepose\n")
    write("commands/index.md", INTRODUCTION + text)


def file_name(name: str) -> str:
    """Return the name of a command's page."""
    return "-".join(name.split()[1:])
