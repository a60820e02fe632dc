"""The terminal that a table is printed to: its width, and whether it shows colors."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import IO

from rich.console import Console
from rich.text import Text

_USUAL_WIDTH = 80
_NARROWEST = 20
"""A terminal that claims to be narrower gets lines of this width: shorter ones would have to split numbers."""


@dataclass(frozen=True, slots=True)
class Screen:
    """Where lines go."""

    width: int | None
    """in cells; None where there is no terminal, so that nothing has to be left out"""
    console: Console

    @classmethod
    def of(cls, handle: IO[str]) -> Screen:
        """Return the screen behind `handle`, which may also be a file or a pipe."""
        is_terminal = handle.isatty()
        # Without the force, FORCE_COLOR and its kin would color a file.
        shows_colors = is_terminal and not os.environ.get("NO_COLOR")
        console = Console(file=handle, force_terminal=shows_colors, highlight=False, width=_USUAL_WIDTH)
        return cls(terminal_width(handle) if is_terminal else None, console)

    def print(self, line: Text) -> None:
        """Print one line, which is not folded."""
        self.console.print(line, soft_wrap=True)


def terminal_width(handle: IO[str]) -> int:
    """Return the width of the terminal behind `handle`: COLUMNS where that is a number from 1, else what it says."""
    typed = os.environ.get("COLUMNS", "")
    if typed.isdecimal() and 0 < len(typed) < 6 and int(typed) > 0:
        width = int(typed)
    else:
        try:
            width = os.get_terminal_size(handle.fileno()).columns
        except (OSError, ValueError, AttributeError):
            width = 0
    return max(width or _USUAL_WIDTH, _NARROWEST)
