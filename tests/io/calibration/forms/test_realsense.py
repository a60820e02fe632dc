from __future__ import annotations

import json
from typing import Any

import pytest

from circlepose.io.calibration.reader import read_camera_file
from tests.support.lens_formulas import POINTS, brown, check_pixels, kannala_brandt
from tests.support.refusals import refused_calibration

FOCAL, CENTER = (905.5, 907.0), (640.25, 355.75)
ZEROS = [0.0] * 5


def intrinsics(
    model: object = "distortion.brown_conrady", coeffs: list[float] = ZEROS, **more: Any
) -> dict[str, Any]:
    entries = {"width": 1280, "height": 720, "ppx": 640.25, "ppy": 355.75, "fx": 905.5, "fy": 907.0}
    return entries | {"model": model, "coeffs": coeffs} | more


@pytest.mark.parametrize("model", ["distortion.brown_conrady", "Brown Conrady", "RS2_DISTORTION_BROWN_CONRADY", 4])
def test_brown_conrady_is_that_of_opencv(model: object) -> None:
    file = read_camera_file(json.dumps(intrinsics(model, [-0.06, 0.02, 0.001, -0.002, 0.004])).encode())
    assert file.form == "RealSense intrinsics"
    assert file.camera.image_size == (1280, 720)
    check_pixels(file.camera, [brown(p, FOCAL, CENTER, [-0.06, 0.02, 0.004], (0.001, -0.002)) for p in POINTS])


@pytest.mark.parametrize(
    "model", ["none", "inverse_brown_conrady", "modified_brown_conrady", "Inverse Brown Conrady", 2]
)
def test_without_coefficients_all_are_the_same(model: object) -> None:
    camera = read_camera_file(json.dumps(intrinsics(model)).encode()).camera
    check_pixels(camera, [brown(p, FOCAL, CENTER, []) for p in POINTS])


def test_the_modified_model_is_ours_without_tangential_terms() -> None:
    camera = read_camera_file(
        json.dumps(intrinsics("modified_brown_conrady", [-0.06, 0.02, 0, 0, 0.004])).encode()
    ).camera
    check_pixels(camera, [brown(p, FOCAL, CENTER, [-0.06, 0.02, 0.004]) for p in POINTS])


def test_kannala_brandt() -> None:
    content = json.dumps(intrinsics("kannala_brandt4", [0.03, -0.01, 0.002, 0.001, 0.0])).encode()
    expected = [kannala_brandt(p, FOCAL, CENTER, [0.03, -0.01, 0.002, 0.001]) for p in POINTS]
    check_pixels(read_camera_file(content).camera, expected)


def test_several_streams_by_their_path() -> None:
    content = json.dumps(
        {"device": "D435", "color": {"intrinsics": intrinsics()}, "depth": intrinsics(fx=600.5)}
    ).encode()
    assert any("color.intrinsics taken" in note for note in read_camera_file(content).notes)
    assert read_camera_file(content, "depth").camera.camera_matrix[0, 0] == 600.5
    assert "its cameras are color.intrinsics, depth" in refused_calibration(content, "infrared")


def section(
    stream: str, size: str, fx: str, coeffs: str = "0  \t0  \t0  \t0  \t0  ", model: str = "Brown Conrady"
) -> str:
    width, height = size.split("x")
    return (
        f' Intrinsic of "{stream}" / {size} / {{Y8}}\n  Width:      \t{width}\n  Height:     \t{height}\n'
        f"  PPX:        \t640.25\n  PPY:        \t355.75\n  Fx:         \t{fx}\n  Fy:         \t907.0\n"
        f"  Distortion: \t{model}\n  Coeffs:     \t{coeffs}\n  FOV (deg):  \t70.5 x 43.3\n\n"
    )


def test_what_rs_enumerate_devices_prints() -> None:
    text = (
        "Device info: \n    Name : \tIntel RealSense D435\n\nIntrinsic Parameters:\n\n"
        + section("Depth", "1280x720", "600.5")
        + section("Color", "1280x720", "905.5", "-0.06  0.02  0.001  -0.002  0.004")
        + section("Color", "1280x720", "905.5", "-0.06  0.02  0.001  -0.002  0.004")
        + 'Extrinsic Parameters:\nExtrinsic from "Depth"\t  To\t  "Color" :\n Rotation Matrix:\n   1 0 0\n'
    )
    file = read_camera_file(text.encode(), "color 1280x720")
    assert file.camera.image_size == (1280, 720)
    check_pixels(file.camera, [brown(p, FOCAL, CENTER, [-0.06, 0.02, 0.004], (0.001, -0.002)) for p in POINTS])
    assert any("Depth 1280x720 taken" in note for note in read_camera_file(text.encode()).notes)


@pytest.mark.parametrize(
    ("entries", "said"),
    [
        (intrinsics("inverse_brown_conrady", [0.1, 0, 0, 0, 0]), "maps pixels to points"),
        (intrinsics("modified_brown_conrady", [0.1, 0, 0.001, 0, 0]), "after the radial ones"),
        (intrinsics("none", [0.1, 0, 0, 0, 0]), "the coefficients are not 0"),
        (intrinsics("ftheta", [0.9, 0, 0, 0, 0]), "f-theta"),
        (intrinsics("ftheta"), "f-theta"),
        (intrinsics("kannala_brandt4", [0.1, 0, 0, 0, 0.1]), "coeffs[5]"),
        (intrinsics("something", [0.1, 0, 0, 0, 0]), "model"),
        (intrinsics(coeffs=[0.1]), "expected 5 coefficients"),
        (intrinsics(coeffs=[float("nan")] * 5), "coeffs"),
        (intrinsics(fx="wide"), "fx: expected a number"),
        (intrinsics(height=-1), "width, height"),
        ({key: value for key, value in intrinsics(coeffs=[0.1] * 5).items() if key != "model"}, "model: is missing"),
        ({key: value for key, value in intrinsics().items() if key != "fy"}, "fy: is missing"),
        ({key: value for key, value in intrinsics().items() if key != "coeffs"}, "coeffs: is missing"),
    ],
)
def test_what_is_refused(entries: dict[str, Any], said: str) -> None:
    assert said in refused_calibration(json.dumps(entries))
    assert "leave out the name" in refused_calibration(json.dumps(entries), "color")
