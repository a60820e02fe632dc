"""Which rows and columns of a layout are written: those that the user asked for."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from difflib import get_close_matches

from circlepose.errors import UsageError
from circlepose.io.tables.columns import Row


@dataclass(frozen=True, slots=True)
class Selection:
    """All rows and columns, unless fields say less."""

    columns: tuple[str, ...] | None = None
    """names of columns of the layout, in the order to write them; None for all"""
    chosen_only: bool = False
    """leave out the candidates that are not chosen; what failed stays"""

    def rows(self, rows: Iterable[Row]) -> Iterator[Row]:
        """Yield the rows of our own layouts that are written, with all their fields."""
        return (row for row in rows if not (self.chosen_only and row.get("chosen") is False))

    def printed_rows(self, rows: Iterable[Row]) -> Iterator[Row]:
        """Yield the rows of a printed table that are written."""
        return (row for row in rows if not (self.chosen_only and row.get("Candidate") == "other"))


EVERYTHING = Selection()


def read_columns(option: str, typed: str, known: tuple[str, ...]) -> tuple[str, ...]:
    """Return those of the columns `known` that are written as NAME,NAME,...; raises `UsageError`."""
    names = tuple(name.strip() for name in typed.split(","))
    for place, name in enumerate(names):
        if name not in known:
            close = get_close_matches(name, known, n=3, cutoff=0.5)
            meant = f"did you mean {' or '.join(close)}? " if close else ""
            raise UsageError(f"{option}: there is no column {name!r}; {meant}the columns are: {', '.join(known)}.")
        if name in names[:place]:
            raise UsageError(f"{option}: {name} is there twice.")
    return names
