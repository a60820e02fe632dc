from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circlepose.camera.camera import Camera, CameraSigma
from circlepose.io.calibration.reader import read_camera
from tests.support.written_cameras import POINTS, cameras, check_same_pixels, fisheye, pinhole, written

ENDINGS = st.sampled_from(["", ".yaml", ".yml", ".xml", ".json", ".xml.gz", ".json.gz"])


def opened(text: str) -> cv2.FileStorage:
    return cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)


@given(camera=cameras(), ending=ENDINGS)
def test_opencv_itself_reads_the_same_numbers(camera: Camera, ending: str) -> None:
    storage = opened(written(camera, "opencv", ending).text)
    assert storage.getNode("camera_matrix").mat().tobytes() == camera.camera_matrix.tobytes()
    read = storage.getNode("distortion_coefficients").mat().ravel()
    count = len(camera.dist_coeffs)
    assert read[:count].tobytes() == camera.dist_coeffs.tobytes()
    assert not read[count:].any()
    assert int(storage.getNode("fisheye_model").real()) == (camera.model == "fisheye")
    size = (storage.getNode("image_width").real(), storage.getNode("image_height").real())
    assert size == camera.image_size


@given(camera=cameras(), ending=ENDINGS, points=POINTS)
def test_every_syntax_is_read_back(camera: Camera, ending: str, points: np.ndarray) -> None:
    check_same_pixels(camera, "opencv", points, ending)


@settings(max_examples=30)
@given(points=POINTS)
@pytest.mark.parametrize("camera", [pinhole(0), pinhole(5), pinhole(8), pinhole(12), pinhole(14), fisheye()])
def test_opencv_projects_to_our_pixels(camera: Camera, points: np.ndarray) -> None:
    storage = opened(written(camera, "opencv").text)
    matrix = storage.getNode("camera_matrix").mat()
    dist = storage.getNode("distortion_coefficients").mat().ravel()
    project = cv2.fisheye.projectPoints if camera.model == "fisheye" else cv2.projectPoints
    theirs = project(points[:, None], np.zeros(3), np.zeros(3), matrix, dist)[0].reshape(-1, 2)
    ours = camera.project(points)
    # Beyond a fold of the lens model we have no pixel, and OpenCV has one that no light reaches.
    seen = np.isfinite(ours[:, 0])
    np.testing.assert_allclose(theirs[seen], ours[seen], rtol=1e-12, atol=1e-9)


def test_the_header_is_the_one_that_all_versions_read() -> None:
    assert written(pinhole(5), "opencv").text.startswith("%YAML:1.0\n---\n")


def test_the_standard_deviations_are_kept() -> None:
    camera = replace(pinhole(5), sigma=CameraSigma(0.1 + 0.2, 0.5))
    for ending in ("", ".xml", ".json"):
        assert read_camera(written(camera, "opencv", ending).text.encode()) == camera
