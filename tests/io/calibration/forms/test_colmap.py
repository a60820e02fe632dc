from __future__ import annotations

import struct

import pytest

from circlepose.io.calibration.reader import read_camera_file
from tests.support.lens_formulas import POINTS, brown, check_pixels, kannala_brandt
from tests.support.refusals import refused_calibration

HEADER = "# Camera list with one line of data per camera:\n#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n#\n"
FOCAL, CENTER = (812.5, 815.25), (641.0, 363.5)
HALF = (640.5, 363.0)
"""where COLMAP's principal point is with the first pixel's center at 0"""

# By model: its parameters, and the pixel of a point by the formula in COLMAP's models.h, half a pixel moved.
MODELS = {
    "SIMPLE_PINHOLE": ("812.5 641 363.5", lambda p: brown(p, (812.5, 812.5), HALF, [])),
    "PINHOLE": ("812.5 815.25 641 363.5", lambda p: brown(p, FOCAL, HALF, [])),
    "SIMPLE_RADIAL": ("812.5 641 363.5 -0.06", lambda p: brown(p, (812.5, 812.5), HALF, [-0.06])),
    "RADIAL": ("812.5 641 363.5 -0.06 0.02", lambda p: brown(p, (812.5, 812.5), HALF, [-0.06, 0.02])),
    "OPENCV": (
        "812.5 815.25 641 363.5 -0.06 0.02 0.001 -0.002",
        lambda p: brown(p, FOCAL, HALF, [-0.06, 0.02], (0.001, -0.002)),
    ),
    "FULL_OPENCV": (
        "812.5 815.25 641 363.5 -0.06 0.02 0.001 -0.002 0.003 0.04 -0.005 0.006",
        lambda p: brown(p, FOCAL, HALF, [-0.06, 0.02, 0.003, 0.04, -0.005, 0.006], (0.001, -0.002)),
    ),
    "SIMPLE_FISHEYE": ("812.5 641 363.5", lambda p: kannala_brandt(p, (812.5, 812.5), HALF, [])),
    "FISHEYE": ("812.5 815.25 641 363.5", lambda p: kannala_brandt(p, FOCAL, HALF, [])),
    "SIMPLE_RADIAL_FISHEYE": ("812.5 641 363.5 0.03", lambda p: kannala_brandt(p, (812.5, 812.5), HALF, [0.03])),
    "RADIAL_FISHEYE": (
        "812.5 641 363.5 0.03 -0.01",
        lambda p: kannala_brandt(p, (812.5, 812.5), HALF, [0.03, -0.01]),
    ),
    "OPENCV_FISHEYE": (
        "812.5 815.25 641 363.5 0.03 -0.01 0.002 0.001",
        lambda p: kannala_brandt(p, FOCAL, HALF, [0.03, -0.01, 0.002, 0.001]),
    ),
}
NUMBERS = {
    **{"SIMPLE_PINHOLE": 0, "PINHOLE": 1, "SIMPLE_RADIAL": 2, "RADIAL": 3, "OPENCV": 4, "OPENCV_FISHEYE": 5},
    **{"FULL_OPENCV": 6, "SIMPLE_RADIAL_FISHEYE": 8, "RADIAL_FISHEYE": 9, "SIMPLE_FISHEYE": 14, "FISHEYE": 15},
}


def line(model: str, camera_id: int = 1, parameters: str | None = None) -> str:
    return f"{camera_id} {model} 1280 720 {MODELS[model][0] if parameters is None else parameters}\n"


def binary(*cameras: tuple[int, int, str]) -> bytes:
    content = struct.pack("<Q", len(cameras))
    for camera_id, model, parameters in cameras:
        values = [float(word) for word in parameters.split()]
        content += struct.pack(f"<iiQQ{len(values)}d", camera_id, model, 1280, 720, *values)
    return content


@pytest.mark.parametrize("model", MODELS)
def test_each_model_projects_by_its_formula(model: str) -> None:
    parameters, formula = MODELS[model]
    file = read_camera_file((HEADER + line(model)).encode())
    assert file.form == "COLMAP cameras"
    assert file.camera.image_size == (1280, 720)
    assert any("-0.5 px" in note for note in file.notes)
    check_pixels(file.camera, [formula(point) for point in POINTS])
    assert read_camera_file(binary((1, NUMBERS[model], parameters))).camera == file.camera


def test_a_line_without_the_heading_is_recognized() -> None:
    assert read_camera_file(line("OPENCV").encode()).form == "COLMAP cameras"


def test_a_camera_is_chosen_by_its_id() -> None:
    content = (HEADER + line("PINHOLE", 3) + line("RADIAL", 7)).encode()
    assert "3 taken, of the 2 cameras 3, 7" in read_camera_file(content).notes
    assert read_camera_file(content, "7").camera.dist_coeffs.any()
    assert "no camera '4'; its cameras are 3, 7" in refused_calibration(content, "4")
    both = binary((3, 1, MODELS["PINHOLE"][0]), (7, 3, MODELS["RADIAL"][0]))
    assert read_camera_file(both, "7").camera == read_camera_file(content, "7").camera


@pytest.mark.parametrize(
    ("model", "meant"),
    [
        ("FOV", "field-of-view"),
        ("THIN_PRISM_FISHEYE", "thin prism"),
        ("RAD_TAN_THIN_PRISM_FISHEYE", "thin prism"),
        ("SIMPLE_DIVISION", "division"),
        ("DIVISION", "division"),
        ("EUCM", "extended unified"),
        ("EQUIRECTANGULAR", "map of directions"),
        ("OPENCVV", "expected a pinhole model"),
    ],
)
def test_a_model_that_we_lack_is_named(model: str, meant: str) -> None:
    text = refused_calibration(f"{HEADER}1 {model} 1280 720 800 640 360 0.1 0.1\n")
    assert meant in text
    assert "line 4" in text


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (HEADER, "no line of a camera"),
        (HEADER + "1 OPENCV 1280 720 800 800 640 360 0.1\n", "has 8 parameters (fx fy cx cy k1 k2 p1 p2), got 5"),
        (HEADER + "1 PINHOLE 1280 720 800 x 640 360\n", "line 4: expected a number, got 'x'"),
        (HEADER + "1 PINHOLE 1280\n", "line 4: expected CAMERA_ID MODEL"),
        (HEADER + "1 PINHOLE 1280 0 800 800 640 360\n", "WIDTH, HEIGHT"),
        (HEADER + "1 PINHOLE 1280 720 nan 800 640 360\n", "PARAMS"),
        (HEADER + line("PINHOLE") + line("PINHOLE"), "line 5: the camera '1' is given twice"),
        ("# Image list with two lines of data per image:\n#   IMAGE_ID, QW, QX\n1 0.8 0\n", "give its cameras.txt"),
    ],
)
def test_what_is_wrong_is_named_with_its_line(content: str, said: str) -> None:
    assert said in refused_calibration(content)


def test_a_binary_file_that_is_damaged() -> None:
    whole = binary((1, 4, MODELS["OPENCV"][0]), (2, 4, MODELS["OPENCV"][0]))
    assert "ends early" in refused_calibration(whole[:-8])
    assert "1 bytes too many" in refused_calibration(whole + b"\0")
    assert "lens model number 60" in refused_calibration(binary((1, 60, "1 2 3")))
