"""Our own layouts of the results: their columns, their rows, and how each is written as data."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Literal, TextIO, TypeGuard

from circlepose.io.tables import DATA_LAYOUTS, DataLayout, Layout
from circlepose.io.tables.board_records import BOARDS_SCHEMA, board_image_record
from circlepose.io.tables.board_rows import BOARD_COLUMNS, board_rows
from circlepose.io.tables.columns import COLUMNS, Row, pose_rows, write_csv_rows
from circlepose.io.tables.json_records import POSES_SCHEMA, image_record, write_json_document, write_json_lines
from circlepose.io.tables.pair_rows import PAIR_COLUMNS, PAIRS_SCHEMA, pair_record, pair_rows
from circlepose.io.tables.selection import EVERYTHING, Selection
from circlepose.results import ImageResult

DataFormat = Literal["csv", "tsv", "json", "jsonl"]


@dataclass(frozen=True, slots=True)
class DataTable:
    """A layout: its columns, and what makes the rows and the JSON of an image."""

    columns: tuple[str, ...]
    rows_of: Callable[[ImageResult], Iterable[Row]]
    schema: str
    key: str
    """of the JSON document, whose value is the list of all records"""
    records_of: Callable[[ImageResult, bool], Iterable[Row]]
    """its records in JSON; the second argument is whether the chosen candidates alone are asked for"""


TABLES: Mapping[DataLayout, DataTable] = {
    "poses": DataTable(
        COLUMNS,
        pose_rows,
        POSES_SCHEMA,
        "images",
        lambda result, chosen_only: [image_record(result, chosen_only=chosen_only)],
    ),
    "boards": DataTable(
        BOARD_COLUMNS,
        board_rows,
        BOARDS_SCHEMA,
        "images",
        lambda result, chosen_only: [board_image_record(result, chosen_only=chosen_only)],
    ),
    "pairs": DataTable(
        PAIR_COLUMNS,
        pair_rows,
        PAIRS_SCHEMA,
        "rows",
        lambda result, _chosen_only: map(pair_record, pair_rows(result)),
    ),
}


def is_data_layout(layout: Layout) -> TypeGuard[DataLayout]:
    """Return whether a layout is one of ours, and not that of a paper."""
    return layout in DATA_LAYOUTS


def table_header(layout: DataLayout, selection: Selection = EVERYTHING) -> tuple[str, ...]:
    """Return the columns of a layout that are written."""
    return TABLES[layout].columns if selection.columns is None else selection.columns


def table_rows(result: ImageResult, layout: DataLayout, selection: Selection = EVERYTHING) -> Iterable[Row]:
    """Return the rows of an image that are written, with all their fields."""
    return selection.rows(TABLES[layout].rows_of(result))


def write_data(
    results: Iterable[ImageResult],
    handle: TextIO,
    *,
    data_format: DataFormat,
    layout: DataLayout,
    selection: Selection = EVERYTHING,
) -> None:
    """Write all `results` to `handle` in one of the data formats; JSON has all keys, whatever the columns."""
    table = TABLES[layout]

    def records_of(result: ImageResult) -> Iterable[Row]:
        return table.records_of(result, selection.chosen_only)

    def rows_of(result: ImageResult) -> Iterable[Row]:
        return table_rows(result, layout, selection)

    if data_format == "json":
        write_json_document(table.schema, table.key, records_of, results, handle)
    elif data_format == "jsonl":
        write_json_lines(table.schema, records_of, results, handle)
    else:
        delimiter = "\t" if data_format == "tsv" else ","
        write_csv_rows(table_header(layout, selection), rows_of, results, handle, delimiter=delimiter)
