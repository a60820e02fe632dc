from __future__ import annotations

import csv
import io
import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from circlepose.io.tables import columns, paper_layouts
from circlepose.io.tables.columns import COLUMNS, cell, pose_rows
from circlepose.io.tables.reader import read_pose_file
from circlepose.io.text.escaping import unquoted
from circlepose.results import CircleResult, ImageResult, Status
from tests.support.discs import CENTER_MM, NORMAL, RADIUS_MM, made_circle, made_result

COVARIANCE = np.diag([0.01, 0.04, 0.09, 3e-6, 1e-6])
NUMBERS = ["center_x_mm", "center_y_mm", "center_z_mm", "normal_x", "normal_y", "normal_z"]
FAILED = ImageResult("bad.png", Status.NO_CIRCLE, "nothing there")


def read_csv(results, layout="poses"):
    handle = io.StringIO()
    paper_layouts.write_results(results, handle, data_format="csv", layout=layout)
    return list(csv.DictReader(io.StringIO(handle.getvalue())))


def read_json(results, layout="poses"):
    handle = io.StringIO()
    paper_layouts.write_results(results, handle, data_format="json", layout=layout)
    return json.loads(handle.getvalue())


def test_columns_are_those_agreed_on_in_their_order():
    assert ", ".join(COLUMNS) == (
        "image, instance, circle, method, solution, chosen, status, center_x_mm, center_y_mm, center_z_mm, "
        "normal_x, normal_y, normal_z, radius_mm, position_difference_mm, orientation_difference_deg, "
        "generatrix_mm, ambiguity, center_u_px, center_v_px, semi_major_px, semi_minor_px, angle_deg, residual_px, "
        "cone, sigma_x_mm, sigma_y_mm, sigma_z_mm, sigma_normal_deg, flags, rim_used, score, settled_by"
    )


def test_every_row_key_is_a_column():
    for row in pose_rows(made_result(made_circle(covariance=COVARIANCE))):
        assert set(row) <= set(COLUMNS)


def test_a_row_per_candidate_with_one_chosen():
    first, second = read_csv([made_result()])
    assert (first["solution"], first["chosen"]) == ("0", "true")
    assert (second["solution"], second["chosen"]) == ("1", "false")
    center = [float(first[f"center_{axis}_mm"]) for axis in "xyz"]
    normal = [float(first[f"normal_{axis}"]) for axis in "xyz"]
    np.testing.assert_allclose(center, CENTER_MM, atol=1e-6)
    np.testing.assert_allclose(normal, NORMAL, atol=1e-9)
    assert float(first["radius_mm"]) == RADIUS_MM
    assert first["flags"] == "poor_fit;near_right"
    assert first["cone"] == "elliptical"
    assert first["ambiguity"] == "0.250000"
    assert first["sigma_x_mm"] == first["generatrix_mm"] == ""


def test_sigmas_come_from_the_covariance():
    row, _ = read_csv([made_result(made_circle(covariance=COVARIANCE))])
    assert [row[f"sigma_{axis}_mm"] for axis in "xyz"] == ["0.100000", "0.200000", "0.300000"]
    assert float(row["sigma_normal_deg"]) == pytest.approx(np.degrees(np.sqrt(4e-6)), abs=1e-6)


def test_a_failed_image_has_one_row_of_name_and_status():
    (row,) = read_csv([FAILED])
    assert {key: value for key, value in row.items() if value} == {"image": "bad.png", "status": "no_circle"}


def test_too_few_circles_adds_a_row_to_those_found():
    result = replace(made_result(), status=Status.TOO_FEW_CIRCLES)
    rows = read_csv([result])
    assert [row["status"] for row in rows] == ["ok", "ok", "too_few_circles"]
    assert [key for key, value in rows[-1].items() if value] == ["image", "status"]


def test_a_circle_without_a_pose_has_one_row():
    failed = CircleResult(0, "disc", "kabuka-arenas", 20.0, status=Status.NO_POSE, reason="edge-on")
    rows = read_csv([ImageResult("a.png", Status.NO_POSE, circles=(failed,))])
    assert [(row["method"], row["status"], row["ambiguity"]) for row in rows] == [("kabuka-arenas", "no_pose", "")]


@pytest.mark.parametrize(
    ("name", "shown"),
    [
        ("=1+cmd.png", "'=1+cmd.png"),
        ("+1", "'+1"),
        ("-1.png", "'-1.png"),
        ("@a", "'@a"),
        ("'=a", "''=a"),
        ("\t=1", r"$'\t=1'"),
        ("\r=1", r"$'\r=1'"),
    ],
)
def test_names_that_a_spreadsheet_would_run_are_kept_from_it(name, shown):
    assert read_csv([replace(FAILED, image=name)])[0]["image"] == shown
    assert read_json([replace(FAILED, image=name)])["images"][0]["image"] == name


def test_negative_numbers_get_no_apostrophe():
    assert read_csv([made_result()])[0]["center_y_mm"] == "-5.000000"


def test_names_with_commas_quotes_line_ends_and_stray_bytes_survive():
    name = 'a,"b"\nc\udcff.png'
    (row,) = read_csv([replace(FAILED, image=name)])
    assert row["image"] == r"""$'a,"b"\nc\xff.png'"""
    assert read_json([replace(FAILED, image=name)])["images"][0]["image"] == row["image"]
    assert unquoted(row["image"]) == name


@pytest.mark.parametrize("data_format", ["csv", "jsonl"])
@pytest.mark.parametrize(
    "name", ["a\nb", "a\rb", "a\u2028b", "\x1b[2J\x07", "a\x85b\x9b", "\udcff", "q\"'\\", "\u202egnp.a"]
)
def test_every_row_is_one_line_of_utf8_that_leaves_a_terminal_alone(name, data_format):
    handle = io.StringIO()
    paper_layouts.write_results([replace(FAILED, image=name)], handle, data_format=data_format, layout="poses")
    lines = handle.getvalue().encode("utf-8").decode("utf-8").splitlines()
    assert len(lines) == (2 if data_format == "csv" else 1)
    assert all(line.isprintable() for line in lines)
    table = read_pose_file(handle.getvalue().encode(), "t").table
    assert list(table.image_status) == [name]


@given(st.floats(), st.sampled_from(COLUMNS))
def test_number_cells_are_numbers_or_empty_and_never_minus_zero(value, column):
    shown = cell(column, value)
    if not np.isfinite(value):
        assert shown == ""
    else:
        assert float(shown) == pytest.approx(value, abs=1e-4)
        assert "e" not in shown
        assert float(shown) != 0.0 or not shown.startswith("-")


@pytest.mark.parametrize(
    ("column", "value", "expected"),
    [
        ("center_x_mm", -1e-9, "0.000000"),
        ("normal_x", -0.5, "-0.500000000"),
        ("center_u_px", 12.34567, "12.3457"),
        ("angle_deg", 90.0, "90.000000"),
        ("chosen", True, "true"),
        ("instance", 3, "3"),
        ("image", None, ""),
    ],
)
def test_cells_are_fixed_in_form(column, value, expected):
    assert cell(column, value) == expected


def test_json_holds_full_precision_and_nests_by_image():
    document = read_json([made_result(made_circle(covariance=COVARIANCE)), FAILED])
    assert document["schema"] == "circlepose.poses/1"
    good, bad = document["images"]
    assert (good["width"], good["height"], bad["width"]) == (320, 240, None)
    assert (bad["status"], bad["reason"], bad["circles"]) == ("no_circle", "nothing there", [])
    (circle,) = good["circles"]
    assert circle["flags"] == ["poor_fit", "near_right"]
    first, second = circle["solutions"]
    exact = made_circle().candidates
    assert [first[f"center_{axis}_mm"] for axis in "xyz"] == exact[0].center.tolist()
    assert [second[f"normal_{axis}"] for axis in "xyz"] == exact[1].normal.tolist()
    assert first["covariance"] == COVARIANCE.tolist()
    assert first["generatrix_mm"] is None


def test_json_uses_the_tables_names():
    document = read_json([made_result(made_circle(covariance=COVARIANCE))])
    (circle,) = document["images"][0]["circles"]
    extra = {
        "reason",
        "solutions",
        "covariance",
        "covariance_terms",
        "nested_rims",
        "plane",
        "color_mix",
        "vanishing_normal",
        "vanishing_normal_sigma_deg",
        "vanishing_normal_distance_deg",
        "vanishing_normal_distance_sigmas",
        "generatrix_expected_mm",
        "generatrix_ends_mm",
        "generatrix_ends_sigma_mm",
        "height_mm",
        "height_sigma_mm",
    }
    assert (set(circle) | set(circle["solutions"][0])) - extra == set(COLUMNS) - {"image"}


def test_json_turns_what_is_no_number_into_null():
    circle = replace(made_circle(), residual_px=float("nan"))
    assert read_json([made_result(circle)])["images"][0]["circles"][0]["residual_px"] is None


def test_a_json_document_stays_readable_when_the_run_ends_early():
    def results():
        yield FAILED
        raise KeyboardInterrupt

    handle = io.StringIO()
    with pytest.raises(KeyboardInterrupt):
        paper_layouts.write_results(results(), handle, data_format="json", layout="poses")
    assert [image["image"] for image in json.loads(handle.getvalue())["images"]] == ["bad.png"]


@pytest.mark.parametrize("data_format", ["csv", "jsonl"])
def test_rows_leave_when_their_image_is_done(data_format):
    handle = io.StringIO()
    lengths = []

    def results():
        for _ in range(3):
            lengths.append(len(handle.getvalue().splitlines()))
            yield FAILED

    paper_layouts.write_results(results(), handle, data_format=data_format, layout="poses")
    assert np.diff(lengths).tolist() == [1, 1]


def test_each_json_line_is_an_image_with_its_schema():
    handle = io.StringIO()
    paper_layouts.write_results([made_result(), FAILED], handle, data_format="jsonl", layout="poses")
    lines = [json.loads(line) for line in handle.getvalue().splitlines()]
    assert [(line["schema"], line["image"]) for line in lines] == [
        ("circlepose.poses/1", "a.png"),
        ("circlepose.poses/1", "bad.png"),
    ]


def compared() -> ImageResult:
    circles = []
    for method, difference in (("chen-huang", 0.0), ("kabuka-arenas", 1.234)):
        circle = made_circle(method=method)
        changed = replace(
            circle.candidates[0], position_difference_mm=difference, orientation_difference_deg=difference
        )
        circles.append(replace(circle, candidates=(changed, circle.candidates[1])))
    return made_result(*circles)


def test_table1_has_the_columns_and_decimals_of_the_print():
    rows = read_csv([compared(), FAILED], "table1")
    assert list(rows[0]) == [
        "Method",
        "Image",
        "Circle center position",
        "Position difference (mm)",
        "Surface normal",
        "Orientation difference (deg)",
        "Ambiguity",
        *NUMBERS,
    ]
    printed = ["chen-huang", "a.png", "(10.00, -5.00, 200.00)", "", "(0.53, 0.11, -0.84)", "", "0.2500"]
    assert list(rows[0].values())[:7] == printed
    assert (rows[1]["Position difference (mm)"], rows[1]["Orientation difference (deg)"]) == ("1.23", "1.23")
    assert (rows[2]["Image"], rows[2]["Circle center position"]) == ("bad.png", "no_circle")


@pytest.mark.parametrize("layout", ["table1", "table2"])
def test_components_of_vectors_are_numbers_of_their_own(layout):
    """Also negative ones, which as texts a spreadsheet would take for formulas."""
    exact = np.concatenate([CENTER_MM, NORMAL])
    row = read_csv([made_result()], layout)[0]
    np.testing.assert_allclose([float(row[name]) for name in NUMBERS], exact, atol=1e-6)
    known = read_json([made_result()], layout)["rows"][0]
    np.testing.assert_allclose([known[name] for name in NUMBERS], exact, atol=1e-12)
    failed = read_json([FAILED], layout)["rows"][0]
    assert [failed[name] for name in NUMBERS] == [None] * 6


def test_the_table_layouts_show_the_ambiguity_of_the_chosen_candidate():
    coin_flip = made_result(replace(made_circle(), ambiguity=0.5))
    assert [row["Ambiguity"] for row in read_csv([coin_flip], "table1")] == ["0.5000"]
    assert [row["Ambiguity"] for row in read_csv([coin_flip], "table2")] == ["0.5000", ""]
    assert [row["Ambiguity"] for row in read_json([coin_flip], "table2")["rows"]] == [0.5, None]


def test_table1_tells_several_circles_apart():
    rows = read_csv([made_result(made_circle(0), made_circle(1))], "table1")
    assert [row["Image"] for row in rows] == ["a.png [0 disc]", "a.png [1 disc]"]


def test_table2_has_both_candidates_of_the_largest_circle():
    big, small = made_circle(circle="big"), made_circle(circle="small")
    candidates = tuple(replace(c, generatrix_mm=45.2 - 5.0 * i) for i, c in enumerate(big.candidates))
    rows = read_csv([made_result(replace(big, candidates=candidates, chosen=1), small)], "table2")
    assert [(row["Scene"], row["Candidate"], row["GCC"]) for row in rows] == [
        ("a.png", "chosen", "40.20"),
        ("a.png", "other", "45.20"),
    ]
    assert rows[1]["TV"] == "(10.0000, -5.0000, 200.0000)"


def test_printed_tables_as_json_hold_lists():
    document = read_json([made_result()], "table2")
    assert document["schema"] == "circlepose.table2/1"
    assert document["rows"][0]["TV"] == made_circle().candidates[0].center.tolist()


def test_every_column_has_a_meaning_with_its_unit_in_the_name():
    assert all(columns.COLUMN_MEANING.values())
    lengths = [name for name in COLUMNS if name.startswith(("center_", "sigma_", "semi_"))]
    assert all(name.endswith(("_mm", "_px", "_deg")) for name in lengths)
