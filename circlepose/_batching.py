"""Rows of batches: dataclasses, and tuples, of arrays whose first axis is that of the rims, however nested."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields, is_dataclass
from typing import Any, TypeVar

import numpy as np

from circlepose._typing import IntArray

_Batch = TypeVar("_Batch")
_Result = TypeVar("_Result")
_AT_ONCE = 128
"""More would not be sooner, but take more memory."""


def rows(batch: _Batch, which: IntArray | slice) -> _Batch:
    """Return the rims `which` (n,) of a batch; what is no array holds for all of them."""
    return _rows(batch, which)


def put_rows(batch: _Batch, which: IntArray, others: _Batch, those: IntArray | None = None) -> None:
    """Write the rims of `others`, all or `those` (n,), over the rims `which` (n,) of a batch."""
    if isinstance(batch, np.ndarray):
        batch[which] = others if those is None else others[those]  # type: ignore[index]
    else:
        for own, other in zip(_parts(batch), _parts(others), strict=True):
            put_rows(own, which, other, those)


def in_parts(function: Callable[..., _Result], *batches: Any) -> _Result:
    """Return what `function` makes of `batches` (each of m rims), called with some of the rims at a time."""
    number = len(batches[0])
    if number <= _AT_ONCE:
        return function(*batches)
    parts = [slice(i, i + _AT_ONCE) for i in range(0, number, _AT_ONCE)]
    return joined([function(*(rows(batch, part) for batch in batches)) for part in parts])


def joined(batches: Sequence[_Batch]) -> _Batch:
    """Return the rims of all `batches` as one."""
    return batches[0] if len(batches) == 1 else _joined(batches)


def _joined(batches: Sequence[Any]) -> Any:
    first = batches[0]
    if isinstance(first, np.ndarray):
        return np.concatenate(batches)
    parts = tuple(_joined(each) for each in zip(*map(_parts, batches), strict=True))
    return parts if isinstance(first, tuple) else type(first)(*parts)


def _rows(batch: Any, which: IntArray | slice) -> Any:
    if isinstance(batch, np.ndarray):
        return batch[which]
    if isinstance(batch, tuple):
        return tuple(_rows(each, which) for each in batch)
    if is_dataclass(batch) and not isinstance(batch, type):
        return type(batch)(*(_rows(each, which) for each in _parts(batch)))
    return batch


def _parts(batch: Any) -> tuple[Any, ...]:
    if isinstance(batch, tuple):
        return batch
    return tuple(getattr(batch, field.name) for field in fields(batch)) if is_dataclass(batch) else ()
