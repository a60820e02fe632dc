from __future__ import annotations

import pytest

from circlepose.camera.camera import Camera
from circlepose.io.calibration.reader import read_camera_file
from circlepose.io.calibration.writers.conversion import convert
from tests.support.written_cameras import MATRIX, SIZE, file_of, fisheye, pinhole, written


@pytest.mark.parametrize(
    ("camera", "model", "count"),
    [
        (pinhole(0), "PINHOLE", 4),
        (pinhole(4), "OPENCV", 8),
        (pinhole(5), "FULL_OPENCV", 12),
        (pinhole(8), "FULL_OPENCV", 12),
        (Camera.create(MATRIX, [0.0] * 14, SIZE), "PINHOLE", 4),
        (fisheye(), "OPENCV_FISHEYE", 8),
    ],
)
def test_the_line_of_the_camera(camera: Camera, model: str, count: int) -> None:
    (line,) = (each for each in written(camera, "colmap").text.splitlines() if not each.startswith("#"))
    camera_id, name, width, height, *parameters = line.split()
    assert (camera_id, name, int(width), int(height)) == ("1", model, *SIZE)
    assert len(parameters) == count
    numbers = [float(each) for each in parameters]
    # The center of COLMAP's first pixel is (0.5, 0.5).
    assert numbers[2:4] == [640.75, 356.25]
    kept = min(len(camera.dist_coeffs), count - 4)
    assert numbers[4 : 4 + kept] == camera.dist_coeffs[:kept].tolist()


@pytest.mark.parametrize(("name", "kept"), [("7", "7"), ("0", "0"), ("007", "1"), ("cam1", "1")])
def test_a_number_is_kept_as_the_camera_id(name: str, kept: str) -> None:
    conversion = convert(file_of(pinhole(4), name=name), "colmap")
    assert read_camera_file(conversion.text.encode()).name == kept
    assert any(f"the camera {name} is called 1" in each for each in conversion.remarks) == (name != kept)
