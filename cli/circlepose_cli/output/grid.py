"""Tables for people: columns that fit the terminal, with no number folded, split or cut.

What does not fit is tried in this order: a smaller gap, headers on several lines, names shortened in their middle and
words on several lines, columns left out (named below the table), and at last one value a line.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import IO, Literal, TypeAlias

from rich.cells import cell_len
from rich.text import Text

from circlepose_cli.output.screen import Screen

_SHORTEST_NAME = 12
_MARGIN = 1
Kind: TypeAlias = Literal["number", "words", "name"]
Line: TypeAlias = Text


@dataclass(frozen=True, slots=True)
class Column:
    """What a column holds."""

    header: str
    """one line or, with line ends, several"""
    kind: Kind = "words"
    """a number stands as it is, words may go on several lines, a name may be shortened in its middle"""
    rank: int = 0
    """columns of the highest rank are left out first, those of rank 0 never"""


@dataclass(frozen=True, slots=True)
class Row:
    """A cell for each column."""

    cells: tuple[str, ...]
    """each one line or, with line ends, several"""
    style: str = ""
    styles: tuple[tuple[int, str], ...] = ()
    """number of a column, and the style of its cell"""
    heading: str = ""
    """a line of its own above the row"""
    whole: tuple[str, ...] = ()
    """the cells before repeats were blanked, where they were"""


@dataclass(frozen=True, slots=True)
class Grid:
    """A table whose place is not known yet."""

    columns: tuple[Column, ...]
    rows: tuple[Row, ...]
    title: str = ""
    how_to_get: str = "--format csv"
    """what shows columns that are left out"""


@dataclass(frozen=True, slots=True)
class _Fit:
    kept: tuple[int, ...]
    widths: tuple[int, ...]
    gap: int
    headers: tuple[tuple[str, ...], ...]


def print_grid(handle: IO[str], *forms: Grid) -> None:
    """Print the first of several forms of a table that fits the place of `handle`, else one value a line."""
    screen = Screen.of(handle)
    for line in grid_lines(forms, screen.width):
        screen.print(line)


def grid_lines(forms: Sequence[Grid], width: int | None) -> Iterator[Line]:
    """Yield the lines of the first of several forms of a table that fits `width`, else one value a line."""
    first = forms[0]
    if first.title:
        yield Text(shortened(first.title, width))
    # Another form rather than a column left out; only the last has nothing after it.
    for form, complete in (*((form, True) for form in forms[:-1]), *((form, False) for form in forms)):
        fit = _fitted(form, width, complete=complete)
        if fit is not None:
            yield from _table_lines(form, fit, width)
            yield from _left_out_lines(form, fit, width)
            return
    yield from _list_lines(first, width or 1)


def shortened(name: str, width: int | None) -> str:
    """Return `name` in at most `width` cells, its middle replaced where it is longer."""
    if width is None or cell_len(name) <= width:
        return name
    if width < 3:
        return "…" if width > 0 else ""
    tail = _last_cells(name, (width - 1) // 2)
    return f"{_first_cells(name, width - 1 - cell_len(tail))}…{tail}"


def wrapped(text: str, width: int) -> list[str]:
    """Return the words of `text` on lines of at most `width` cells; only a word that is longer is shortened."""
    lines: list[str] = []
    for word in text.split():
        if lines and cell_len(lines[-1]) + 1 + cell_len(word) <= width:
            lines[-1] += f" {word}"
        else:
            lines.append(shortened(word, width))
    return lines or [""]


def _first_cells(name: str, width: int) -> str:
    end = 0
    while end < len(name) and cell_len(name[: end + 1]) <= width:
        end += 1
    return name[:end]


def _last_cells(name: str, width: int) -> str:
    start = len(name)
    while start > 0 and cell_len(name[start - 1 :]) <= width:
        start -= 1
    # A combining mark would join what is written before it.
    while start < len(name) and cell_len(name[start]) == 0:
        start += 1
    return name[start:]


def _fitted(grid: Grid, width: int | None, *, complete: bool) -> _Fit | None:
    """Return how `grid` fits `width`, if `complete` with all columns; None where it does not."""
    everything = tuple(range(len(grid.columns)))
    if width is None:
        return _fit(grid, everything, 2, None, wraps=False)
    ranks = sorted({column.rank for column in grid.columns if column.rank}, reverse=True)
    for most in (None, *(() if complete else ranks)):
        kept = tuple(n for n in everything if most is None or grid.columns[n].rank < most)
        for gap, wraps in ((2, False), (2, True), (1, True)):
            fit = _fit(grid, kept, gap, width, wraps=wraps)
            if fit is not None:
                return fit
    return None


def _fit(grid: Grid, kept: tuple[int, ...], gap: int, width: int | None, *, wraps: bool) -> _Fit | None:
    cells = {n: [row.cells[n] for row in grid.rows] for n in kept}
    natural = {n: max(map(cell_len, _lines_of(cells[n])), default=0) for n in kept}
    least = {n: _least(grid.columns[n], cells[n], natural[n], gap) for n in kept}
    for n in kept:
        header = grid.columns[n].header
        least[n] = max(least[n], _longest_word([header]) if wraps else max(map(cell_len, header.split("\n"))))
        natural[n] = max(natural[n], least[n])
    if width is not None:
        room = width - _MARGIN - gap * (len(kept) - 1)
        # The widest gives way first, so that none becomes much narrower than another.
        while sum(natural.values()) > room:
            able = [n for n in kept if natural[n] > least[n]]
            if not able:
                return None
            natural[max(able, key=lambda n: natural[n])] -= 1
    headers = (grid.columns[n].header for n in kept)
    lines = tuple(
        tuple(wrapped(header, natural[n]) if wraps else header.split("\n"))
        for n, header in zip(kept, headers, strict=True)
    )
    return _Fit(kept, tuple(natural[n] for n in kept), gap, lines)


def _least(column: Column, cells: Sequence[str], natural: int, gap: int) -> int:
    """Return the narrowest width for the cells of a column; only a small gap goes with shortened names."""
    if column.kind == "number":
        return natural
    if column.kind == "words":
        return _longest_word(cells)
    return min(natural, _SHORTEST_NAME if gap == 1 else 2 * _SHORTEST_NAME)


def _longest_word(texts: Sequence[str]) -> int:
    return max((cell_len(word) for text in texts for word in text.split()), default=0)


def _table_lines(grid: Grid, fit: _Fit, width: int | None) -> Iterator[Line]:
    columns = [grid.columns[n] for n in fit.kept]
    height = max(map(len, fit.headers))
    for line in range(height):
        words = [(*[""] * (height - len(header)), *header)[line] for header in fit.headers]
        yield _joined(columns, words, fit, [""] * len(words))
    yield Text(" " * _MARGIN + "─" * (sum(fit.widths) + fit.gap * (len(fit.widths) - 1)), style="dim")
    for row in grid.rows:
        if row.heading:
            yield Text(shortened(row.heading, width))
        styles = dict(row.styles)
        cells = [
            _cell_lines(column, row.cells[n], wide)
            for n, column, wide in zip(fit.kept, columns, fit.widths, strict=True)
        ]
        for line in range(max(map(len, cells))):
            words = [cell[line] if line < len(cell) else "" for cell in cells]
            yield _joined(columns, words, fit, [styles.get(n, row.style) for n in fit.kept])


def _cell_lines(column: Column, text: str, width: int) -> list[str]:
    if column.kind == "number":
        return text.split("\n")
    if column.kind == "name":
        return [shortened(text, width)]
    return [
        part for line in text.split("\n") for part in (wrapped(line, width) if cell_len(line) > width else [line])
    ]


def _one_line(header: str) -> str:
    return header.replace("\n", " ")


def _lines_of(cells: Sequence[str]) -> list[str]:
    return [line for cell in cells for line in cell.split("\n")]


def _joined(columns: Sequence[Column], words: Sequence[str], fit: _Fit, styles: Sequence[str]) -> Line:
    line = Text(" " * _MARGIN)
    for place, (column, word, width, style) in enumerate(zip(columns, words, fit.widths, styles, strict=True)):
        space = " " * (width - cell_len(word))
        before, behind = (space, "") if column.kind == "number" else ("", space)
        line.append(" " * fit.gap * bool(place) + before)
        line.append(word, style=style)
        line.append(behind)
    line.rstrip()
    return line


def _left_out_lines(grid: Grid, fit: _Fit, width: int | None) -> Iterator[Line]:
    names = [_one_line(column.header) for n, column in enumerate(grid.columns) if n not in fit.kept]
    if not names or width is None:
        return
    wide = next(wide for wide in range(width, 10_000) if _fitted(grid, wide, complete=True) is not None)
    note = f"not shown: {', '.join(names)}; a terminal of {wide} columns shows all, or {grid.how_to_get}"
    for line in wrapped(note, width):
        yield Text(line, style="dim")


def _list_lines(grid: Grid, width: int) -> Iterator[Line]:
    """Yield one value a line, for terminals that are narrower than any table."""
    for number, row in enumerate(grid.rows):
        if number:
            yield Text()
        styles = dict(row.styles)
        for n, (column, cell) in enumerate(zip(grid.columns, row.whole or row.cells, strict=True)):
            if not cell.strip():
                continue
            style = styles.get(n, row.style)
            label = f"{_one_line(column.header)} "
            if column.kind == "name":
                lines = [shortened(cell, width)]
            elif cell_len(label) + cell_len(cell.strip()) <= width:
                lines = [label + cell.strip()]
            else:
                lines = [*wrapped(column.header, width), *wrapped(cell, width)]
            yield from (Text(line, style=style) for line in lines)


def without_repeats(rows: Sequence[Row], columns: int) -> tuple[Row, ...]:
    """Return `rows` with those of the first `columns` cells blank that say what the row above says."""
    made = []
    above: tuple[str, ...] = ()
    for row in rows:
        same = 0
        while same < min(columns, len(above)) and row.cells[same] == above[same]:
            same += 1
        made.append(replace(row, cells=("",) * same + row.cells[same:], whole=row.cells))
        above = row.cells
    return tuple(made)
