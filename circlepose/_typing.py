"""Array types used in signatures; shapes are stated in docstrings."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]
RealArray: TypeAlias = NDArray[np.floating[Any]]
"""float32 where there are many pixels, float64 else"""
IntArray: TypeAlias = NDArray[np.int64]
BoolArray: TypeAlias = NDArray[np.bool_]
Image: TypeAlias = NDArray[Any]


def frozen(values: object) -> FloatArray:
    """Return a read-only float64 copy of `values`, fit to be a field of a frozen value."""
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array
