"""What comes on standard input, and files that are passed over, as a shell gives them."""

from __future__ import annotations

import csv

import cv2
import pytest

from tests.support.discs import RADIUS_MM, disc_folder
from tests.support.processes import SETTLE, run, shell


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return disc_folder(tmp_path_factory.mktemp("inputs") / "imgs")


def images_of(text):
    return [row["image"] for row in csv.DictReader(text.splitlines()) if row["solution"] in ("0", "")]


@pytest.mark.parametrize("option", ["", "--stdin image"])
def test_one_image_on_standard_input(folder, option):
    line = f"$circlepose estimate - {option} --calib $1/camera.yaml --radius-mm {RADIUS_MM:g} < $1/disc0.png"
    done = shell(line, folder)
    assert (done.returncode, images_of(done.stdout)) == (0, ["stdin"])
    by_name = run("estimate", folder / "disc0.png", "--calib", folder / "camera.yaml", "--radius-mm", RADIUS_MM)
    assert done.stdout.replace("stdin,", "disc0.png,") == by_name.stdout.replace(f"{folder}/disc0.png,", "disc0.png,")


def test_an_image_that_comes_in_parts(folder):
    line = (
        "(head -c 3 $1/disc0.png; sleep 0.3; tail -c +4 $1/disc0.png) | "
        f"$circlepose estimate - --calib $1/camera.yaml --radius-mm {RADIUS_MM:g}"
    )
    assert images_of(shell(line, folder).stdout) == ["stdin"]


def test_an_image_on_standard_input_has_no_calibration_beside_it(folder):
    done = shell("$circlepose estimate - < $1/disc0.png", folder)
    assert done.returncode == 2
    assert done.stderr.endswith("-: an image on standard input has no calibration beside it; give --calib FILE.\n")


def test_nothing_is_left_of_an_image_on_standard_input(folder, tmp_path):
    line = f"TMPDIR=$2 $circlepose estimate - --calib $1/camera.yaml --radius-mm {RADIUS_MM:g} < $1/disc0.png"
    assert shell(line, folder, tmp_path).returncode == 0
    assert list(tmp_path.iterdir()) == []


def test_what_is_said_to_be_an_image_and_is_none_is_a_row(folder):
    line = f"echo a.png | $circlepose estimate - --stdin image --calib $1/camera.yaml --radius-mm {RADIUS_MM:g}"
    done = shell(line, folder)
    assert done.returncode == 3
    assert "stdin,,,,,,not_an_image," in done.stdout


def test_paths_that_end_with_nul(folder, tmp_path):
    odd = tmp_path / "a\nb.png"
    odd.write_bytes((folder / "disc0.png").read_bytes())
    line = (
        "find $1 $2 -name '*.png' -print0 | sort -z | "
        f"$circlepose estimate - -0 --calib $1/camera.yaml --radius-mm {RADIUS_MM:g}"
    )
    done = shell(line, folder, tmp_path)
    assert (done.returncode, len(images_of(done.stdout))) == (0, 3)


def test_photographs_of_other_kinds_are_counted_with_how_to_convert_them(tmp_path):
    folder = disc_folder(tmp_path / "imgs")
    for name in ("a.heic", "b.HEIC", "c.mp4", "notes.txt"):
        (folder / name).write_text("x")
    for inputs in ([folder], [folder / "*"]):
        done = run("estimate", *inputs)
        assert done.returncode == 0
        assert done.stderr.splitlines()[-2:] == [
            "3 files skipped: 2 .heic, 1 .mp4; convert first (HEIC: heif-convert photo.heic photo.png; a film: "
            "ffmpeg -i run.mp4 frame%06d.png)",
            f"2 measured, 0 failed, 2 ambiguous: {SETTLE}",
        ]


def test_a_folder_of_films_alone_names_how_to_convert_them(tmp_path):
    (tmp_path / "a.mov").write_text("x")
    done = run("estimate", tmp_path)
    assert done.returncode == 2
    assert "holds no image, only 1 other file (a.mov); convert first (a film: ffmpeg -i" in done.stderr


def test_the_other_pages_of_a_tiff_are_not_passed_over_in_silence(folder, tmp_path):
    image = cv2.imread(str(folder / "disc0.png"), cv2.IMREAD_GRAYSCALE)
    assert cv2.imwritemulti(str(tmp_path / "pages.tif"), [image] * 3)
    done = run("estimate", tmp_path, "--calib", folder / "camera.yaml", "--radius-mm", RADIUS_MM)
    assert done.returncode == 0
    assert "pages.tif: has 3 pages; only the first was measured, split the file to measure all\n" in done.stderr


def test_the_depth_range_is_named_where_it_is_the_reason(folder):
    done = run("estimate", folder / "disc0.png", "--depth-range-mm", "1000:2000")
    assert done.returncode == 3
    assert "; depth_range_mm 1000 to 2000 means major axes of " in done.stderr
    assert " px, no others were taken" in done.stderr
