"""JSON Schemas (draft 2020-12) of all JSON that the program writes; `circlepose schema` prints them."""

from __future__ import annotations

import json
from importlib.resources import files
from typing import Any

from circlepose.errors import ArgumentError

_ENDING = ".json"


def names() -> tuple[str, ...]:
    """Return the ids of all schemas, as the key `schema` of the documents has them, such as circlepose.poses/1."""
    stems = (path.name.removesuffix(_ENDING) for path in files(__name__).iterdir() if path.name.endswith(_ENDING))
    return tuple(sorted(f"circlepose.{stem.replace('-', '/')}" for stem in stems))


def schema_text(name: str) -> str:
    """Return the file of a schema, as text; `name` as of `schema`."""
    known = {short: each for each in names() for short in (each, _short(each))}
    if name not in known:
        raise ArgumentError(f"{name}: no schema has this name; expected one of {', '.join(map(_short, names()))}.")
    stem = known[name].removeprefix("circlepose.").replace("/", "-")
    return (files(__name__) / f"{stem}{_ENDING}").read_text(encoding="utf-8")


def schema(name: str) -> dict[str, Any]:
    """Return the JSON Schema of a form of output.

    Parameters
    ----------
    name
        The key `schema` of a document, such as `circlepose.poses/1`, or short `poses`.

    Returns
    -------
    The schema, draft 2020-12. It is strict: a key that it does not name is refused.

    Raises
    ------
    ArgumentError
        Where there is no such schema.
    """
    content: dict[str, Any] = json.loads(schema_text(name))
    return content


def _short(name: str) -> str:
    return name.removeprefix("circlepose.").partition("/")[0]
