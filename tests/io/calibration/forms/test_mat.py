from __future__ import annotations

import io
import struct
import zlib

import numpy as np
import pytest
from scipy.io import savemat

from circlepose.io.calibration.mat_file import MatObject, mat_variables
from circlepose.io.calibration.reader import read_camera_file
from tests.support.projected_points import assert_pixels, brown
from tests.support.refusals import refused_calibration

K = [[800.0, 0.0, 321.5], [0.0, 802.0, 238.25], [0.0, 0.0, 1.0]]
D = [[-0.2, 0.1, 1e-3, 2e-3, 0.01]]


def saved(*, compressed: bool = False, **variables: object) -> bytes:
    handle = io.BytesIO()
    savemat(handle, variables, do_compression=compressed)
    return handle.getvalue()


def pixel(x: float, y: float) -> tuple[float, float]:
    u, v = brown(x, y, (-0.2, 0.1, 0.01), 1e-3, 2e-3)
    return 800.0 * u + 321.5, 802.0 * v + 238.25


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize(("matrix", "dist"), [("K", "D"), ("mtx", "dist"), ("cameraMatrix", "distCoeffs")])
def test_a_camera_matrix_and_coefficients(matrix: str, dist: str, compressed: bool) -> None:
    content = saved(compressed=compressed, **{matrix: K, dist: D}, imageWidth=640, imageHeight=480, note="text")
    file = read_camera_file(content)
    assert file.form == "MAT-file"
    assert file.camera.image_size == (640, 480)
    assert_pixels(file.camera, pixel)
    assert "OpenCV's convention" in file.notes[0]


def test_four_coefficients_are_taken_for_a_pinhole_with_a_remark() -> None:
    file = read_camera_file(saved(K=K, D=D[0][:4]))
    assert file.camera.model == "pinhole"
    assert "not for a fisheye lens" in file.notes[1]


def element(kind: int, data: bytes) -> bytes:
    return struct.pack("<II", kind, len(data)) + data + b"\0" * (-len(data) % 8)


def mat(*elements: bytes) -> bytes:
    return b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + b"".join(elements)


def opaque(name: bytes, class_name: bytes) -> bytes:
    flags = element(6, struct.pack("<II", 17, 0))
    names = b"".join(element(1, each) for each in (name, b"MCOS", class_name))
    return element(14, flags + names + element(14, element(6, struct.pack("<II", 13, 0))))


def numeric(name: bytes, shape: tuple[int, ...], data: bytes, kind: int = 6, stored: int = 9) -> bytes:
    head = element(6, struct.pack("<II", kind, 0)) + element(5, struct.pack(f"<{len(shape)}i", *shape))
    return element(14, head + element(1, name) + element(stored, data))


def test_numbers_are_those_that_scipy_writes() -> None:
    rng = np.random.default_rng(1)
    arrays = {f"a{i}": rng.integers(0, 99, (2, 3)).astype(kind) for i, kind in enumerate("bBhHiIqQfd")}
    found = mat_variables(
        saved(compressed=True, **arrays, inner={"b": {"c": [[1.5]]}}, z=1j, cells=np.array([1, "x"], object))
    )
    assert found == {**{name: array.tolist() for name, array in arrays.items()}, "inner": {"b": {"c": [[1.5]]}}}


def test_big_endian() -> None:
    data = struct.pack(">II", 6, 8) + struct.pack(">II", 6, 0) + struct.pack(">IIii", 5, 8, 1, 1)
    data += struct.pack(">HH4s", 1, 1, b"x\0\0\0") + struct.pack(">IId", 9, 8, 2.5)
    content = b" " * 124 + b"\x01\x00MI" + struct.pack(">II", 14, len(data)) + data
    assert mat_variables(content) == {"x": [[2.5]]}


def test_an_object_is_known_by_its_class() -> None:
    assert mat_variables(mat(opaque(b"params", b"cameraParameters"))) == {"params": MatObject("cameraParameters")}


BOMB = zlib.compress(bytes(30_000_000), 9)
DEEP = {"a": [[1.0]]}
for _ in range(20):
    DEEP = {"a": DEEP}


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (
            mat(opaque(b"params", b"cameraParameters")),
            "cameraParameters, which only MATLAB can read; save it with [K, D]",
        ),
        (mat(opaque(b"t", b"table")), "without a known calibration; expected fc, cc, kc (Bouguet), the structure of"),
        (b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(512) + b"\x89HDF\r\n\x1a\n", "version 7.3 (HDF5); save it"),
        (b"# Created by Octave 8.4.0\n# name: fc\n# type: matrix\n", "a text file of Octave; save it with save("),
        (mat(struct.pack("<II", 15, len(BOMB)) + BOMB), "it unpacks to more than 20 MB"),
        (mat(numeric(b"K", (2**30, 2**30), b"")), "found no numbers"),
        (mat(numeric(b"K", (3, 3), b"\0" * 8)), "it is damaged (cannot reshape array"),
        (mat(numeric(b"K", (-3, -3), b"\0" * 72)), "K has a negative number of rows or columns"),
        (mat(numeric(b"K", (1, 1), b"\0" * 8, stored=77)), "K is stored in an unknown type"),
        (mat(struct.pack("<II", 14, 900)), "an element is longer than the file"),
        (mat(element(14, element(6, b""))), "it is damaged"),
        (mat(element(15, b"no zlib")), "it is damaged"),
        (saved(**DEEP), "found a."),
        (saved(K=K), "found K."),
        (saved(K=K, M=3.0, mtx=K, D=D), "K, mtx: mean the same"),
        (saved(K=np.transpose(K), D=D), "K: stands transposed, as MATLAB's IntrinsicMatrix"),
        (saved(K=K, D=np.zeros((3, 3))), "D: expected one row or one column"),
        (saved(K=np.eye(4), D=D), "K: expected a 3 x 3 matrix, got 4 x 4"),
    ],
)
def test_what_is_wrong_is_said_in_a_sentence(content: bytes, words: str) -> None:
    assert words in refused_calibration(content)
