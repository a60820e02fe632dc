from __future__ import annotations

import io
import zipfile

import numpy as np
import pytest

from circlepose.io.calibration.reader import read_camera_file
from tests.support.lens_formulas import POINTS, brown, check_pixels, kannala_brandt
from tests.support.refusals import refused_calibration

K = np.array([[905.5, 0.0, 640.25], [0.0, 907.0, 355.75], [0.0, 0.0, 1.0]])
D = np.array([[-0.21, 0.09, 0.0004, -0.0002, 0.013]])


def npz(**arrays: object) -> bytes:
    stream = io.BytesIO()
    np.savez(stream, **arrays)  # type: ignore[arg-type]
    return stream.getvalue()


def npy(array: object) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array)  # type: ignore[arg-type]
    return stream.getvalue()


@pytest.mark.parametrize(
    ("matrix", "dist"),
    [
        *(("mtx", "dist"), ("K", "D"), ("camera_matrix", "dist_coeffs"), ("cameraMatrix", "distCoeffs")),
        *(("intrinsic_matrix", "distortion_coefficients"), ("intrinsics", "distortion"), ("camera_mtx", "dist_coef")),
        *(("K1", "D1"), ("mtx_left", "dist_left"), ("mtxL", "distL"), ("left_mtx", "left_dist")),
    ],
)
def test_names_under_which_people_save(matrix: str, dist: str) -> None:
    vectors = np.zeros((3, 3, 1))
    file = read_camera_file(
        npz(ret=0.2, **{matrix: K, dist: D}, rvecs=vectors, newcameramtx=K, image_size=[1280, 720])
    )
    assert file.form == "NumPy arrays"
    assert file.camera.image_size == (1280, 720)
    expected = [brown(p, (905.5, 907.0), (640.25, 355.75), [-0.21, 0.09, 0.013], (0.0004, -0.0002)) for p in POINTS]
    check_pixels(file.camera, expected)


def test_a_compressed_archive_of_floats_of_32_bits_and_fortran_order() -> None:
    stream = io.BytesIO()
    np.savez_compressed(stream, mtx=np.asfortranarray(K.astype(np.float32)), dist=D.T)
    np.testing.assert_array_equal(read_camera_file(stream.getvalue()).camera.camera_matrix, K)


@pytest.mark.parametrize("stated", [{"fisheye": True}, {"fisheye": 1}, {"camera_model": "equidistant"}])
def test_a_fisheye_that_is_stated(stated: dict[str, object]) -> None:
    coefficients = [0.03, -0.01, 0.002, 0.001]
    camera = read_camera_file(npz(K=K, D=np.array(coefficients)[:, None], **stated)).camera
    check_pixels(camera, [kannala_brandt(p, (905.5, 907.0), (640.25, 355.75), coefficients) for p in POINTS])


def test_four_coefficients_without_a_model_get_a_remark() -> None:
    file = read_camera_file(npz(K=K, D=[0.1, 0.01, 0.001, 0.002]))
    assert file.camera.model == "pinhole"
    assert any("fisheye=True" in note for note in file.notes)


@pytest.mark.parametrize(
    "size",
    [
        {"w": 1280, "h": 720},
        {"width": 1280, "height": 720},
        {"img_size": (1280, 720)},
        {"img_shape": (720, 1280)},
        {"image_shape": (720, 1280, 3)},
        {"image_width": np.array([1280]), "image_height": np.array([720])},
    ],
)
def test_image_size(size: dict[str, object]) -> None:
    file = read_camera_file(npz(mtx=K, dist=D, **size))
    assert file.camera.image_size == (1280, 720)
    assert any("(height, width)" in note for note in file.notes) == any("shape" in key for key in size)


def test_several_cameras() -> None:
    content = npz(K1=K, D1=D, K2=2 * K * [[1], [1], [0.5]], D2=D)
    assert read_camera_file(content).camera.camera_matrix[0, 0] == 905.5
    assert any("K1 taken" in note for note in read_camera_file(content).notes)
    for name in ("K2", "2"):
        assert read_camera_file(content, name).camera.camera_matrix[0, 0] == 1811.0
    assert "its cameras are K1, K2" in refused_calibration(content, "K3")


def test_a_transposed_matrix_is_turned_with_a_remark() -> None:
    file = read_camera_file(npz(mtx=K.T, dist=D))
    np.testing.assert_array_equal(file.camera.camera_matrix, K)
    assert any("transposed" in note for note in file.notes)


def test_a_poor_reprojection_error_is_said() -> None:
    assert any(
        note.startswith("ret: a reprojection error of 4.5") for note in read_camera_file(npz(ret=4.5, K=K, D=D)).notes
    )


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (npy(K), "3 x 3 matrix alone"),
        (npy(D), "one array of shape 1 x 5"),
        (npy(np.array({"K": K, "D": D}, dtype=object)), "np.savez('camera.npz'"),
        (npz(K=K, D=np.array([None, 1], dtype=object)), "never unpickles"),
        (npz(K=K), "no lens coefficients"),
        (npz(rvecs=K), "no camera matrix"),
        (npz(K=K, mtx=K, D=D), "mean the same"),
        (npz(K=K[:2], D=D), "3 x 3"),
        (npz(K=K, D=np.zeros(3)), "D"),
        (npz(K=np.full((3, 3), np.nan), D=D), "K"),
        (npz(K=K, D=np.array(["a", "b"])), "expected numbers"),
        (npz(K=K, D=D, image_size=[1280]), "expected 2 numbers"),
        (npz(K=K, D=D, model="omnidirectional"), "omnidirectional"),
        (npy(K)[:100], "damaged"),
        (npy(K)[:-8], "9 values of 8 bytes stand in 64;"),
        (npz(K=K, D=D)[:200], "damaged"),
        (b"\x93NUMPY\x01\x00\x10\x00{'descr': '((((", "damaged"),
    ],
)
def test_what_is_refused(content: bytes, said: str) -> None:
    assert said in refused_calibration(content)


def test_an_array_that_unpacks_to_much_is_not_unpacked() -> None:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        with archive.open("K.npy", "w", force_zip64=True) as member:
            for _ in range(30):
                member.write(bytes(1_000_000))
        archive.writestr("D.npy", npy(D))
    assert "more than 100 kB" in refused_calibration(stream.getvalue())


def test_a_header_that_promises_much_reserves_nothing() -> None:
    header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (99999999, 9), }\n"
    assert "got '<f8', (99999999" in refused_calibration(
        b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header
    )
