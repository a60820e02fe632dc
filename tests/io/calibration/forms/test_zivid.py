from __future__ import annotations

import json

import pytest

from circlepose.io.calibration.reader import read_camera_file
from tests.support.lens_formulas import POINTS, brown, check_pixels
from tests.support.refusals import refused_calibration

FOCAL, CENTER = (2760.5, 2759.25), (951.5, 594.75)
YAML = (
    "__version__: 3\nCameraIntrinsics:\n  CameraMatrix:\n    CX: 951.5\n    CY: 594.75\n"
    "    FX: 2760.5\n    FY: 2759.25\n"
    "  Distortion:\n    K1: -0.06\n    K2: 0.02\n    K3: 0.004\n    P1: 0.001\n    P2: -0.002\n"
)


@pytest.mark.parametrize("named", [True, False])
def test_as_the_sdk_saves_it(named: bool) -> None:
    group = {
        "CameraMatrix": {"CX": 951.5, "CY": 594.75, "FX": 2760.5, "FY": 2759.25},
        "Distortion": {"K1": -0.06, "K2": 0.02, "K3": 0.004, "P1": 0.001, "P2": -0.002},
    }
    expected = [brown(p, FOCAL, CENTER, [-0.06, 0.02, 0.004], (0.001, -0.002)) for p in POINTS]
    file = read_camera_file(YAML.encode())
    assert file.form == "Zivid intrinsics"
    assert any("approximation" in note for note in file.notes)
    check_pixels(file.camera, expected)
    assert (
        read_camera_file(json.dumps({"CameraIntrinsics": group} if named else group).encode()).camera == file.camera
    )


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (YAML.replace("    K2", "    L2").replace("0.02", "0"), "Distortion.K2: is missing"),
        (YAML.replace("  Distortion", "  Distorted"), "Distortion: is missing"),
        (YAML + "    K4: 0.1\n", "Distortion.K4: is 0.1"),
        (YAML.replace("2760.5", "wide"), "CameraMatrix.FX: expected a number"),
    ],
)
def test_what_is_wrong_is_named(text: str, said: str) -> None:
    assert said in refused_calibration(text)
    assert "leave out the name" in refused_calibration(text, "left")
