"""Keys that no form uses though they change the camera: each is refused by its name, and a neutral value is not."""

from __future__ import annotations

import gzip
import io
import json
from typing import Any

import numpy as np
import pytest
import scipy.io

from circlepose.io.calibration.reader import CameraFile, read_camera_file
from tests.support.refusals import refused_calibration

FLAT = {"fx": 905.5, "fy": 907.0, "cx": 640.25, "cy": 355.75}
K = [[905.5, 0.0, 640.25], [0.0, 907.0, 355.75], [0.0, 0.0, 1.0]]
D4 = [-0.06, 0.02, 0.001, -0.002]
D5 = [*D4, 0.01]
ONE_FOCAL = {"focal_length": 905.5, "principal_point": [640.0, 360.0]}


def read(entries: Any) -> CameraFile:
    return read_camera_file(json.dumps(entries).encode())


def refused(entries: Any, key: str) -> str:
    """Return the sentence on `entries`, which names the file and the key."""
    sentence = refused_calibration(entries if isinstance(entries, bytes) else json.dumps(entries))
    assert key in sentence
    return sentence


# --- A fisheye that is stated is never read as a pinhole ---


@pytest.mark.parametrize(
    "stated",
    [
        *({"fisheye": word} for word in ("true", "yes", "True", True, 1)),
        *({"is_fisheye": "1"}, {"use_fisheye": "on"}, {"fisheye_lens": True}, {"fisheye_camera": 1}),
        *({key: "fisheye"} for key in ("calibration_type", "calib_model", "calibration_model", "intrinsic_type")),
    ],
    ids=str,
)
def test_a_fisheye_that_a_key_states_is_read_as_one(stated: dict[str, object]) -> None:
    camera = read({"K": K, "D": D4, **stated}).camera
    assert camera.model == "fisheye"
    assert camera.dist_coeffs.tolist() == D4


@pytest.mark.parametrize("group", ["fisheye", "fisheye_params", "fisheyeCamera", "equidistant", "kannala_brandt"])
@pytest.mark.parametrize("outside", [{}, {"K": K}])
def test_a_fisheye_that_a_group_states_is_read_as_one(group: str, outside: dict[str, object]) -> None:
    inside = {"K": K, "D": D4}
    camera = read({**outside, group: {key: each for key, each in inside.items() if key not in outside}}).camera
    assert camera.model == "fisheye"


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("camera", "fisheye"),
        ("flags", "fisheye"),
        ("flags", ["CALIB_FIX_SKEW", "fisheye"]),
        ("method", "cv2.fisheye.calibrate"),
        ("lens_type", "wide-angle fisheye"),
        ("projection_of_lens", "Kannala-Brandt"),
        ("name", "fisheye_left"),
        ("fisheye", "maybe"),
        ("equidistant", True),
    ],
)
def test_a_fisheye_that_is_stated_otherwise_is_refused(key: str, value: object) -> None:
    assert "fisheye lens" in refused({"K": K, "D": D4, key: value}, f"{key}: ")


@pytest.mark.parametrize("value", ["false", "no", "0", "off", 0, False])
def test_what_is_stated_to_be_no_fisheye_is_a_pinhole(value: object) -> None:
    assert read({"K": K, "D": D4, "fisheye": value}).camera.model == "pinhole"


def test_the_name_of_a_camera_states_no_lens_model_beside_one_that_is_stated() -> None:
    assert read({"K": K, "D": D5, "model": "pinhole", "name": "fisheye_left"}).camera.model == "pinhole"


def test_a_group_that_contradicts_the_model_is_refused() -> None:
    refused({"fisheye": {"fx": 905.5, "fy": 907.0, "cx": 640.0, "cy": 356.0, "D": D5, "model": "pinhole",
                         "distortion_model": "radtan"}}, "contradict")  # fmt: skip


def test_a_lens_profile_of_gyroflow_is_a_fisheye_and_names_its_device() -> None:
    sides = {"w": 1280, "h": 720}
    profile = {
        "name": "HERO8 Black Linear",
        "camera_model": "HERO8 Black",
        "lens_model": "Linear",
        "calib_dimension": sides,
        "orig_dimension": {"w": 2560, "h": 1440},
        "output_dimension": sides,
        "input_horizontal_stretch": 1.0,
        "fisheye_params": {"RMS_error": 0.4, "camera_matrix": K, "distortion_coeffs": D4},
    }
    camera = read(profile).camera
    assert (camera.model, camera.image_size) == ("fisheye", (1280, 720))
    assert "1.33" in refused({**profile, "input_horizontal_stretch": 1.33}, "input_horizontal_stretch")


# --- The shape of a pixel ---


@pytest.mark.parametrize("key", ["pixel_aspect_ratio", "aspect_ratio", "pixelRatio"])
def test_pixels_that_are_not_square_are_refused(key: str) -> None:
    assert "fx and fy" in refused({**ONE_FOCAL, key: 1.1}, key)
    assert read({**ONE_FOCAL, key: 1.0}).camera.camera_matrix[1, 1] == 905.5


def test_an_aspect_ratio_that_fx_and_fy_show_is_neutral() -> None:
    stated = {**FLAT, "fx": 1000.0, "fy": 1100.0, "aspect_ratio": 1.1}
    assert read(stated).camera.camera_matrix[1, 1] == 1100.0
    assert read({**FLAT, "image_size": [1280, 720], "aspect_ratio": "16:9"}).camera.image_size == (1280, 720)


# --- Units, scales, crops and origins ---


@pytest.mark.parametrize(
    ("key", "value", "neutral"),
    [
        *(("binning_x", 2, 1), ("binning", "2x2", "1x1"), ("roi", {"x_offset": 100}, {"x_offset": 0, "width": 640})),
        *(("roi", [100, 50, 640, 480], [0, 0, 640, 480]), ("crop", [10, 10, 90, 90], None), ("offset_x", 8, 0)),
        *(
            ("focal_unit", "mm", "px"),
            ("unit", "mm", "pixels"),
            ("units", {"focal_length": "mm"}, {"baseline": "mm"}),
        ),
        *(("pixel_origin", 1, 0), ("pixel_center", 0.5, 0), ("half_pixel", True, False), ("normalized", True, False)),
        *(("scale", 0.5, 1), ("image_scale", [0.5, 0.5], [1, 1]), ("downsample", 2, 1), ("scale", "half", "full")),
    ],
)
def test_what_changes_the_image_is_refused(key: str, value: object, neutral: object) -> None:
    refused({"K": K, "D": D5, key: value}, f" {key}")
    assert read({"K": K, "D": D5, key: neutral}).camera.dist_coeffs.tolist() == D5


def test_scales_of_depths_and_regions_of_undistorted_images_do_not_matter() -> None:
    harmless = {"scale": 6553.5, "depth_scale": 0.001, "newcameramtx": K, "roi": [10, 20, 600, 440]}
    assert read({"K": K, "D": D5, **harmless}).camera.dist_coeffs.tolist() == D5


# --- Distortion under names that are not known, or in another order ---


@pytest.mark.parametrize("start", [FLAT, {"K": K}], ids=["terms", "matrix"])
@pytest.mark.parametrize(
    ("key", "value"), [("kc", D5), ("kappa1", 0.1), ("lens_params", [0.1]), ("poly", [0.1, 0.2]), ("a3", -0.1)]
)
def test_distortion_of_any_name_is_refused(start: dict[str, object], key: str, value: object) -> None:
    assert "looks like distortion" in refused({**start, key: value}, key)
    neutral = [0.0] if isinstance(value, list) else 0.0
    assert not read({**start, key: neutral}).camera.dist_coeffs.any()


def test_t1_and_t2_beside_k1_are_refused() -> None:
    assert "p1, p2" in refused({**FLAT, "k1": -0.1, "k2": 0.01, "t1": 0.001, "t2": 0.0}, "t1")


@pytest.mark.parametrize("names", [["k1", "k2", "k3", "p1", "p2"], "k1, k2, k3, p1, p2"], ids=["list", "text"])
def test_coefficients_in_another_order_are_refused(names: object) -> None:
    assert "order" in refused({"K": K, "D": D5, "distortion_names": names}, "distortion_names")
    ours = ["k1", "k2", "p1", "p2", "k3"]
    assert read({"K": K, "D": D5, "distortion_names": ours}).camera.dist_coeffs.tolist() == D5


# --- Kalibr ---

KALIBR = {"camera_model": "pinhole", "intrinsics": [905.5, 907.0, 640.25, 355.75], "resolution": [1280, 720]}
RADTAN = {**KALIBR, "distortion_model": "radtan", "distortion_coeffs": D4}


@pytest.mark.parametrize(
    ("key", "value"),
    [
        *((key, D4) for key in ("dist_coeffs", "distortion", "distortion_parameters", "distortion_coefs", "D")),
        *(("k1", -0.06), ("distortion", {"type": "radial-tangential", "parameters": D4}), ("fisheye", True)),
        *(("binning", 2), ("xi", 0.9), ("focal_unit", "mm"), ("lens_model", "equidistant")),
    ],
)
@pytest.mark.parametrize("start", [KALIBR, RADTAN], ids=["without", "radtan"])
@pytest.mark.parametrize("is_nested", [False, True])
def test_kalibr_drops_no_key_that_matters(start: dict[str, object], key: str, value: object, is_nested: bool) -> None:
    entries = {**start, key: value}
    refused({"cam0": entries} if is_nested else entries, key)


def test_kalibr_passes_over_what_does_not_matter() -> None:
    harmless = {"T_cam_imu": [[1, 0, 0, 0]] * 4, "rostopic": "/fisheye/image", "cam_overlaps": [1], "rate_hz": 20,
                "timeshift_cam_imu": 0.01, "comment": "left", "k1": 0.0}  # fmt: skip
    assert read({"cam0": {**RADTAN, **harmless}}).camera.dist_coeffs.tolist() == D4


def test_kalibr_without_a_distortion_model_is_remarked_on() -> None:
    assert any("distortion_model is missing" in note for note in read({"cam0": KALIBR}).notes)
    assert not read({"cam0": RADTAN}).notes


def test_kalibr_with_coefficients_twice_is_refused() -> None:
    refused({**RADTAN, "distortion_coefficients": D4}, "distortion_coeffs, distortion_coefficients")


def test_a_distortion_that_stands_as_the_camera_model_is_read() -> None:
    entries = {"camera_model": "plumb_bob", "distortion_coeffs": D5, "intrinsics": KALIBR["intrinsics"]}
    assert read(entries).camera.dist_coeffs.tolist() == D5
    assert read({**entries, "camera_model": "fisheye", "distortion_coeffs": D4}).camera.model == "fisheye"


# --- Open3D ---

OPEN3D = {"width": 640, "height": 480, "intrinsic_matrix": [610.0, 0, 0, 0, 612.0, 0, 318.5, 241.25, 1.0]}


@pytest.mark.parametrize(
    ("key", "value"),
    [
        *(
            ("k1", -0.3),
            ("D", D5),
            ("radial_distortion", [0.1]),
            ("distortion_params", {"k1": 0.1}),
            ("fisheye", True),
        ),
        *(("distortion_model", "kannala_brandt4"), ("distortion_model", "fisheye"), ("distortion_model", "division")),
        *(("lensDistortionLookupTable", "AAAAAD8AAAA/gAAA"), ("lensDistortionLookupTable", [0.0, 0.001, 0.002])),
        *(("lensDistortionCenter", [318.0, 241.0]), ("skew", 0.5), ("unit", "mm"), ("depth_model", "kannala brandt")),
    ],
)
@pytest.mark.parametrize("place", ["flat", "beside", "within"])
@pytest.mark.parametrize("coefficients", [{}, {"distortion_coefficients": D4}], ids=["without", "with"])
def test_open3d_drops_no_key_that_matters(
    key: str, value: object, place: str, coefficients: dict[str, object]
) -> None:
    intrinsic = {**OPEN3D, **coefficients}
    entries = {
        "flat": {**intrinsic, key: value},
        "beside": {"intrinsic": intrinsic, key: value},
        "within": {"intrinsic": {**intrinsic, key: value}},
    }
    refused(entries[place], key)


def test_open3d_passes_over_what_does_not_matter() -> None:
    harmless = {"class_name": "PinholeCameraIntrinsic", "version_major": 1, "depth_scale": 1000.0, "fps": 30}
    harmless |= {"serial_number": "1234", "color_format": "MJPG", "k1": 0.0, "distortion_model": "plumb_bob"}
    assert read({**OPEN3D, **harmless}).camera.image_size == (640, 480)


# --- Other forms with open keys ---

INFO = {"image_width": 1280, "image_height": 720, "K": [905.5, 0, 640.25, 0, 907.0, 355.75, 0, 0, 1], "D": D5,
        "distortion_model": "plumb_bob", "binning_x": 0, "roi": {"x_offset": 0}}  # fmt: skip
REALSENSE = {"width": 1280, "height": 720, "ppx": 640.25, "ppy": 355.75, "fx": 905.5, "fy": 907.0,
             "model": "distortion.brown_conrady", "coeffs": D5}  # fmt: skip
LIMELIGHT = {"RES_X": 1280, "RES_Y": 720, "INTRINSICS_MATRIX": INFO["K"], "DISTORTION_COEFFICIENTS": D5}
NERFSTUDIO = {"fl_x": 905.5, "fl_y": 907.0, "cx": 640.75, "cy": 356.25, "w": 1280, "h": 720, "k1": -0.06,
              "frames": [{"file_path": "images/1.png"}]}  # fmt: skip
ORB_SLAM = {"Camera.type": "PinHole", "Camera1.fx": 905.5, "Camera1.fy": 907.0, "Camera1.cx": 640.25,
            "Camera1.cy": 355.75}  # fmt: skip
FORMS = {"ROS": INFO, "RealSense": REALSENSE, "Limelight": LIMELIGHT, "nerfstudio": NERFSTUDIO, "ORB-SLAM": ORB_SLAM}


@pytest.mark.parametrize("name", FORMS)
@pytest.mark.parametrize(
    ("key", "value"),
    [
        *(("distortion", [0.3]), ("k9", 0.1), ("lens_type", "FISHEYE"), ("fisheye", "yes"), ("kappa1", 0.1)),
        *(("focal_unit", "mm"), ("pixel_origin", 1), ("pixel_aspect_ratio", 1.1), ("image_scale", 0.5)),
    ],
)
def test_no_form_drops_a_key_that_matters(name: str, key: str, value: object) -> None:
    refused({**FORMS[name], key: value}, key)


@pytest.mark.parametrize("name", FORMS)
def test_harmless_and_neutral_keys_are_passed_over(name: str) -> None:
    harmless = {"date": "2024-05-01", "rms": 0.2, "k9": 0.0, "fisheye": False, "camera_name": "left", "unit": "px"}
    assert name in read({**FORMS[name], **harmless}).form


@pytest.mark.parametrize(
    ("entries", "key"),
    [
        ({**REALSENSE, "k6": 0.1}, "k6"),
        ({**LIMELIGHT, "LENS_MODEL": "FISHEYE"}, "LENS_MODEL"),
        ({**ORB_SLAM, "Camera.k1": 0.3}, "Camera.k1"),
        ({**ORB_SLAM, "Camera1.distortion": [0.3]}, "Camera1.distortion"),
        ({**NERFSTUDIO, "camera_model": "OPENCV", "is_fisheye": True}, "is_fisheye"),
        ({**INFO, "distortion_coefficients": {"rows": 1, "cols": 5, "data": [0.3, 0, 0, 0, 0]}}, "looks like"),
        ({"fisheye": INFO}, "group"),
        ({"fisheye": {**RADTAN}}, "group"),
        ({"fisheye": REALSENSE, "color": REALSENSE}, "group"),
    ],
)
def test_keys_that_one_form_lacks(entries: dict[str, object], key: str) -> None:
    refused(entries, key)


def test_a_scene_has_a_scale_and_a_fisheye_that_is_stated_as_a_number() -> None:
    assert read({**NERFSTUDIO, "scale": 0.33, "offset": [0.5, 0.5, 0.5], "aabb_scale": 16}).camera.model == "pinhole"
    assert read({**NERFSTUDIO, "is_fisheye": 1}).camera.model == "fisheye"


# --- NumPy arrays ---


def archive(**arrays: object) -> bytes:
    stream = io.BytesIO()
    np.savez(stream, **{"K": K, "D": D5, **arrays})
    return stream.getvalue()


@pytest.mark.parametrize(
    ("key", "value"),
    [
        *(("lens", "fisheye"), ("flags", ["fisheye"]), ("k1", -0.1), ("kc", D5), ("binning", 2), ("unit", "mm")),
        *(("pixel_aspect_ratio", 1.1), ("scale", 0.5), ("distortion_model", "kannala_brandt")),
    ],
)
def test_archives_drop_no_array_that_matters(key: str, value: object) -> None:
    refused(archive(fisheye=False, **{key: value}), key)


def test_archives_pass_over_points_and_poses() -> None:
    content = archive(rvecs=np.ones((9, 3, 1)), objpoints=np.ones((9, 54, 3)), ret=0.2, newcameramtx=np.eye(3),
                      roi=[4, 5, 600, 400], k1=0.0)  # fmt: skip
    assert read_camera_file(content).camera.dist_coeffs.tolist() == D5


def test_the_size_of_an_archive_is_turned_where_the_principal_point_shows_it() -> None:
    file = read_camera_file(archive(image_size=[720, 1280]))
    assert file.camera.image_size == (1280, 720)
    assert any("(height, width)" in note for note in file.notes)
    refused(archive(image_size=[0, 1280]), "image_size")


# --- Files in parts, templates, and conventions of other tools ---


def test_a_file_that_is_gzipped_in_parts_is_read_whole() -> None:
    text = json.dumps({"K": K, "D": D5}).encode()
    packed = gzip.compress(text[:40]) + gzip.compress(text[40:])
    assert read_camera_file(packed).camera.dist_coeffs.tolist() == D5
    assert read_camera_file(packed + bytes(7)).camera.dist_coeffs.tolist() == D5
    refused(packed + b"and more", "gzipped")
    refused(packed[:-3], "ends early")
    refused(gzip.compress(b"") * 1000 + packed, "parts")


def test_a_mat_file_that_is_cut_within_an_element_is_damaged() -> None:
    stream = io.BytesIO()
    scipy.io.savemat(stream, {"K": np.array(K), "D": np.array([D5]), "width": 1280.0, "height": 720.0})
    whole = stream.getvalue()
    assert read_camera_file(whole).camera.image_size == (1280, 720)
    # The last variable has 72 bytes.
    for cut in (1, 8, 20, 64, 65, 68, 71):
        refused(whole[:-cut], "damaged")


@pytest.mark.parametrize(("key", "value"), [("fisheye", 1.0), ("k1", -0.1), ("binning", 2.0), ("kc", D5)])
def test_mat_files_drop_no_variable_that_matters(key: str, value: object) -> None:
    for name, each in ((key, value), (key, 0.0)):
        stream = io.BytesIO()
        scipy.io.savemat(stream, {"K": np.array(K), "D": np.array([D5]), "rvecs": np.ones((3, 9)), name: each})
        if each:
            refused(stream.getvalue(), key)
        else:
            assert read_camera_file(stream.getvalue()).camera.dist_coeffs.tolist() == D5


def test_the_names_of_matlab_need_all_of_matlabs_parts() -> None:
    entries = {"FocalLength": [905.5, 907.0], "PrincipalPoint": [641.25, 356.75]}
    assert "RadialDistortion" in refused(entries, "RadialDistortion")
    camera = read({**entries, "RadialDistortion": [-0.06, 0.02]}).camera
    assert camera.camera_matrix[:2, 2].tolist() == [640.25, 355.75]


def test_models_of_colmap_are_remarked_on() -> None:
    notes = read({"model": "OPENCV", **FLAT, "k1": -0.06, "k2": 0.02, "p1": 0.001, "p2": -0.002}).notes
    assert any("subtract 0.5 from cx and cy" in note for note in notes)


def test_a_template_of_yaml_is_not_taken_for_a_camera() -> None:
    text = "base: &b {fx: 905.5, fy: 907.0, cx: 640.25, cy: 355.75}\ncam0: {<<: *b, k1: 0.1}\n"
    file = read_camera_file(text.encode())
    assert file.camera.dist_coeffs.tolist() == [0.1, 0.0, 0.0, 0.0]
    assert any(note.startswith("cam0 taken, of the 2 cameras base, cam0") for note in file.notes)
    assert not read_camera_file(text.encode(), "base").camera.dist_coeffs.any()
