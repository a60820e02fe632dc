from __future__ import annotations

import json
from typing import Any

import pytest

from circlepose.io.calibration.reader import read_camera_file
from tests.support.lens_formulas import POINTS, brown, check_pixels
from tests.support.refusals import refused_calibration

MATRIX = [905.5, 0.0, 640.25, 0.0, 907.0, 355.75, 0.0, 0.0, 1.0]
D = [-0.06, 0.02, 0.001, -0.002, 0.004]


def mat(data: list[float], rows: int = 1) -> dict[str, Any]:
    return {"rows": rows, "cols": len(data) // rows, "type": 6, "data": data}


def calibration(dist_key: str = "distCoeffs", dist: list[float] = D, width: float = 1280.0) -> dict[str, Any]:
    return {
        "resolution": {"width": width, "height": 720.0},
        "cameraIntrinsics": mat(MATRIX, 3),
        dist_key: mat(dist),
        "perViewErrors": [0.3, 0.4],
        "standardDeviation": 0.07,
    }


@pytest.mark.parametrize("dist_key", ["distCoeffs", "cameraExtrinsics"])
def test_files_of_new_and_old_versions(dist_key: str) -> None:
    file = read_camera_file(json.dumps(calibration(dist_key), indent=2).encode())
    assert file.form == "PhotonVision"
    assert file.camera.image_size == (1280, 720)
    expected = [brown(p, (905.5, 907.0), (640.25, 355.75), [-0.06, 0.02, 0.004], (0.001, -0.002)) for p in POINTS]
    check_pixels(file.camera, expected)


def test_a_newer_file_with_a_model_of_eight_coefficients() -> None:
    entries = calibration(dist=[*D, 0.03, -0.01, 0.002]) | {"lensmodel": "LENSMODEL_OPENCV", "observations": []}
    radial = [-0.06, 0.02, 0.004, 0.03, -0.01, 0.002]
    expected = [brown(p, (905.5, 907.0), (640.25, 355.75), radial, (0.001, -0.002)) for p in POINTS]
    check_pixels(read_camera_file(json.dumps(entries).encode()).camera, expected)


def test_settings_with_several_resolutions() -> None:
    settings = {"baseName": "cam", "calibrations": [calibration(), calibration(width=1920.0)], "fov": 70.0}
    content = json.dumps(settings).encode()
    assert any("1280x720 taken" in note for note in read_camera_file(content).notes)
    assert read_camera_file(content, "1920x720").camera.image_size == (1920, 720)
    settings["calibrations"] = [calibration(), calibration()]
    assert "two calibrations of 1280x720" in refused_calibration(json.dumps(settings))


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"distCoeffs": None}, "distCoeffs: expected"),
        ({"resolution": None}, "resolution: is missing"),
        ({"resolution": {"width": 0, "height": 720}}, "resolution"),
        ({"cameraIntrinsics": mat(MATRIX[:6], 2)}, "cameraIntrinsics"),
        ({"distCoeffs": mat([0.1] * 9)}, "distCoeffs"),
        ({"lensmodel": "LENSMODEL_STERIOGRAPHIC"}, "lensmodel"),
        ({"lensmodel": "LENSMODEL_SPLINED_STEREOGRAPHIC"}, "spline"),
    ],
)
def test_what_is_wrong_is_named(changed: dict[str, Any], said: str) -> None:
    assert said in refused_calibration(json.dumps(calibration() | changed))


def test_missing_coefficients() -> None:
    entries = calibration()
    del entries["distCoeffs"]
    assert "distCoeffs: is missing" in refused_calibration(json.dumps(entries))
