"""The reference of the library, from its docstrings: every name of `circlepose.__all__`."""

from __future__ import annotations

import enum
import inspect

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
    """Return the directive that shows one name."""
    if not inspect.isclass(getattr(circlepose, name)):
        return f".. autofunction:: circlepose.{name}\n"
    return f".. autoclass:: circlepose.{name}\n   :members:\n   :undoc-members:\n   :member-order: bysource\n"


def write_pages() -> None:
    """Write a page for each kind of name and one that lists them."""
    for title, meaning in KINDS.items():
        chosen = sorted((name for name in names() if kind(name) == title), key=str.lower)
        body = "\n".join(f"## {name}\n\n```{{eval-rst}}\n{entry(name)}```\n" for name in chosen)
        write(f"api/{title}.md", f"# {title.capitalize()}\n\n{meaning}\n\n{body}")
    text = "# Python reference\n\nMade from the docstrings: every name of `circlepose`. A guide with examples is "
    text += "[From Python](../../python.md).\n\n```{toctree}\n" + "\n".join(KINDS) + "\n```\n"
    write("api/index.md", text)
