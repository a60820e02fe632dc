"""OpenCV's calibration files: what the keys mean, under the names that its samples and users gave them."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

from circlepose._arguments import shown
from circlepose._typing import FloatArray
from circlepose.camera.camera import Camera, LensModel
from circlepose.errors import CalibrationError
from circlepose.io.calibration import numbers
from circlepose.io.calibration.document import Document
from circlepose.io.calibration.form import Form, Reading
from circlepose.io.text.validation import some_keys
from circlepose.io.text.yaml import MatrixNode

# Keys are compared in lower case without separators. The digit at the end is the camera of a stereo file: M1 D1.
_END = r"(?P<end>[0-9]|left|right)?"
_MATRIX_KEY = re.compile(rf"(?:cameramatrix|intrinsicmatrix|intrinsics?|mtx|k|m){_END}")
_DIST_KEY = re.compile(rf"(?:dist(?:ortion)?(?:coeff?(?:icient)?s?)?|d){_END}")
# Of fx, fy, cx, cy, as OpenCV's interactive calibration writes them; one that was kept fixed is 0 there.
_SIGMA_KEY = re.compile(rf"cameramatrixstddev{_END}")
_MODEL_KEYS = ("fisheyemodel", "fisheye", "distortionmodel", "cameramodel", "lensmodel", "model")
_FISHEYE_WORDS = ("fisheye", "equidistant", "kannalabrandt", "kb4")
_PINHOLE_WORDS = ("pinhole", "opencv", "plumbbob", "radtan", "radialtangential", "rational", "brown", "standard")


def _recognizes(document: Document) -> bool:
    """Whether the syntax is OpenCV's, or a matrix stands under one of the names of a camera matrix."""
    # An OpenCV file may lack its camera matrix, and says so best.
    entries = document.entries
    return document.is_file_storage or any(
        _MATRIX_KEY.fullmatch(_plain(key)) and _is_matrix(value) for key, value in entries.items()
    )


def _read(document: Document, camera_name: str | None) -> Reading:
    """Return the camera of a FileStorage file and remarks; `camera_name` picks one of several, as `2` or `M2`."""
    where, entries = document.name, document.entries
    matrices = _keys(entries, _MATRIX_KEY, where)
    if not matrices:
        raise CalibrationError(f"{where}: camera_matrix: is missing; found the keys {some_keys(entries)}.")
    end, notes = _choose(matrices, where, camera_name)
    matrix_key = matrices[end]
    dist_key = _keys(entries, _DIST_KEY, where).get(end)
    if dist_key is None:
        raise CalibrationError(
            f"{where}: distortion_coefficients: is missing (found {some_keys(entries)}); "
            "if the lens has no distortion, give 5 zeros."
        )
    dist = numbers.coefficients(entries[dist_key], where, dist_key)
    model, said = _model(entries, where)
    if not said and len(dist) == 4 and any(dist):
        notes += (
            f"the 4 coefficients are taken for a pinhole lens (k1 k2 p1 p2); "
            f"for a fisheye lens add fisheye_model: 1 to {where}",
        )
    matrix: FloatArray = numbers.camera_matrix(entries[matrix_key], where, matrix_key)
    camera = numbers.build_camera(where, (matrix_key, matrix), (dist_key, dist), _image_size(entries, where), model)
    return Reading(_with_sigma(camera, entries, where, end), notes)


def _plain(key: str) -> str:
    return re.sub(r"[\s_-]", "", key).lower()


def _is_matrix(value: object) -> bool:
    # A K1 or M that is one number or a group of keys is something else.
    return isinstance(value, MatrixNode | list) or (isinstance(value, Mapping) and "data" in value)


def _keys(entries: Mapping[str, object], pattern: re.Pattern[str], where: str) -> dict[str, str]:
    """Return the keys of matrices whose names match, by the end of the name that numbers the camera."""
    found: dict[str, str] = {}
    for key, value in entries.items():
        match = pattern.fullmatch(_plain(key))
        if match and _is_matrix(value):
            end = match["end"] or ""
            if end in found:
                raise CalibrationError(f"{where}: {found[end]}, {key}: mean the same; remove one of them.")
            found[end] = key
    return found


def _choose(matrices: dict[str, str], where: str, camera_name: str | None) -> tuple[str, tuple[str, ...]]:
    if camera_name is not None:
        for end, key in matrices.items():
            if camera_name.lower() in {key.lower(), end}:
                return end, ()
        raise CalibrationError(
            f"{where}: holds no camera {camera_name!r}; its camera matrices are {some_keys(matrices.values())}."
        )
    end = min(matrices)
    if len(matrices) == 1:
        return end, ()
    return end, (f"{matrices[end]} taken, of the {len(matrices)} cameras {some_keys(matrices.values())}",)


def _model(entries: Mapping[str, object], where: str) -> tuple[LensModel, bool]:
    """Return the lens model and whether the file states it."""
    for key, value in entries.items():
        if _plain(key) not in _MODEL_KEYS:
            continue
        if isinstance(value, int | float) and value in (0, 1):
            return ("fisheye" if value else "pinhole"), True
        word = _plain(str(value))
        if any(known in word for known in _FISHEYE_WORDS):
            return "fisheye", True
        if any(known in word for known in _PINHOLE_WORDS):
            return "pinhole", True
        raise CalibrationError(
            f"{where}: {key}: expected pinhole or fisheye, got {shown(value)}; correct or remove it."
        )
    return "pinhole", False


def _with_sigma(camera: Camera, entries: Mapping[str, object], where: str, end: str) -> Camera:
    """Add how well the camera is known, where the file says it: the larger of both axes."""
    key = _keys(entries, _SIGMA_KEY, where).get(end)
    if key is None:
        return camera
    values = numbers.coefficients(entries[key], where, key)
    if len(values) != 4 or not all(0.0 <= value < math.inf for value in values):
        raise CalibrationError(
            f"{where}: {key}: expected the standard deviations of fx, fy, cx, cy, 4 numbers of 0 or more."
        )
    return numbers.with_sigma(camera, where, max(values[:2]), max(values[2:]))


def _image_size(entries: Mapping[str, object], where: str) -> tuple[int, int] | None:
    plain = {_plain(key): (key, value) for key, value in entries.items()}
    for prefix in ("image", ""):
        names = (f"{prefix}width", f"{prefix}height")
        if all(name in plain for name in names):
            (width_key, width), (height_key, height) = (plain[name] for name in names)
            return numbers.image_size(width, height, where, f"{width_key}, {height_key}")
    for name in ("imagesize", "imgsize", "size", "resolution", "cameraresolution"):
        if name in plain:
            key, value = plain[name]
            width, height = numbers.number_list(value, where, key, 2)
            return numbers.image_size(width, height, where, key)
    return None


FORM = Form("OpenCV FileStorage", _recognizes, _read, is_generic=True)
