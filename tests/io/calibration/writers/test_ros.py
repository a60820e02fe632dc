from __future__ import annotations

import numpy as np
import pytest
import yaml
from hypothesis import given

from circlepose.camera.camera import Camera
from circlepose.io.calibration.reader import read_camera_file
from circlepose.io.calibration.writers.conversion import convert
from tests.support.written_cameras import cameras, file_of, fisheye, pinhole, written


@given(camera=cameras(8))
def test_the_keys_and_matrices_of_a_camera_info(camera: Camera) -> None:
    """As camera_calibration_parsers reads them: numbers in lists row by row, whose shapes stand beside them."""
    entries = yaml.safe_load(written(camera, "ros").text)
    assert (entries["image_width"], entries["image_height"]) == camera.image_size
    for key, shape in (("camera_matrix", (3, 3)), ("rectification_matrix", (3, 3)), ("projection_matrix", (3, 4))):
        assert (entries[key]["rows"], entries[key]["cols"]) == shape
        assert all(type(each) is float for each in entries[key]["data"])
    matrix = np.reshape(entries["camera_matrix"]["data"], (3, 3))
    assert matrix.tobytes() == camera.camera_matrix.tobytes()
    np.testing.assert_array_equal(np.reshape(entries["rectification_matrix"]["data"], (3, 3)), np.eye(3))
    np.testing.assert_array_equal(np.reshape(entries["projection_matrix"]["data"], (3, 4))[:, :3], matrix)
    dist = entries["distortion_coefficients"]
    names = {"plumb_bob": 5, "rational_polynomial": 8, "equidistant": 4}
    assert dist["rows"] * dist["cols"] == len(dist["data"]) == names[entries["distortion_model"]]


@pytest.mark.parametrize(
    ("camera", "model"),
    [
        (pinhole(0), "plumb_bob"),
        (pinhole(4), "plumb_bob"),
        (pinhole(5), "plumb_bob"),
        (pinhole(8), "rational_polynomial"),
        (fisheye(), "equidistant"),
    ],
)
def test_the_model_that_is_named(camera: Camera, model: str) -> None:
    assert f"\ndistortion_model: {model}\n" in written(camera, "ros").text


@pytest.mark.parametrize(
    ("name", "kept"), [("left_2", "left_2"), ("123", "123"), ("true", "true"), ("a b", "camera")]
)
def test_a_name_is_kept_where_ros_takes_it(name: str, kept: str) -> None:
    conversion = convert(file_of(pinhole(5), name=name), "ros")
    assert yaml.safe_load(conversion.text)["camera_name"] == kept
    assert read_camera_file(conversion.text.encode(), kept).name == kept
    assert any(name in remark for remark in conversion.remarks) == (name != kept)
