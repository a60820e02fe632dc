from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from circlepose.batch import measure
from circlepose.errors import OutputError
from circlepose.io.inputs.images import InputImage
from circlepose.results import ImageResult, Status
from circlepose.solvers import CIRCLE_METHODS
from circlepose_cli.output.overlay_names import OverlayNames
from tests.support.discs import CAMERA_YAML, CENTER_MM, RADIUS_MM, disc_folder, found_notes, write_disc
from tests.support.processes import SETTLE


@pytest.fixture(autouse=True)
def _plain_environment(monkeypatch):
    for library in ("OPENBLAS", "OMP", "MKL"):
        monkeypatch.setenv(f"{library}_NUM_THREADS", "1")
    monkeypatch.delenv("CIRCLEPOSE_DEBUG", raising=False)


def rows_of(text):
    return list(csv.DictReader(io.StringIO(text)))


def test_a_folder_is_measured_without_an_option(run, folder):
    code, out, err = run("estimate", folder)
    rows = rows_of(out)
    assert code == 0
    assert [(row["image"], row["solution"]) for row in rows] == [
        ("disc0.png", "0"),
        ("disc0.png", "1"),
        ("disc1.png", "0"),
        ("disc1.png", "1"),
    ]
    found = [[float(row[f"center_{axis}_mm"]) for axis in "xyz"] for row in rows]
    assert min(np.linalg.norm(np.array(found) - CENTER_MM, axis=1)) < 1.0
    assert err == f"{found_notes(folder)}2 measured, 0 failed, 2 ambiguous: {SETTLE}\n"


def test_an_image_that_fails_is_a_row_a_message_and_code_3(run, folder):
    (folder / "disc10.png").write_bytes(b"junk")
    code, out, err = run("estimate", folder)
    assert code == 3
    assert rows_of(out)[-1]["status"] == Status.NOT_AN_IMAGE
    assert err.removeprefix(found_notes(folder)).splitlines() == [
        "disc10.png: is no image of a known format",
        f"2 measured, 1 failed (not_an_image 1), 2 ambiguous: {SETTLE}",
    ]


def test_quiet_and_verbose(run, folder):
    cv2.imwrite(str(folder / "blank.png"), np.full((240, 320), 90, np.uint8))
    assert run("estimate", folder, "--quiet")[2] == ""
    _, _, err = run("estimate", folder, "-v")
    assert f"{folder}: camera {folder / 'camera.yaml'}, target {folder / 'target.yaml'}" in err
    assert "blank.png: " in err


def test_names_cannot_steer_the_terminal(run, folder):
    (folder / "a\x1b[31m.png").write_bytes(b"junk")
    _, _, err = run("estimate", folder)
    assert "a\\x1b[31m.png" in err
    assert "\x1b" not in err


def test_a_name_with_a_line_end_stays_on_its_line(run, folder):
    (folder / "b\nc.yaml").write_text("color: red\n")
    _, _, err = run("estimate", folder, "--calib", folder / "b\nc.yaml")
    assert "b\\nc.yaml: is no calibration of a known form" in err
    assert err.count("\n") == 1


def test_a_calibration_beside_the_images_that_is_no_file(run, folder):
    (folder / "camera.yaml").unlink()
    (folder / "camera.yaml").symlink_to(folder / "elsewhere.yaml")
    code, _, err = run("estimate", folder)
    assert code == 2
    assert "camera.yaml: is a link to a file that is not there; put the file itself there, or remove it." in err


def test_without_a_calibration(run, folder):
    (folder / "camera.yaml").unlink()
    code, out, err = run("estimate", folder)
    assert (code, out) == (2, "")
    assert err == (
        f"circlepose: {folder}: no calibration for the images there; give --calib FILE or put a camera.yaml "
        "beside them.\n"
    )


def test_without_a_target_the_message_shows_all_four_ways(run, folder):
    (folder / "target.yaml").unlink()
    code, out, err = run("estimate", folder)
    assert (code, out) == (2, "")
    for way in ("--radius-mm 60", "--target rings.yaml", str(folder / "target.yaml"), "target: {radius_mm: 60}"):
        assert way in err


def radius(run, *args):
    code, out, err = run("estimate", *args, "--format", "jsonl")
    assert code == 0, err
    return {circle["radius_mm"] for line in out.splitlines() for circle in json.loads(line)["circles"]}


def test_the_target_is_taken_in_the_order_told(run, folder, tmp_path):
    (folder / "camera.yaml").write_text(CAMERA_YAML + "target: {radius_mm: 21}\n")
    (folder / "target.yaml").write_text("radius_mm: 22\n")
    file = tmp_path / "mine.yaml"
    file.write_text("radius_mm: 23\n")
    assert radius(run, folder, "--radius-mm", "24") == {24.0}
    assert radius(run, folder, "--target", file) == {23.0}
    assert radius(run, folder) == {22.0}
    (folder / "target.yaml").unlink()
    assert radius(run, folder) == {21.0}


def test_the_calibration_named_comes_before_the_one_beside(run, folder, tmp_path):
    (folder / "camera.yaml").write_text("nonsense")
    other = tmp_path / "other.yaml"
    other.write_text(CAMERA_YAML)
    assert run("estimate", folder, "--calib", other)[0] == 0


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (["--target", "t.yaml", "--radius-mm", "5"], "--target, --radius-mm: give one of them"),
        (["--radius-mm", "-5"], "--radius-mm: expected a positive radius"),
        (["--radius-mm", "nan"], "--radius-mm: expected a positive radius"),
        (["--count", "0"], "--count: expected a whole number"),
        (["--count", "many"], "--count: expected a whole number"),
        (["--depth-range-mm", "9:5"], "--depth-range-mm: expected two numbers"),
        (["--major-px", "5"], "--major-px: expected two numbers"),
        (["--minor-px", "a:b"], "--minor-px: expected two numbers"),
        (["--normal", "0,-1"], "--normal: expected a direction X,Y,Z in the camera frame"),
        (["--normal", "0,0,0"], "--normal: expected a direction X,Y,Z"),
        (
            ["--normal", "0,0,-1", "--normal-spread-deg", "0"],
            "circlepose: --normal-spread-deg: expected a positive angle",
        ),
        (
            ["--normal-spread-deg", "9"],
            "--normal-spread-deg: needs --normal X,Y,Z",
        ),
        (["--up", "a,b,c"], "--up: expected a direction X,Y,Z"),
        (["--up-spread-deg", "9"], "--up-spread-deg: needs --up X,Y,Z"),
        (["--facing", "sideways"], "--facing: expected left, right, up, down or a direction X,Y,Z"),
        (["--facing", "0,0,0"], "--facing: expected a direction X,Y,Z"),
        (
            ["--normal", "1,0,-1", "--normal-spread-deg", "9", "--up", "0,1,0", "--up-spread-deg", "9"],
            "circlepose: --normal, --up: exclude each other",
        ),
        (["--jobs", "0"], "--jobs"),
        (["--method", "guess"], "kanatani-liu"),
        (["--format", "xml"], "jsonl"),
        (["--no-such-flag"], "--no-such-flag"),
        (["--calib", "gone.yaml"], "gone.yaml"),
        (["-o", "gone/out.csv"], "folder"),
    ],
)
def test_misuse_ends_with_2_and_one_clear_message(run, folder, args, message):
    code, out, err = run("estimate", folder, *args)
    assert (code, out) == (2, "")
    assert message in err
    assert "Traceback" not in err


@pytest.mark.parametrize("name", ["empty", "nothing*.png"])
def test_inputs_without_an_image_end_with_2(run, tmp_path, name):
    (tmp_path / "empty").mkdir()
    code, _, err = run("estimate", tmp_path / name)
    assert code == 2
    assert name in err


def test_the_command_line_overrides_the_target(run, folder):
    code, out, _ = run("estimate", folder / "disc0.png", "--count", "3")
    assert (code, rows_of(out)[-1]["status"]) == (3, "too_few_circles")
    for args in (["--polarity", "bright"], ["--depth-range-mm", "500:600"], ["--major-px", "5:9"]):
        assert run("estimate", folder, *args)[0] == 3, args
    (folder / "target.yaml").write_text("{radius_mm: 20, axis_intervals_px: {major: [5, 9]}}\n")
    assert run("estimate", folder, "--minor-px", "20:200")[0] == 3
    assert run("estimate", folder, "--major-px", "20:200", "--minor-px", "20:200")[0] == 0


def candidate(run, folder, *args):
    """The chosen normal's x and the ambiguity, of the first image."""
    code, out, err = run("estimate", folder / "disc0.png", *args)
    assert code == 0, err
    row = next(row for row in rows_of(out) if row["chosen"] == "true")
    return float(row["normal_x"]), float(row["ambiguity"]), row["flags"]


def test_hints_choose_the_candidate(run, folder):
    """The disc faces right."""
    for args in (("--normal", "1,0,-1"), ("--facing", "right"), ("--facing", "1,0.2,0"), ("--up", "-0.5,-0.1,0.8")):
        x, ambiguity, flags = candidate(run, folder, *args)
        assert x > 0.4
        assert ambiguity < 0.2
        assert "ambiguous" not in flags
    assert candidate(run, folder, "--facing", "left")[0] < 0.4
    assert candidate(run, folder, "--normal", "-1,0,-1")[0] < 0.4


def test_hints_of_the_command_line_override_the_targets(run, folder):
    (folder / "target.yaml").write_text("radius_mm: 20\nnormal_hint: {direction: [1, 0, -1], spread_deg: 40}\n")
    wide, narrow = (candidate(run, folder, *args) for args in ((), ("--normal-spread-deg", "15")))
    assert wide[0] > 0.4
    assert narrow[0] > 0.4
    assert narrow[1] < wide[1] < 0.45
    assert candidate(run, folder, "--normal", "-1,0,-1")[0] < 0.4


def test_all_folders_are_checked_before_the_first_image(run, tmp_path):
    disc_folder(tmp_path / "a")
    write_disc(disc_folder(tmp_path / "b", images=0) / "disc.png")
    (tmp_path / "b" / "camera.yaml").unlink()
    code, out, err = run("estimate", tmp_path, "-r")
    assert (code, out) == (2, "")
    assert str(tmp_path / "b") in err


def test_each_folder_has_its_own_setup(run, tmp_path):
    disc_folder(tmp_path / "a", 1)
    (disc_folder(tmp_path / "b", 1) / "target.yaml").write_text("radius_mm: 40\n")
    _, out, _ = run("estimate", tmp_path, "-r")
    assert [(row["image"], float(row["radius_mm"])) for row in rows_of(out)[::2]] == [
        ("a/disc0.png", 20.0),
        ("b/disc0.png", 40.0),
    ]


@pytest.mark.parametrize(
    ("value", "says"),
    [
        ("6cm", "'--radius-mm': expected a number of mm without its unit, such as 60, got '6cm'."),
        (
            "1e300",
            "--radius-mm: expected a positive radius in mm (not a diameter) within 1e-06 to 1e+12 mm",
        ),
        ("1e-300", "--radius-mm: expected a positive radius in mm"),
        ("nan", "--radius-mm: expected a positive radius in mm (not a diameter), got nan."),
    ],
)
def test_a_radius_that_is_none_is_quoted(run, folder, value, says):
    code, out, err = run("estimate", folder, "--radius-mm", value)
    assert (code, out) == (2, "")
    assert says in err.replace("\n", " ")
    assert "Warning" not in err


def test_other_sizes_are_refused_unless_scaled(run, folder):
    (folder / "camera.yaml").write_text("fx: 800\nfy: 800\ncx: 319.5\ncy: 239.5\nimage_size: [640, 480]\n")
    code, out, err = run("estimate", folder)
    assert (code, rows_of(out)[0]["status"]) == (3, "size_mismatch")
    # The library names its parameter there.
    assert "or give --scale-calib if the whole image was resized, not cropped" in err
    assert "scale_calibration" not in err
    assert run("estimate", folder, "--scale-calib")[0] == 0


@pytest.mark.parametrize(
    ("name", "starts"),
    [("out.csv", "image,"), ("out.json", '{"schema"'), ("out.jsonl", '{"schema"')],
)
def test_the_output_file_takes_its_form_from_its_ending(run, folder, tmp_path, name, starts):
    code, out, _ = run("estimate", folder, "-o", tmp_path / name)
    assert (code, out) == (0, "")
    assert (tmp_path / name).read_text().startswith(starts)
    assert len(list(tmp_path.iterdir())) == 2


def test_an_output_file_stands_as_it_was_when_the_run_breaks(run, folder, tmp_path, monkeypatch):
    def full(path, image, **_):
        raise OutputError(f"{path}: cannot be written (No space left on device).")

    file = tmp_path / "out.csv"
    run("estimate", folder, "-o", file)
    before = file.read_bytes()
    monkeypatch.setattr(measure, "write_image", full)
    code, _, err = run("estimate", folder, "-o", file, "--overlay", tmp_path / "pictures")
    assert (code, "No space left" in err) == (2, True)
    assert file.read_bytes() == before


def test_a_bug_costs_its_image_and_is_told_with_code_1(run, folder, monkeypatch):
    read = measure.read_photograph

    def broken(path):
        return 1 / 0 if path.name == "disc0.png" else read(path)

    monkeypatch.setattr(measure, "read_photograph", broken)
    code, out, err = run("estimate", folder)
    assert code == 1
    assert [row["status"] for row in rows_of(out)] == ["internal_error", "ok", "ok"]
    assert "disc0.png: ZeroDivisionError: division by zero\n" in err
    assert "please report it" in err
    assert "Traceback" not in err
    assert "Traceback" in run("estimate", folder, "--verbose")[2]
    monkeypatch.setenv("CIRCLEPOSE_DEBUG", "1")
    assert "Traceback" in run("estimate", folder)[2]


def test_an_image_that_vanishes_while_others_are_measured_is_a_row(run, folder, monkeypatch):
    read = measure.read_photograph

    def read_and_remove(path):
        (folder / "disc1.png").unlink(missing_ok=True)
        return read(path)

    monkeypatch.setattr(measure, "read_photograph", read_and_remove)
    code, out, err = run("estimate", folder)
    assert code == 3
    assert [(row["image"], row["status"]) for row in rows_of(out)][-1] == ("disc1.png", "unreadable")
    assert "disc1.png: there is no such file\n" in err


def test_what_is_left_is_resumed_and_then_nothing_is_left(run, folder, tmp_path, monkeypatch):
    whole, file, journal = (tmp_path / name for name in ("whole.csv", "out.csv", "out.csv.journal"))
    run("estimate", folder, "-o", whole)
    measured = []

    def first_only(item, options):
        measured.append(item.name)
        if len(measured) == 2:
            raise OutputError("out.csv: cannot be written (No space left on device).")
        return measure_file(item, options)

    measure_file = measure.measure_file
    monkeypatch.setattr(measure, "measure_file", first_only)
    assert run("estimate", folder, "-o", file)[0] == 2
    assert journal.exists()
    code, _, err = run("estimate", folder, "-o", file, "--resume", "--no-refine")
    assert (code, "refine was True and is False" in err) == (2, True)
    code, _, err = run("estimate", folder, "-o", file, "--resume")
    summary = f"1 finished before\n{file}: written\n2 measured, 0 failed, 2 ambiguous: {SETTLE}\n"
    assert (code, err) == (0, found_notes(folder) + summary)
    assert measured == ["disc0.png", "disc1.png", "disc1.png"]
    assert file.read_bytes() == whole.read_bytes()
    assert not journal.exists()


def test_an_unfinished_run_that_is_begun_anew_is_mentioned(run, folder, tmp_path, monkeypatch):
    file = tmp_path / "out.csv"
    gone = ImageResult("disc0.png", Status.TIMED_OUT, "was not measured within 120 s")
    monkeypatch.setattr(measure, "measure_file", lambda item, options: gone if item.name == gone.image else ok(item))
    ok = lambda item: ImageResult(item.name, Status.NO_CIRCLE, "none")  # noqa: E731
    code, _, err = run("estimate", folder, "-o", file)
    assert code == 3
    assert err.endswith("the same command with --resume measures only what is left\n")
    monkeypatch.undo()
    code, _, err = run("estimate", folder, "-o", file)
    assert (code, "out.csv.journal: was left by an unfinished run" in err) == (0, True)


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (["--resume"], "--resume: needs -o FILE"),
        (["--resume", "-o", "/dev/null"], "/dev/null is not a regular file"),
        (["--timeout", "0"], "--timeout: expected a positive time in seconds, got 0."),
        (["--timeout", "nan"], "--timeout: expected a positive time"),
    ],
)
def test_what_cannot_be_resumed_or_waited_for_is_told(run, folder, args, message):
    code, out, err = run("estimate", folder, *args)
    assert (code, out) == (2, "")
    assert message in err


def test_the_table_is_for_reading(run, folder):
    (folder / "zzz.png").write_bytes(b"junk")
    code, out, _ = run("estimate", folder, "--format", "table", "--method", "all")
    assert code == 3
    header, *_ = (line for line in out.splitlines() if line.strip())
    assert [word for word in ("image", "method", "x mm", "n z", "ambiguity") if word not in header] == []
    assert all(method in out for method in CIRCLE_METHODS)
    assert "not_an_image" in out
    assert "\x1b" not in out


def test_table1_compares_the_methods_one_below_the_other(run, folder):
    _, out, _ = run("estimate", folder, "--format", "table", "--layout", "table1", "--method", "all")
    body = [line for line in out.splitlines() if "disc" in line]
    assert [line.split()[0] for line in body[::2]] == list(CIRCLE_METHODS)
    assert "Circle center position" in out


def test_table2_in_every_form(run, folder):
    for output_format in ("csv", "json", "jsonl", "table"):
        code, out, _ = run("estimate", folder, "--layout", "table2", "--format", output_format)
        assert code == 0
        assert "GCC" in out


def test_overlays_are_drawn_one_per_image(run, folder, tmp_path):
    code, _, _ = run("estimate", folder, "--overlay", tmp_path / "new" / "pictures")
    assert code == 0
    assert sorted(path.name for path in (tmp_path / "new" / "pictures").iterdir()) == ["disc0.png", "disc1.png"]


def test_overlays_do_not_go_among_the_images(run, folder):
    before = (folder / "disc0.png").read_bytes()
    code, _, err = run("estimate", folder, "--overlay", folder)
    assert code == 2
    assert "--overlay" in err
    assert (folder / "disc0.png").read_bytes() == before


def named(*names):
    return [InputImage(path=Path("/elsewhere") / name.lstrip("/"), name=name) for name in names]


def overlay_names(folder, *names):
    images = named(*names)
    pictures = OverlayNames(folder, images)
    return [pictures.path_for(image) for image in images]


def test_overlay_names_are_distinct_and_stay_inside(tmp_path):
    hostile = [
        "a/x.png",
        "b/x.png",
        "a__x.png",
        "../../etc/x.jpg",
        "/abs/y.png",
        "..\\z.png",
        "A/X.png",
        "n\x1b?.png",
        "..",
    ]
    paths = overlay_names(tmp_path, *hostile)
    assert all(path.parent == tmp_path and path.suffix == ".png" for path in paths)
    assert len({path.name.casefold() for path in paths}) == len(hostile)
    assert [path.name for path in paths[:3]] == ["a__x.png", "b__x.png", "a__x-2.png"]
    assert paths[4].name == "y.png"
    assert paths[7].name == "n__.png"


def test_overlay_names_of_a_stream_are_distinct_too(tmp_path):
    pictures = OverlayNames(tmp_path, ())
    names = [pictures.path_for(image).name for image in named("a/x.png", "b/x.png", "b/x.png")]
    assert names == ["x.png", "b__x.png", "b__x-2.png"]


def test_an_overlay_folder_that_cannot_be_made(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="--overlay"):
        OverlayNames(tmp_path / "file", ())


def test_a_radius_is_no_diameter(run, folder):
    _, out, _ = run("estimate", folder / "disc0.png", "--radius-mm", RADIUS_MM)
    row = rows_of(out)[0]
    pixels = 2.0 * float(row["semi_major_px"])
    assert pixels == pytest.approx(2.0 * RADIUS_MM * 400.0 / CENTER_MM[2], rel=0.05)
