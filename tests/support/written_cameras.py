"""Cameras of all models to be written, and the check that a form gives the same camera back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from hypothesis import strategies as st

from circlepose.camera.camera import EXACT, Camera, CameraSigma
from circlepose.camera.lens import PINHOLE_COUNTS
from circlepose.io.calibration.reader import CameraFile, read_camera_file
from circlepose.io.calibration.writers import WrittenForm
from circlepose.io.calibration.writers.conversion import Conversion, convert
from circlepose.io.calibration.writers.registry import WRITERS

COEFFICIENTS = (-0.21, 0.09, 4e-4, -2e-4, 0.013, 0.02, -3e-3, 1e-3, 1e-3, -3e-4, 5e-5, 2e-5, 0.01, -0.02)
MATRIX = [[905.5, 0.0, 640.25], [0.0, 907.125, 355.75], [0.0, 0.0, 1.0]]
SIZE = (1280, 720)
# cv2 flushes subnormal numbers to zero on some platforms.
_TERM = st.floats(-1.0, 1.0, allow_subnormal=False) | st.sampled_from([0.0, 1e-5, -1e-17, 1e-300])
_FOCAL = st.floats(1.0, 1e5) | st.sampled_from([1e5, 1000.0])
_CENTER = st.floats(0.0, 1e4, allow_subnormal=False)
_POINT = st.tuples(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.floats(0.2, 3.0))
POINTS = st.lists(_POINT, min_size=1, max_size=20).map(np.array)


@st.composite
def cameras(draw: st.DrawFn, most: int = 14, *, fisheye: bool = True, skew: bool = False) -> Camera:
    """Cameras of up to `most` pinhole coefficients that are not 0, more of them 0; and fisheyes."""
    if fisheye and draw(st.booleans()):
        model, given = "fisheye", draw(st.lists(_TERM, min_size=4, max_size=4))
    else:
        model, count = "pinhole", draw(st.sampled_from(PINHOLE_COUNTS))
        given = draw(st.lists(_TERM, min_size=min(count, most), max_size=min(count, most)))
        given += [0.0] * (count - len(given))
    shear = draw(_TERM) if skew else 0.0
    matrix = [[draw(_FOCAL), shear, draw(_CENTER)], [0.0, draw(_FOCAL), draw(_CENTER)], [0.0, 0.0, 1.0]]
    size = (draw(st.integers(1, 20000)), draw(st.integers(1, 20000)))
    return Camera.create(matrix, given, size, model)  # type: ignore[arg-type]


SIGMAS = st.builds(CameraSigma, st.floats(0.0, 100.0), st.floats(0.0, 100.0)) | st.just(EXACT)


def pinhole(count: int, skew: float = 0.0, size: tuple[int, int] | None = SIZE) -> Camera:
    """Return a pinhole camera with `count` coefficients that are not 0."""
    matrix = np.array(MATRIX)
    matrix[0, 1] = skew
    return Camera.create(matrix, COEFFICIENTS[:count], size)


def fisheye() -> Camera:
    """Return a fisheye camera whose image reaches 100 deg off its axis."""
    matrix = [[405.5, 0.0, 640.25], [0.0, 407.125, 355.75], [0.0, 0.0, 1.0]]
    return Camera.create(matrix, [0.02, -3e-3, 1e-5, 1e-4], SIZE, "fisheye")


def file_of(camera: Camera, **more: object) -> CameraFile:
    """Return what the reader gives of a camera."""
    return CameraFile(camera, "circlepose", Path("cam.yaml"), **more)  # type: ignore[arg-type]


def written(camera: Camera, to: WrittenForm, ending: str = "") -> Conversion:
    """Return a camera as a file of a form."""
    return convert(file_of(camera), to, ending)


def check_same_pixels(camera: Camera, to: WrittenForm, points: np.ndarray, ending: str = "") -> Camera:
    """Assert that a form gives the same camera back, by the pixels of `points` (n, 3); returns that camera."""
    file = read_camera_file(written(camera, to, ending).text.encode())
    assert file.form == WRITERS[to].name
    again = file.camera
    assert again.model == camera.model
    assert again.image_size == camera.image_size
    np.testing.assert_allclose(again.project(points), camera.project(points), rtol=1e-15, atol=1e-9)
    return again
