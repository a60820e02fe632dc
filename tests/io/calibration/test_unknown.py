"""Files that are no calibration: what each is, and the step to take, in one sentence and soon."""

from __future__ import annotations

import gzip
import json
import pickle
import time
from pathlib import Path

import pytest

from circlepose.errors import CalibrationError
from circlepose.io.calibration.reader import read_camera_file

MATRIX = [[900.0, 0.0, 640.0], [0.0, 900.0, 480.0], [0.0, 0.0, 1.0]]
NUMPY_YAML = """camera_matrix: !!python/object/apply:numpy.core.multiarray._reconstruct
  args:
  - !!python/name:numpy.ndarray ''
  - !!python/tuple [0]
  - !!binary |
    Yg==
"""


def answer(content: bytes | Path) -> str:
    begin = time.perf_counter()
    with pytest.raises(CalibrationError) as caught:
        read_camera_file(content)
    assert time.perf_counter() - begin < 20.0
    text = str(caught.value)
    assert text[-1] in ".?"
    assert "\n" not in text
    assert len(text) < 1000
    assert "radius_mm" not in text
    return text


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"radius_mm: 60\n", "describes a target; give it as --target"),
        (b"kind: coplanar\nradii_mm: [50, 30]\n", "describes a target; give it as --target"),
        (b"image,instance,circle,method,status,center_x_mm\na.png,0,disc,fit,ok,1.5\n", "is a table of poses"),
        (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", "is an image, no calibration; give the file with the camera matrix"),
        (b"\xff\xd8\xff\xe0\0\x10JFIF", "is an image"),
        (pickle.dumps({"mtx": MATRIX}), "is a Python pickle, which is never loaded"),
        (pickle.dumps({"mtx": MATRIX}, protocol=0), "is a Python pickle, which is never loaded"),
        (b"\x89HDF\r\n\x1a\n\0\0", "is an HDF5 file; write the camera matrix"),
        (NUMPY_YAML.encode(), "is YAML of Python objects, as yaml.dump writes NumPy arrays; write matrix.tolist()"),
        (b"#ROSBAG V2.0\nE\0\0\0", "is a ROS bag; record one message of its camera_info as text: rostopic echo"),
        (b"SQLite format 3\0\x10\0", "of a ROS 2 bag, record one message of its camera_info as text: ros2 topic"),
        (b"\x89MCAP0\r\n\x01", "is a ROS 2 bag (MCAP)"),
        (json.dumps({"cells": [], "metadata": {}, "nbformat": 4}).encode(), "is a Jupyter notebook"),
        (b"<!DOCTYPE html>\n<html lang='en'><head>", "is a web page (HTML), no calibration; download"),
        (b"%time,field.header.seq,field.K0\n1,2,3\n", "record one message as text: rostopic echo -n1"),
        (b"[[900.   0. 640.]\n [  0. 900. 480.]\n [  0.   0.   1.]]\n", "is a matrix as NumPy prints it"),
        (b"{'mtx': array([[900., 0., 640.],\n       [0., 900., 480.]])}", "is printed by Python; write"),
        (b"import cv2\nret = cv2.calibrateCamera()\n", "is a Python program"),
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:ab\n", "fetch it with git lfs pull"),
        (b"%PDF-1.7\n", "is a PDF"),
        (b"900 0 640\n0 900 480\n0 0 1\n", "is text of no known form of a calibration; expected camera_matrix"),
        (b"Hello, this is the camera of the lab.\n", "is text of no known form of a calibration"),
        (b"name: left\ncolor: red\n", "is no calibration of a known form; expected camera_matrix"),
        (b"- 1\n- 2\n", "expected keys and values, such as `fx: 1200`; found a list"),
        (json.dumps(MATRIX).encode(), "expected keys and values, such as `fx: 1200`; found a list"),
        (b'{"fx": 900,\n"fy": 900 "cx": 640}', "line 2: is not valid JSON (Expecting ',' delimiter)"),
        (b"fx: 900\nfy: [900\ncx: 640\n", "line 3: is not valid YAML"),
        (b"a: 1\n---\nb: 2\n", "holds 2 YAML documents"),
        (b"# nothing but a remark\n", "expected keys and values, such as `fx: 1200`"),
        (b"", "is empty"),
        (b" \r\n\t\n", "is empty"),
        (b"\x01\x02\x03\x00\xfe", "is a binary file of no known form"),
        (b'{"K":' * 5000 + b"1" + b"}" * 5000, "nested too deeply"),
        (b"K: " + b"[" * 5000, "nested too deeply"),
        (gzip.compress(b"\0" * 20_000_000, mtime=0), "unpacks to more than 10 MB"),
        (json.dumps({f"group {i}": {f"k{j}": {"a": j} for j in range(100)} for i in range(200)}).encode(), "is no"),
    ],
)  # fmt: skip
def test_what_it_is_and_what_to_do(content: bytes, says: str) -> None:
    assert says in answer(content)


def test_a_large_file_is_named_by_its_first_bytes(tmp_path: Path) -> None:
    for begin, says in ((b"#ROSBAG V2.0\n", "is a ROS bag"), (b"K: [", "is larger than 10 MB")):
        path = tmp_path / "large"
        with path.open("wb") as handle:
            handle.write(begin)
            handle.truncate(100_000_000)
        assert says in answer(path)


def test_messages_name_the_file(tmp_path: Path) -> None:
    path = tmp_path / "cam.yaml"
    path.write_bytes(b"radii_mm: [1]\n")
    assert answer(path).startswith(f"{path}: describes a target")
