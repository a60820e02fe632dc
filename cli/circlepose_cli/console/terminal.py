"""How wide the terminal is, and reports in words that fit it."""

from __future__ import annotations

import os
import re
from textwrap import wrap
from typing import IO

_USUAL_WIDTH = 80
NARROWEST = 20
"""A terminal that claims to be narrower gets lines of this width: shorter ones would have to split numbers."""
_LEAST_ROOM = 24
"""Lines below a column have at least this width, or begin at the left."""


def width_of(handle: IO[str]) -> int | None:
    """Return the width of the terminal behind `handle`: COLUMNS where that is a number from 1, else what it says.

    None where there is no terminal: nothing has to be left out then.
    """
    if not handle.isatty():
        return None
    typed = os.environ.get("COLUMNS", "")
    if typed.isdecimal() and 0 < len(typed) < 6 and int(typed) > 0:
        width = int(typed)
    else:
        try:
            width = os.get_terminal_size(handle.fileno()).columns
        except (OSError, ValueError, AttributeError):
            width = 0
    return max(width or _USUAL_WIDTH, NARROWEST)


def fitted(report: str, handle: IO[str], indent: int | None = None) -> str:
    """Return a report with its lines broken between words where they are longer than the terminal of `handle`.

    What follows is set below the last column of its line, or `indent` cells in.
    """
    width = width_of(handle)
    if width is None:
        return report
    return "\n".join(part for line in report.split("\n") for part in _parts(line, width, indent))


def _parts(line: str, width: int, indent: int | None) -> list[str]:
    columns = [match.end() for match in re.finditer(r"\s{2,}|^\s+", line)] if indent is None else [indent]
    indents = [" " * column for column in columns if column <= width - _LEAST_ROOM]
    below = indents[-1] if indents else ""
    return wrap(line, width, subsequent_indent=below, break_long_words=False, break_on_hyphens=False) or [""]
