from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest

from circlepose.errors import CalibrationError
from circlepose.io.calibration.reader import CameraFile, read_camera_file
from tests.support.lens_formulas import CX, CY, FX, FY, SIZE, check_terms
from tests.support.refusals import refused_calibration

K = [[FX, 0.0, CX], [0.0, FY, CY], [0.0, 0.0, 1.0]]
ROWS = [each for row in K for each in row]
D = [-0.215, 0.094, 4.5e-4, -2.5e-4, 0.013]


TERMS = dict(zip(("k1", "k2", "p1", "p2", "k3"), D, strict=True))
FLAT = {"fx": FX, "fy": FY, "cx": CX, "cy": CY}


def read(entries: Any, camera_name: str | None = None) -> CameraFile:
    return read_camera_file(json.dumps(entries).encode(), camera_name)


def refused(content: Any, camera_name: str | None = None) -> str:
    return refused_calibration(content if isinstance(content, bytes) else json.dumps(content), camera_name)


@pytest.mark.parametrize(
    "entries",
    [
        {"K": K, "D": D, "image_size": SIZE},
        {"K": K, "D": [D], "width": 1280, "height": 960},
        {"camera_matrix": K, "dist_coeff": [[each] for each in D], "image_width": 1280, "image_height": 960},
        {"cameraMatrix": ROWS, "distCoeffs": D, "imageSize": {"width": 1280, "height": 960}},
        {"mtx": K, "dist": [D], "img_shape": [960, 1280, 3]},
        {"intrinsics": [FX, FY, CX, CY], "distortion": D, "resolution": [1280, 960]},
        {"intrinsics": K, "distCoef": D, "resolution": "1280x960"},
        {"intrinsics": FLAT, "distortion": TERMS, "resolution": {"width": 1280, "height": 960}},
        {"camera_matrix": FLAT, "dist_coeffs": D, "image_size": SIZE},
        {**FLAT, **TERMS, "w": 1280, "h": 960},
        {"Fx": FX, "Fy": FY, "ppx": CX, "ppy": CY, **TERMS, "size": SIZE},
        {"focal_length": [FX, FY], "principal_point": [CX, CY], "dist_coeffs": D, "image_size": SIZE},
        {**FLAT, "radial_distortion": [D[0], D[1], D[4]], "tangential_distortion": D[2:4], "image_size": SIZE},
        {"calibration": {"front": {"intrinsics": FLAT, "distortion": {"coefficients": D, "model": "plumb_bob"}}},
         "image_size": SIZE},
        {"Camera.fx": FX, "Camera.fy": FY, "Camera.cx": CX, "Camera.cy": CY, "Camera.dist": D,
         "Camera.width": 1280, "Camera.height": 960},
        [{"K": K, "D": D, "image_size": SIZE}],
        {"cameras": [{"camera": {
            "type": "pinhole", "image_width": 1280, "image_height": 960,
            "intrinsics": {"rows": 4, "cols": 1, "data": [FX, FY, CX, CY]},
            "distortion": {"type": "radial-tangential", "parameters": {"rows": 5, "cols": 1, "data": D}},
        }}]},
        {"intrinsics": {"matrix": K}, "distortion": {"values": D}, "image_size": SIZE},
        {"camera_matrix": {"rows": 3, "cols": 3, "data": ROWS}, "dist": D, "image_size": SIZE},
    ],
)  # fmt: skip
def test_the_same_camera_under_the_names_that_people_give(entries: Any) -> None:
    file = read(entries)
    assert file.form == "keys and values"
    assert file.camera.image_size == SIZE
    assert file.doubts == ()
    check_terms(file, TERMS)


def test_own_names_beside_harmless_ones_are_read_and_the_rest_is_named() -> None:
    file = read(
        {"camera_matrix": K, "dist_coeffs": D, "image_size": SIZE, "rms": 0.3, "date": "2024-05-01", "board": 3}
    )
    assert file.notes == ("not used: date, board",)
    assert [doubt.about for doubt in read({"K": K, "D": D, "image_size": SIZE, "rms": 9.5}).doubts] == ["rms"]
    check_terms(file, TERMS)


def test_other_models_by_their_terms() -> None:
    rational = {**TERMS, "k4": 0.11, "k5": -0.02, "k6": 0.003}
    check_terms(read({**FLAT, **rational}), rational)
    fisheye = {"k1": -0.02, "k2": 0.004, "k3": -0.001, "k4": 0.0002}
    check_terms(read({**FLAT, **fisheye, "model": "equidistant"}), fisheye, fisheye=True)
    check_terms(read({**FLAT, "D": list(fisheye.values()), "is_fisheye": True}), fisheye, fisheye=True)
    named = read({**FLAT, "camera_model": "pinhole", "distortion_model": "fisheye", "D": list(fisheye.values())})
    check_terms(named, fisheye, fisheye=True)


def test_the_type_of_the_distortion_is_finer_than_that_of_the_camera() -> None:
    fisheye = {"k1": -0.02, "k2": 0.004, "k3": -0.001, "k4": 0.0002}
    bent = {"type": "equidistant", "parameters": list(fisheye.values())}
    check_terms(read({"type": "pinhole", "intrinsics": FLAT, "distortion": bent}), fisheye, fisheye=True)


def test_skew_moves_along_x_and_is_remarked_on() -> None:
    file = read({**FLAT, **TERMS, "skew": -1.75})
    check_terms(file, TERMS, skew=-1.75)
    assert any("skew of -1.75 px" in note for note in file.notes)
    check_terms(read({**FLAT, **TERMS, "alpha_c": 0.002}), TERMS, skew=0.002 * FX)


@pytest.mark.parametrize("flat", [True, False])
@pytest.mark.parametrize("key", ["K", "camera_matrix"])
def test_a_matrix_that_stands_column_by_column_is_transposed(key: str, flat: bool) -> None:
    columns = [list(column) for column in zip(*K, strict=True)]
    file = read(
        {
            key: [each for column in columns for each in column] if flat else columns,
            "dist_coeffs": D,
            "image_size": SIZE,
        }
    )
    check_terms(file, TERMS)
    assert [note for note in file.notes if "was transposed" in note]
    assert [note for note in file.notes if "MATLAB" in note]


def test_a_size_of_height_and_width_is_turned_where_the_principal_point_shows_it() -> None:
    file = read({"K": K, "D": D, "image_size": [960, 1280], "date": 1})
    assert file.camera.image_size == SIZE
    assert "image_size is (height, width)" in file.notes[0]


def test_without_distortion_it_is_said() -> None:
    file = read({**FLAT, "width": 1280, "height": 960})
    check_terms(file, {})
    assert file.notes == ("no distortion coefficients in the file: taken for a lens without distortion",)


@pytest.mark.parametrize(
    "entries",
    [
        {"left": {"K": K, "D": D}, "right": {"K": K, "D": [0.5, 0, 0, 0, 0]}, "image_size": SIZE},
        {"cameras": [{"name": "left", **FLAT, **TERMS}, {"name": "right", **FLAT, "k1": 0.5}], "image_size": SIZE},
        {"K_left": K, "D_left": D, "K_right": K, "D_right": [0.5, 0, 0, 0, 0], "R": K, "image_size": SIZE},
        {"LEFT.K": K, "LEFT.D": D, "RIGHT.K": K, "RIGHT.D": [0.5, 0, 0, 0, 0], "image_size": SIZE},
    ],
)
def test_of_several_cameras_the_first_is_taken_or_the_named_one(entries: Any) -> None:
    first = read(entries)
    check_terms(first, TERMS)
    assert "of the 2 cameras" in first.notes[0]
    second = read(entries, "right")
    check_terms(second, {"k1": 0.5})
    assert first.camera.image_size == second.camera.image_size == SIZE
    assert "holds no camera 'top'; its cameras are" in refused(entries, "top")


@pytest.mark.parametrize(
    ("entries", "says"),
    [
        ({**FLAT, "k1": 0.1, "k7": 0.2}, "k7: is no known key and looks like distortion (0.2)"),
        ({**FLAT, "distortion": {"a": 0.1, "b": 0.2}}, "distortion.a: is no known key and looks like distortion"),
        ({**FLAT, "distortion_model": "none", "D": D}, "D, distortion_model: contradict each other"),
        ({**FLAT, "xi": 1.2}, "xi: is no known key and looks like distortion"),
        ({**FLAT, "dist_cofs": D}, "did you mean dist_coeffs?"),
        ({**FLAT, "lens_distortion_terms": D}, "lens_distortion_terms: is no known key and looks like distortion"),
        ({"camera_matrx": K, "dist_coeffs": D}, "camera_matrx: is no known key; did you mean camera_matrix?"),
        ({**FLAT, "imge_width": 1280, "image_height": 960}, "imge_width: is no known key; did you mean image_width?"),
        ({**FLAT, "k1": 0.1, "k2": 0.1, "k3": 0.1, "k4": 0.1}, "k4: is given without k5 and k6"),
        ({**FLAT, "model": "fisheye", "p1": 0.1}, "p1: a fisheye camera has the coefficients k1 k2 k3 k4"),
        ({**FLAT, "model": "fisheye", "date": 1}, "a fisheye camera has 4 coefficients"),
        (
            {**FLAT, "model": "double_sphere", "D": []},
            "double sphere model, which circlepose does not have",
        ),
        ({**FLAT, "lens_model": "fishy", "D": []}, "lens_model: expected a pinhole model"),
        ({**FLAT, "fisheye": True, "distortion_model": "radtan", "D": [0, 0, 0, 0]}, "contradict each other"),
        ({"K": K, "D": [0.1, 0.2, 0.3]}, "may be k1 k2 k3 or k1 k2 p1"),
        ({"K": K, "D": [0.1] * 6}, "got 6"),
        ({"K": K, "D": None}, "D: has no value; expected [k1, k2, p1, p2, k3]"),
        ({"K": K, "D": [math.nan] * 5}, "D: has entries that are not finite"),
        ({"K": K, "D": D, **TERMS}, "D, k1: mean the same"),
        ({"K": K, "mtx": K, "D": D}, "K, mtx: mean the same"),
        ({"K": K, "D": D, "fx": 1.0}, "fx: contradicts K"),
        ({"K1": K, "K2": K, "D": D}, "D: it is not clear of which camera this distortion is"),
        ({"K": K, "D1": D}, "D1: it is not clear of which camera"),
        ({"fx": FX, "cx": CX, "cy": CY, "date": 1}, "fy: missing; give camera_matrix, or all of fx, fy, cx, cy"),
        ({"focal_length_mm": 8, "cx": CX, "cy": CY}, "fx, fy: missing"),
        ({"K": K, "D": D, "image_size": SIZE, "image_width": 640, "image_height": 480}, "contradict each other"),
        ({"K": K, "D": D, "image_width": 640}, "image_width: stands without the image's height"),
        ({"K": K, "D": D, "image_size": 640}, "image_size: expected [width, height] in px, got 640"),
        ({"K": "a.txt", "D": D}, "camera_matrix: missing"),
        ({"K": K, "D": D, **{f"key_{i}": i for i in range(20_000)}}, "holds more than 10000 keys"),
    ],
)
def test_what_is_not_clear_is_refused_with_the_step(entries: Any, says: str) -> None:
    assert says in refused(entries)


def test_a_term_of_zero_and_lists_of_other_things_are_no_hindrance() -> None:
    seen = [{"x": 1, "y": 2, "w": 3, "h": 4}] * 20_000
    file = read({**FLAT, **TERMS, "k7": 0, "board": {"width": 9, "height": 6}, "seen": seen, "dist_std": [0.1]})
    check_terms(file, TERMS)
    assert file.notes == ("not used: k7, board, seen, dist_std",)


def test_yaml_as_python_dumps_it() -> None:
    lines = [f"{key}: {value!r}" for key, value in {**FLAT, **TERMS}.items()]
    text = "\n".join([*lines, "image_size: !!python/tuple", "- 1280", "- 960", "calibrated: 2024-05-01", ""])
    file = read_camera_file(text.encode())
    check_terms(file, TERMS)
    assert file.camera.image_size == SIZE


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "latin-1", "cp932"])
@pytest.mark.parametrize("line_end", ["\n", "\r\n"])
def test_every_encoding_in_which_keys_and_numbers_are_clear(encoding: str, line_end: str) -> None:
    remark = {"latin-1": "# Müllers Gerät", "cp932": "# カメラの校正"}.get(encoding, "# camera")
    text = line_end.join([remark, f"K: {K}", f"D: {D}", "image_size: [1280, 960]", ""])
    check_terms(read_camera_file(text.encode(encoding)), TERMS)


TOML = f"""[cam_0]
name = "left"
size = [ 1280, 960,]
matrix = [ [ {FX}, 0.0, {CX},], [ 0.0, {FY}, {CY},], [ 0.0, 0.0, 1.0,],]
distortions = {D}
rotation = [ 0.1, 0.2, 0.3,]
translation = [ 1.0, 2.0, 3.0,]

[cam_1]
name = "right"
size = [ 1280.0, 960.0]
matrix = [ [ {FX}, 0.0, {CX},], [ 0.0, {FY}, {CY},], [ 0.0, 0.0, 1.0,],]
distortions = [-0.02, 0.004, -0.001, 0.0002]
fisheye = true

[metadata]
error = 0.5
"""
INI = f"[camera]\nresolution = [1280 960]\nfx = {FX} ; px\nfy={FY}\ncx: {CX}\ncy = {CY}\nname = a b\n"


def test_toml_as_anipose_and_pose2sim_write_it() -> None:
    first = read_camera_file(TOML.encode())
    assert (first.form, first.camera.image_size) == ("keys and values", SIZE)
    assert "cam_0 taken, of the 2 cameras cam_0, cam_1" in first.notes
    check_terms(first, TERMS)
    for name in ("cam_1", "right"):
        second = read_camera_file(TOML.encode(), name)
        check_terms(second, {"k1": -0.02, "k2": 0.004, "k3": -0.001, "k4": 0.0002}, fisheye=True)


@pytest.mark.parametrize(
    "lens",
    [
        f"dist = [{' '.join(map(str, D))}]",
        f"dist = {', '.join(map(str, D))}",
        "\n".join(f"{key} = {value}" for key, value in TERMS.items()),
        "[distortion]\n" + "\n".join(f"{key.upper()} = {value}  # remark" for key, value in TERMS.items()),
    ],
)
def test_ini(lens: str) -> None:
    file = read_camera_file(f"{INI}{lens}\n".encode())
    assert file.camera.image_size == SIZE
    check_terms(file, TERMS)


@pytest.mark.parametrize(
    ("entries", "says"),
    [
        ({**FLAT, "fx": "905.5", "k1": 0.1}, "fx: expected a number, got '905.5'; remove the quotes"),
        ({**FLAT, "fx": "905.5"}, "got '905.5'; remove the quotes"),
        ({**FLAT, "k1": "0.1"}, "k1: expected a number, got '0.1'; remove the quotes"),
        ({"K": [[str(each) for each in row] for row in K], "D": D}, "got '1180.5'; remove the quotes"),
        ({"K": K, "D": "0.1 0.2 0 0 0"}, "D: expected [k1, k2, p1, p2, k3], or [] for no distortion, got the text"),
        ({"K": K, "dist_coeffs": "[0.1, 0.2, 0, 0]"}, "write the numbers here as a list, without quotes"),
        ({"K": K, "distortion": "dist.npy"}, "distortion: expected [k1, k2, p1, p2, k3], or []"),
        ({"K": "900 0 640 0 900 480 0 0 1", "D": D}, "K: expected [[fx, 0, cx], [0, fy, cy], [0, 0, 1]], got the"),
        ({"camera_matrix": K, "dist_coeffs": ["0.1", 0, 0, 0]}, "got ['0.1', 0, 0, 0]; remove the quotes"),
        ({**FLAT, "fx": [905, 5], "k1": 0.1}, "fx: expected a number, with a point and not a comma, got [905, 5]"),
        ({**FLAT, "radial_distortion_1": 0.03}, "expected dist_coeffs, or k1, k2, p1, p2, k3; rename it so"),
        ({**FLAT, "k1": 0.1, "camera_model": "HERO8 Black"}, "if it names a device, rename this key to device"),
        (
            {**FLAT, "k1": 0.1, "camera_model": "omnidir 2", "distortion_model": "radtan"},
            "is an omnidirectional",
        ),
        ([{"camera_intrinsic": []}], "camera_intrinsic: expected a matrix or a list of numbers, got []"),
    ],
)
def test_texts_in_place_of_numbers_and_names_in_place_of_models(entries: Any, says: str) -> None:
    assert says in refused(entries)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("fx:900\nfy:900\ncx:640\ncy:480\n", "line 1: fx: needs a blank after the colon; write `fx: `"),
        ("fx: 900\nfy:900\ncx: 640\ncy: 480\n", "line 2: fy: needs a blank after the colon"),
        ("[camera]\nfx = 9 px\nfy = 9\ncx = 3\ncy = 3\nrubbish\n", "line 6: is neither `[section]` nor `key"),
        (f"fx: {'9' * 5000}\n", "holds a whole number of thousands of digits"),
        (f'{{"fx": {"9" * 5000}}}', "holds a whole number of thousands of digits"),
    ],
)  # fmt: skip
def test_slips_of_syntax(text: str, says: str) -> None:
    assert says in refused(text.encode())


@pytest.mark.parametrize(
    "key", ["new_camera_matrix", "optimal_camera_matrix", "newcameramtx", "newCameraMatrix", "new_mtx"]
)
def test_the_camera_matrix_of_undistorted_images_is_passed_over(key: str) -> None:
    file = read({"camera_matrix": K, "dist_coeffs": D, "image_size": SIZE, key: [[1.0, 0, 1], [0, 1, 1], [0, 0, 1]]})
    assert file.notes == (f"not used: {key}",)
    check_terms(file, TERMS)


def test_names_of_devices_and_capitals_of_models() -> None:
    entries = {**FLAT, **TERMS, "camera_model": "HERO8 Black", "distortion_type": "plumb_bob", "date": 1}
    check_terms(read(entries), TERMS)
    fisheye = [-0.02, 0.004, -0.001, 0.0002]
    file = read({**FLAT, "model": "Fisheye", "dist_coeffs": fisheye})
    assert file.form == "circlepose"
    check_terms(file, {f"k{i}": each for i, each in enumerate(fisheye, 1)}, fisheye=True)


def test_sensors_without_a_matrix_are_no_cameras_and_lists_have_no_name() -> None:
    sensors = [{"token": "a", "camera_intrinsic": []}, {"token": "b", "camera_intrinsic": K}]
    check_terms(read(sensors), {})
    check_terms(read(sensors, "1"), {})
    panoptic = {"cameras": [{"name": "00_00", "resolution": SIZE, "K": K, "distCoef": D}]}
    check_terms(read(panoptic, "00_00"), TERMS)
    assert "holds no camera '0'; its cameras are 00_00." in refused(panoptic, "0")


def test_cameras_of_two_digits() -> None:
    entries = {"K_01": K, "dist_01": D, "K_02": K, "dist_02": [0.5, 0, 0, 0, 0], "H_02": 960, "W_02": 1280}
    check_terms(read(entries), TERMS)
    second = read(entries, "02")
    check_terms(second, {"k1": 0.5})
    assert second.camera.image_size == SIZE
    many = {f"{key}{i}": value for i in range(1, 12) for key, value in (("K", K), ("D", [i / 100, 0, 0, 0, 0]))}
    assert read(many).notes[0].startswith("K1 taken, of the 11 cameras K1, K2, K3,")
    check_terms(read(many, "11"), {"k1": 0.11})


def test_nothing_in_a_file_steers_a_terminal(tmp_path: Path) -> None:
    key = "b\x1b[31m\u202eoard"
    path = tmp_path / "a\nb.json"
    path.write_text(json.dumps({**FLAT, **TERMS, "width": 1280, "height": 960, key: 3}))
    file = read_camera_file(path)
    assert file.notes == ("not used: b\\x1b[31m\\u202eoard",)
    path.write_text(json.dumps({**FLAT, key: {"dist_terms": [1.0, 2.0]}}))
    with pytest.raises(CalibrationError) as caught:
        read_camera_file(path)
    assert str(caught.value).isprintable()
    assert "a\\nb.json: b\\x1b[31m" in str(caught.value)
