"""Checks of what library functions are given: one sentence that names the parameter, and what it was given."""

from __future__ import annotations

import math
import reprlib
import warnings
from collections.abc import Callable, Collection, Iterable, Mapping
from functools import wraps
from numbers import Integral, Real
from typing import TypeVar

import numpy as np

from circlepose._typing import FloatArray
from circlepose.errors import ArgumentError, CircleposeError

Value = TypeVar("Value")

LENGTHS_MM = (1e-6, 1e12)
"""Lengths from a nanometre to a million kilometres: no use is beyond, and no product of them overflows."""
HOW_CAMERA = "of Camera.create or read_camera"
HOW_TARGET = "such as Target.circle(60.0), or of read_target"
"""How one comes by a camera, and by a target."""
_LONGEST = 120


def shown(value: object) -> str:
    """Return a short text of a value, for a message."""
    if isinstance(value, str):
        return repr(value[:40])
    text = " ".join(reprlib.repr(value).split())
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."


def instance_of(kind: type[Value], name: str, value: object, how: str) -> Value:
    """Return `value` if it is a `kind`; else raise `ArgumentError` that says `how` to get one."""
    if isinstance(value, kind):
        return value
    raise ArgumentError(f"{name}: expected a {kind.__name__} ({how}), got {shown(value)}.")


def one_of(names: Collection[str], name: str, value: object, error: type[CircleposeError] = ArgumentError) -> str:
    """Return `value` if it is one of the `names`."""
    if isinstance(value, str) and value in names:
        return value
    raise error(f"{name}: expected one of {', '.join(names)}, got {shown(value)}.")


def one_of_or_truth(
    names: Collection[str], name: str, value: object, error: type[CircleposeError] = ArgumentError
) -> str:
    """Return `value` if it is one of the `names`; True is `yes`, False is `no`."""
    if _is_truth(value):
        return "yes" if value else "no"
    if isinstance(value, str) and value in names:
        return value
    raise error(f"{name}: expected one of {', '.join(names)}, or True or False, got {shown(value)}.")


def truth(name: str, value: object, error: type[CircleposeError] = ArgumentError) -> bool:
    """Return `value`, True or False; NumPy's own are taken."""
    if _is_truth(value):
        return bool(value)
    raise error(f"{name}: expected True or False, got {shown(value)}.")


def _is_truth(value: object) -> bool:
    # NumPy's own, whose name depends on its version, is no bool.
    return type(value).__name__ in ("bool", "bool_")


def text(name: str, value: object) -> str:
    """Return `value` if it is a text."""
    if isinstance(value, str):
        return value
    raise ArgumentError(f"{name}: expected a text, got {shown(value)}.")


def number(name: str, value: object, expected: str, error: type[CircleposeError] = ArgumentError) -> float:
    """Return `value` as a float if it is a finite real number; `expected` completes the sentence."""
    if isinstance(value, Real) and not _is_truth(value):
        try:
            real = float(value)
        except (OverflowError, ValueError):
            real = math.inf
        if math.isfinite(real):
            return real
    raise error(f"{name}: expected {expected}, got {shown(value)}.")


def whole(name: str, value: object, expected: str, error: type[CircleposeError] = ArgumentError) -> int:
    """Return `value` as an int if it is a whole number."""
    if isinstance(value, Integral) and not _is_truth(value):
        return int(value)
    raise error(f"{name}: expected {expected}, got {shown(value)}.")


def parts(
    name: str, value: object, expected: str, error: type[CircleposeError] = ArgumentError
) -> tuple[object, ...]:
    """Return `value` as a tuple if it is a sequence, or an array, and no text."""
    is_sequence = hasattr(value, "__len__") and hasattr(value, "__getitem__") and not isinstance(value, Mapping)
    if isinstance(value, Iterable) and is_sequence and not isinstance(value, str | bytes):
        try:
            return tuple(value)
        except TypeError:  # an array without a dimension
            pass
    raise error(f"{name}: expected {expected}, got {shown(value)}.")


def numbers(
    name: str, value: object, expected: str, count: int, error: type[CircleposeError] = ArgumentError
) -> tuple[float, ...]:
    """Return `value` as a tuple of `count` finite numbers."""
    found = parts(name, value, expected, error)
    if len(found) != count:
        raise error(f"{name}: expected {expected}, got {shown(value)}.")
    return tuple(number(name, part, expected, error) for part in found)


def float_array(name: str, value: object, expected: str, error: type[CircleposeError] = ArgumentError) -> FloatArray:
    """Return `value` (...), real numbers in an array or in nested sequences, as float64."""
    refused = error(f"{name}: expected {expected}, got {shown(value)}.")
    if value is None:
        # NumPy would take it for NaN.
        raise refused
    try:
        array = np.asarray(value)
        if array.dtype.kind in "biufO":
            with np.errstate(over="ignore"):
                return array.astype(np.float64)
    except Exception as reason:  # whatever the conversion of an object raises
        raise refused from reason
    raise refused


def vectors(name: str, value: object, expected: str, count: int) -> FloatArray:
    """Return `value` if it is an array (..., count) of real numbers, or as one if it is nested sequences."""
    if isinstance(value, np.ndarray) and value.dtype.kind in "iuf" and value.shape[-1:] == (count,):
        return value
    array = float_array(name, value, expected)
    if array.shape[-1:] != (count,):
        raise ArgumentError(f"{name}: expected {expected}, got {shown(value)}.")
    return array


def length_mm(name: str, value: object, expected: str, error: type[CircleposeError] = ArgumentError) -> float:
    """Return `value` if it is a length in mm within `LENGTHS_MM`."""
    length = number(name, value, expected, error)
    low, high = LENGTHS_MM
    if low <= length <= high:
        return length
    limits = f" within {low:g} to {high:g} mm" if length > 0.0 else ""
    raise error(f"{name}: expected {expected}{limits}, got {shown(value)}.")


def score(name: str, value: object) -> float | None:
    """Return `value` if it is None or a score."""
    expected = "a score from 0 to 1, such as 0.2"
    if value is None or 0.0 <= number(name, value, expected) <= 1.0:
        return None if value is None else float(value)  # type: ignore[arg-type]
    raise ArgumentError(f"{name}: expected {expected}, got {shown(value)}.")


def bound_px(name: str, value: object) -> float | None:
    """Return `value` if it is None or a positive length in px."""
    expected = "a positive number of px, such as 0.3"
    if value is None or number(name, value, expected) > 0.0:
        return None if value is None else float(value)  # type: ignore[arg-type]
    raise ArgumentError(f"{name}: expected {expected}, got {shown(value)}.")


def warn_renamed(former: str, new: str) -> None:
    """Warn the caller's caller that `former` is now called `new`."""
    warnings.warn(f"{former} is now called {new}", DeprecationWarning, stacklevel=3)


def with_former_names(**new_names: str) -> Callable[[type[Value]], type[Value]]:
    """Return a decorator of classes whose constructor also takes parameters by their former names, with a warning."""

    def decorated(kind: type[Value]) -> type[Value]:
        initialize = kind.__init__

        @wraps(initialize)
        def with_new_names(self: Value, *args: object, **kwargs: object) -> None:
            for former, new in new_names.items():
                if former in kwargs:
                    warn_renamed(f"{kind.__name__}({former}=)", f"{kind.__name__}({new}=)")
                    # `dataclasses.replace` gives both, of which the former name is the one that was asked for.
                    kwargs[new] = kwargs.pop(former)
            initialize(self, *args, **kwargs)

        # mypy holds that no instance's constructor may differ from its class's; this is the class's own.
        kind.__init__ = with_new_names  # type: ignore[assignment]
        return kind

    return decorated
