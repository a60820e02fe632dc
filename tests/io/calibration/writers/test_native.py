from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given

from circlepose.camera.camera import Camera, CameraSigma
from circlepose.io.calibration.reader import read_camera, read_camera_file
from circlepose.io.calibration.writers.conversion import convert
from circlepose.io.target_file import target_from_mapping
from tests.support.written_cameras import SIGMAS, cameras, file_of, pinhole, written


@given(camera=cameras(skew=True), sigma=SIGMAS)
def test_our_own_form_loses_nothing(camera: Camera, sigma: CameraSigma) -> None:
    camera = replace(camera, sigma=sigma)
    assert read_camera(written(camera, "circlepose").text.encode()) == camera


@pytest.mark.parametrize(
    "target",
    [
        {"radius_mm": 60},
        {"kind": "coaxial", "radii_mm": [45, 30], "height_mm": 1e-5, "depth_range_mm": [714, 800]},
        {"radius_mm": 12.5, "polarity": "dark", "count": "all", "facing": "up", "radius_sigma_mm": 0.1},
    ],
)
def test_the_target_is_kept(target: dict[str, object]) -> None:
    text = convert(file_of(pinhole(5), target=target), "circlepose").text
    again = read_camera_file(text.encode())
    assert again.form == "circlepose"
    assert again.target is not None
    assert target_from_mapping(again.target, "f") == target_from_mapping(target, "f")
