"""`circlepose statuses`: what the statuses and flags in the output mean."""

from __future__ import annotations

import typer

_WIDTH = 16


def statuses() -> None:
    """Explain the statuses and flags."""
    from circlepose.pose import FLAG_MEANING, STATUS_MEANING  # noqa: PLC0415 - needs NumPy

    typer.echo("Status:")
    for status, meaning in STATUS_MEANING.items():
        typer.echo(f"  {status:<{_WIDTH}}  {meaning}")
    typer.echo("Flags:")
    for flag, meaning in FLAG_MEANING.items():
        typer.echo(f"  {flag:<{_WIDTH}}  {meaning}")
