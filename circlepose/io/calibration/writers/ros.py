"""ROS camera_info: the YAML that `camera_calibration_parsers` reads and `camera_info_manager` loads.

K and D are of the raw image, in OpenCV's conventions. R is the identity and P holds K, as of a monocular camera.
`plumb_bob` has 5 coefficients, `rational_polynomial` 8, `equidistant` 4; matrices are lists row by row.
Source: camera_calibration_parsers/src/parse_yml.cpp (keys), sensor_msgs/CameraInfo (meaning of K, D, R, P),
sensor_msgs/distortion_models (names).
"""

from __future__ import annotations

import re

import numpy as np

from circlepose._typing import FloatArray
from circlepose.io.calibration.number_text import number_list_text
from circlepose.io.calibration.writers.writer import NAME, Contents, Lens, Writer
from circlepose.io.marks import COMMENT

_UNNAMED = "camera"
_NAME = re.compile(r"[A-Za-z0-9_]+")
"""what camera_info_manager takes for a name"""


def _text(contents: Contents) -> str:
    camera = contents.camera
    width, height = contents.size
    lines = [COMMENT, f"image_width: {width}", f"image_height: {height}", f'camera_name: "{_name(contents)}"']
    lines += _matrix("camera_matrix", camera.camera_matrix)
    lines.append(f"distortion_model: {contents.lens.name}")
    lines += _matrix("distortion_coefficients", camera.dist_coeffs[None, :])
    lines += _matrix("rectification_matrix", np.eye(3))
    lines += _matrix("projection_matrix", np.column_stack([camera.camera_matrix, np.zeros(3)]))
    return "\n".join(lines) + "\n"


def _matrix(key: str, matrix: FloatArray) -> list[str]:
    rows, columns = matrix.shape
    return [f"{key}:", f"  rows: {rows}", f"  cols: {columns}", f"  data: [{number_list_text(matrix.ravel())}]"]


def _name(contents: Contents) -> str:
    return contents.name if _NAME.fullmatch(contents.name) else _UNNAMED


def _remarks(contents: Contents) -> tuple[str, ...]:
    said = "rectification_matrix is the identity and projection_matrix holds camera_matrix, as of a single camera"
    if contents.name and contents.name != _name(contents):
        return (said, f"camera_name is {_UNNAMED}: ROS takes letters, digits and _, not {contents.name}")
    return (said,)


WRITER = Writer(
    "ros",
    "ROS camera_info",
    (
        Lens("plumb_bob", "pinhole", 5),
        Lens("rational_polynomial", "pinhole", 8),
        Lens("equidistant", "fisheye", 4),
    ),
    (".yaml", ".yml"),
    _text,
    frozenset({NAME}),
    remarks=_remarks,
)
