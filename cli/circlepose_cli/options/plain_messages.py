"""Typer's messages on a value that is no number, or none of the choices, in plain words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import typer
from typer.core import TyperGroup

_EXPECTED = {
    "int_parsing": "a whole number",
    "int_parsing_size": "a whole number",
    "int_from_float": "a whole number",
    "float_parsing": "a number",
    "greater_than_equal": "at least {ge}",
    "less_than_equal": "at most {le}",
}
"""what is expected, by the type of a fault that Pydantic found"""


class PlainGroup(TyperGroup):
    """Commands whose values, if they cannot be read, are reported in plain words."""

    def invoke(self, ctx: Any) -> Any:
        """Run the command; raises `BadParameter` with the text of `plain`."""
        try:
            return super().invoke(ctx)
        except typer.BadParameter as error:
            error.message = plain(error)
            raise


def plain(error: typer.BadParameter) -> str:
    """Return the message of `error`, without the wording of Pydantic, by which Typer reads values."""
    errors = getattr(error.__cause__, "errors", None)
    fault: Mapping[str, Any] = errors()[0] if callable(errors) else {}
    expected = _EXPECTED.get(fault.get("type", ""))
    if expected is None:
        return error.message.removeprefix("Value error, ")
    return f"expected {expected.format(**fault.get('ctx', {}))}, got {str(fault['input'])[:40]!r}."
