from __future__ import annotations

import json
import math

import cv2
import numpy as np
import pytest

from circlepose.errors import CalibrationError
from circlepose.io.calibration.reader import CameraFile, read_camera_file

BROWN = {"projection_type": "brown", "width": 1280, "height": 720, "focal_x": 0.85, "focal_y": 0.851, "c_x": 0.002,
         "c_y": -0.001, "k1": -0.06, "k2": 0.02, "k3": 0.004, "p1": 0.001, "p2": -0.002}  # fmt: skip
FISHEYE = {"projection_type": "fisheye", "width": 720, "height": 1280, "focal": 0.5, "k1": 0.01, "k2": -0.002}
POINTS = ((0.0, 0.0), (0.31, -0.22), (-0.4, 0.17))


def read(entries: object, camera_name: str | None = None) -> CameraFile:
    return read_camera_file(json.dumps(entries).encode(), camera_name)


def pixel(x: float, y: float, width: int, height: int) -> tuple[float, float]:
    """Return the pixel of a place in shares of the longer side, from the center."""
    size = max(width, height)
    return x * size - 0.5 + width / 2.0, y * size - 0.5 + height / 2.0


@pytest.mark.parametrize(("u", "v"), POINTS)
def test_brown_projects_as_opensfm_does(u: float, v: float) -> None:
    camera = read({"v2 brown": BROWN}).camera
    r2 = u * u + v * v
    radial = 1 - 0.06 * r2 + 0.02 * r2**2 + 0.004 * r2**3
    x = u * radial + 2 * 0.001 * u * v - 0.002 * (r2 + 2 * u * u)
    y = v * radial - 2 * 0.002 * u * v + 0.001 * (r2 + 2 * v * v)
    expected = pixel(0.85 * x + 0.002, 0.851 * y - 0.001, 1280, 720)
    point = np.array([[[u, v, 1.0]]])
    seen, _ = cv2.projectPoints(point, np.zeros(3), np.zeros(3), camera.camera_matrix, camera.dist_coeffs)
    np.testing.assert_allclose(seen.ravel(), expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize(("u", "v"), POINTS[1:])
def test_the_fisheye_projects_as_opensfm_does(u: float, v: float) -> None:
    camera = read([{"cameras": {"v2 fisheye": FISHEYE}, "shots": {}}]).camera
    assert camera.model == "fisheye"
    r = math.hypot(u, v)
    theta = math.atan(r)
    share = 0.5 * theta * (1 + 0.01 * theta**2 - 0.002 * theta**4) / r
    expected = pixel(share * u, share * v, 720, 1280)
    point = np.array([[[u, v, 1.0]]])
    seen, _ = cv2.fisheye.projectPoints(point, np.zeros(3), np.zeros(3), camera.camera_matrix, camera.dist_coeffs)
    np.testing.assert_allclose(seen.ravel(), expected, rtol=0, atol=1e-9)


def test_of_several_cameras_one_is_named() -> None:
    file = read({"one": BROWN, "two": FISHEYE}, "two")
    assert (file.form, file.camera.model) == ("OpenSfM cameras", "fisheye")
    assert any("longer side" in note for note in file.notes)


@pytest.mark.parametrize(
    ("entries", "words"),
    [
        ({**BROWN, "projection_type": "fisheye624"}, "thin prism"),
        ({**BROWN, "projection_type": "dual", "focal": 0.5}, "projection_type"),
        ({**BROWN, "projection_type": "radial"}, "p1|k3"),
        ({**FISHEYE, "k3": 0.1}, "k3"),
        ({**FISHEYE, "c_x": 0.1}, "c_x"),
        ({key: value for key, value in BROWN.items() if key != "width"}, "width, height"),
        ({key: value for key, value in BROWN.items() if key != "focal_y"}, "focal_y"),
    ],
)
def test_what_is_wrong_is_answered_with_a_sentence(entries: dict[str, object], words: str) -> None:
    with pytest.raises(CalibrationError, match=words):
        read({"v2": entries})
