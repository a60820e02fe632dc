"""Commands whose options are the fields of a frozen dataclass, so that each option is declared once.

A field is `name: Annotated[type, typer.Option(...)] = default`. A field whose type is
itself such a dataclass stands for all options of that one. A text that needs reading has `Parsed` in its annotation.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping
from dataclasses import MISSING, dataclass, fields, is_dataclass
from functools import wraps
from typing import Annotated, Any, TypeVar, get_args, get_type_hints

Options = TypeVar("Options")


@dataclass(frozen=True, slots=True)
class Parsed:
    """How the value of a field is made from what is typed."""

    parse: Callable[[str, Any], object]
    """takes the option, such as --count, and its value; raises `UsageError`"""
    typed: type = str
    """what Typer makes of the text before"""


def takes(options: type[Options]) -> Callable[[Callable[[Options], None]], Callable[..., None]]:
    """Return a decorator for a command that gets the dataclass `options`; Typer sees an option for each field."""
    declared = list(_declared(options))

    def decorate(command: Callable[[Options], None]) -> Callable[..., None]:
        @wraps(command)
        def expanded(**values: object) -> None:
            command(_filled(options, values))

        signature = inspect.Signature(declared)
        expanded.__signature__ = signature  # type: ignore[attr-defined]
        expanded.__annotations__ = {each.name: each.annotation for each in declared}
        return expanded

    return decorate


def _declared(options: type) -> Iterator[inspect.Parameter]:
    for name, annotation, default in _fields(options):
        if is_dataclass(annotation):
            yield from _declared(annotation)  # type: ignore[arg-type]
            continue
        parsed, others = _parsed(annotation)
        shown = annotation if parsed is None else Annotated[parsed.typed | None, *others]
        yield inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=shown)


def _filled(options: type[Options], values: Mapping[str, object]) -> Options:
    filled: dict[str, object] = {}
    for name, annotation, _ in _fields(options):
        if is_dataclass(annotation):
            filled[name] = _filled(annotation, values)  # type: ignore[arg-type]
            continue
        parsed, _others = _parsed(annotation)
        value = values[name]
        option = f"--{name.replace('_', '-')}"
        filled[name] = value if parsed is None or value is None else parsed.parse(option, value)
    return options(**filled)


def _fields(options: type) -> Iterator[tuple[str, Any, Any]]:
    """Yield name, annotation and default of each field."""
    hints = get_type_hints(options, include_extras=True)
    for field in fields(options):
        yield field.name, hints[field.name], inspect.Parameter.empty if field.default is MISSING else field.default


def _parsed(annotation: object) -> tuple[Parsed | None, list[object]]:
    """Return the `Parsed` in an annotation, and what else is there."""
    extras = list(get_args(annotation)[1:])
    parsed = next((each for each in extras if isinstance(each, Parsed)), None)
    return parsed, [each for each in extras if each is not parsed]
