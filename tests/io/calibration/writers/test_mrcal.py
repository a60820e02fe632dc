from __future__ import annotations

import ast

import pytest

from circlepose.camera.camera import Camera
from tests.support.written_cameras import SIZE, pinhole, written


@pytest.mark.parametrize("count", [0, 4, 5, 8, 12])
def test_the_dict_that_mrcal_evaluates(count: int) -> None:
    """With the keys that mrcal/cameramodel.py requires, and as many numbers as the model has."""
    entries = ast.literal_eval(written(pinhole(count), "mrcal").text)
    assert entries["lensmodel"] == (f"LENSMODEL_OPENCV{count}" if count else "LENSMODEL_PINHOLE")
    assert entries["intrinsics"] == [905.5, 907.125, 640.25, 355.75, *pinhole(count).dist_coeffs.tolist()]
    assert entries["extrinsics"] == [0] * 6
    assert tuple(entries["imagersize"]) == SIZE


def test_a_tilt_of_0_is_left_out() -> None:
    camera = Camera.create(pinhole(12).camera_matrix, [*pinhole(12).dist_coeffs, 0.0, 0.0], SIZE)
    assert "LENSMODEL_OPENCV12" in written(camera, "mrcal").text
