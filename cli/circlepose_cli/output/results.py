"""Results to standard output or a file, in the form asked for."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import PurePath
from typing import IO

from circlepose.errors import UsageError
from circlepose.io.atomic import is_replaceable_file
from circlepose.io.remote.images import Place, RemoteFile
from circlepose.io.tables import Layout
from circlepose.io.tables.data_layouts import DataFormat, is_data_layout, table_header
from circlepose.io.tables.paper_layouts import write_results
from circlepose.io.tables.reference import Reference
from circlepose.io.tables.selection import EVERYTHING, Selection, read_columns
from circlepose.results import ImageResult
from circlepose_cli.options.declared import FormatChoice

_BY_SUFFIX = {
    ".csv": FormatChoice.CSV,
    ".tsv": FormatChoice.TSV,
    ".json": FormatChoice.JSON,
    ".jsonl": FormatChoice.JSONL,
    ".ndjson": FormatChoice.JSONL,
    ".parquet": FormatChoice.PARQUET,
}
DELIMITERS = {FormatChoice.CSV: ",", FormatChoice.TSV: "\t"}
_DATA_FORMATS: dict[FormatChoice, DataFormat] = {
    FormatChoice.CSV: "csv",
    FormatChoice.TSV: "tsv",
    FormatChoice.JSON: "json",
    FormatChoice.JSONL: "jsonl",
}


def choose_format(
    asked: FormatChoice | None, output: Place | None, *, to_terminal: bool, of_estimate: bool = True
) -> FormatChoice:
    """Return the form asked for, or else a table for a terminal, what a file's ending names, csv for a pipe.

    Raises `UsageError` for an ending that names no form, and for Parquet where it cannot be.
    """
    form = asked if asked is not None else _usual_format(output, to_terminal=to_terminal)
    if form is FormatChoice.PARQUET and not of_estimate:
        raise UsageError("--format parquet: only estimate writes Parquet; give csv, tsv, json or jsonl.")
    if form is FormatChoice.PARQUET and (output is None or is_compressed(output)):
        raise UsageError("--format parquet: needs -o FILE, whose name does not end in .gz.")
    return form


def _usual_format(output: Place | None, *, to_terminal: bool) -> FormatChoice:
    if output is None:
        return FormatChoice.TABLE if to_terminal else FormatChoice.CSV
    if not output.name or (not isinstance(output, RemoteFile) and not is_replaceable_file(output)):
        # A device, a pipe, or a folder, which is refused when it is opened.
        return FormatChoice.CSV
    name = PurePath(output.name[:-3] if is_compressed(output) else output.name)
    form = _BY_SUFFIX.get(name.suffix.lower())
    if form is None:
        ending = f"the ending {PurePath(output.name).suffix} names no form" if name.suffix else "has no ending"
        raise UsageError(
            f"-o {output}: {ending}; expected .csv, .tsv, .json, .jsonl (each also with .gz) or .parquet, "
            "or give --format."
        )
    return form


def is_compressed(output: Place) -> bool:
    """Return whether the name of an output asks for gzip."""
    return output.name.lower().endswith(".gz")


def choose_rows(
    typed_columns: str | None, *, chosen_only: bool, output_format: FormatChoice, layouts: Sequence[Layout]
) -> Selection:
    """Return the rows and columns asked for; raises `UsageError` where columns cannot be chosen.

    Where more than one of `layouts` is possible yet, a column of any of them will do.
    """
    if typed_columns is None:
        return Selection(chosen_only=chosen_only)
    known: dict[str, tuple[str, ...]] = {}
    for layout in layouts:
        if not is_data_layout(layout):
            raise UsageError(
                f"--columns: goes with --layout poses, boards or pairs; {layout} has the columns of its paper."
            )
        known[layout] = table_header(layout)
    if output_format in (FormatChoice.JSON, FormatChoice.JSONL):
        raise UsageError(
            f"--columns: goes with csv, tsv, parquet and table; {output_format} always has all keys, "
            "which jq, for example, selects."
        )
    first = known.pop(layouts[0])
    return Selection(read_columns("--columns", typed_columns, first, known), chosen_only)


def write_output(
    results: Iterable[ImageResult],
    handle: IO[str] | IO[bytes],
    *,
    output_format: FormatChoice,
    layout: Layout,
    reference: Reference | None = None,
    selection: Selection = EVERYTHING,
) -> None:
    """Write `results` to `handle`, binary for Parquet and text otherwise; `reference` for the layout `table2`."""
    if output_format is FormatChoice.TABLE:
        from circlepose_cli.output.table import write_table  # noqa: PLC0415 - needs rich

        write_table(results, handle, layout, reference, selection)  # type: ignore[arg-type]
    elif output_format is FormatChoice.PARQUET:
        from circlepose.io.tables.parquet import write_parquet  # noqa: PLC0415 - few ask for it

        assert is_data_layout(layout)
        write_parquet(results, handle, selection, layout)  # type: ignore[arg-type]
    else:
        data_format = _DATA_FORMATS[output_format]
        write_results(
            results,
            handle,  # type: ignore[arg-type]
            data_format=data_format,
            layout=layout,
            reference=reference,
            selection=selection,
        )
