"""Checked forms of our own files: pydantic finds what is wrong, one sentence says it."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from typing import TypeVar, get_args

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import ErrorDetails

from circlepose._arguments import shown
from circlepose.errors import CircleposeError

REMOVE_QUOTES = "; remove the quotes"
_NUMBER = re.compile(r"[-+]?(?:\d{1,30}\.?\d{0,30}|\.\d{1,30})(?:[eE][-+]?\d{1,3})?")


class Strict(BaseModel):
    """A form whose every key is known and whose numbers are finite numbers.

    The `description` of each field completes the sentence "expected ...".
    """

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


Form = TypeVar("Form", bound=Strict)


def parse(form: type[Form], entries: Mapping[str, object], where: str, error: type[CircleposeError]) -> Form:
    """Return `entries` as a `form`; raises `error` that names `where`, the key and what is expected there."""
    empty = [key for key, value in entries.items() if value is None and key in form.model_fields]
    if empty:
        raise error(f"{where}: {empty[0]}: has no value; expected {_expected(form, empty[0])}.")
    try:
        return form.model_validate(dict(entries))
    except ValidationError as reason:
        # A key that is not known explains one that is missing, so it is reported first.
        errors = sorted(reason.errors(), key=lambda each: each["type"] != "extra_forbidden")
        raise error(f"{where}: {_sentence(form, entries, errors[0])}") from None


def unknown_key(key: str, known: Iterable[str]) -> str:
    """Return the end of a sentence on a key that is not known: a near one, or all of them."""
    names = list(known)
    near = get_close_matches(key.lower(), names, n=1, cutoff=0.7)
    hint = f"did you mean {near[0]}?" if near else f"the keys are {', '.join(names)}."
    return f"{some_keys([key])}: is no known key; {hint}"


def is_number_in_quotes(value: object) -> bool:
    """Whether a value is a text that would be a number without its quotes, or a list with such a text."""
    if isinstance(value, list):
        return any(isinstance(each, str) and is_number_in_quotes(each) for each in value)
    return isinstance(value, str) and _NUMBER.fullmatch(value.strip()) is not None


def brief(text: str) -> str:
    """Return a text found in a file, or the beginning of a long one, for a message."""
    return text if len(text) <= 200 else f"{text[:200]}..."


def some_keys(entries: Iterable[str]) -> str:
    """Return the first of the keys found in a file, for a message."""
    keys = list(entries)
    return ", ".join([key if len(key) <= 40 else f"{key[:40]}..." for key in keys[:12]] + ["..."] * (len(keys) > 12))


def _sentence(form: type[Strict], entries: Mapping[str, object], detail: ErrorDetails) -> str:
    path = index = expected = ""
    value: object = entries
    inner: object = entries
    level: type[Strict] | None = form
    for part in detail["loc"]:
        if isinstance(part, int) and isinstance(inner, list) and part < len(inner):
            # Said only where a key follows.
            inner, index = inner[part], f"{index}[{part}]"
        elif isinstance(part, str) and isinstance(inner, Mapping) and level is not None:
            before = f"{path}{index}." if path else ""
            if part in level.model_fields:
                expected = _expected(level, part)
                inner = value = inner.get(part)
                path, index, level = f"{before}{part}", "", _nested(level, part)
            elif part in inner:
                return f"{before}{unknown_key(part, level.model_fields)}"
        # Other parts are names of the alternatives of a field.
    if isinstance(inner, float) and not math.isfinite(inner):
        return f"{path}: expected {expected}; {_in_yaml(inner)} is not a finite number."
    if value is None:
        what = "is missing" if detail["type"] == "missing" else "has no value"
        return f"{path}: {what}; expected {expected}."
    hint = REMOVE_QUOTES if is_number_in_quotes(value) else ""
    return f"{path}: expected {expected}, got {shown(value)}{hint}."


def _in_yaml(value: float) -> str:
    """Return a number that is not finite as YAML has it."""
    return ".nan" if math.isnan(value) else ".inf" if value > 0.0 else "-.inf"


def _expected(form: type[Strict], key: str) -> str:
    return str(form.model_fields[key].description)


def _nested(form: type[Strict], key: str) -> type[Strict] | None:
    """Return the form of a field, or of the items of a list."""
    annotations: list[object] = [form.model_fields[key].annotation]
    for option in annotations:
        if isinstance(option, type) and issubclass(option, Strict):
            return option
        annotations += get_args(option)
    return None
