"""`circlepose schema`: the JSON Schema of a JSON output."""

from __future__ import annotations

from typing import Annotated

import typer


def schema(
    name: Annotated[
        str | None,
        typer.Argument(metavar="[NAME]", help="Key `schema` of the JSON, such as poses.", show_default=False),
    ] = None,
) -> None:
    """Print the JSON Schema of a JSON output.

    Without NAME: the names, and what each is the schema of.
    """
    from circlepose import schemas  # noqa: PLC0415 - not for --help

    if name is not None:
        typer.echo(schemas.schema_text(name), nl=False)
        return
    width = max(map(len, schemas.names()))
    for each in schemas.names():
        typer.echo(f"{each:<{width}}  {schemas.schema(each)['title']}")
