from __future__ import annotations

import gzip
from pathlib import Path

import cv2
import numpy as np
import pytest

from circlepose.errors import CalibrationError
from circlepose.io.calibration.reader import read_camera_file
from tests.support.lens_formulas import CX, CY, FX, FY, SIZE, check_terms

K = np.array([[FX, 0.0, CX], [0.0, FY, CY], [0.0, 0.0, 1.0]])
D = [-0.215, 0.094, 4.5e-4, -2.5e-4, 0.013]
TERMS = dict(zip(("k1", "k2", "p1", "p2", "k3"), D, strict=True))
FISHEYE = {"k1": -0.02, "k2": 0.004, "k3": -0.001, "k4": 0.0002}


def matrix(rows: int, cols: int, values: object, dt: str = "d") -> str:
    return f"!!opencv-matrix\n   rows: {rows}\n   cols: {cols}\n   dt: {dt}\n   data: {values}\n"


NUMBERS = [float(each) for each in K.ravel()]
BODY = f"camera_matrix: {matrix(3, 3, NUMBERS)}distortion_coefficients: {matrix(1, 5, D)}"


@pytest.mark.parametrize(
    "size",
    [
        "image_width: 1280\nimage_height: 960\n",
        "image_width:1280\nimage_height:960\n",
        "image_size: [ 1280, 960 ]\n",
        f"image_size: {matrix(2, 1, [1280, 960], 'i')}",
        f"imageSize: {matrix(1, 2, [1280, 960], 'u')}",
        'image_size: "(1280, 960)"\n',
    ],
)
@pytest.mark.parametrize("pack", [bytes, gzip.compress])
def test_sizes_as_opencv_programs_write_them(size: str, pack: type) -> None:
    text = f"%YAML:1.0\n---\n{size}aspectRatio: 1.\nflags: 6\n{BODY}"
    file = read_camera_file(pack(text.encode()))
    assert (file.form, file.camera.image_size, file.notes) == ("OpenCV FileStorage", SIZE, ())
    check_terms(file, TERMS)


def test_a_key_without_a_blank_is_only_read_where_the_file_is_opencvs() -> None:
    with pytest.raises(CalibrationError, match=r"^<bytes>"):
        read_camera_file(f"fx:{FX}\nfy:{FY}\ncx:{CX}\ncy:{CY}\n".encode())


@pytest.mark.parametrize("suffix", ["xml", "yml", "json", "yml.gz", "xml.gz"])
def test_a_stereo_file_as_opencv_writes_it(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"stereo.{suffix}"
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("M1", K)
    storage.write("D1", np.array([0.5, 0.0, 0.0, 0.0, 0.0]))
    storage.write("M2", K)
    storage.write("D2", np.array([D]))
    for name in ("R", "E", "F", "R1", "R2"):
        storage.write(name, np.eye(3))
    for name in ("P1", "P2"):
        storage.write(name, np.eye(3, 4))
    storage.write("T", np.array([[-60.0], [0.0], [0.0]]))
    storage.write("Q", np.eye(4))
    storage.release()
    check_terms(read_camera_file(path), {"k1": 0.5})
    check_terms(read_camera_file(path, "M2"), TERMS)


@pytest.mark.parametrize("said", ["fisheye_model: 1\n", "camera_model: fisheye\n", "is_fisheye: 1\n"])
def test_the_fisheye_of_opencv(said: str) -> None:
    coefficients = matrix(4, 1, list(FISHEYE.values()))
    text = f"%YAML:1.0\n---\n{said}K: {matrix(3, 3, NUMBERS)}D: {coefficients}"
    check_terms(read_camera_file(text.encode()), FISHEYE, fisheye=True)


def test_matrices_in_a_group_and_of_other_types_of_numbers() -> None:
    numbers = [1200.0, 0.0, 640.0, 0.0, 1200.0, 480.0, 0.0, 0.0, 1.0]
    inner = f"camera_matrix: {matrix(3, 3, numbers, 'f')}dist_coeffs: {matrix(5, 1, [0, 0, 0, 0, 0], 'i')}"
    text = "%YAML:1.0\n---\ncam0:\n" + "".join(f"   {line}\n" for line in inner.splitlines())
    file = read_camera_file(text.encode())
    assert file.form == "OpenCV FileStorage"
    assert file.camera.camera_matrix.ravel().tolist() == numbers


def test_a_matrix_that_stands_column_by_column() -> None:
    text = f"%YAML:1.0\n---\nK: {matrix(3, 3, [float(each) for each in K.T.ravel()])}D: {matrix(1, 5, D)}"
    file = read_camera_file(text.encode())
    check_terms(file, TERMS)
    assert "was transposed" in file.notes[0]


@pytest.mark.parametrize(
    ("rest", "says"),
    [
        (f"radial_terms: {matrix(1, 1, [0.5])}", "radial_terms: is no known key and looks like distortion"),
        (f"image_size: {matrix(1, 3, [1, 2, 3])}", "image_size: expected 2 numbers, got 3"),
        ("image_width: 1280\nimage_height: 960\nimage_size: [640, 480]\n", "contradict each other"),
        ("lens_model: double_sphere\n", "double sphere model, which circlepose does not have; calibrate again"),
    ],
)
def test_what_is_refused(rest: str, says: str) -> None:
    with pytest.raises(CalibrationError) as caught:
        read_camera_file(f"%YAML:1.0\n---\n{BODY}{rest}".encode())
    assert says in str(caught.value)
