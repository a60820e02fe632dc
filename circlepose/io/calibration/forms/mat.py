"""MATLAB's .mat files with a camera matrix and coefficients in OpenCV's convention, as SciPy and MATLAB save them.

`[K, D] = cameraIntrinsicsToOpenCV(params)` and `savemat("cam.mat", {"mtx": mtx, "dist": dist})` give such files.
"""

from __future__ import annotations

import re

from circlepose.errors import CalibrationError
from circlepose.io.calibration import numbers
from circlepose.io.calibration.document import Document
from circlepose.io.calibration.form import Form, Reading, refuse_name
from circlepose.io.calibration.leftovers import refuse_leftovers
from circlepose.io.calibration.lens_models import pinhole_coefficients, plain
from circlepose.io.calibration.mat_file import MatObject, Value, is_mat_file, is_newer_mat_file
from circlepose.io.calibration.matlab_text import Rows
from circlepose.io.calibration.matlab_values import Fields, values_of
from circlepose.io.text.validation import some_keys

_MATRIX = re.compile(r"k|mtx|(?:camera|intrinsic)s?matrix|intrinsics?")
_DIST = re.compile(r"d|dist|dist(?:ortion)?coeff?(?:icient)?s?")
_SIZES = (("imagewidth", "imageheight"), ("width", "height"))
_OCTAVE = "# Created by Octave"


def _recognizes(document: Document) -> bool:
    """Whether the file is one of MATLAB's, or of Octave's, whatever is in it."""
    if is_mat_file(document.content) or is_newer_mat_file(document.content):
        return True
    return document.text is not None and document.text.startswith(_OCTAVE)


def _read(document: Document, camera_name: str | None) -> Reading:
    """Return the camera of a file whose variables are a camera matrix and its coefficients."""
    where = document.name
    if not is_mat_file(document.content):
        kind = "a .mat file of version 7.3 (HDF5)" if is_newer_mat_file(document.content) else "a text file of Octave"
        raise CalibrationError(f"{where}: is {kind}; save it with save('camera.mat', '-v7').")
    refuse_name(camera_name, where)
    values = values_of(document)
    if values.problem:
        raise CalibrationError(f"{where}: is a .mat file that cannot be read, {values.problem}; save it again.")
    key, matrix_rows = _one(values.fields, _MATRIX, where)
    dist_key, dist_rows = _one(values.fields, _DIST, where)
    matrix = numbers.camera_matrix(matrix_rows, where, key)
    if matrix[2, :2].any() and not matrix[:2, 2].any():
        raise CalibrationError(
            f"{where}: {key}: stands transposed, as MATLAB's IntrinsicMatrix, whose pixels count from 1; call it "
            "IntrinsicMatrix beside RadialDistortion, or save what cameraIntrinsicsToOpenCV returns."
        )
    dist = pinhole_coefficients(numbers.coefficients(dist_rows, where, dist_key), where, dist_key)
    camera = numbers.build_camera(where, (key, matrix), (dist_key, dist), _size(values.fields, where), "pinhole")
    rest = {name: _plain(value) for name, value in values.fields.items() if not isinstance(value, MatObject)}
    refuse_leftovers(rest, {key, dist_key}, where, camera)
    notes: tuple[str, ...] = (f"{key} and {dist_key} are taken in OpenCV's convention, whose pixels count from 0",)
    if len(dist) == 4 and any(dist):
        notes += ("the 4 coefficients are taken for a pinhole lens (k1 k2 p1 p2), not for a fisheye lens",)
    return Reading(camera, notes)


def _one(fields: Fields, pattern: re.Pattern[str], where: str) -> tuple[str, Rows]:
    keys = [key for key, value in fields.items() if pattern.fullmatch(plain(key)) and isinstance(value, list)]
    if len(keys) == 1:
        return keys[0], _rows(fields[keys[0]])
    if keys:
        raise CalibrationError(f"{where}: {some_keys(keys)}: mean the same; save one of them.")
    objects = [value.class_name for value in fields.values() if isinstance(value, MatObject)]
    held = f"an object of the class {objects[0][:40]}" if objects else some_keys(fields) or "no numbers"
    raise CalibrationError(
        f"{where}: is a .mat file without a known calibration; expected fc, cc, kc (Bouguet), the structure of "
        f"toStruct(cameraParams), or K and D of cameraIntrinsicsToOpenCV; found {held}."
    )


def _rows(value: Value) -> Rows:
    return value if isinstance(value, list) else []


def _size(fields: Fields, where: str) -> tuple[int, int] | None:
    scalars = {
        plain(key): value[0][0] for key, value in fields.items() if isinstance(value, list) and _is_scalar(value)
    }
    for width, height in _SIZES:
        if width in scalars and height in scalars:
            return numbers.image_size(scalars[width], scalars[height], where, f"{width}, {height}")
    return None


def _plain(value: Value) -> object:
    """Return a matrix of one number as the number."""
    return value[0][0] if isinstance(value, list) and _is_scalar(value) else value


def _is_scalar(value: Rows) -> bool:
    return len(value) == 1 and len(value[0]) == 1


FORM = Form("MAT-file", _recognizes, _read, is_generic=True)
