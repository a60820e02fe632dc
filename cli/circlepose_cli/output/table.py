"""Results as a table for people; the data formats hold more."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TextIO

from circlepose.io.tables import DataLayout, Layout, paper_layouts
from circlepose.io.tables.columns import Row
from circlepose.io.tables.data_layouts import is_data_layout, table_rows
from circlepose.io.tables.reference import Reference
from circlepose.io.tables.selection import EVERYTHING, Selection
from circlepose.results import ImageResult
from circlepose_cli.output.board_table import board_forms
from circlepose_cli.output.grid import Column, Grid, print_grid, without_repeats
from circlepose_cli.output.grid import Row as Line
from circlepose_cli.output.pair_table import pair_forms
from circlepose_cli.output.pose_table import chosen_columns_form, pose_forms, shown

_FORMS: Mapping[DataLayout, Callable[[Sequence[Row]], tuple[Grid, ...]]] = {
    "poses": pose_forms,
    "boards": board_forms,
    "pairs": pair_forms,
}
"""forms of a table, the widest first"""


def write_table(
    results: Iterable[ImageResult],
    handle: TextIO,
    layout: Layout,
    reference: Reference | None = None,
    selection: Selection = EVERYTHING,
) -> None:
    """Write a table of all `results` when they have ended: the chosen candidates, the others dimmed."""
    if not is_data_layout(layout):
        print_grid(handle, _printed(results, layout, reference, selection))
        return
    rows = [row for result in results for row in table_rows(result, layout, selection)]
    forms = _FORMS[layout](rows) if selection.columns is None else (chosen_columns_form(rows, selection.columns),)
    print_grid(handle, *forms)


def _printed(
    results: Iterable[ImageResult], layout: Layout, reference: Reference | None, selection: Selection
) -> Grid:
    columns, rows_of = paper_layouts.columns_and_rows(layout, reference)
    rows = [
        paper_layouts.printed(row, columns) for result in results for row in selection.printed_rows(rows_of(result))
    ]
    if layout == "table1":
        # In print the methods are compared one below the other; data formats go image by image.
        order = {method: place for place, method in enumerate(dict.fromkeys(row["Method"] for row in rows))}
        rows.sort(key=lambda row: order[row["Method"]])
    made = [Line(tuple("--" if value in (None, "") else shown(value) for value in row.values())) for row in rows]
    names = ("Image", "Scene")
    return Grid(
        tuple(
            Column(column, "name" if column in names else "words", int(column == paper_layouts.AMBIGUITY))
            for column in columns
        ),
        without_repeats(made, 1),
    )
