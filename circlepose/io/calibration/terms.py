"""Terms that a calibration names one by one: fx, fy, cx, cy and the coefficients of the lens."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from circlepose._arguments import shown
from circlepose.errors import CalibrationError
from circlepose.io.calibration import numbers
from circlepose.io.text.validation import some_keys


def mapping(value: object, where: str, key: str) -> Mapping[str, object]:
    """Return a group of keys; raises `CalibrationError` where something else stands."""
    if isinstance(value, Mapping):
        return value
    what = "is missing" if value is None else f"is {shown(value)}"
    raise CalibrationError(f"{where}: {key}: {what}; expected a group of keys and values.")


def term(entries: Mapping[str, object], key: str, where: str, prefix: str = "") -> float:
    """Return the number at `key`; `prefix` stands before it in messages."""
    if key not in entries:
        found = some_keys(map(str, entries)) or "none"
        raise CalibrationError(f"{where}: {prefix}{key}: is missing; found the keys {found}.")
    return numbers.number(entries[key], where, prefix + key)


def matrix(
    entries: Mapping[str, object],
    where: str,
    keys: Sequence[str] = ("fx", "fy", "cx", "cy"),
    prefix: str = "",
) -> list[list[float]]:
    """Return the camera matrix of four numbers under `keys`."""
    fx, fy, cx, cy = (term(entries, key, where, prefix) for key in keys)
    return rows(fx, fy, cx, cy)


def rows(fx: float, fy: float, cx: float, cy: float, skew: float = 0.0) -> list[list[float]]:
    """Return the rows of a camera matrix."""
    return [[fx, skew, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]


def lens(
    entries: Mapping[str, object],
    where: str,
    keys: Sequence[str],
    prefix: str = "",
    optional: Iterable[str] = (),
) -> list[float]:
    """Return the coefficients under `keys`, in this order; one that is `optional` may be left out, and is then 0."""
    may_lack = set(optional)
    return [0.0 if key in may_lack and key not in entries else term(entries, key, where, prefix) for key in keys]


def refuse_rest(
    entries: Mapping[str, object], known: Iterable[str], where: str, model: str, prefix: str = ""
) -> None:
    """Raise `CalibrationError` on a term that is not 0 and that the `model` does not have."""
    known = list(known)
    for key, value in entries.items():
        if key not in known and value != 0:
            has = f"has only {', '.join(known)}" if known else "has no such term"
            raise CalibrationError(
                f"{where}: {prefix}{some_keys([str(key)])}: is {shown(value)}, but the model {model} {has}; "
                "correct the model or this term."
            )
