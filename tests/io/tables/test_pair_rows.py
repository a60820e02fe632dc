"""The layout `pairs`: its columns and rows, the names of circles, and its JSON."""

from __future__ import annotations

import io
import json
from dataclasses import replace

import numpy as np
import pytest

import circlepose
from circlepose.io.tables.pair_rows import PAIR_COLUMNS, pair_rows
from circlepose.io.tables.paper_layouts import write_results
from circlepose.results import ImageResult, Status
from tests.support.discs import CENTER_MM, made_circle, made_result

COVARIANCE = np.diag([1e-4, 1e-4, 4e-4, 1e-8, 1e-8])
THREE = made_result(
    made_circle(0, covariance=COVARIANCE),
    made_circle(1, CENTER_MM + np.array([30.0, 0.0, 40.0]), covariance=COVARIANCE),
    made_circle(2, CENTER_MM + np.array([0.0, 60.0, 0.0])),
)


def text_of(results, data_format):
    handle = io.StringIO()
    write_results(results, handle, data_format=data_format, layout="pairs")
    return handle.getvalue()


def test_columns_are_those_agreed_on_in_their_order():
    assert ", ".join(PAIR_COLUMNS) == "image, first, second, distance_mm, sigma_mm, angle_deg, sigma_deg"


def test_a_row_per_two_circles_by_the_chosen_candidates():
    lines = text_of([THREE], "csv").splitlines()
    assert lines[0] == ",".join(PAIR_COLUMNS)
    assert [line.split(",")[:4] for line in lines[1:]] == [
        ["a.png", "0/disc", "1/disc", "50.000000"],
        ["a.png", "0/disc", "2/disc", "60.000000"],
        ["a.png", "1/disc", "2/disc", "78.102497"],
    ]
    # Of a circle without a covariance nothing is known.
    assert [line.split(",")[4] for line in lines[1:]] == ["0.024166", "", ""]
    # Along (3, 0, 4) / 5: twice 0.36 of 1e-4 and 0.64 of 4e-4.
    assert float(lines[1].split(",")[4]) == pytest.approx(np.sqrt(2 * (0.36e-4 + 2.56e-4)), abs=1e-6)
    other = replace(THREE, circles=(replace(THREE.circles[0], chosen=1), *THREE.circles[1:]))
    assert next(pair_rows(other))["angle_deg"] > 10.0


def test_names_alone_where_none_repeats():
    circles = [replace(circle, circle=f"r0c{number}") for number, circle in enumerate(THREE.circles)]
    assert [(row["first"], row["second"]) for row in pair_rows(made_result(*circles))] == [
        ("r0c0", "r0c1"),
        ("r0c0", "r0c2"),
        ("r0c1", "r0c2"),
    ]


def test_an_image_without_a_pair_has_a_row():
    failed = ImageResult("bad.png", Status.NO_CIRCLE, "nothing")
    assert text_of([failed, made_result()], "tsv").splitlines()[1:] == ["bad.png" + "\t" * 6, "a.png" + "\t" * 6]
    (row,) = circlepose.to_rows(failed, layout="pairs")
    assert row == dict.fromkeys(PAIR_COLUMNS) | {"image": "bad.png"}


def test_json_has_rows_at_full_precision():
    document = json.loads(text_of([THREE], "json"))
    assert (document["schema"], len(document["rows"])) == ("circlepose.pairs/1", 3)
    assert document["rows"][2]["distance_mm"] == pytest.approx(np.sqrt(6100.0), rel=1e-15)
    assert document["rows"][2]["sigma_mm"] is None
    lines = text_of([THREE], "jsonl").splitlines()
    assert [json.loads(line) for line in lines] == [
        {"schema": "circlepose.pairs/1"} | row for row in document["rows"]
    ]
