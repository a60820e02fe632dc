"""The reference of the library, from its docstrings: every name of `circlepose.__all__`."""

from __future__ import annotations

import enum
import inspect
import sys

import circlepose
from sitegen.paths import write

KINDS = {
    "functions": "What a program calls.",
    "values": "What functions take and return: frozen values.",
    "enumerations": "Names that a value can have.",
    "exceptions": "All descend from `CircleposeError`; each says in one sentence what is wrong.",
}


def kind(name: str) -> str:
    """Return on which page a name stands."""
    value = getattr(circlepose, name)
    if not inspect.isclass(value):
        return "functions"
    if issubclass(value, Exception):
        return "exceptions"
    return "enumerations" if issubclass(value, enum.Enum) else "values"


def names() -> list[str]:
    """Return the public names that have a docstring."""
    return [name for name in circlepose.__all__ if name != "__version__"]


def entry(name: str) -> str:
    """Return what shows one name."""
    value = getattr(circlepose, name)
    if not inspect.isclass(value):
        return directive(f".. autofunction:: circlepose.{name}\n")
    if kind(name) == "enumerations":
        return directive(f".. autoclass:: circlepose.{name}\n") + "\n" + members(value)
    return directive(
        f".. autoclass:: circlepose.{name}\n   :members:\n   :undoc-members:\n   :member-order: bysource\n"
    )


def directive(text: str) -> str:
    """Return a directive of reStructuredText in Markdown."""
    return f"```{{eval-rst}}\n{text}```\n"


def members(enumeration: type[enum.Enum]) -> str:
    """Return the table of an enumeration's members, with the meaning that its module gives them."""
    tables = [value for value in vars(sys.modules[enumeration.__module__]).values() if isinstance(value, dict)]
    meanings = next((table for table in tables if set(table) == set(enumeration)), {})
    rows = [f"| `{each.name}` | `{each.value}` | {meanings.get(each, '')} |" for each in enumeration]
    return "\n".join(["| member | value | meaning |", "|---|---|---|", *rows]) + "\n"


def write_pages() -> None:
    """Write a page for each kind of name and one that lists them."""
    for title, meaning in KINDS.items():
        chosen = sorted((name for name in names() if kind(name) == title), key=str.lower)
        body = "\n".join(f"## {name}\n\n{entry(name)}" for name in chosen)
        write(f"api/{title}.md", f"# {title.capitalize()}\n\n{meaning}\n\n{body}")
    text = "# Python reference\n\nMade from the docstrings: every name of `circlepose`. A guide with examples is "
    text += "[From Python](../../python.md).\n\n```{toctree}\n:maxdepth: 2\n\n" + "\n".join(KINDS) + "\n```\n"
    write("api/index.md", text)
