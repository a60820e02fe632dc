"""COLMAP's cameras.txt of one camera: CAMERA_ID MODEL WIDTH HEIGHT PARAMS[].

COLMAP's pixel (0, 0) is the corner of the image and the center of the first pixel (0.5, 0.5), so cx and cy move by
+0.5 px. Of `FULL_OPENCV` the parameters are k1 k2 p1 p2 k3 k4 k5 k6, as OpenCV orders them.
Source: COLMAP's doc/format.rst (the file), doc/database.rst (pixels), src/colmap/sensor/models.h (parameters).
"""

from __future__ import annotations

import re

from circlepose.io.calibration.number_text import number_text
from circlepose.io.calibration.writers.writer import NAME, Contents, Lens, Writer
from circlepose.io.marks import COMMENT

_FIRST = "1"
_ID = re.compile(r"0|[1-9][0-9]{0,8}")
_CENTER_OF_FIRST_PX = 0.5


def _text(contents: Contents) -> str:
    fx, fy, cx, cy = contents.focal_and_center
    moved = [fx, fy, cx + _CENTER_OF_FIRST_PX, cy + _CENTER_OF_FIRST_PX, *contents.camera.dist_coeffs.tolist()]
    width, height = contents.size
    parameters = " ".join(map(number_text, moved))
    return (
        f"{COMMENT}\n"
        "# Camera list with one line of data per camera:\n"
        "#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n"
        "# Number of cameras: 1\n"
        f"{_id(contents)} {contents.lens.name} {width} {height} {parameters}\n"
    )


def _id(contents: Contents) -> str:
    return contents.name if _ID.fullmatch(contents.name) else _FIRST


def _remarks(contents: Contents) -> tuple[str, ...]:
    moved = "cx, cy moved by +0.5 px: the center of COLMAP's first pixel is (0.5, 0.5)"
    if contents.name and contents.name != _id(contents):
        return (moved, f"the camera {contents.name} is called {_FIRST}: COLMAP numbers its cameras")
    return (moved,)


WRITER = Writer(
    "colmap",
    "COLMAP cameras",
    (
        Lens("PINHOLE", "pinhole", 0),
        Lens("OPENCV", "pinhole", 4),
        Lens("FULL_OPENCV", "pinhole", 8),
        Lens("OPENCV_FISHEYE", "fisheye", 4),
    ),
    (".txt",),
    _text,
    frozenset({NAME}),
    remarks=_remarks,
)
