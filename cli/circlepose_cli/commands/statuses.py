"""`circlepose statuses`: what the statuses and flags in the output mean."""

from __future__ import annotations

import typer


def statuses() -> None:
    """Explain the statuses and flags."""
    from circlepose.results import FLAG_MEANING, STATUS_MEANING  # noqa: PLC0415 - needs NumPy

    width = max(map(len, (*STATUS_MEANING, *FLAG_MEANING)))
    typer.echo("Status:")
    for status, meaning in STATUS_MEANING.items():
        typer.echo(f"  {status:<{width}}  {meaning}")
    typer.echo("Flags:")
    for flag, meaning in FLAG_MEANING.items():
        typer.echo(f"  {flag:<{width}}  {meaning}")
