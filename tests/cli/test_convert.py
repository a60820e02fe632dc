"""`circlepose camera --to`: what is written, where, and what is said of it."""

from __future__ import annotations

import gzip

import pytest

from circlepose.io.calibration.reader import read_camera, read_camera_file
from tests.support.discs import CAMERA_YAML

TO = "--to opencv|ros|kalibr|colmap|mrcal|circlepose"
CHAIN = """
cam0:
  camera_model: pinhole
  intrinsics: [400.0, 400.0, 159.5, 119.5]
  distortion_model: radtan
  distortion_coeffs: [-0.1, 0.01, 0.0, 0.0]
  resolution: [320, 240]
cam1:
  camera_model: pinhole
  intrinsics: [410.0, 410.0, 160.5, 118.5]
  distortion_model: equidistant
  distortion_coeffs: [0.01, 0.0, 0.0, 0.0]
  resolution: [320, 240]
"""


@pytest.fixture
def camera(tmp_path):
    path = tmp_path / "camera.yaml"
    path.write_text(CAMERA_YAML)
    return path


@pytest.fixture
def chain(tmp_path):
    path = tmp_path / "chain.yaml"
    path.write_text(CHAIN)
    return path


@pytest.mark.parametrize("to", ["opencv", "ros", "kalibr", "colmap", "mrcal", "circlepose"])
@pytest.mark.parametrize("output", [(), ("-o", "-")])
def test_standard_output_holds_the_file_alone(run, camera, to, output):
    code, out, err = run("camera", camera, "--to", to, *output)
    assert code == 0
    assert read_camera(out.encode()).image_size == (320, 240)
    assert "camera --to" not in err
    assert "to see it" not in err


@pytest.mark.parametrize("name", ["out.yaml", "out.xml", "out.json", "out.yml.gz"])
def test_a_file_of_the_syntax_that_its_ending_states(run, camera, tmp_path, name):
    code, out, err = run("camera", camera, "--to", "opencv", "-o", tmp_path / name)
    assert (code, out) == (0, "")
    content = (tmp_path / name).read_bytes()
    text = gzip.decompress(content) if name.endswith(".gz") else content
    begins = {"out.xml": b"<?xml", "out.json": b"{"}
    assert text.startswith(begins.get(name, b"%YAML:1.0\n"))
    assert read_camera(tmp_path / name).camera_matrix.tobytes() == read_camera(camera).camera_matrix.tobytes()
    assert f"circlepose camera {tmp_path / name}" in err.splitlines()[-1]


def test_our_own_file_is_replaced_and_no_other(run, camera, tmp_path):
    output = tmp_path / "out.yaml"
    assert run("camera", camera, "--to", "ros", "-o", output)[0] == 0
    assert run("camera", camera, "--to", "kalibr", "-o", output)[0] == 0
    output.write_text("precious: 1\n")
    code, _, err = run("camera", camera, "--to", "ros", "-o", output)
    assert code == 2
    assert "does not bear circlepose's mark" in err
    assert output.read_text() == "precious: 1\n"
    assert run("camera", camera, "--to", "ros", "-o", output, "--overwrite")[0] == 0
    assert read_camera_file(output).form == "ROS camera_info"


def test_the_calibration_itself_is_never_overwritten(run, camera, tmp_path):
    link = tmp_path / "link.yaml"
    link.symlink_to(camera)
    for output in (camera, link):
        code, _, err = run("camera", camera, "--to", "ros", "-o", output, "--overwrite")
        assert code == 2
        assert "would be overwritten, but it holds the calibration to convert" in err
    assert camera.read_text() == CAMERA_YAML


def test_one_camera_of_several_by_its_name(run, chain):
    code, out, err = run("camera", chain, "--to", "colmap")
    assert code == 0
    assert " OPENCV 320 240 400.0 400.0 160.0 120.0 " in out
    assert "cam0 taken, of the 2 cameras cam0, cam1" in err
    code, out, err = run("camera", chain, "--to", "colmap", "--camera-name", "cam1")
    assert code == 0
    assert " OPENCV_FISHEYE 320 240 410.0 410.0 161.0 119.0 " in out
    assert "the camera cam1 is called 1" in err


def test_what_looks_wrong_is_said(run, tmp_path):
    (tmp_path / "mm.yaml").write_text("{fx: 8, fy: 8, cx: 159.5, cy: 119.5, image_size: [320, 240]}\n")
    code, _, err = run("camera", tmp_path / "mm.yaml", "--to", "circlepose")
    assert code == 0
    assert "warning: " in err
    assert "focal length in mm" in err


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("-o", "out.yaml"), f"-o: needs {TO}"),
        (("--overwrite",), f"--overwrite: needs {TO}"),
        (("--to", "ros", "--overwrite"), "--overwrite: needs -o FILE"),
        (("--to", "ros", "--format", "json"), "--format json: is of the report"),
        (("--to", "ros", "--target", "t.yaml"), "--target: is for the report"),
        (("--to", "ros", "-o", "out.json"), "ROS camera_info is written as .yaml or .yml, not .json"),
        (("--to", "colmap", "-o", "cameras.bin"), "COLMAP cameras is written as .txt, not .bin"),
        (("--to", "ros", "-o", "out.yaml.gz"), "ROS camera_info is written as .yaml or .yml, not .yaml.gz"),
        (("--to", "halcon"), "halcon"),
    ],
)
def test_options_that_do_not_go_together(run, camera, tmp_path, monkeypatch, options, words):
    monkeypatch.chdir(tmp_path)
    code, out, err = run("camera", camera, *options)
    assert (code, out) == (2, "")
    assert words in " ".join(err.split())
    assert [each.name for each in tmp_path.iterdir()] == ["camera.yaml"]


def test_a_refused_camera_leaves_the_former_file(run, tmp_path):
    (tmp_path / "skew.yaml").write_text(
        "{camera_matrix: [[400, 2.0, 159.5], [0, 400, 119.5], [0, 0, 1]], image_size: [320, 240]}\n"
    )
    output = tmp_path / "out.yaml"
    output.write_text("# Written by circlepose\nformer: 1\n")
    code, out, err = run("camera", tmp_path / "skew.yaml", "--to", "kalibr", "-o", output)
    assert (code, out) == (2, "")
    assert "Kalibr camchain cannot hold a pinhole camera with a skew of 2 px exactly" in err
    assert output.read_text() == "# Written by circlepose\nformer: 1\n"
