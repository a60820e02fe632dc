from __future__ import annotations

import json
from typing import Any

import pytest

from circlepose.io.calibration.reader import read_camera_file
from tests.support.lens_formulas import POINTS, brown, check_pixels
from tests.support.refusals import refused_calibration

ENTRIES: dict[str, Any] = {
    "DISPLAY_NAME": "1280x720",
    "REPROJECTION_ERROR": 0.4,
    "RES_X": 1280.0,
    "RES_Y": 720.0,
    "INTRINSICS_MATRIX": [905.5, 0.0, 640.25, 0.0, 907.0, 355.75, 0.0, 0.0, 1.0],
    "DISTORTION_COEFFICIENTS": [-0.06, 0.02, 0.001, -0.002, 0.004],
}


def test_a_result_as_it_is_downloaded() -> None:
    file = read_camera_file(json.dumps(ENTRIES).encode())
    assert file.form == "Limelight"
    assert file.camera.image_size == (1280, 720)
    expected = [brown(p, (905.5, 907.0), (640.25, 355.75), [-0.06, 0.02, 0.004], (0.001, -0.002)) for p in POINTS]
    check_pixels(file.camera, expected)


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"INTRINSICS_MATRIX": [1, 2, 3]}, "INTRINSICS_MATRIX: expected a 3 x 3 matrix"),
        ({"DISTORTION_COEFFICIENTS": [0.1] * 9}, "DISTORTION_COEFFICIENTS: expected"),
        ({"RES_X": "wide"}, "RES_X, RES_Y: expected a number"),
    ],
)
def test_what_is_wrong_is_named(changed: dict[str, Any], said: str) -> None:
    assert said in refused_calibration(json.dumps(ENTRIES | changed))


def test_missing_coefficients_and_a_name() -> None:
    rest = {key: value for key, value in ENTRIES.items() if key != "DISTORTION_COEFFICIENTS"}
    assert "DISTORTION_COEFFICIENTS: is missing" in refused_calibration(json.dumps(rest))
    assert "leave out the name" in refused_calibration(json.dumps(ENTRIES), "left")


def test_a_poor_reprojection_error_is_a_doubt() -> None:
    file = read_camera_file(json.dumps(ENTRIES | {"REPROJECTION_ERROR": 3.0}).encode())
    assert any(doubt.about == "REPROJECTION_ERROR" for doubt in file.doubts)
