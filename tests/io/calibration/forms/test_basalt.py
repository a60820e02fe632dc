from __future__ import annotations

import json
from typing import Any

import pytest

from circlepose.io.calibration.reader import read_camera_file
from tests.support.lens_formulas import POINTS, brown, check_pixels, kannala_brandt
from tests.support.refusals import refused_calibration

FOCAL, CENTER = (705.5, 707.0), (640.25, 355.75)
MATRIX = {"fx": 705.5, "fy": 707.0, "cx": 640.25, "cy": 355.75}
RADTAN = {"k1": -0.06, "k2": 0.02, "p1": 0.001, "p2": -0.002, "k3": 0.004, "k4": 0.03, "k5": -0.01, "k6": 0.002}
KB4 = {"k1": 0.03, "k2": -0.01, "k3": 0.002, "k4": 0.001}
POSE = {"px": 0.1, "py": 0.0, "pz": 0.0, "qx": 0.0, "qy": 0.0, "qz": 0.0, "qw": 1.0}


def calibration(*cameras: tuple[str, dict[str, Any]]) -> bytes:
    value = {
        "T_imu_cam": [POSE for _ in cameras],
        "intrinsics": [{"camera_type": kind, "intrinsics": MATRIX | values} for kind, values in cameras],
        "resolution": [[1280, 720] for _ in cameras],
        "vignette": [],
        "imu_update_rate": 200.0,
    }
    return json.dumps({"value0": value}, indent=4).encode()


def test_radtan8_kb4_and_pinhole() -> None:
    content = calibration(("pinhole-radtan8", RADTAN | {"rpmax": 2.7}), ("kb4", KB4), ("pinhole", {}))
    first = read_camera_file(content)
    assert first.form == "Basalt calibration"
    assert first.camera.image_size == (1280, 720)
    assert any("cam0 taken" in note for note in first.notes)
    radial = [RADTAN[key] for key in ("k1", "k2", "k3", "k4", "k5", "k6")]
    check_pixels(first.camera, [brown(p, FOCAL, CENTER, radial, (0.001, -0.002)) for p in POINTS])
    fisheye = read_camera_file(content, "cam1").camera
    check_pixels(fisheye, [kannala_brandt(p, FOCAL, CENTER, list(KB4.values())) for p in POINTS])
    check_pixels(read_camera_file(content, "cam2").camera, [brown(p, FOCAL, CENTER, []) for p in POINTS])
    assert "its cameras are cam0, cam1, cam2" in refused_calibration(content, "cam3")


@pytest.mark.parametrize(
    ("kind", "values", "said"),
    [
        ("ds", {"xi": -0.2, "alpha": 0.5}, "double sphere"),
        ("eucm", {"alpha": 0.5, "beta": 1.1}, "extended unified"),
        ("ucm", {"alpha": 0.5}, "omnidirectional"),
        ("fov", {"w": 0.9}, "field-of-view"),
        ("kb9", KB4, "camera_type"),
        ("kb4", KB4 | {"k5": 0.1}, "intrinsics.k5: is 0.1"),
        ("pinhole-radtan8", KB4, "intrinsics.p1: is missing"),
        ("kb4", KB4 | {"fx": "1"}, "intrinsics.fx: expected a number"),
    ],
)
def test_what_is_refused(kind: str, values: dict[str, Any], said: str) -> None:
    text = refused_calibration(calibration((kind, values)))
    assert said in text
    assert "cam0" in text
