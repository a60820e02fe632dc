"""`circlepose statuses`: what the statuses and flags in the output mean."""

from __future__ import annotations

import sys

import typer

from circlepose_cli.console.terminal import fitted


def statuses() -> None:
    """Explain the statuses and flags."""
    from circlepose.results import FLAG_MEANING, STATUS_MEANING  # noqa: PLC0415 - needs NumPy

    width = max(map(len, (*STATUS_MEANING, *FLAG_MEANING)))
    lines = []
    for title, meanings in (("Status:", STATUS_MEANING), ("Flags:", FLAG_MEANING)):
        lines += [title, *(f"  {name:<{width}}  {meaning}" for name, meaning in meanings.items())]
    typer.echo(fitted("\n".join(lines), sys.stdout))
