from __future__ import annotations

import json
from typing import Any

import pytest

from circlepose.io.calibration.reader import read_camera_file
from tests.support.lens_formulas import POINTS, brown, check_pixels, kannala_brandt
from tests.support.refusals import refused_calibration

FOCAL, CENTER = (905.0, 905.0 * 1.002), (640.25, 355.75)
MATRIX = {"f": 905.0, "ar": 1.002, "cx": 640.25, "cy": 355.75}
ZEROS = dict.fromkeys(("k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4", "tauX", "tauY"), 0.0)
BROWN = MATRIX | ZEROS | {"k1": -0.06, "k2": 0.02, "k3": 0.004, "p1": 0.001, "p2": -0.002}
NAME = "libCalib::CameraModelOpenCV"


def camera(values: dict[str, Any], name: str | None = NAME, number: int = 1, **more: Any) -> dict[str, Any]:
    parameters = {key: {"val": value, "state": 0, "stdDev": 0.1} for key, value in values.items()}
    data = {
        "parameters": parameters,
        "CameraModelCRT": {"CameraModelBase": {"imageSize": {"width": 1280, "height": 720}}},
    }
    model: dict[str, Any] = {"polymorphic_id": number + (2**31 if name else 0)}
    if name:
        model["polymorphic_name"] = name
    model["ptr_wrapper"] = {"id": 2147483650, "data": data}
    return {"model": model, "transform": {"rotation": {"rx": 0, "ry": 0, "rz": 0}}} | more


def calibration(*cameras: dict[str, Any]) -> bytes:
    return json.dumps({"Calibration": {"cameras": list(cameras), "targets": []}}).encode()


def test_opencv_with_an_aspect_ratio() -> None:
    file = read_camera_file(calibration(camera(BROWN)))
    assert file.form == "calib.io"
    assert file.camera.image_size == (1280, 720)
    assert len(file.camera.dist_coeffs) == 5
    check_pixels(file.camera, [brown(p, FOCAL, CENTER, [-0.06, 0.02, 0.004], (0.001, -0.002)) for p in POINTS])


def test_the_rational_model() -> None:
    values = BROWN | {"k4": 0.03, "k5": -0.01, "k6": 0.002}
    radial = [-0.06, 0.02, 0.004, 0.03, -0.01, 0.002]
    check_pixels(
        read_camera_file(calibration(camera(values))).camera,
        [brown(p, FOCAL, CENTER, radial, (0.001, -0.002)) for p in POINTS],
    )


def test_fisheye() -> None:
    values = MATRIX | {"k1": 0.03, "k2": -0.01, "k3": 0.002, "k4": 0.001}
    built = read_camera_file(calibration(camera(values, "libCalib::CameraModelOpenCVFisheye"))).camera
    check_pixels(built, [kannala_brandt(p, FOCAL, CENTER, [0.03, -0.01, 0.002, 0.001]) for p in POINTS])


def test_several_cameras_of_which_the_first_names_the_model() -> None:
    content = calibration(camera(BROWN), camera(BROWN | {"f": 911.0}, None))
    assert any("cam0 taken" in note for note in read_camera_file(content).notes)
    assert read_camera_file(content, "cam1").camera.camera_matrix[0, 0] == 911.0
    named = calibration(camera(BROWN, serial="A1"), camera(BROWN | {"f": 911.0}, None, serial="B2"))
    assert read_camera_file(named, "B2").camera.camera_matrix[0, 0] == 911.0


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (calibration(camera(BROWN, "libCalib::CameraModelHalcon")), "polymorphic_name"),
        (calibration(camera(BROWN, "libCalib::CameraModelDoubleSphere")), "double sphere"),
        (calibration(camera(BROWN, None)), "polymorphic_name"),
        (calibration(camera(BROWN | {"k7": 0.1})), "parameters.k7: is 0.1"),
        (
            calibration(camera({key: value for key, value in BROWN.items() if key != "ar"})),
            "parameters.ar: is missing",
        ),
        (calibration(camera(BROWN | {"cx": "left"})), "parameters.cx: expected a number"),
        (calibration(camera(BROWN) | {"model": {"ptr_wrapper": None}}), "polymorphic_name"),
    ],
)
def test_what_is_refused(content: bytes, said: str) -> None:
    assert said in refused_calibration(content)
