"""A Parquet file, read back with what its readers use, is the CSV with types."""

from __future__ import annotations

import csv
import importlib
import io
import math
from dataclasses import replace

import numpy as np
import pytest

from circlepose.io.tables import parquet as tables
from circlepose.io.tables.columns import COLUMNS, TEXT_COLUMNS, WHOLE_NUMBER_COLUMNS, cell, csv_text, write_csv
from circlepose.results import ImageResult, Status
from tests.support.discs import made_circle, made_result

pytest.importorskip("pyarrow")

RESULTS = [
    made_result(made_circle(covariance=np.diag([1e-4, 4e-4, 9e-4, 1e-8, 1e-8])), image="a.png"),
    made_result(made_circle(instance=3, method="fu-zhou"), image="\u00e9 \u4e2d,\n\udce9 =.png"),
    ImageResult("bad.png", Status.NO_CIRCLE, "nothing"),
    made_result(replace(made_circle(), status=Status.NO_POSE, candidates=(), residual_px=math.nan), image="c.png"),
    made_result(replace(made_circle(), residual_px=math.inf, ambiguity=-0.0), image="=d.png"),
]


def kind(column):
    if column in TEXT_COLUMNS:
        return "text"
    return "whole" if column in WHOLE_NUMBER_COLUMNS else "truth" if column == "chosen" else "number"


def by_pandas(path):
    pandas = importlib.import_module("pandas")
    frame = pandas.read_parquet(path, dtype_backend="numpy_nullable")
    kinds = {"string": "text", "Int32": "whole", "boolean": "truth", "Float64": "number"}
    rows = [[None if value is pandas.NA else value for value in row] for row in frame.itertuples(index=False)]
    return {name: kinds[str(dtype)] for name, dtype in frame.dtypes.items()}, rows


def by_polars(path):
    polars = importlib.import_module("polars")
    frame = polars.read_parquet(path)
    kinds = {polars.String: "text", polars.Int32: "whole", polars.Boolean: "truth", polars.Float64: "number"}
    return {name: kinds[dtype] for name, dtype in frame.schema.items()}, frame.rows()


def by_duckdb(path):
    relation = importlib.import_module("duckdb").read_parquet(str(path))
    kinds = {"VARCHAR": "text", "INTEGER": "whole", "BOOLEAN": "truth", "DOUBLE": "number"}
    types = dict(zip(relation.columns, (kinds[str(each)] for each in relation.types), strict=True))
    return types, relation.fetchall()


READERS = {"pandas": by_pandas, "polars": by_polars, "duckdb": by_duckdb}


@pytest.mark.parametrize("reader", READERS)
def test_what_is_read_back_is_the_csv_with_types(tmp_path, reader):
    pytest.importorskip(reader, reason=f"{reader} is not installed; pip install 'circlepose[test-tables]'")
    with (tmp_path / "t.parquet").open("wb") as handle:
        tables.write_parquet(RESULTS, handle)
    text = io.StringIO()
    write_csv(RESULTS, text)
    expected = list(csv.DictReader(io.StringIO(text.getvalue())))
    types, rows = READERS[reader](tmp_path / "t.parquet")
    assert types == {column: kind(column) for column in COLUMNS}
    assert list(types) == list(COLUMNS)
    assert len(rows) == len(expected) == 8
    for row, cells in zip(rows, expected, strict=True):
        for column, value in zip(types, row, strict=True):
            assert not (isinstance(value, float) and math.isnan(value)), column
            assert shown(column, value) == cells[column], column


def shown(column, value):
    """The CSV's cell of a value that was read: with the CSV's decimals, and its guard against formulas."""
    if value is None:
        return ""
    if column in TEXT_COLUMNS:
        return value if not value.startswith("=") else f"'{value}"
    return cell(column, bool(value) if column == "chosen" else value if kind(column) == "whole" else float(value))


def test_numbers_are_there_at_full_precision(tmp_path):
    from pyarrow import parquet  # noqa: PLC0415 - an extra

    with (tmp_path / "t.parquet").open("wb") as handle:
        tables.write_parquet(RESULTS[:1], handle)
    read = parquet.read_table(tmp_path / "t.parquet")
    centers = [candidate.center[2] for candidate in RESULTS[0].circles[0].candidates]
    assert read.column("center_z_mm").to_pylist() == centers
    assert read.column("generatrix_mm").null_count == 2
    assert read.schema.metadata[b"schema"] == b"circlepose.poses/1"


def test_a_name_is_read_as_from_a_csv():
    text = io.StringIO()
    write_csv(RESULTS, text)
    names = [csv_text(row["image"]) for row in csv.DictReader(io.StringIO(text.getvalue()))]
    assert list(dict.fromkeys(names)) == [result.image for result in RESULTS]


def test_rows_are_written_as_they_come(tmp_path, monkeypatch):
    """A run of millions of images does not gather them in memory."""
    from pyarrow import parquet  # noqa: PLC0415 - an extra

    monkeypatch.setattr(tables, "_BATCH_ROWS", 4)
    sizes = []
    with (tmp_path / "t.parquet").open("wb") as handle:

        def measured():
            for number in range(10):
                sizes.append(handle.tell())
                yield made_result(image=f"{number}.png")

        tables.write_parquet(measured(), handle)
    assert len(set(sizes)) >= 5
    assert parquet.ParquetFile(tmp_path / "t.parquet").num_row_groups == 5


def test_no_image_is_a_table_without_rows(tmp_path):
    from pyarrow import parquet  # noqa: PLC0415 - an extra

    with (tmp_path / "t.parquet").open("wb") as handle:
        tables.write_parquet([], handle)
    read = parquet.read_table(tmp_path / "t.parquet")
    assert (read.num_rows, read.column_names) == (0, list(COLUMNS))
