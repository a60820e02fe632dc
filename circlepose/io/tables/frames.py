"""Our own layouts as plain rows and as a data frame of pandas."""

from __future__ import annotations

import math
from collections.abc import Iterable
from importlib.util import find_spec
from typing import TYPE_CHECKING

from circlepose import _arguments
from circlepose.errors import UsageError
from circlepose.io.tables import DATA_LAYOUTS, DataLayout
from circlepose.io.tables.columns import TEXT_COLUMNS, WHOLE_NUMBER_COLUMNS, Row
from circlepose.io.tables.data_layouts import TABLES
from circlepose.results import ImageResult

if TYPE_CHECKING:
    import pandas

_EXPECTED = "an ImageResult, or several, as of estimate or measure"


def to_rows(results: ImageResult | Iterable[ImageResult], *, layout: DataLayout = "poses") -> list[Row]:
    """Return results as rows: one per image, circle and candidate, as in the tables of the command line.

    Parameters
    ----------
    results
        What `circlepose.estimate` returned, or several of them, such as `circlepose.measure` yields.
    layout
        `poses`; `boards`, a row per image, board and candidate; or `pairs`, a row per two circles of an image.

    Returns
    -------
    Mappings with all columns of the layout (docs/cli.md), in their order: texts, numbers and truths; None for
    an empty cell. An image without a pose has a row too: its status says why.

    Raises
    ------
    ArgumentError
        Where something else than results is given, or another layout.
    """
    _arguments.one_of(DATA_LAYOUTS, "layout", layout)
    table = TABLES[layout]
    return [
        {column: _plain(row.get(column)) for column in table.columns}
        for result in _several(results)
        for row in table.rows_of(_arguments.instance_of(ImageResult, "results", result, "of estimate or measure"))
    ]


def to_dataframe(results: ImageResult | Iterable[ImageResult], *, layout: DataLayout = "poses") -> pandas.DataFrame:
    """Return the rows of `to_rows` as a data frame of pandas.

    Parameters
    ----------
    results, layout
        As of `to_rows`.

    Returns
    -------
    The columns of the layout. Their types do not depend on the rows: numbers are float64 (NaN for an empty cell),
    whole numbers such as `instance` Int64, `chosen` boolean, texts object (None for an empty cell).

    Raises
    ------
    UsageError
        Where pandas is not installed.
    ArgumentError
        As of `to_rows`.
    """
    rows = to_rows(results, layout=layout)
    if find_spec("pandas") is None:
        raise UsageError("to_dataframe: needs pandas, which is not installed; run: pip install pandas.")
    import pandas  # noqa: PLC0415 - no dependency

    columns = TABLES[layout].columns
    return pandas.DataFrame(
        {name: pandas.Series([row[name] for row in rows], dtype=_dtype(name)) for name in columns}, columns=columns
    )


def _several(results: object) -> Iterable[object]:
    if isinstance(results, ImageResult):
        return [results]
    return results if hasattr(results, "__next__") else _arguments.parts("results", results, _EXPECTED)  # type: ignore[return-value]


def _plain(value: object) -> object:
    """Return a cell's value: texts that are no members of enumerations, None for what is no number."""
    if isinstance(value, str):
        return str(value)
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _dtype(column: str) -> str:
    if column in TEXT_COLUMNS:
        return "object"
    if column in WHOLE_NUMBER_COLUMNS:
        return "Int64"
    return "boolean" if column == "chosen" else "float64"
