"""Which rows and columns of a layout are written: those that the user asked for."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from itertools import chain

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


def read_columns(
    option: str, typed: str, known: tuple[str, ...], others: Mapping[str, tuple[str, ...]] | None = None
) -> tuple[str, ...]:
    """Return those of the columns `known` that are written as NAME,NAME,...; raises `UsageError`.

    `others` are those of further layouts, by name, where it is not settled yet which will be written.
    """
    names = tuple(name.strip() for name in typed.split(","))
    further = {layout: [each for each in its if each not in known] for layout, its in (others or {}).items()}
    every = list(dict.fromkeys(chain(known, *further.values())))
    unknown = list(dict.fromkeys(name for name in names if name not in every))
    if unknown:
        most = 3 if len(unknown) == 1 else 1
        close = [each for name in unknown for each in get_close_matches(name, every, n=most, cutoff=0.5)]
        meant = f"did you mean {(' or ' if most > 1 else ', ').join(dict.fromkeys(close))}? " if close else ""
        what = "there is no column" if len(unknown) == 1 else "there are no columns"
        also = "".join(f"; of {layout} also: {', '.join(its)}" for layout, its in further.items())
        raise UsageError(
            f"{option}: {what} {', '.join(map(repr, unknown))}; {meant}the columns are: {', '.join(known)}{also}."
        )
    for place, name in enumerate(names):
        if name in names[:place]:
            raise UsageError(f"{option}: {name} is there twice.")
    return names
