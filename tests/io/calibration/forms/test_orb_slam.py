from __future__ import annotations

import pytest

from circlepose.io.calibration.reader import read_camera_file
from tests.support.lens_formulas import POINTS, brown, check_pixels, kannala_brandt
from tests.support.refusals import refused_calibration

FOCAL, CENTER = (705.5, 707.0), (640.25, 355.75)
HEAD = "%YAML:1.0\n\n#----------\n# Camera Parameters. Adjust them!\n#----------\n"
SIZE = "Camera.width: 1280\nCamera.height: 720\nCamera.fps: 30.0\nCamera.RGB: 1\nORBextractor.nFeatures: 1000\n"


def matrix(name: str = "Camera", fx: float = 705.5) -> str:
    return f"{name}.fx: {fx}\n{name}.fy: 707.0\n{name}.cx: 640.25\n{name}.cy: 355.75\n"


def terms(name: str = "Camera", **values: float) -> str:
    return "".join(f"{name}.{key}: {value}\n" for key, value in values.items())


PLAIN = terms(k1=-0.06, k2=0.02, p1=0.001, p2=-0.002)
STEREO = (
    "LEFT.height: 720\nLEFT.width: 1280\nLEFT.D: !!opencv-matrix\n   rows: 1\n   cols: 5\n   dt: d\n"
    "   data: [-0.28, 0.07, 0.0002, 1.7e-05, 0.0]\nLEFT.K: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
    "   data: [458.5, 0.0, 637.25, 0.0, 457.25, 348.5, 0.0, 0.0, 1.0]\n"
)


@pytest.mark.parametrize("head", [HEAD, HEAD + 'Camera.type: "PinHole"\n'])
def test_orb_slam_2(head: str) -> None:
    file = read_camera_file((head + matrix() + PLAIN + SIZE).encode())
    assert file.form == "ORB-SLAM settings"
    assert file.camera.image_size == (1280, 720)
    check_pixels(file.camera, [brown(p, FOCAL, CENTER, [-0.06, 0.02], (0.001, -0.002)) for p in POINTS])


def test_orb_slam_3_with_k3_and_images_that_it_resizes() -> None:
    text = (
        f'{HEAD}File.version: "1.0"\nCamera.type: "PinHole"\n{matrix("Camera1")}'
        f"{terms('Camera1', k1=-0.06, k2=0.02, p1=0.001, p2=-0.002, k3=0.004)}{SIZE}"
        "Camera.newWidth: 640\nCamera.newHeight: 360\n"
    )
    file = read_camera_file(text.encode())
    assert file.camera.image_size == (1280, 720)
    assert any("Camera.newWidth" in note and "1280 x 720" in note for note in file.notes)
    check_pixels(file.camera, [brown(p, FOCAL, CENTER, [-0.06, 0.02, 0.004], (0.001, -0.002)) for p in POINTS])


@pytest.mark.parametrize("head", ['Camera.type: "KannalaBrandt8"\n', "Camera.bFishEye: 1\n"])
def test_fisheye(head: str) -> None:
    text = HEAD + head + matrix() + terms(k1=0.03, k2=-0.01, k3=0.002, k4=0.001) + SIZE
    camera = read_camera_file(text.encode()).camera
    check_pixels(camera, [kannala_brandt(p, FOCAL, CENTER, [0.03, -0.01, 0.002, 0.001]) for p in POINTS])


def test_two_cameras() -> None:
    fisheye = terms(k1=0.03, k2=-0.01, k3=0.002, k4=0.001)
    text = (
        HEAD + 'Camera.type: "KannalaBrandt8"\n' + matrix("Camera1") + fisheye.replace("Camera", "Camera1")
        + matrix("Camera2", 711.0) + fisheye.replace("Camera", "Camera2") + SIZE
    )  # fmt: skip
    assert any("Camera1 taken" in note for note in read_camera_file(text.encode()).notes)
    assert read_camera_file(text.encode(), "camera2").camera.camera_matrix[0, 0] == 711.0
    assert "its cameras are Camera1, Camera2" in refused_calibration(text, "Camera")


def test_of_a_stereo_file_the_raw_images_are_taken() -> None:
    text = HEAD + matrix() + terms(k1=0.0, k2=0.0, p1=0.0, p2=0.0) + SIZE + STEREO
    file = read_camera_file(text.encode())
    expected = [brown(p, (458.5, 457.25), (637.25, 348.5), [-0.28, 0.07], (0.0002, 1.7e-05)) for p in POINTS]
    check_pixels(file.camera, expected)
    assert any("rectifies" in note for note in file.notes)
    assert read_camera_file(text.encode(), "Camera").camera.camera_matrix[0, 0] == 705.5


def test_a_rectified_camera_and_one_without_coefficients_get_a_remark() -> None:
    rectified = read_camera_file((HEAD + 'Camera.type: "Rectified"\n' + matrix("Camera1") + SIZE).encode())
    assert any("rectified already" in note for note in rectified.notes)
    bare = read_camera_file((HEAD + 'Camera.type: "PinHole"\n' + matrix("Camera1") + SIZE).encode())
    assert any("no distortion" in note for note in bare.notes)
    assert rectified.camera == bare.camera


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (HEAD + 'Camera.type: "MEI"\n' + matrix() + PLAIN, "omnidirectional"),
        (HEAD + matrix() + PLAIN + "Camera.k4: 0.1\n", "Camera.k4: is 0.1, but the model PinHole has only"),
        (HEAD + 'Camera.type: "KannalaBrandt8"\n' + matrix() + PLAIN, "Camera.p1"),
        (HEAD + 'Camera.type: "Rectified"\n' + matrix() + PLAIN, "Camera.k1"),
        (HEAD + matrix() + terms(k1=0.1), "Camera.k2: is missing"),
        (HEAD + matrix().replace("Camera.cy", "Camera.cz") + PLAIN, "Camera.cy: is missing"),
        (HEAD + matrix().replace("707.0", "abc") + PLAIN, "Camera.fy: expected a number"),
        (HEAD + "Camera.bFishEye: 1\n" + matrix() + PLAIN, "Camera.bFishEye"),
        (HEAD + "Camera.bFishEye: 7\n" + matrix() + PLAIN, "expected 0 or 1"),
        (HEAD + matrix() + STEREO.replace("LEFT.D", "LEFT.X"), "LEFT.D: is missing"),
    ],
)
def test_what_is_wrong_is_named(text: str, said: str) -> None:
    assert said in refused_calibration(text)
