"""`circlepose plan`: every form of its output, its exit codes, and what it refuses."""

from __future__ import annotations

import csv
import io
import json
import re
import sys
from dataclasses import fields

import pytest

from circlepose.planning.views import USUAL, Look
from circlepose_cli.app import main
from circlepose_cli.options.plan import PlanRequest
from circlepose_cli.reports.plan import COLUMNS
from tests.support.discs import CAMERA_YAML

CAMERA = ("--focal-mm", 8, "--pixel-um", 16, "--image-size", "320x240")
DISC = ("--radius-mm", 20)
VIEW = ("--distance-mm", 400, "--tilt-deg", 30)


@pytest.fixture
def plan(run):
    return lambda *args: run("plan", *args)


@pytest.fixture
def camera(tmp_path):
    """A calibration file."""
    path = tmp_path / "camera.yaml"
    path.write_text(CAMERA_YAML)
    return path


def rows(out):
    return list(csv.DictReader(io.StringIO(out)))


def test_a_row_per_view_as_csv_and_the_notes_on_standard_error(plan):
    code, out, err = plan(
        *CAMERA, *DISC, "--distance-mm", "450:600", "--tilt-deg", "20:50", "--steps", 2, "--place", "middle,corner"
    )
    found = rows(out)
    assert code == 0
    assert list(found[0]) == list(COLUMNS)
    assert [(row["place"], row["tilt_deg"], row["distance_mm"]) for row in found] == [
        (place, tilt, distance)
        for place in ("middle", "corner")
        for tilt in ("20.0", "50.0")
        for distance in ("450.0", "600.0")
    ]
    assert all(row["found"] == "1.00" and float(row["sigma_position_mm"]) > 0.0 for row in found)
    assert "The camera is taken as exact: give --camera-sigma" in err
    assert "The radius is taken as exact: give --radius-sigma-mm" in err
    assert "A lone circle has two poses" in err
    assert err.splitlines()[-1] == "Next: circlepose print makes the sheet of a target file."


def test_what_is_known_of_camera_and_radius_is_counted(plan):
    code, out, err = plan(*CAMERA, *DISC, *VIEW, "--camera-sigma", "1,1", "--radius-sigma-mm", 0.05)
    (row,) = rows(out)
    assert code == 0
    assert float(row["camera_share"]) > 0.1
    assert float(row["radius_share"]) > 0.1
    assert "exact" not in err


def test_json_has_the_numbers_whole_and_nulls(plan):
    code, out, err = plan(
        *CAMERA, *DISC, "--distance-mm", "30:400", "--steps", 2, "--tilt-deg", 30, "--format", "json"
    )
    document = json.loads(out)
    near, far = document["rows"]
    assert (code, err, document["schema"]) == (0, "", "circlepose.plan/1")
    assert (near["found"], near["reason"]) == (0.0, "no contour is the target's image")
    assert [near[key] for key in ("sigma_position_mm", "wrong", "camera_share", "apart_deg")] == [None] * 4
    assert far["sigma_position_mm"] == pytest.approx(
        sum(far[f"sigma_{axis}_mm"] ** 2 for axis in "xyz") ** 0.5, rel=1e-9
    )
    assert (far["reason"], far["sigma_roll_deg"], far["flags"]) == ("", None, "ambiguous")


def test_json_lines(plan):
    _, out, _ = plan(*CAMERA, *DISC, *VIEW, "--format", "jsonl")
    (line,) = out.splitlines()
    assert json.loads(line)["schema"] == "circlepose.plan/1"


def test_a_narrow_table_keeps_what_counts(plan, monkeypatch):
    for module in ("screen", "sheets"):
        monkeypatch.setattr(f"circlepose_cli.output.{module}.width_of", lambda _: 70)
    code, out, _ = plan(*CAMERA, *DISC, *VIEW, "--format", "table")
    assert code == 0
    lines = out.splitlines()
    assert all(len(line) <= 70 for line in lines[:6])
    assert re.search(r"middle +30\.0 +400\.0 +20\.000 +0\.\d{4} +0\.\d{4} +0\.5000 +1\.00", out)
    assert "not shown: " in out
    # What is empty in all rows is no column.
    assert "roll" not in out
    assert "reason" not in out


def test_the_reason_is_in_the_table(plan):
    code, out, _ = plan(*CAMERA, *DISC, "--distance-mm", 30, "--tilt-deg", 30, "--format", "table")
    assert code == 0
    assert "no contour is the target's image" in out


def test_a_file_of_its_endings_form(plan, tmp_path):
    path = tmp_path / "plan.json"
    assert plan(*CAMERA, *DISC, *VIEW, "-o", path)[:2] == (0, "")
    assert len(json.loads(path.read_text())["rows"]) == 1


def test_a_board_has_a_roll(plan, tmp_path):
    target = tmp_path / "board.yaml"
    target.write_text(
        "kind: board\nradius_mm: 8\ngrid: {pattern: symmetric, rows: 2, columns: 3, spacing_mm: 30}\n"
        "marks: [{at: [0, 0], radii_mm: [5]}]\n"
    )
    code, out, err = plan(*CAMERA, "--target", target, *VIEW)
    (row,) = rows(out)
    assert code == 0
    assert float(row["sigma_roll_deg"]) > 0.0
    assert "lone circle" not in err


def test_the_farthest_distance_for_an_accuracy(plan):
    code, out, err = plan(*CAMERA, *DISC, "--distance-mm", "200:2000", "--tilt-deg", 30, "--sigma-mm", 0.2)
    (row,) = rows(out)
    assert code == 0
    assert 200.0 < float(row["distance_mm"]) < 2000.0
    assert 0.15 < float(row["sigma_position_mm"]) <= 0.2
    assert "Wanted: 0.2 mm; each row is the farthest distance of the range for it." in err


def test_the_smallest_radius_for_an_accuracy(plan):
    code, out, err = plan(*CAMERA, *DISC, *VIEW, "--sigma-mm", 0.2, "--sigma-deg", 1, "--find", "radius")
    (row,) = rows(out)
    assert code == 0
    assert float(row["distance_mm"]) == 400.0
    assert float(row["radius_mm"]) < 20.0
    assert 0.1 < float(row["sigma_position_mm"]) <= 0.2
    assert "Wanted: 0.2 mm and 1 deg; each row is the smallest radius for it." in err


@pytest.mark.parametrize(("find", "distance"), [("distance", ""), ("radius", "400.0")])
def test_nothing_as_accurate_as_wanted_ends_with_4(plan, monkeypatch, find, distance):
    monkeypatch.setattr("circlepose_cli.runs.plan.LARGEST_FACTOR", 2.0)
    code, out, err = plan(*CAMERA, *DISC, *VIEW, "--sigma-mm", "1e-9", "--find", find)
    (row,) = rows(out)
    assert code == 4
    assert (row["place"], row["tilt_deg"], row["distance_mm"], row["radius_mm"]) == ("middle", "30.0", distance, "")
    assert (row["found"], row["flags"]) == ("", "")
    assert row["reason"] == "nowhere in the range both found and as accurate as wanted"
    assert "circlepose: no view is as accurate as wanted." in err


@pytest.mark.parametrize("ending", ["png", "svg", "pdf"])
def test_a_plot(plan, tmp_path, ending):
    pytest.importorskip("matplotlib", reason="plots need the extra report")
    path = tmp_path / f"plan.{ending}"
    code, out, _ = plan(*CAMERA, *DISC, "--distance-mm", "30:400", "--steps", 2, "--tilt-deg", 30, "--plot", path)
    assert (code, len(rows(out))) == (0, 2)
    assert path.stat().st_size > 1000
    path.write_text("mine")
    code, out, err = plan(*CAMERA, *DISC, *VIEW, "--plot", path)
    assert (code, out, path.read_text()) == (2, "", "mine")
    assert "--overwrite" in err


def test_a_plot_of_a_search_without_result(plan, tmp_path):
    pytest.importorskip("matplotlib", reason="plots need the extra report")
    code, _, err = plan(*CAMERA, *DISC, *VIEW, "--sigma-mm", "1e-9", "--plot", tmp_path / "plan.png")
    assert code == 4
    assert "Warning" not in err


def test_a_missing_matplotlib_is_told_before_anything_is_done(plan, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    code, out, err = plan(*CAMERA, *DISC, *VIEW, "--plot", tmp_path / "plan.png")
    assert (code, out) == (2, "")
    assert "pip install 'circlepose[report]'" in err


@pytest.mark.parametrize(
    ("args", "message"),
    [
        ((*DISC, *VIEW), "camera: give --calib FILE, or all of --focal-mm, --pixel-um and --image-size."),
        ((*CAMERA[:4], *DISC, *VIEW), "camera: give --calib FILE, or all of"),
        (("--calib", "{camera}", *CAMERA[:2], *DISC, *VIEW), "--calib, --focal-mm, --pixel-um: give the file, or"),
        (
            ("--calib", "{camera}", *CAMERA[4:5], "640x480", *DISC, *VIEW),
            "--image-size: the calibration states another",
        ),
        (("--calib", "{sizeless}", *DISC, *VIEW), "states no image size; give --image-size WxH."),
        ((*CAMERA, "--camera-name", "cam1", *DISC, *VIEW), "--camera-name: names a camera of a calibration file;"),
        ((*CAMERA[:2], "--pixel-um", 0, *CAMERA[4:], *DISC, *VIEW), "--pixel-um: expected a positive number, got 0."),
        ((*CAMERA[:4], "--image-size", "320", *DISC, *VIEW), "--image-size: expected WIDTHxHEIGHT in px"),
        ((*CAMERA, "--camera-sigma", "1", *DISC, *VIEW), "--camera-sigma: expected FOCAL_PX,CENTER_PX"),
        ((*CAMERA, *VIEW), "--target, --radius-mm: give one of them."),
        ((*CAMERA, "--target", "{target}", *DISC, *VIEW), "--target, --radius-mm: give one of them."),
        ((*CAMERA, "--target", "{coaxial}", *VIEW), "the height of a coaxial part is needed: give height_mm or"),
        ((*CAMERA, "--radius-mm", 0, *VIEW), "--radius-mm: expected a positive radius"),
        ((*CAMERA, *DISC, *VIEW, "--radius-sigma-mm", 30), "--radius-sigma-mm: expected a standard deviation"),
        ((*CAMERA, *DISC), "Missing option '--distance-mm'"),
        ((*CAMERA, *DISC, "--distance-mm", 0), "--distance-mm: expected distances above 0."),
        ((*CAMERA, *DISC, "--distance-mm", "9:3"), "--distance-mm: expected a number or two, LOW:HIGH"),
        ((*CAMERA, *DISC, *VIEW[:2], "--tilt-deg", 90), "--tilt-deg: expected angles below 90, got 90;"),
        ((*CAMERA, *DISC, *VIEW[:2], "--tilt-deg", "a"), "--tilt-deg: expected a number or two, LOW:HIGH"),
        ((*CAMERA, *DISC, *VIEW, "--place", "middle,up"), "--place: expected some of middle, right, bottom, corner"),
        ((*CAMERA, *DISC, *VIEW, "--noise", -1), "--noise: expected gray levels of 0 or more, got -1."),
        ((*CAMERA, *DISC, *VIEW, "--blur-px", "nan"), "--blur-px: expected 0 to 30 px, got nan."),
        (
            (*CAMERA, *DISC, *VIEW, "--contrast", 256),
            "--contrast: expected gray levels above 0 and up to 255, got 256.",
        ),
        (
            (*CAMERA, *DISC, *VIEW, "--find", "radius"),
            "--find: needs the wanted accuracy, --sigma-mm or --sigma-deg.",
        ),
        ((*CAMERA, *DISC, *VIEW, "--sigma-mm", 0), "--sigma-mm: expected a positive number, such as 0.1, got 0."),
        ((*CAMERA, *DISC, *VIEW, "--sigma-deg", -1), "--sigma-deg: expected a positive number"),
        (
            (*CAMERA, *DISC, *VIEW, "--plot", "plan.gif"),
            "--plot plan.gif: expected a file that ends in .png, .svg, .pdf.",
        ),
        (
            ("--calib", "{camera}", *DISC, *VIEW, "-o", "{camera}"),
            "would be overwritten, but it holds the calibration",
        ),
        ((*CAMERA, "--target", "{target}", *VIEW, "-o", "{target}"), "would be overwritten, but it holds the target"),
        ((*CAMERA, *DISC, *VIEW, "--plot", "a.svg", "-o", "a.svg"), "are one file; give two names."),
    ],
)
def test_what_is_refused_gets_a_sentence(plan, tmp_path, camera, args, message):
    texts = {
        "sizeless": CAMERA_YAML.replace("image_size: [320, 240]\n", ""),
        "target": "radius_mm: 20\n",
        "coaxial": "kind: coaxial\nradii_mm: [30, 20]\n",
    }
    paths = {"camera": camera, **{name: tmp_path / f"{name}.yaml" for name in texts}}
    for name, text in texts.items():
        paths[name].write_text(text)
    before = {path: path.read_bytes() for path in paths.values()}
    code, out, err = plan(*(str(arg).format(**paths) for arg in args))
    assert (code, out) == (2, "")
    assert message in err
    assert "Traceback" not in err
    assert {path: path.read_bytes() for path in paths.values()} == before


def test_a_calibration_without_a_size_takes_the_option(plan, camera):
    camera.write_text(CAMERA_YAML.replace("image_size: [320, 240]\n", ""))
    assert plan("--calib", camera, "--image-size", "320x240", *DISC, *VIEW)[0] == 0


def test_help_has_examples(capsys):
    assert main(["plan", "--help"]) == 0
    assert "--distance-mm 50:999 --sigma-mm 1" in capsys.readouterr().out


def test_the_defaults_are_those_of_the_library():
    options = {field.name: field.default for field in fields(PlanRequest)}
    assert Look(options["noise"], options["blur_px"], options["contrast"]) == USUAL
