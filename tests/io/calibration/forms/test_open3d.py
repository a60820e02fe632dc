from __future__ import annotations

import json

import pytest

from circlepose.errors import CalibrationError
from circlepose.io.calibration.reader import read_camera_file
from tests.support.projected_points import assert_pixels, brown
from tests.support.refusals import refused_calibration

COLUMNS = [610.0, 0.0, 0.0, 0.0, 612.0, 0.0, 318.5, 241.25, 1.0]
INTRINSIC = {"width": 640, "height": 480, "intrinsic_matrix": COLUMNS}


def pixel(x: float, y: float) -> tuple[float, float]:
    return 610.0 * x + 318.5, 612.0 * y + 241.25


PARAMETERS = {
    "class_name": "PinholeCameraParameters",
    "extrinsic": [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0],
    "intrinsic": INTRINSIC,
    "version_major": 1,
    "version_minor": 0,
}


@pytest.mark.parametrize("document", [INTRINSIC, PARAMETERS, {**INTRINSIC, "serial_number_": "1", "color_mode": "M"}])
def test_the_matrix_is_read_column_by_column(document: dict[str, object]) -> None:
    file = read_camera_file(json.dumps(document).encode())
    assert file.form == "Open3D"
    assert file.camera.image_size == (640, 480)
    assert_pixels(file.camera, pixel)
    assert "stands column by column" in file.notes[0]


def test_coefficients_beside_the_matrix_are_used() -> None:
    document = {**INTRINSIC, "distortion_coefficients": [-0.2, 0.1, 1e-3, 2e-3, 0.01]}
    file = read_camera_file(json.dumps(document).encode())
    assert_pixels(file.camera, lambda x, y: pixel(*brown(x, y, (-0.2, 0.1, 0.01), 1e-3, 2e-3)))


def test_a_trajectory_has_a_camera_a_frame() -> None:
    other = {**PARAMETERS, "intrinsic": {**INTRINSIC, "intrinsic_matrix": [300.0, *COLUMNS[1:]]}}
    content = json.dumps({"class_name": "PinholeCameraTrajectory", "parameters": [PARAMETERS, other]}).encode()
    assert_pixels(read_camera_file(content).camera, pixel)
    assert read_camera_file(content, "1").camera.camera_matrix[0, 0] == 300.0
    with pytest.raises(CalibrationError, match="its cameras are 0, 1"):
        read_camera_file(content, "2")


def test_a_matrix_row_by_row_is_not_open3ds() -> None:
    rows = [610.0, 0.0, 318.5, 0.0, 612.0, 241.25, 0.0, 0.0, 1.0]
    document = {"width": 640, "height": 480, "intrinsic_matrix": rows, "distortion_coefficients": [0.0] * 5}
    file = read_camera_file(json.dumps(document).encode())
    assert file.form != "Open3D"
    assert_pixels(file.camera, pixel)


@pytest.mark.parametrize(
    ("document", "words"),
    [
        ({**PARAMETERS, "intrinsic": {"width": 640, "height": 480}}, "intrinsic.intrinsic_matrix: is missing"),
        ({**INTRINSIC, "width": -1}, "width, height: expected a positive width and height"),
        ({**INTRINSIC, "distortion_coefficients": "none"}, "distortion_coefficients: expected a matrix or a list"),
        ({"class_name": "PinholeCameraTrajectory", "parameters": [3]}, "parameters[0]: expected a camera, got 3"),
        ({**INTRINSIC, "intrinsic_matrix": ["610", *COLUMNS[1:]]}, "intrinsic_matrix: expected a number, got '610'"),
    ],
)
def test_what_is_wrong_is_said_in_a_sentence(document: dict[str, object], words: str) -> None:
    assert words in refused_calibration(json.dumps(document).encode())
