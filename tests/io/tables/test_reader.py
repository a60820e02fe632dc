from __future__ import annotations

import csv
import io
import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from circlepose.errors import UsageError
from circlepose.io.tables import paper_layouts
from circlepose.io.tables.columns import COLUMNS
from circlepose.io.tables.reader import read_pose_file
from circlepose.results import CircleResult, ImageResult, Status
from tests.support.discs import CENTER_MM, NORMAL, made_circle, made_result

FAILED = ImageResult("bad.png", Status.NO_CIRCLE, "nothing there")
TOO_FEW = ImageResult("few.png", Status.TOO_FEW_CIRCLES, circles=(made_circle(),))
NO_POSE = CircleResult(0, "disc", "kabuka-arenas", 20.0, status=Status.NO_POSE, reason="edge-on")
RESULTS = (
    made_result(made_circle(), made_circle(1, CENTER_MM + 50.0), made_circle(method="kanatani-liu")),
    FAILED,
    TOO_FEW,
    ImageResult("none.png", Status.NO_POSE, circles=(NO_POSE,)),
)


def written(results=RESULTS, data_format="csv", layout="poses"):
    handle = io.StringIO()
    paper_layouts.write_results(results, handle, data_format=data_format, layout=layout)
    return handle.getvalue()


def read(text, **options):
    content = text if isinstance(text, bytes) else text.encode()
    return read_pose_file(content, "poses.csv", **options)


def edited(edit):
    """The CSV of a result after `edit` of its rows (dicts)."""
    rows = list(csv.DictReader(io.StringIO(written([made_result()]))))
    edit(rows)
    handle = io.StringIO()
    writer = csv.DictWriter(handle, rows[0], lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return handle.getvalue()


def complaint(text, **options):
    with pytest.raises(UsageError) as caught:
        read(text, **options)
    message = str(caught.value)
    assert message.startswith("poses.csv")
    assert message.endswith((".", "?"))
    return message


def test_a_table_is_read_as_it_was_written():
    table = read(written()).table
    assert not table.is_truth
    assert table.images == ("a.png", "few.png", "none.png", "bad.png")
    assert table.image_status == {"bad.png": "no_circle", "few.png": "too_few_circles"}
    first = table.circles[0]
    assert (first.image, first.instance, first.circle, first.method) == ("a.png", 0, "disc", "chen-huang")
    assert len(first.poses) == 2
    np.testing.assert_allclose(first.poses[first.chosen].center_mm, CENTER_MM, atol=1e-6)
    np.testing.assert_allclose(first.poses[first.chosen].normal, NORMAL, atol=1e-9)
    assert (table.circles[-1].status, table.circles[-1].poses) == ("no_pose", ())


@pytest.mark.parametrize("data_format", ["json", "jsonl"])
@pytest.mark.parametrize("results", [RESULTS, RESULTS[:1], (FAILED,)])
def test_all_forms_say_the_same(data_format, results):
    from_csv, other = read(written(results)), read(written(results, data_format))
    assert (from_csv.form, other.form) == ("csv", data_format)
    assert other.table.image_status == from_csv.table.image_status
    for ours, theirs in zip(other.table.circles, from_csv.table.circles, strict=True):
        assert (ours.image, ours.instance, ours.method) == (theirs.image, theirs.instance, theirs.method)
        assert (ours.status, ours.chosen, len(ours.poses)) == (theirs.status, theirs.chosen, len(theirs.poses))
        for pose, same in zip(ours.poses, theirs.poses, strict=True):
            np.testing.assert_allclose(pose.center_mm, same.center_mm, atol=1e-6)
            np.testing.assert_allclose(pose.normal, same.normal, atol=1e-8)


@pytest.mark.parametrize("name", ["=1+a.png", "-a.png", "'a.png", 'b,"c"\n.png', "ü.png"])
def test_names_come_back_as_they_were(name):
    for data_format in ("csv", "json", "jsonl"):
        assert read(written([made_result(image=name)], data_format)).table.images == (name,)


def test_rows_and_columns_may_come_in_any_order_and_columns_may_be_added_or_left_out():
    rows = list(csv.reader(io.StringIO(written())))
    keep = [column for column in reversed(rows[0]) if not column.startswith(("sigma", "flags"))]
    handle = io.StringIO()
    writer = csv.writer(handle)
    writer.writerow([*keep, "mine"])
    for row in reversed(rows[1:]):
        writer.writerow([*(row[rows[0].index(column)] for column in keep), "note"])
    table = read("\ufeff" + handle.getvalue()).table
    assert set(table.circles) == set(read(written()).table.circles)


def test_pandas_and_spreadsheets_write_true_in_their_own_way():
    def edit(rows):
        rows[0]["chosen"], rows[1]["chosen"] = "True", "FALSE"

    assert read(edited(edit)).table == read(written([made_result()])).table


TRUTH = "image,instance,circle,center_x_mm,center_y_mm,center_z_mm,normal_x,normal_y,normal_z\n"


@pytest.mark.parametrize(
    "text",
    [
        TRUTH + "a.png,0,disc,1,2,500,0,0.6,-0.8\n",
        "image,circle,radius,x,y,z,nx,ny,nz\na.png,disc,60,1,2,500,0,0.6,-0.8\n",
        "nx, ny, nz, cx, cy, cz, image\n0,0.6,-0.8,1,2,500,a.png\n",
    ],
)
def test_truths_of_several_forms(text):
    table = read(text, truth_allowed=True).table
    assert table.is_truth
    (circle,) = table.circles
    assert circle.circle == ("disc" if "disc" in text else None)
    assert circle.instance == (0 if "instance" in text else None)
    assert circle.poses[0].center_mm == (1.0, 2.0, 500.0)
    np.testing.assert_allclose(circle.poses[0].normal, (0.0, 0.6, -0.8))


def test_empty_cells_of_a_truth_are_unknown():
    table = read(TRUTH + "a.png,0,disc,1,2,500,,,\na.png,1,disc,,,,0,0,-1\n", truth_allowed=True).table
    assert table.circles[0].poses[0].normal is None
    assert table.circles[1].poses[0].center_mm is None


def test_a_truth_is_no_table_of_poses():
    message = complaint(TRUTH + "a.png,0,disc,1,2,500,0,0.6,-0.8\n")
    assert "has no column method and no column solution" in message


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"", "is empty"),
        (b" \n\n", "is empty"),
        (b"\x89PNG\r\n\x1a\n\xff", "is not UTF-8 text"),
        (b"a\0b", "is a binary file"),
        (",,\n", "has no rows"),
        (written([]), "has no rows"),
        ('{"schema": "circlepose.poses/1", "images": []}', "has no rows"),
        ("radius_mm: 60\npolarity: dark, or any\n", "has no column image"),
        (written(layout="table1"), "has no column image"),
        (written().replace(",", ";"), "semicolons"),
        (written().rstrip(",\n"), f"line 12: has 14 cells, the header {len(COLUMNS)}; is the file cut short?"),
        (written() + '"a', "is no valid CSV"),
        (written().replace("flags", "image"), "has two columns image"),
        (written().replace("chosen", "picked"), "has no column chosen"),
        (written().replace("center_z_mm", "z"), "has no column center_z_mm"),
        (written() + written(), "line 13: instance: expected a whole number"),
        (written([made_result(), made_result()]), "solution: a.png, disc 0, chen-huang has number 0 twice"),
        (written([RESULTS[-1], RESULTS[-1]]), "none.png, disc 0, kabuka-arenas is there twice, with status no_pose"),
        (written([FAILED]) + written([TOO_FEW]).splitlines()[-1].replace("few.png", "bad.png"), "before"),
        (written(data_format="json")[:-20], "is no valid JSON"),
        (written(data_format="jsonl")[:-20], "line 4: is no valid JSON; is the file cut short?"),
        ("[" * 100_000, "is no valid JSON"),
        ("[1, 2]", "schema: expected 'circlepose.poses/1' or 'circlepose.boards/1', got None"),
        (written(data_format="json", layout="table1"), "got 'circlepose.table1/1'"),
        (written(data_format="jsonl", layout="table1"), "got 'circlepose.table1/1'"),
        ('{"schema": "circlepose.poses/1"}', "images: expected a list, got None"),
        ('{"schema": "circlepose.poses/1", "images": [3]}', "image 0: image: expected an object"),
        ('{"schema": "circlepose.poses/1", "image": "a", "circles": 1}', "line 1: circles: expected a list"),
    ],
)
def test_what_is_no_table_of_poses(text, message):
    assert message in complaint(text)


@pytest.mark.parametrize(
    ("column", "value", "message"),
    [
        ("image", "", "image: is empty"),
        ("status", "", "status: is empty"),
        ("method", "", "method: is empty"),
        ("circle", "", "circle: is empty, though status is ok"),
        ("instance", "", "instance: expected a whole number from 0, got ''"),
        ("instance", "-1", "instance: expected a whole number"),
        ("solution", "0.5", "solution: expected a whole number"),
        ("chosen", "yes", "chosen: expected true or false, got 'yes'"),
        ("chosen", "false", "chosen: a.png, disc 0, chen-huang has 0 chosen candidates"),
        ("status", "no_pose", "status: a.png, disc 0, chen-huang has two different ones"),
        ("center_x_mm", "", "center_x_mm: is empty, though status is ok"),
        ("normal_y", "", "normal_y: is empty, though status is ok"),
        ("center_z_mm", "far", "center_z_mm: expected a number or an empty cell, got 'far'"),
        ("center_z_mm", "nan", "center_z_mm: expected a number"),
        ("center_z_mm", "1e999", "center_z_mm: expected a number"),
        ("normal_x", "3", "normal_x: expected the first of the three numbers of a unit vector"),
        ("center_z_mm", "-200", "normal_x: the normal points away from the camera"),
    ],
)
def test_cells_that_cannot_be_meant(column, value, message):
    def edit(rows):
        rows[0][column] = value

    assert message in complaint(edited(edit))
    assert "line " in complaint(edited(edit))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("image,x,y,nx,ny,nz\na.png,1,2,0,0,-1\n", "has no column z"),
        ("image,instance\na.png,0\n", "has no column center_x_mm"),
        ("frame,x,y,z,nx,ny,nz\na.png,1,2,3,0,0,-1\n", "has no column image"),
        ("image,x,y,z,nx,ny,nz\na.png,1,,3,0,0,-1\n", "line 2: y: is empty, but not all of x, y, z are"),
        ("image,x,y,z,nx,ny,nz\na.png,1,2,3,0,0,1\n", "line 2: nx: the normal points away"),
        ("image,instance,x,y,z,nx,ny,nz\na.png,one,1,2,3,0,0,-1\n", "instance: expected a whole number"),
    ],
)
def test_truths_that_are_none(text, message):
    assert message in complaint(text, truth_allowed=True)


@given(st.binary(max_size=60) | st.text(max_size=60).map(str.encode))
def test_any_content_is_read_or_refused_in_a_sentence(content):
    for start in (b"", b"image,", b'{"schema": "circlepose.poses/1", '):
        complaint_or_table(start + content)


leaves = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(max_size=5)


@given(st.recursive(leaves, lambda inner: st.lists(inner, max_size=3), max_leaves=5), st.data())
def test_any_value_in_a_document_is_read_or_refused_in_a_sentence(value, data):
    document = json.loads(written(RESULTS[:1], "json"))
    image = document["images"][0]
    circle = image["circles"][0]
    place = data.draw(st.sampled_from([document, image, circle, circle["solutions"][0]]))
    place[data.draw(st.sampled_from(sorted(place)))] = value
    complaint_or_table(json.dumps(document).encode())


def complaint_or_table(content):
    try:
        table = read_pose_file(content, "poses.csv", truth_allowed=True).table
    except UsageError:
        return
    for circle in table.circles:
        for pose in circle.poses:
            assert all(map(math.isfinite, (*(pose.center_mm or ()), *(pose.normal or ()))))
