"""Our own layouts as Parquet. Needs pyarrow, which comes with the extra `tables`."""

from __future__ import annotations

import math
from collections.abc import Iterable
from importlib.util import find_spec
from itertools import chain, islice
from typing import Any, BinaryIO

from circlepose.errors import UsageError
from circlepose.io.tables import DataLayout
from circlepose.io.tables.columns import TEXT_COLUMNS, WHOLE_NUMBER_COLUMNS
from circlepose.io.tables.data_layouts import TABLES, table_header, table_rows
from circlepose.io.tables.selection import EVERYTHING, Selection
from circlepose.io.text.escaping import quoted
from circlepose.results import ImageResult

_BATCH_ROWS = 10_000


def require_parquet() -> None:
    """Raise `UsageError` unless pyarrow is installed."""
    if find_spec("pyarrow") is None:
        raise UsageError("Parquet needs pyarrow, which is not installed; run: pip install 'circlepose[tables]'")


def write_parquet(
    results: Iterable[ImageResult],
    handle: BinaryIO,
    selection: Selection = EVERYTHING,
    layout: DataLayout = "poses",
) -> None:
    """Write the rows of all `results` with typed columns; null where a table of text has an empty cell."""
    require_parquet()
    import pyarrow  # noqa: PLC0415 - an extra
    from pyarrow import parquet  # noqa: PLC0415

    header = table_header(layout, selection)
    fields = [(name, _kind(name, pyarrow)) for name in header]
    schema = pyarrow.schema(fields, metadata={"schema": TABLES[layout].schema})
    rows = chain.from_iterable(table_rows(result, layout, selection) for result in results)
    with parquet.ParquetWriter(handle, schema) as writer:
        while batch := list(islice(rows, _BATCH_ROWS)):
            columns = {name: [_value(row.get(name)) for row in batch] for name in header}
            writer.write_table(pyarrow.table(columns, schema=schema))


def _kind(name: str, pyarrow: Any) -> Any:
    if name in TEXT_COLUMNS:
        return pyarrow.string()
    if name in WHOLE_NUMBER_COLUMNS:
        return pyarrow.int32()
    return pyarrow.bool_() if name == "chosen" else pyarrow.float64()


def _value(value: object) -> object:
    if isinstance(value, str):
        return quoted(str(value))
    return None if isinstance(value, float) and not math.isfinite(value) else value
