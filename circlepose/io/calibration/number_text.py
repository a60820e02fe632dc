"""Numbers as calibration files have them: every bit of a float, in the words of YAML, JSON, XML and Python alike."""

from __future__ import annotations

from collections.abc import Iterable


def number_text(value: float) -> str:
    """Return the shortest decimal that is read back as the same float.

    Always with a point: YAML 1.1, which PyYAML reads, takes `1e-05` for a word.
    """
    text = repr(float(value))
    mantissa, exponent, power = text.partition("e")
    return f"{mantissa}.0{exponent}{power}" if exponent and "." not in mantissa else text


def number_list_text(values: Iterable[float]) -> str:
    """Return numbers with commas between them."""
    return ", ".join(map(number_text, values))
