from __future__ import annotations

import json
import math

import pytest

from circlepose.errors import CalibrationError
from circlepose.io.calibration.reader import read_camera_file
from tests.support.projected_points import assert_pixels, brown, equidistant
from tests.support.refusals import refused_calibration

FRAME = {"file_path": "images/frame_00001.png", "transform_matrix": [[1.0, 0.0, 0.0, 0.0]] * 4}
LENS = {"fl_x": 1072.25, "fl_y": 1068.5, "cx": 1504.0, "cy": 1000.0, "w": 3008, "h": 2000}


def content(*frames: dict[str, object], **entries: object) -> bytes:
    return json.dumps({**entries, "frames": list(frames) or [FRAME]}).encode()


def pixel(u: float, v: float) -> tuple[float, float]:
    # The center of the top left pixel is (0.5, 0.5) there, and (0, 0) here.
    return 1072.25 * u + 1504.0 - 0.5, 1068.5 * v + 1000.0 - 0.5


def test_opencvs_model_with_the_half_pixel() -> None:
    lens = {**LENS, "camera_model": "OPENCV", "k1": -0.1, "k2": 0.05, "k3": 0.01, "p1": 1e-3, "p2": -2e-3}
    file = read_camera_file(content(**lens))
    assert file.form == "nerfstudio transforms"
    assert file.camera.image_size == (3008, 2000)
    assert file.notes == ("cx, cy moved by -0.5 px: the center of nerfstudio's top left pixel is (0.5, 0.5)",)
    assert_pixels(file.camera, lambda x, y: pixel(*brown(x, y, (-0.1, 0.05, 0.01), 1e-3, -2e-3)))


@pytest.mark.parametrize("model", [{"camera_model": "OPENCV_FISHEYE", "p1": 1e-5}, {"is_fisheye": True}])
def test_a_fisheye_has_four_coefficients(model: dict[str, object]) -> None:
    file = read_camera_file(content(**LENS, **model, k1=0.03, k2=5e-3, k3=6e-4, k4=1e-4))
    assert_pixels(file.camera, lambda x, y: pixel(*equidistant(x, y, (0.03, 5e-3, 6e-4, 1e-4))))
    assert any("p1, p2 are not used" in note for note in file.notes) == ("p1" in model)


def test_an_angle_of_view_gives_the_focal_length_and_the_center() -> None:
    file = read_camera_file(content(camera_angle_x=0.7, w=800.0, h=600.0))
    f = 400.0 / math.tan(0.35)
    assert_pixels(file.camera, lambda x, y: (f * x + 399.5, f * y + 299.5))
    assert [note.split(";")[0] for note in file.notes] == ["fl_x is missing", "cx, cy are missing"]


def test_each_frame_may_have_a_lens() -> None:
    frames = [{**FRAME, **LENS}, {**FRAME, **LENS, "file_path": "b.png", "fl_x": 500.0}]
    file = read_camera_file(content(*frames, camera_model="OPENCV"))
    assert_pixels(file.camera, pixel)
    assert file.notes[0].startswith("images/frame_00001.png taken, of the 2 cameras")
    assert read_camera_file(content(*frames), "b.png").camera.camera_matrix[0, 0] == 500.0
    with pytest.raises(CalibrationError, match=r"its cameras are images/frame_00001.png, b.png"):
        read_camera_file(content(*frames), "c.png")


@pytest.mark.parametrize(
    ("lens", "words"),
    [
        ({**LENS, "k4": 1e-3}, "k4: is 0.001, a term in r^8"),
        ({**LENS, "camera_model": "EQUIRECTANGULAR"}, "EQUIRECTANGULAR'"),
        ({**LENS, "camera_model": "FISHEYE624"}, "is a fisheye model with thin prism terms"),
        ({**LENS, "ftheta_p0": 1.0}, "ftheta_p0: is a term of a lens model that circlepose does not have"),
        ({"camera_angle_x": 0.7}, "w, h: are missing, so camera_angle_x gives no focal length"),
        ({"camera_angle_x": 7.0, "w": 8, "h": 6}, "camera_angle_x: expected an angle of view between 0 and pi"),
        ({"fl_x": 800.0}, "cx, cy: are missing"),
        ({**LENS, "fl_x": "wide"}, "fl_x: expected a number, got 'wide'"),
        ({**LENS, "w": 0}, "w, h: expected a positive width and height"),
        ({**LENS, "cy": None}, "cy: expected a number, got None"),
    ],
)
def test_what_is_wrong_is_said_in_a_sentence(lens: dict[str, object], words: str) -> None:
    assert words in refused_calibration(content(**lens))
