"""Results to standard output or a file, in the form asked for."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import PurePath
from typing import TextIO

from circlepose.files.layouts import DataFormat, write_results
from circlepose.files.reference import Reference
from circlepose.files.remote import Place
from circlepose.pose import ImageResult
from circlepose_cli.options import FormatChoice, LayoutChoice

_BY_SUFFIX = {".json": FormatChoice.JSON, ".jsonl": FormatChoice.JSONL, ".ndjson": FormatChoice.JSONL}
_DATA_FORMATS: dict[FormatChoice, DataFormat] = {
    FormatChoice.CSV: "csv",
    FormatChoice.JSON: "json",
    FormatChoice.JSONL: "jsonl",
}


def choose_format(asked: FormatChoice | None, output: Place | None, *, to_terminal: bool) -> FormatChoice:
    """Return the form asked for, or else a table for a terminal, what a file's ending says, csv for a pipe."""
    if asked is not None:
        return asked
    if output is not None:
        return _BY_SUFFIX.get(PurePath(output.name).suffix.lower(), FormatChoice.CSV)
    return FormatChoice.TABLE if to_terminal else FormatChoice.CSV


def write_output(
    results: Iterable[ImageResult],
    handle: TextIO,
    *,
    output_format: FormatChoice,
    layout: LayoutChoice,
    reference: Reference | None = None,
) -> None:
    """Write `results` to `handle`; `reference` for the layout `table2`."""
    if output_format is FormatChoice.TABLE:
        from circlepose_cli.table import write_table  # noqa: PLC0415 - needs rich

        write_table(results, handle, layout.value, reference)
    else:
        data_format = _DATA_FORMATS[output_format]
        write_results(results, handle, data_format=data_format, layout=layout.value, reference=reference)
