"""Sizes of paper."""

from __future__ import annotations

import math
import re

from circlepose.errors import UsageError

PAPERS: dict[str, tuple[float, float]] = {
    "a5": (148.0, 210.0),
    "a4": (210.0, 297.0),
    "a3": (297.0, 420.0),
    "a2": (420.0, 594.0),
    "a1": (594.0, 841.0),
    "a0": (841.0, 1189.0),
    "letter": (215.9, 279.4),
    "legal": (215.9, 355.6),
    "tabloid": (279.4, 431.8),
}
"""width and height, mm"""
_OWN = re.compile(r"(\d{1,5}(?:\.\d{1,3})?)[xX](\d{1,5}(?:\.\d{1,3})?)")


def paper_mm(text: str) -> tuple[float, float]:
    """Return width and height in mm of a paper by its name, or written as WxH; raises `UsageError`."""
    named = PAPERS.get(text.strip().lower())
    if named is not None:
        return named
    own = _OWN.fullmatch(text.strip())
    width, height = (float(own[1]), float(own[2])) if own else (math.nan, math.nan)
    if not (width > 0.0 and height > 0.0):
        names = ", ".join(name.upper() if name[0] == "a" else name for name in PAPERS)
        raise UsageError(f"--paper: expected {names}, or WIDTHxHEIGHT in mm such as 210x297, got {text!r}.")
    return width, height
