"""COLMAP and mrcal themselves, where they are at hand, read what is written for them and project to our pixels."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from circlepose.camera.camera import Camera
from tests.support.written_cameras import SIZE, fisheye, pinhole, written

POINTS = np.column_stack([np.random.default_rng(1).uniform(-0.5, 0.5, (50, 2)), np.ones(50)])


@pytest.mark.parametrize("camera", [pinhole(0), pinhole(4), pinhole(5), pinhole(8), fisheye()])
def test_colmap(camera: Camera, tmp_path: Path) -> None:
    pycolmap = pytest.importorskip("pycolmap", reason="pycolmap is not installed")
    (tmp_path / "cameras.txt").write_text(written(camera, "colmap").text)
    (tmp_path / "images.txt").touch()
    (tmp_path / "points3D.txt").touch()
    reconstruction = pycolmap.Reconstruction()
    reconstruction.read_text(str(tmp_path))
    theirs = reconstruction.cameras[1]
    assert (theirs.width, theirs.height) == SIZE
    pixels = np.array([theirs.img_from_cam(point) for point in POINTS]).reshape(-1, 2)
    np.testing.assert_allclose(pixels - 0.5, camera.project(POINTS), rtol=0, atol=1e-9)


@pytest.mark.parametrize("camera", [pinhole(0), pinhole(4), pinhole(5), pinhole(8), pinhole(12)])
def test_mrcal(camera: Camera, tmp_path: Path) -> None:
    mrcal = pytest.importorskip("mrcal", reason="mrcal is not installed")
    path = tmp_path / "camera.cameramodel"
    path.write_text(written(camera, "mrcal").text)
    theirs = mrcal.cameramodel(str(path))
    assert tuple(theirs.imagersize()) == SIZE
    np.testing.assert_allclose(mrcal.project(POINTS, *theirs.intrinsics()), camera.project(POINTS), rtol=0, atol=1e-9)
