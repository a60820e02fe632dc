from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from circlepose.camera.camera import Camera
from circlepose.io.calibration.file_storage import parse_storage
from circlepose.io.calibration.reader import read_camera, write_camera
from circlepose.io.calibration.writers.storage_syntax import yaml_text

# OpenCV flushes numbers below the smallest normal one to zero on some platforms.
NUMBERS = st.floats(allow_nan=False, allow_infinity=False, allow_subnormal=False)
MEANT = st.floats(-1e9, 1e9, allow_subnormal=False)
FOCAL = st.floats(1e-3, 1e6)
SHAPES = st.tuples(st.integers(1, 4), st.integers(1, 5))
shared_folder = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60)


@given(st.lists(NUMBERS, min_size=1, max_size=15))
def test_opencv_reads_what_we_write_to_the_bit(values: list[float]) -> None:
    matrix = np.array([values])
    text = yaml_text({"image_width": 640, "word": "pinhole", "m": matrix})
    storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
    assert storage.getNode("m").mat().tobytes() == matrix.tobytes()
    assert storage.getNode("image_width").real() == 640
    assert storage.getNode("word").string() == "pinhole"


@pytest.mark.parametrize("suffix", ["yml", "xml", "json"])
@given(data=st.data())
def test_we_read_what_opencv_writes_exactly(suffix: str, data: st.DataObject) -> None:
    rows, cols = data.draw(SHAPES)
    values = data.draw(st.lists(NUMBERS, min_size=rows * cols, max_size=rows * cols))
    matrix = np.array(values).reshape(rows, cols)
    storage = cv2.FileStorage(f".{suffix}", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
    storage.write("m", matrix)
    storage.write("number", values[0])
    storage.write("word", 'a "word": <1e-3> // no remark')
    entries, is_opencv = parse_storage(storage.releaseAndGetString(), "f")
    assert is_opencv
    assert entries["word"] == 'a "word": <1e-3> // no remark'
    assert entries["number"] == values[0]
    node = entries["m"]
    assert isinstance(node, dict)
    assert (node["rows"], node["cols"]) == (rows, cols)
    np.testing.assert_array_equal(np.array(node["data"], dtype=np.float64).reshape(rows, cols), matrix)


@shared_folder
@given(fx=FOCAL, fy=FOCAL, skew=MEANT, cx=MEANT, cy=MEANT, data=st.data())
def test_a_camera_keeps_every_bit(
    tmp_path: Path, fx: float, fy: float, skew: float, cx: float, cy: float, data: st.DataObject
) -> None:
    count = data.draw(st.sampled_from([0, 4, 5, 8, 12, 14]))
    dist = data.draw(st.lists(MEANT, min_size=count, max_size=count))
    camera = Camera.create([[fx, skew, cx], [0, fy, cy], [0, 0, 1]], dist, (640, 480))
    path = tmp_path / "cam.yaml"
    write_camera(camera, path)
    read = read_camera(path)
    assert read.camera_matrix.tobytes() == camera.camera_matrix.tobytes()
    assert read.dist_coeffs.tobytes() == camera.dist_coeffs.tobytes()
    assert read.image_size == camera.image_size
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    assert storage.getNode("camera_matrix").mat().tobytes() == camera.camera_matrix.tobytes()
    storage.release()


def test_a_target_in_xml_is_a_mapping() -> None:
    text = (
        "<?xml version='1.0'?><opencv_storage><target><kind>coplanar</kind><radii_mm>50. 30.</radii_mm>"
        "<count>2</count></target><list><_>1</_><_>2</_></list><empty></empty></opencv_storage>"
    )
    entries, _ = parse_storage(text, "f")
    assert entries["target"] == {"kind": "coplanar", "radii_mm": [50.0, 30.0], "count": 2}
    assert entries["list"] == [1, 2]
