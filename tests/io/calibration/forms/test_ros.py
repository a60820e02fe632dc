from __future__ import annotations

import pytest

from circlepose.errors import CalibrationError
from circlepose.io.calibration.reader import read_camera_file
from tests.support.lens_formulas import CX, CY, FX, FY, SIZE, check_terms

K = [FX, 0.0, CX, 0.0, FY, CY, 0.0, 0.0, 1.0]
D = [-0.215, 0.094, 4.5e-4, -2.5e-4, 0.013]
NAMES = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
TERMS = dict(zip(NAMES, D, strict=False))
RATIONAL = [*D, 0.11, -0.02, 0.003]
FISHEYE = {"k1": -0.02, "k2": 0.004, "k3": -0.001, "k4": 0.0002}


def info(model: str = "distortion_model: plumb_bob", dist: list[float] = D) -> str:
    return (
        f"image_width: 1280\nimage_height: 960\ncamera_name: narrow\n"
        f"camera_matrix:\n  rows: 3\n  cols: 3\n  data: {K}\n{model}\n"
        f"distortion_coefficients:\n  rows: 1\n  cols: {len(dist)}\n  data: {dist}\n"
    )


def message(upper: bool = True, dist: list[float] = D) -> str:
    k, d = ("K", "D") if upper else ("k", "d")
    block = "".join(f"\n- {each}" for each in K)
    return (
        "header:\n  stamp:\n    sec: 17\n    nanosec: 5\n  frame_id: camera_optical_frame\nheight: 960\nwidth: 1280\n"
        f"distortion_model: plumb_bob\n{d}: {dist}\n{k}:{block}\nbinning_x: 0\nbinning_y: 0\n"
        "roi:\n  x_offset: 0\n  y_offset: 0\n  height: 0\n  width: 0\n  do_rectify: false\n---\n"
    )


def indented(text: str, by: int) -> str:
    return "".join(f"{' ' * by}{line}\n" for line in text.splitlines())


@pytest.mark.parametrize("model", ["plumb_bob", "OPENCV", "opencv", "radtan", "Brown-Conrady"])
@pytest.mark.parametrize("key", ["distortion_model", "camera_model"])
def test_the_pinhole_model_under_all_its_names(model: str, key: str) -> None:
    file = read_camera_file(info(f"{key}: {model}").encode())
    assert (file.form, file.camera.image_size, file.notes) == ("ROS camera_info", SIZE, ())
    check_terms(file, TERMS)


@pytest.mark.parametrize("model", ["fisheye", "equidistant", "kannala_brandt"])
def test_the_fisheye_under_all_its_names(model: str) -> None:
    file = read_camera_file(info(f"distortion_model: {model}", list(FISHEYE.values())).encode())
    check_terms(file, FISHEYE, fisheye=True)


@pytest.mark.parametrize("zeros", [0, 3, 9])
def test_plumb_bob_with_zeros_behind_it(zeros: int) -> None:
    file = read_camera_file(info(dist=D + [0.0] * zeros).encode())
    assert (file.camera.dist_coeffs.tolist(), file.notes) == (D, ())


@pytest.mark.parametrize("zeros", [0, 6])
def test_plumb_bob_whose_terms_are_the_rational_model(zeros: int) -> None:
    file = read_camera_file(info(dist=RATIONAL + [0.0] * zeros).encode())
    check_terms(file, dict(zip(NAMES, RATIONAL, strict=True)))
    assert "the lens model is rational_polynomial, not plumb_bob" in file.notes[0]


@pytest.mark.parametrize("upper", [True, False])
def test_messages_as_topic_echo_prints_them(upper: bool) -> None:
    one = message(upper)
    check_terms(read_camera_file(one.encode()), TERMS)
    assert read_camera_file(one.encode()).notes == ()
    other = message(upper, [0.5, 0.0, 0.0, 0.0, 0.0])
    several = read_camera_file((one + other + other).encode())
    check_terms(several, TERMS)
    assert several.notes == ("the first of 3 messages is taken",)
    # The recording was stopped in the middle of a message.
    check_terms(read_camera_file((one + other[:90]).encode()), TERMS)


def test_parameters_of_ros_2() -> None:
    check_terms(read_camera_file(f"/**:\n  ros__parameters:\n{indented(info(), 4)}".encode()), TERMS)
    nested = f"robot:\n  left:\n    ros__parameters:\n      camera:\n{indented(info(), 8)}"
    other = f"  right:\n    ros__parameters:\n{indented(info(dist=[0.5, 0.0, 0.0, 0.0, 0.0]), 6)}"
    both = read_camera_file((nested + other).encode())
    check_terms(both, TERMS)
    assert both.notes == ("robot/left/camera taken, of the 2 cameras robot/left/camera, robot/right",)
    check_terms(read_camera_file((nested + other).encode(), "robot/right"), {"k1": 0.5})
    flat = f"fx: {FX}\nfy: {FY}\ncx: {CX}\ncy: {CY}\ndist_coeffs: {D}\n"
    check_terms(read_camera_file(f"node:\n  ros__parameters:\n{indented(flat, 4)}".encode()), TERMS)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (info("distortion_model: omni"), "distortion_model: 'omni' is an omnidirectional model"),
        (info("distortion_model: plumbob"), "distortion_model: expected a pinhole model (such as plumb_bob"),
        (info("distortion_model: 3"), "distortion_model: expected a name such as plumb_bob, got 3"),
        (info(dist=D[:3]), "the model plumb_bob has 0, 4, 5 coefficients, got 3"),
        (info("distortion_model: equidistant", [0.1, 0.0, 0.0, 0.0, 0.0]), "(a 0 after them may be removed)"),
        (info() + "width: 640\nheight: 480\n", "image_width, image_height, width, height: contradict each other"),
        (
            "/**:\n  ros__parameters:\n    video_device: /dev/video0\n    image_width: 640\n"
            "    camera_info_url: package://usb_cam/config/camera_info.yaml\n",
            "the calibration is in the file that it names (package://usb_cam/config/camera_info.yaml)",
        ),
    ],
)
def test_what_is_refused(text: str, says: str) -> None:
    with pytest.raises(CalibrationError) as caught:
        read_camera_file(text.encode())
    assert says in str(caught.value)


def test_a_matrix_that_stands_column_by_column() -> None:
    columns = [FX, 0.0, 0.0, 0.0, FY, 0.0, CX, CY, 1.0]
    file = read_camera_file(info().replace(str(K), str(columns)).encode())
    check_terms(file, TERMS)
    assert "was transposed" in file.notes[0]


# --- The .ini of camera_calibration ---

ROWS = f"{FX} 0.0 {CX}\n0.0 {FY} {CY}\n0.0 0.0 1.0\n"


def ini(name: str = "narrow_stereo/left", dist: list[float] = D) -> str:
    return (
        "# oST version 5.0 parameters\n\n\n[image]\n\nwidth\n1280\n\nheight\n960\n\n"
        f"[{name}]\n\ncamera matrix\n{ROWS}\ndistortion\n{' '.join(map(str, dist))}\n\n"
        "rectification\n1.0 0.0 0.0\n0.0 1.0 0.0\n0.0 0.0 1.0\n\n"
        f"projection\n{FX} 0.0 {CX} 0.0\n0.0 {FY} {CY} 0.0\n0.0 0.0 1.0 0.0\n"
    )


def test_the_ini_of_camera_calibration() -> None:
    file = read_camera_file(ini().encode())
    assert (file.form, file.camera.image_size, file.notes) == ("ROS .ini", SIZE, ())
    check_terms(file, TERMS)
    check_terms(read_camera_file(ini().replace("\n", "\r\n").encode()), TERMS)
    check_terms(read_camera_file(ini(dist=RATIONAL).encode()), dict(zip(NAMES, RATIONAL, strict=True)))


def test_two_cameras_in_one_ini() -> None:
    both = ini() + ini("narrow_stereo/right", [0.5, 0.0, 0.0, 0.0, 0.0])
    first = read_camera_file(both.encode())
    check_terms(first, TERMS)
    assert "narrow_stereo/left taken, of the 2 cameras" in first.notes[0]
    check_terms(read_camera_file(both.encode(), "narrow_stereo/right"), {"k1": 0.5})


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (ini(dist=D[:3]), "line 19: distortion: expected 4 or 5 or 8 numbers, got 3"),
        (ini(dist=D[:4]), "4 numbers may be of a fisheye, and this form states no lens model; give the .yaml"),
        (ini().replace(f"{FX} 0.0 {CX}\n", f"{FX} 0.0\n", 1), "camera matrix: expected 9 numbers, got 8"),
        (ini().replace("-0.215 ", "-0.21x5 "), "line 20: expected numbers, got"),
        (ini().replace("height\n960\n", ""), "height: is missing"),
        (ini().split("960")[1].replace("[narrow_stereo/left]", "[]"), "stands in no section"),
        (ini() + ini(), "[narrow_stereo/left] is there twice"),
        (ini() + ini("right").replace("1280", "640"), "width: expected 1 number, got 2"),
        (ini().replace("distortion\n", "lens\n"), "distortion: is missing"),
    ],
)
def test_an_ini_that_is_refused(text: str, says: str) -> None:
    with pytest.raises(CalibrationError) as caught:
        read_camera_file(text.encode())
    assert says in str(caught.value)
