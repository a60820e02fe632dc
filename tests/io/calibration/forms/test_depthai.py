from __future__ import annotations

import json

import pytest

from circlepose.errors import CalibrationError
from circlepose.io.calibration.reader import read_camera_file
from tests.support.projected_points import assert_pixels, brown, equidistant
from tests.support.refusals import refused_calibration

RATIONAL = [1.9, -0.4, 2e-4, -3e-4, 0.05, 2.1, -0.3, 0.02, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]


def camera(f: float, dist: list[float] = RATIONAL, **others: object) -> dict[str, object]:
    return {
        "cameraType": 0,
        "distortionCoeff": dist,
        "extrinsics": {"rotationMatrix": [], "toCameraSocket": -1},
        "height": 800,
        "intrinsicMatrix": [[f, 0.0, 643.5], [0.0, f + 1.0, 398.25], [0.0, 0.0, 1.0]],
        "lensPosition": 0,
        "specHfovDeg": 71.86,
        "width": 1280,
        **others,
    }


def device(*pairs: list[object]) -> bytes:
    return json.dumps({"batchName": "", "boardName": "DM9098", "cameraData": list(pairs), "version": 7}).encode()


THREE = device(
    [2, camera(801.0)],
    [0, camera(1502.0, lensPosition=130)],
    [1, camera(290.0, [0.05, -0.01, 2e-3, -1e-3] + [0.0] * 10, cameraType=1)],
)


def test_the_first_socket_is_read_with_all_coefficients() -> None:
    file = read_camera_file(THREE)
    assert file.form == "depthai"
    assert file.camera.image_size == (1280, 800)
    assert file.notes[0] == "CAM_A taken, of the 3 cameras CAM_A, CAM_B, CAM_C"
    assert "lens position 130" in file.notes[1]

    def pixel(x: float, y: float) -> tuple[float, float]:
        k1, k2, p1, p2, k3, k4, k5, k6 = RATIONAL[:8]
        r2 = x * x + y * y
        radial = (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3) / (1 + k4 * r2 + k5 * r2**2 + k6 * r2**3)
        u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
        v = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
        return 1502.0 * u + 643.5, 1503.0 * v + 398.25

    assert_pixels(file.camera, pixel)


@pytest.mark.parametrize("name", ["CAM_B", "cam_b", "1", "left"])
def test_a_fisheye_camera_by_the_name_of_its_socket(name: str) -> None:
    file = read_camera_file(THREE, name)
    assert file.camera.model == "fisheye"

    def pixel(x: float, y: float) -> tuple[float, float]:
        u, v = equidistant(x, y, (0.05, -0.01, 2e-3, -1e-3))
        return 290.0 * u + 643.5, 291.0 * v + 398.25

    assert_pixels(file.camera, pixel)


def test_five_coefficients_of_a_camera_that_somebody_set() -> None:
    file = read_camera_file(device([0, camera(800.0, [-0.2, 0.1, 1e-3, 2e-3, 0.01])]))

    def pixel(x: float, y: float) -> tuple[float, float]:
        u, v = brown(x, y, (-0.2, 0.1, 0.01), 1e-3, 2e-3)
        return 800.0 * u + 643.5, 801.0 * v + 398.25

    assert_pixels(file.camera, pixel)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (
            device([0, camera(800.0, cameraType=3)]),
            "CAM_A: cameraType: expected 0 (perspective) or 1 (fisheye), got 3",
        ),
        (device([0, camera(800.0, RATIONAL, cameraType=1)]), "distortionCoeff: a fisheye camera has 4 coefficients"),
        (device([0, camera(800.0, [0.1] * 13)]), "expected 0, 4, 5, 8, 12, 14 coefficients"),
        (
            device([0, camera(800.0, intrinsicMatrix=[[0.0] * 3] * 3)]),
            "is all zeros, as of a camera never calibrated",
        ),
        (device([0, {"cameraType": 0}]), "intrinsicMatrix: is missing"),
        (device([0, camera(1.0)], [0, camera(2.0)]), "the socket 0 is given twice"),
        (device([99, camera(1.0)]), "expected a socket from 0 to 25, got 99"),
        (device([0, 7]), "expected pairs [socket, camera]"),
        (device([0, camera(800.0, width=-4)]), "width, height: expected a positive width"),
    ],
)
def test_what_is_wrong_is_said_in_a_sentence(content: bytes, words: str) -> None:
    assert words in refused_calibration(content)


def test_another_socket_is_refused_with_those_that_there_are() -> None:
    with pytest.raises(CalibrationError, match="its cameras are CAM_A, CAM_B, CAM_C"):
        read_camera_file(THREE, "CAM_D")
