"""The terminal that a table is printed to: its width, and whether it shows colors."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import IO

from rich.console import Console
from rich.text import Text

from circlepose_cli.console.terminal import width_of

_ANY_WIDTH = 80
"""Rich folds no line here; left to itself it would print nothing where COLUMNS is 0."""


@dataclass(frozen=True, slots=True)
class Screen:
    """Where lines go."""

    width: int | None
    """in cells; None where there is no terminal, so that nothing has to be left out"""
    console: Console

    @classmethod
    def of(cls, handle: IO[str]) -> Screen:
        """Return the screen behind `handle`, which may also be a file or a pipe."""
        # Without the force, FORCE_COLOR and its kin would color a file.
        shows_colors = handle.isatty() and not os.environ.get("NO_COLOR")
        console = Console(file=handle, force_terminal=shows_colors, highlight=False, width=_ANY_WIDTH)
        return cls(width_of(handle), console)

    def print(self, line: Text) -> None:
        """Print one line, which is not folded."""
        self.console.print(line, soft_wrap=True)
