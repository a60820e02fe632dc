"""Results as plain values that JSON keeps to the last bit, and back: what a run leaves for another to go on with.

Contours, which are large and in no table, are left out.
"""

from __future__ import annotations

import dataclasses
import types
from collections.abc import Mapping
from enum import Enum
from functools import cache
from typing import Any, Literal, TypeVar, Union, cast, get_args, get_origin, get_type_hints

import numpy as np

from circlepose._typing import FloatArray, frozen
from circlepose.pose import ImageResult

T = TypeVar("T")

_LEFT_OUT = frozenset({"contour"})


def plain_result(result: ImageResult) -> dict[str, Any]:
    """Return `result`, without contours, as values for JSON; NaN and infinities stay what they are."""
    return cast("dict[str, Any]", _plain(result))


def restored_result(plain: object) -> ImageResult:
    """Return the result that `plain_result` made `plain` of; raises `ValueError` when it is anything else."""
    try:
        return cast("ImageResult", _restored(plain, ImageResult))
    except (TypeError, KeyError, AttributeError) as error:
        raise ValueError(f"is no stored result: {error}") from error


def _plain(value: Any) -> Any:
    if isinstance(value, Enum):
        return value.value
    if dataclasses.is_dataclass(value):
        names = (field.name for field in dataclasses.fields(value))
        return {name: _plain(getattr(value, name)) for name in names if name not in _LEFT_OUT}
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    if isinstance(value, (tuple, list)):
        return [_plain(each) for each in value]
    if isinstance(value, Mapping):
        return {str(key): _plain(each) for key, each in value.items()}
    if value is None or isinstance(value, (str, int, float)):
        return value
    raise TypeError(f"a {type(value).__name__} cannot be stored")


def _restored(plain: Any, kind: Any) -> Any:
    """Return `plain` as the annotated type `kind` says."""
    origin, arguments = get_origin(kind), get_args(kind)
    if origin in {Union, types.UnionType}:
        if plain is None:
            return None
        (kind,) = (each for each in arguments if each is not type(None))
        return _restored(plain, kind)
    if origin is tuple:
        return tuple(_restored(each, arguments[0]) for each in plain)
    if kind == FloatArray:
        # Which of NumPy's releases decides what `get_origin` makes of it.
        return frozen(np.array(plain, dtype=np.float64))
    if origin in {Mapping, Literal} or kind in {str, int, float, bool}:
        return plain
    if dataclasses.is_dataclass(kind):
        hints = _hints(cast("type", kind))
        return cast("type", kind)(**{name: _restored(each, hints[name]) for name, each in plain.items()})
    if isinstance(kind, type) and issubclass(kind, Enum):
        return kind(plain)
    raise TypeError(f"a {kind} cannot be restored")


@cache
def _hints(kind: type) -> dict[str, Any]:
    return get_type_hints(kind)
