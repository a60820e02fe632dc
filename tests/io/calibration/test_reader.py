from __future__ import annotations

import io
import math
import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from circlepose.camera.camera import Camera
from circlepose.camera.plausibility import Doubt
from circlepose.errors import CalibrationError
from circlepose.io.calibration.reader import CameraFile, read_camera, read_camera_file, write_camera
from tests.support.refusals import refused_calibration

K = [[1200.0, 0.0, 639.5], [0.0, 1210.0, 479.5], [0.0, 0.0, 1.0]]
FLAT = "[1200, 0, 639.5, 0, 1210, 479.5, 0, 0, 1]"
D = [-0.21, 0.09, 4e-4, -2e-4, 0.0]


def cv_yaml(
    rest: str = "", matrix: str = FLAT, dist: str = "[-0.21, 0.09, 4e-4, -2e-4, 0.]", count: int = 5
) -> bytes:
    return (
        "%YAML:1.0\n---\nimage_width: 1280\nimage_height: 960\n"
        f"camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: {matrix}\n"
        f"distortion_coefficients: !!opencv-matrix\n   rows: {count}\n   cols: 1\n   dt: d\n   data: {dist}\n{rest}"
    ).encode()


def ros_yaml(model: str = "plumb_bob", dist: str = "[-0.21, 0.09, 4e-4, -2e-4, 0]", rest: str = "") -> bytes:
    count = dist.count(",") + 1
    return (
        "image_width: 1280\nimage_height: 960\ncamera_name: narrow\n"
        f"camera_matrix:\n  rows: 3\n  cols: 3\n  data: {FLAT}\n"
        f"distortion_model: {model}\ndistortion_coefficients:\n  rows: 1\n  cols: {count}\n  data: {dist}\n{rest}"
    ).encode()


def kalibr_yaml(
    model: str = "pinhole", dist_model: str = "radtan", dist: str = "[-0.21, 0.09, 4e-4, -2e-4]"
) -> bytes:
    return (
        f"cam0:\n  camera_model: {model}\n  intrinsics: [1200, 1210, 639.5, 479.5]\n"
        f"  distortion_model: {dist_model}\n  distortion_coeffs: {dist}\n  resolution: [1280, 960]\n"
    ).encode()


OWN = (
    b"fx: 1200\nfy: 1210\ncx: 639.5\ncy: 479.5\ndist_coeffs: [-0.21, 0.09, 4e-4, -2e-4, 0]\nimage_size: [1280, 960]\n"
)


def check(file: CameraFile, form: str, dist: list[float] = D, model: str = "pinhole") -> None:
    assert file.form == form
    assert file.camera.model == model
    assert file.camera.image_size == (1280, 960)
    np.testing.assert_array_equal(file.camera.camera_matrix, K)
    np.testing.assert_array_equal(file.camera.dist_coeffs, dist)


# --- OpenCV ---


def test_opencv_yaml() -> None:
    check(read_camera_file(cv_yaml()), "OpenCV FileStorage")


@pytest.mark.parametrize(
    "pairs",
    [
        ("camera_matrix", "distortion_coefficients"),
        ("Camera_Matrix", "Distortion_Coefficients"),
        ("cameraMatrix", "distCoeffs"),
        ("K", "D"),
        ("M1", "D1"),
        ("K1", "D1"),
        ("intrinsic_matrix", "dist_coeffs"),
        ("mtx", "dist"),
    ],
)
@pytest.mark.parametrize("suffix", ["yml", "xml", "json"])
@pytest.mark.parametrize("shape", [(1, 5), (5, 1), (5,)])
def test_opencv_names_in_every_syntax_that_opencv_writes(
    tmp_path: Path, pairs: tuple[str, str], suffix: str, shape: tuple[int, ...]
) -> None:
    path = tmp_path / f"cam.{suffix}"
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("calibration_time", "Mon Jan  1 12:00:00 2024")
    storage.write("nframes", 12)
    storage.writeComment("flags: +zero_tangent_dist")
    storage.write("image_Width", 1280)
    storage.write("image_Height", 960)
    storage.write(pairs[0], np.array(K))
    storage.write(pairs[1], np.array(D).reshape(shape))
    storage.write("avg_reprojection_error", 0.25)
    storage.write("per_view_reprojection_errors", np.array([math.nan, math.inf, -math.inf]))
    storage.release()
    check(read_camera_file(path), "OpenCV FileStorage")


def test_old_xml_without_line_ends_and_with_an_encoding() -> None:
    numbers = FLAT.strip("[]").replace(",", "")
    text = (
        '<?xml version="1.0" encoding="UTF-8"?><opencv_storage><image_width>1280</image_width>'
        '<image_height>960</image_height><Camera_Matrix type_id="opencv-matrix"><rows>3</rows><cols>3</cols>'
        f"<dt>d</dt><data>{numbers}</data></Camera_Matrix>"
        '<Distortion_Coefficients type_id="opencv-matrix"><rows>1</rows><cols>5</cols><dt>d</dt>'
        "<data>-2.1e-1 .09 4e-4\n -2e-4 0.</data></Distortion_Coefficients></opencv_storage>"
    )
    check(read_camera_file(text.encode()), "OpenCV FileStorage")


@pytest.mark.parametrize("count", [4, 5, 8, 12, 14])
@pytest.mark.parametrize("row", [True, False])
def test_coefficients_in_a_row_or_a_column(count: int, row: bool) -> None:
    values = [0.01 * (i + 1) for i in range(count)]
    text = cv_yaml(dist=str(values), count=count)
    if row:
        text = text.replace(f"rows: {count}\n   cols: 1".encode(), f"rows: 1\n   cols: {count}".encode())
    np.testing.assert_array_equal(read_camera(text).dist_coeffs, values)


def test_no_coefficients_at_all() -> None:
    assert read_camera(cv_yaml(dist="[]", count=0)).dist_coeffs.shape == (0,)


@pytest.mark.parametrize(
    "line",
    [
        "fisheye_model: 1",
        'distortion_model: "fisheye"',
        "camera_model: opencv_fisheye",
        'distortion_model: "equidistant"',
    ],
)
def test_opencv_fisheye(line: str) -> None:
    file = read_camera_file(cv_yaml(line + "\n", dist="[0.1, 0.01, 0., 0.]", count=4))
    check(file, "OpenCV FileStorage", [0.1, 0.01, 0.0, 0.0], "fisheye")
    assert file.notes == ()


@pytest.mark.parametrize("line", ["fisheye_model: 0", 'distortion_model: "opencv: k1 k2 p1 p2 k3"', "model: pinhole"])
def test_opencv_pinhole_said(line: str) -> None:
    check(read_camera_file(cv_yaml(line + "\n")), "OpenCV FileStorage")


def test_four_coefficients_of_an_unsaid_model_are_remarked_on() -> None:
    file = read_camera_file(cv_yaml(dist="[0.1, 0.01, 0., 0.]", count=4))
    assert file.camera.model == "pinhole"
    assert any("fisheye_model: 1" in note for note in file.notes)


_M = f"!!opencv-matrix {{rows: 3, cols: 3, dt: d, data: {FLAT}}}"
_D = "!!opencv-matrix {rows: 1, cols: 4, dt: d, data: [%s, 0, 0, 0]}"
STEREO = f"M1: {_M}\nD1: {_D % 0.1}\nM2: {_M}\nD2: {_D % 0.2}\n"


def test_stereo_file_gives_the_first_or_the_named_camera() -> None:
    first = read_camera_file(STEREO.encode())
    assert first.camera.dist_coeffs[0] == 0.1
    assert any("M1 taken" in note for note in first.notes)
    assert read_camera_file(STEREO.encode(), "M2").camera.dist_coeffs[0] == 0.2
    assert read_camera_file(STEREO.encode(), "2").camera.dist_coeffs[0] == 0.2
    assert "M1, M2" in refused_calibration(STEREO.encode(), "left")


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (
            cv_yaml(matrix="[1200, 0, 639.5, 0, 1210, 479.5, 0, 0]"),
            "camera_matrix: 3 rows of 3 columns need 9 numbers",
        ),
        (
            cv_yaml(matrix="[.Nan, 0, 639.5, 0, 1210, 479.5, 0, 0, 1]"),
            "camera_matrix: has entries that are not finite",
        ),
        (cv_yaml(matrix="[0, 0, 0, 0, 0, 0, 0, 0, 0]"), "camera_matrix: is all zeros"),
        (cv_yaml(matrix="[0, 0, 5, 0, 1210, 479.5, 0, 0, 1]"), "camera_matrix: is singular"),
        (cv_yaml(matrix="[-1200, 0, 5, 0, 1210, 479.5, 0, 0, 1]"), "focal lengths"),
        (cv_yaml(matrix="[1200, 0, 5, 3, 1210, 479.5, 0, 0, 1]"), "expected ..fx, s, cx"),
        (cv_yaml(matrix="[1200, 0, x, 0, 1210, 479.5, 0, 0, 1]"), "camera_matrix.data: expected a number, got 'x'"),
        (cv_yaml(matrix="[1200, 0, true, 0, 1210, 479.5, 0, 0, 1]"), "expected a number, got True"),
        (cv_yaml(matrix=f"[{'9' * 400}, 0, 1, 0, 1210, 479.5, 0, 0, 1]"), "too large"),
        (cv_yaml(dist="[0.1, .Inf, 0, 0, 0]"), "distortion_coefficients: has entries that are not finite"),
        (cv_yaml(dist="[1, 2, 3, 4, 5, 6]", count=6), "distortion_coefficients: a pinhole camera has 0, 4, 5, 8"),
        (cv_yaml("fisheye_model: 1\n"), "distortion_coefficients: a fisheye camera has 4 coefficients, got 5"),
        (
            cv_yaml("distortion_model: omni\n"),
            "distortion_model: 'omni' is an omnidirectional model, which .* calibrate",
        ),
        (cv_yaml(dist="[1, 2, 3, 4]", count=2).replace(b"cols: 1\n", b"cols: 2\n"), "expected one row or one column"),
        (cv_yaml().replace(b"image_width: 1280", b"image_width: 0"), "image_width.*positive width and height"),
        (cv_yaml().replace(b"image_width: 1280", b"image_width: big"), "image_width.*expected a number, got 'big'"),
        (cv_yaml().replace(b"   rows: 3\n", b""), "rows is missing"),
        (
            cv_yaml().replace(b"distortion_coefficients", b"coefs_of_lens"),
            "coefs_of_lens: is no known key and looks like",
        ),
        (cv_yaml().replace(b"distortion_coefficients", b"lens"), "distortion_coefficients: is missing"),
        (cv_yaml().replace(b"camera_matrix", b"homography"), "camera_matrix: is missing"),
        (cv_yaml().replace(b"   rows: 3\n   cols: 3\n", b"   sizes: [3, 3, 1]\n"), "got 3 sizes"),
        (cv_yaml("target: round\n"), "target: expected a mapping"),
        (cv_yaml(f"K: !!opencv-matrix {{rows: 3, cols: 3, data: {FLAT}}}\n"), "camera_matrix, K: mean the same"),
        (b'{"camera_matrix": {"type_id": "opencv-matrix", "rows": 3, "rows": 4}}', "'rows' is given twice"),
        (b'{"camera_matrix": ', "line 1: is not valid JSON"),
        (b"<opencv_storage><a>1</a><a>2</a></opencv_storage>", "'a' is given twice"),
        (b"<opencv_storage><a>1</opencv_storage>", "is not valid XML"),
        (b"<opencv_storage>1</opencv_storage>", "holds no keys"),
        (b"<project><a>1</a></project>", "XML of another kind .<project>."),
        (b'<!DOCTYPE x [<!ENTITY a "b">]><opencv_storage><a>&a;</a></opencv_storage>', "document type or entities"),
        (b"<opencv_storage>" + b"<a>" * 9000 + b"</a>" * 9000 + b"</opencv_storage>", "nested too deeply"),
        (b'{"a":' * 100_000 + b"1" + b"}" * 100_000, "nested too deeply"),
    ],
)
def test_opencv_files_that_are_refused(content: bytes, says: str) -> None:
    text = refused_calibration(content)
    assert re.search(says, text), text


# --- ROS ---


def test_ros_yaml() -> None:
    check(read_camera_file(ros_yaml()), "ROS camera_info")
    check(read_camera_file(ros_yaml(), "narrow"), "ROS camera_info")


def test_ros_models() -> None:
    eight = [0.1, 0.2, 0.0, 0.0, 0.0, 0.01, 0.02, 0.03]
    check(read_camera_file(ros_yaml("rational_polynomial", str(eight))), "ROS camera_info", eight)
    four = [0.1, 0.01, 0.0, 0.0]
    check(read_camera_file(ros_yaml("equidistant", str(four))), "ROS camera_info", four, "fisheye")


@pytest.mark.parametrize(("k", "d"), [("K", "D"), ("k", "d")])
def test_ros_message_as_it_is_printed(k: str, d: str) -> None:
    text = (
        'header: \n  seq: 3\n  stamp: \n    secs: 1\n    nsecs: 5\n  frame_id: "cam"\nheight: 960\nwidth: 1280\n'
        f'distortion_model: "plumb_bob"\n{d}: [-0.21, 0.09, 0.0004, -0.0002, 0.0]\n{k}: {FLAT}\n'
        "binning_x: 0\nbinning_y: 0\nroi: \n  x_offset: 0\n  y_offset: 0\n  height: 0\n  width: 0\n"
        "  do_rectify: False\n---\n"
    )
    check(read_camera_file(io.StringIO(text)), "ROS camera_info")
    block = text.replace(f"{k}: {FLAT}", f"{k}:\n" + "\n".join(f"- {each}" for each in np.ravel(K)))
    check(read_camera_file(block.encode()), "ROS camera_info")
    assert "binning_x: is 2" in refused_calibration(text.replace("binning_x: 0", "binning_x: 2").encode())
    assert "roi.x_offset: is 8" in refused_calibration(text.replace("x_offset: 0", "x_offset: 8").encode())
    undistorted = text.replace('"plumb_bob"', '""').replace("[-0.21, 0.09, 0.0004, -0.0002, 0.0]", "[]")
    assert read_camera(undistorted.encode()).dist_coeffs.shape == (0,)
    never = text.replace(FLAT, str([0.0] * 9)).replace("height: 960\nwidth: 1280", "height: 0\nwidth: 0")
    assert f"{k}: is all zeros" in refused_calibration(never.encode())


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (
            ros_yaml("omnidirectional"),
            "distortion_model: 'omnidirectional' is an omnidirectional model, which circlepose does not have",
        ),
        (ros_yaml().replace(b"distortion_model: plumb_bob\n", b""), "distortion_model: is missing"),
        (ros_yaml("equidistant"), "distortion_coefficients: the model equidistant has 4 coefficients, got 5"),
        (ros_yaml("rational_polynomial"), "the model rational_polynomial has 8, 12, 14 coefficients, got 5"),
        (ros_yaml().replace(b"distortion_coefficients", b"distortion"), "distortion_coefficients: is missing"),
    ],
)
def test_ros_files_that_are_refused(content: bytes, says: str) -> None:
    assert says in refused_calibration(content)


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("fx: 1e12\nfy: 600\ncx: 0\ncy: 0\n", r"fx, fy: holds a number as large as 1e\+12"),
        ("camera_matrix: [[600, 0, 1], [0, 600, 1], [0, 0, 1e-320]]\n", "camera_matrix: "),
        ("camera_matrix: [[1e308, 0, 1], [0, 600, 1], [0, 0, 0.5]]\n", "camera_matrix: "),
        ("fx: 1e-12\nfy: 600\ncx: 0\ncy: 0\n", "fx, fy: a focal length of 1e-12 px cannot be meant"),
        ("fx: 600\nfy: 600\ncx: 0\ncy: 0\ndist_coeffs: [1e300, 0, 0, 0]\n", "dist_coeffs: holds a number as large"),
        (f"fx: 600\nfy: 600\ncx: 0\ncy: 0\nimage_size: [1{'0' * 300}, 5]\n", "image size: holds a number as large"),
    ],
)
def test_numbers_with_which_sums_overflow_are_refused(content: str, says: str) -> None:
    with pytest.raises(CalibrationError, match=says):
        read_camera_file(content.encode())


def test_ros_other_name_is_refused() -> None:
    assert "holds no camera 'wide', only narrow" in refused_calibration(ros_yaml(), "wide")


# --- Kalibr ---


def test_kalibr() -> None:
    check(read_camera_file(kalibr_yaml()), "Kalibr camchain", D[:4])
    check(read_camera_file(kalibr_yaml(dist_model="equidistant")), "Kalibr camchain", D[:4], "fisheye")
    check(read_camera_file(kalibr_yaml(dist_model="none", dist="[]")), "Kalibr camchain", [])


def test_kalibr_camera_by_name() -> None:
    both = kalibr_yaml() + kalibr_yaml(dist="[0.5, 0, 0, 0]").replace(b"cam0", b"cam1")
    first = read_camera_file(both)
    assert first.camera.dist_coeffs[0] == -0.21
    assert first.notes == ("cam0 taken, of the 2 cameras cam0, cam1",)
    second = read_camera_file(both, "cam1")
    assert second.camera.dist_coeffs[0] == 0.5
    assert second.notes == ()
    assert "its cameras are cam0, cam1" in refused_calibration(both, "cam2")


def test_a_single_camera_with_kalibrs_keys() -> None:
    text = (
        "%YAML:1.0\nsensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n  data: [1]\nresolution: [1280, 960]\n"
        "camera_model: pinhole\nintrinsics: [1200, 1210, 639.5, 479.5] # fu fv cu cv\n"
        "distortion_model: radial-tangential\ndistortion_coefficients: [-0.21, 0.09, 4e-4, -2e-4]\n"
    )
    check(read_camera_file(text.encode()), "Kalibr camchain", D[:4])


@pytest.mark.parametrize(
    ("content", "says"),
    [
        *((kalibr_yaml(model), f"camera_model: '{model}' is ") for model in ("omni", "eucm", "ds")),
        (kalibr_yaml(dist_model="fov", dist="[0.9]"), "cam0: distortion_model: 'fov' is the field-of-view model"),
        (kalibr_yaml(dist="[1, 2, 3]"), "cam0: distortion_coeffs: radtan has 4 coefficients, got 3"),
        (kalibr_yaml().replace(b"1200, ", b""), "cam0: intrinsics: expected 4 numbers, got 3"),
        (kalibr_yaml().replace(b"1200", b"-1200"), "cam0: intrinsics: is singular or mirrored"),
        (kalibr_yaml().replace(b"[1280, 960]", b"[1280]"), "cam0: resolution: expected 2 numbers"),
        (kalibr_yaml().replace(b"[1280, 960]", b"[1280, 960.5]"), "resolution: expected a positive width and height"),
    ],
)
def test_kalibr_files_that_are_refused(content: bytes, says: str) -> None:
    assert says in refused_calibration(content)


# --- Our own ---


def test_own_form() -> None:
    check(read_camera_file(OWN), "circlepose")
    matrix = OWN.replace(b"fx: 1200\nfy: 1210\ncx: 639.5\ncy: 479.5\n", f"camera_matrix: {K}\n".encode())
    check(read_camera_file(matrix), "circlepose")
    check(read_camera_file(b"{" + OWN.strip().replace(b"\n", b", ") + b"}"), "circlepose")
    fisheye = OWN.replace(b", 0]", b"]") + b"model: fisheye\n"
    check(read_camera_file(fisheye), "circlepose", D[:4], "fisheye")


def test_own_form_needs_neither_coefficients_nor_size() -> None:
    file = read_camera_file(b"fx: 1200\nfy: 1200\ncx: 600\ncy: 400\n")
    assert file.camera.dist_coeffs.shape == (0,)
    assert file.camera.image_size is None
    assert ["image size is not given" in doubt.text for doubt in file.doubts] == [True]


def test_target_in_the_calibration_is_handed_on() -> None:
    for content in (OWN, cv_yaml(), ros_yaml(), kalibr_yaml()):
        file = read_camera_file(content + b"target:\n  radius_mm: 60\n")
        assert file.target == {"radius_mm": 60}
    assert read_camera_file(OWN).target is None


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (OWN + b"modell: pinhole\n", "modell: is no known key; did you mean model?"),
        (
            OWN.replace(b"dist_coeffs", b"dist_cofs"),
            "dist_cofs: is no known key and looks like distortion ([-0.21, 0.09, 0.0004, -0.0002, 0]); did you mean "
            "dist_coeffs?",
        ),
        (OWN + b"model: omni\n", "model: expected one of pinhole, fisheye, got 'omni'"),
        (OWN + f"camera_matrix: {K}\n".encode(), "fx: give either camera_matrix or fx, fy, cx, cy"),
        (OWN.replace(b"cy: 479.5\n", b""), "cy: missing; give camera_matrix, or all of fx, fy, cx, cy"),
        (OWN.replace(b"1200", b"-1200"), "fx, fy: is singular or mirrored"),
        (OWN.replace(b"1200", b".nan"), "fx: expected one finite number"),
        (OWN.replace(b"1200", b"true"), "fx: expected one finite number, the focal length along x in px, got True"),
        (OWN.replace(b"1200", b'"1200"'), "fx: expected one finite number"),
        (OWN.replace(b"1200", b""), "fx: has no value; expected one finite number"),
        (OWN.replace(b"[1280, 960]", b"[1280]"), "image_size: expected [width, height]"),
        (OWN.replace(b"[1280, 960]", b"[1280, 0]"), "image_size: expected a positive width and height"),
        (OWN.replace(b"[1280, 960]", b"[1280, 960.5]"), "image_size: expected [width, height]"),
        (OWN.replace(b"-2e-4, 0]", b"]"), "dist_coeffs: a pinhole camera has 0, 4, 5, 8, 12, 14 coefficients, got 3"),
        (b"camera_matrix: [[1, 0], [0, 1]]\n", "camera_matrix: expected 3 rows of 3 finite numbers"),
        (b"camera_matrix: [[1, 0, 0], [0, .nan, 1], [0, 0, 1]]\n", "camera_matrix: expected 3 rows of 3 finite"),
        (b"target:\n  radius_mm: 60\n", "fx, fy, cx, cy: missing"),
        (b"a: 1\nb: 2\n", "no calibration of a known form"),
    ],
)
def test_own_files_that_are_refused(content: bytes, says: str) -> None:
    assert says in refused_calibration(content)


def test_own_form_has_no_camera_names() -> None:
    assert "leave out the name 'cam1'" in refused_calibration(OWN, "cam1")


def test_lists_under_opencvs_names_are_read_too() -> None:
    file = read_camera_file(f"camera_matrix: {K}\ndist_coeff: [{D}]\n".encode())
    np.testing.assert_array_equal(file.camera.camera_matrix, K)
    np.testing.assert_array_equal(file.camera.dist_coeffs, D)


@pytest.mark.parametrize(
    ("content", "key", "says"),
    [
        (OWN.replace(b"1200", b"8").replace(b"1210", b"8"), "fx", "focal length of 8 px in .* looks like .* in mm"),
        (OWN.replace(b"639.5", b"6395"), "fx", r"principal point \(6395, 479.5\) px is .* looks cropped"),
        (OWN.replace(b"cx: 639.5", b"cx: 1279.5").replace(b"cy: 479.5", b"cy: 959.5"), "fx", "about 2560 x 1920 px"),
        (OWN.replace(b"cx: 639.5", b"cx: 0").replace(b"cy: 479.5", b"cy: 0"), "fx", "looks left at 0"),
        (cv_yaml().replace(b"1200", b"8."), "Camera_Matrix|camera_matrix", "in mm"),
        (kalibr_yaml().replace(b"1200", b"8").replace(b"1210", b"8"), "cam0.intrinsics", "in mm"),
    ],
)
def test_what_no_camera_has_is_refused_with_file_key_and_what_it_looks_like(
    content: bytes, key: str, says: str
) -> None:
    file = read_camera_file(content)
    assert file.doubts[0].is_grave
    with pytest.raises(CalibrationError, match=rf"^<bytes>: ({key}): .*{says}.*set force_calibration\.$"):
        file.refuse_grave()


def test_of_several_cameras_the_refused_one_is_named() -> None:
    chain = kalibr_yaml() + kalibr_yaml().replace(b"cam0", b"cam1").replace(b"1200", b"8").replace(b"1210", b"8")
    read_camera_file(chain).refuse_grave()
    with pytest.raises(CalibrationError, match=r"^<bytes>: cam1\.intrinsics: a focal length of 8 px"):
        read_camera_file(chain, "cam1").refuse_grave()


def test_a_usual_calibration_has_no_doubts() -> None:
    assert read_camera_file(OWN).doubts == ()
    read_camera_file(OWN).refuse_grave()


@pytest.mark.parametrize("key", ["avg_reprojection_error", "Avg_Reprojection_Error", "rms", "reprojection_error"])
def test_a_calibration_whose_own_error_says_that_it_failed_is_refused(key: str) -> None:
    def doubts(rms_px: float) -> tuple[Doubt, ...]:
        return read_camera_file(cv_yaml() + f"{key}: {rms_px}\n".encode()).doubts

    assert doubts(0.3) == ()
    assert [(doubt.about, doubt.is_grave) for doubt in doubts(1.5)] == [(key, False)]
    with pytest.raises(CalibrationError, match=f"{key}: a reprojection error of 9.5 px .*did not succeed"):
        read_camera_file(cv_yaml() + f"{key}: 9.5\n".encode()).refuse_grave()


# --- Real files and writing ---


def test_real_calibrations_read_as_opencv_reads_them(shared_data: Path) -> None:
    files = sorted(shared_data.glob("*/camera.yml"))
    assert files
    for path in files:
        storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
        camera = read_camera(path)
        np.testing.assert_array_equal(camera.camera_matrix, storage.getNode("camera_matrix").mat())
        np.testing.assert_array_equal(camera.dist_coeffs, storage.getNode("distortion_coefficients").mat().ravel())
        width, height = storage.getNode("image_width").real(), storage.getNode("image_height").real()
        assert camera.image_size == (width, height)


@pytest.mark.parametrize("model", ["pinhole", "fisheye"])
@pytest.mark.parametrize("size", [(1280, 960), None])
def test_what_is_written_is_read_back(tmp_path: Path, model: str, size: tuple[int, int] | None) -> None:
    camera = Camera.create(K, D[:4], size, model)  # type: ignore[arg-type]
    write_camera(camera, tmp_path / "cam.yaml")
    file = read_camera_file(tmp_path / "cam.yaml")
    assert (file.camera.model, file.camera.image_size) == (model, size)
    np.testing.assert_array_equal(file.camera.dist_coeffs, D[:4])
    assert not any("fisheye" in note for note in file.notes)


def test_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(CalibrationError, match=r"cam\.yaml: there is no such file"):
        read_camera(tmp_path / "cam.yaml")
