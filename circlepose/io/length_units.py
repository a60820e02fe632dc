"""Radii whose name says another unit than mm, a diameter, or no unit: refused, with what to write instead."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from circlepose.errors import TargetError

_IN_RADIUS_MM = {
    "diameter_mm": 0.5,
    "radius_cm": 10.0,
    "diameter_cm": 5.0,
    "radius_m": 1000.0,
    "diameter_m": 500.0,
}
_UNIT_UNSAID = ("radius", "radii", "r", "diameter", "d", "size")


def check_units(mapping: Mapping[str, object], where: str) -> None:
    """Raise `TargetError` at the first such key of a target, or of one of its marks or circles."""
    for path, key, value in _entries(mapping):
        factor = _IN_RADIUS_MM.get(key.lower())
        if factor is not None and isinstance(value, int | float) and not isinstance(value, bool):
            raise TargetError(f"{where}: {path}: the file takes a radius in mm; write radius_mm: {value * factor:g}.")
        if factor is not None or key.lower() in _UNIT_UNSAID:
            raise TargetError(
                f"{where}: {path}: does not say its unit; write radius_mm (a radius, not a diameter, in mm) "
                f"or radii_mm, such as radius_mm: 60."
            )


def check_column(column: str, where: str) -> None:
    """Raise `TargetError` where the name of a column is such a one."""
    factor = _IN_RADIUS_MM.get(column.lower())
    if factor is not None:
        values = "half of each value" if factor == 0.5 else f"{factor:g} times each value"
        raise TargetError(
            f"{where}: column {column!r}: the file takes a radius in mm; name the column radius_mm and "
            f"write {values}."
        )
    if column.lower() in _UNIT_UNSAID:
        raise TargetError(
            f"{where}: column {column!r} does not say its unit; name it radius_mm (a radius, not a diameter, in mm)."
        )


def _entries(mapping: Mapping[str, object]) -> Iterator[tuple[str, str, object]]:
    """Yield the path, the key and the value of each entry of a target and of its marks and circles."""
    for key, value in mapping.items():
        yield key, key, value
    for name in ("marks", "circles"):
        parts = mapping.get(name)
        for i, part in enumerate(parts if isinstance(parts, list) else ()):
            for key, value in part.items() if isinstance(part, Mapping) else ():
                yield f"{name}[{i}].{key}", str(key), value
