"""Rows of batches: dataclasses, and tuples, of arrays whose first axis is that of the rims, however nested."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Any, TypeVar

import numpy as np

from circlepose._typing import IntArray

_Batch = TypeVar("_Batch")


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
