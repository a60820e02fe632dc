"""Files of other kinds, known by their first bytes or words: what each is, and what to give in its place."""

from __future__ import annotations

import re
from collections.abc import Mapping

_AS_TEXT = "write the camera matrix and the coefficients as JSON or YAML"
_BY_BYTES: tuple[tuple[bytes, str], ...] = (
    (
        rb"\x89PNG|\xff\xd8\xff|BM....\0\0|GIF8|II\*\0|MM\0\*|RIFF....WEBP",
        "is an image, no calibration; give the file with the camera matrix as --calib, and images as inputs",
    ),
    (rb"\x89HDF\r\n", f"is an HDF5 file; {_AS_TEXT} (h5py, then json.dump of matrix.tolist())"),
    (
        rb"\x80[\x02-\x05]",
        f"is a Python pickle, which is never loaded, since it may run any program; {_AS_TEXT} "
        "(json.dump of matrix.tolist()), or numpy.savez",
    ),
    (
        rb"#ROSBAG V",
        "is a ROS bag; record one message of its camera_info as text: rostopic echo -n1 /camera/camera_info "
        "> camera.yaml",
    ),
    (
        rb"SQLite format 3\0",
        "is an SQLite database; of a ROS 2 bag, record one message of its camera_info as text: ros2 "
        "topic echo --once /camera/camera_info > camera.yaml; of COLMAP, export the model as text",
    ),
    (
        rb"\x89MCAP0\r\n",
        "is a ROS 2 bag (MCAP); record one message of its camera_info as text: ros2 topic echo --once "
        "/camera/camera_info > camera.yaml",
    ),
    (
        rb"PK\x03\x04|7z\xbc\xaf|Rar!|\xfd7zXZ|BZh[1-9]|\x28\xb5\x2f\xfd",
        "is an archive; unpack it, and give the calibration in it",
    ),
    (rb"%PDF-", f"is a PDF; {_AS_TEXT}"),
    (rb"PAR1", "is a table (Parquet), no calibration; give the file with the camera matrix"),
    (rb"ARROW1|FEA1", "is a table (Arrow), no calibration; write the row of one camera as YAML"),
    (
        rb"BLENDER",
        "is a Blender scene, no calibration; write fx = fy = (focal length in mm) / (width of the sensor in mm) * "
        "(width of the image in px), cx = (width - 1) / 2, cy = (height - 1) / 2 as YAML",
    ),
    (rb"\xff\xfe\0\0|\0\0\xfe\xff", "is UTF-32 text; save it as UTF-8"),
    (rb"\x7fELF|MZ", "is a program, no calibration; give the file with the camera matrix"),
)
_BY_TEXT: tuple[tuple[str, str], ...] = (
    (
        r"\s*(?:<!doctype html|<html)",
        "is a web page (HTML), no calibration; download the file itself (on GitHub: Raw)",
    ),
    (
        r"[^\n]*!!python/(?:object|name|module)|(?s:.){0,100000}?\n[^\n]*!!python/(?:object|name|module)",
        "is YAML of Python objects, as yaml.dump writes NumPy arrays; write matrix.tolist() in place of the array",
    ),
    (
        r"\s*\{(?s:.){0,100000}?\"nbformat\"|\s*\{\s*\"cells\"\s*:",
        f"is a Jupyter notebook; {_AS_TEXT} in it (json.dump of matrix.tolist()), and give that file",
    ),
    (
        r"%time,",
        "is a table of recorded messages (rostopic echo -p); record one message as text: rostopic echo -n1 "
        "/camera/camera_info > camera.yaml",
    ),
    (
        r"(?=[^\n]*\bimage\b)[\w ]+,(?=[^\n]*(?:center_x_mm|normal_x|status))[^\n]*",
        "is a table of poses, no calibration; give the file with the camera matrix",
    ),
    (
        r"\((?:dp|lp)\d|c(?:numpy|builtins|copy_reg|__builtin__|_codecs)\b[\w.]*\n|c[\w.]+\n\w+\n(?:p\d+\n|[(q)])",
        f"is a Python pickle, which is never loaded, since it may run any program; {_AS_TEXT} "
        "(json.dump of matrix.tolist()), or numpy.savez",
    ),
    (r"version https://git-lfs", "is a pointer of Git LFS, not the file itself; fetch it with git lfs pull"),
    (
        r"\s*Calibration results\s*\n=+\s*\n\s*Camera-system parameters|\s*Camera-system parameters",
        "is Kalibr's report; give the camchain (-camchain.yaml) that Kalibr writes with it",
    ),
    (
        r"(?s:.){0,20000}?\b(?:np\.)?array\(\[",
        "is printed by Python; write matrix.tolist() with json.dump, and give that file",
    ),
    (
        r"\s*\[\[\s*-?[\d.]+(?:e[-+]\d+)?\s+-?[\d.]",
        "is a matrix as NumPy prints it; write matrix.tolist() with json.dump "
        "under the key camera_matrix, beside dist_coeffs",
    ),
    (r"\s*(?:import|from) \w+", "is a Python program, no calibration; give the file that it writes"),
)
_TARGET_KEYS = ("radius_mm", "radii_mm", "generatrix_mm", "diameter_mm")


def kind_of(content: bytes) -> str | None:
    """Return what a file is by its first bytes, and what to do, as the end of a sentence; None if not known."""
    for pattern, what in _BY_BYTES:
        if re.match(pattern, content, re.DOTALL):
            return what
    return None


def kind_of_text(text: str) -> str | None:
    """Return what a text is, and what to do, as the end of a sentence; None if not known."""
    for pattern, what in _BY_TEXT:
        if re.match(pattern, text, re.IGNORECASE):
            return what
    return None


def kind_of_keys(entries: Mapping[str, object]) -> str | None:
    """Return what keys and values are that hold no camera, and what to do; None if not known."""
    if any(key in entries for key in _TARGET_KEYS):
        return "describes a target; give it as --target, and the camera's calibration as --calib"
    if "scenes" in entries or "views" in entries or ("camera" in entries and "image_size" not in entries):
        return "describes a scene to render, or names its camera in another file; give the calibration itself"
    url = _first_of(entries, ("camera_info_url", "camera_info_file", "calibration_file", "calib_file"), 0)
    if url is not None:
        return (
            f"holds the parameters of a driver; the calibration is in the file that it names ({url[:100]}); give that"
        )
    return None


def _first_of(entries: Mapping[str, object], keys: tuple[str, ...], depth: int) -> str | None:
    for key, value in entries.items():
        if key in keys and isinstance(value, str):
            return value
        if isinstance(value, Mapping) and depth < 6:
            found = _first_of(value, keys, depth + 1)
            if found is not None:
                return found
    return None
