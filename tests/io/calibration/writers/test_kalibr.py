from __future__ import annotations

import pytest
import yaml
from hypothesis import given

from circlepose.camera.camera import Camera
from circlepose.errors import CalibrationError
from circlepose.io.calibration.writers.conversion import convert
from tests.support.written_cameras import SIZE, cameras, file_of, fisheye, pinhole, written


@given(camera=cameras(4))
def test_what_kalibr_checks(camera: Camera) -> None:
    """As kalibr_common/ConfigReader.py does: floats, counts by model, whole numbers, a topic."""
    entries = yaml.safe_load(written(camera, "kalibr").text)["cam0"]
    assert entries["camera_model"] == "pinhole"
    assert entries["distortion_model"] == ("equidistant" if camera.model == "fisheye" else "radtan")
    for key in ("intrinsics", "distortion_coeffs"):
        assert len(entries[key]) == 4
        assert all(type(each) is float for each in entries[key])
    (fx, _, cx), (_, fy, cy), _ = camera.camera_matrix.tolist()
    assert entries["intrinsics"] == [fx, fy, cx, cy]
    assert entries["resolution"] == list(camera.image_size or ())
    assert isinstance(entries["rostopic"], str)


def test_a_name_of_another_camera_is_said_to_change() -> None:
    assert any("cam1 is called cam0" in each for each in convert(file_of(fisheye(), name="cam1"), "kalibr").remarks)
    assert not any("called" in each for each in convert(file_of(fisheye(), name="cam0"), "kalibr").remarks)


def test_a_negative_principal_point_is_refused_as_kalibr_refuses_it() -> None:
    camera = Camera.create([[900.0, 0.0, -3.5], [0.0, 900.0, 200.0], [0.0, 0.0, 1.0]], [], SIZE)
    with pytest.raises(CalibrationError, match=r"takes no negative principal point, and it is \(-3\.5, 200\) px"):
        written(camera, "kalibr")


def test_five_coefficients_of_which_the_last_is_0_are_four() -> None:
    camera = Camera.create(pinhole(4).camera_matrix, [0.1, 0.2, 0.3, 0.4, 0.0], SIZE)
    assert "distortion_coeffs: [0.1, 0.2, 0.3, 0.4]\n" in written(camera, "kalibr").text
