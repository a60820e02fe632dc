"""MATLAB's cameraParameters and cameraIntrinsics: as they print, as a structure in a .mat file, or as its JSON.

MATLAB counts pixels from 1, states sizes as rows and columns, and IntrinsicMatrix stands transposed (K does not).
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

import numpy as np

from circlepose._typing import FloatArray
from circlepose.errors import CalibrationError
from circlepose.io.calibration import numbers, terms
from circlepose.io.calibration.document import Document
from circlepose.io.calibration.form import Form, Reading, choose, refuse_name
from circlepose.io.calibration.mat_file import MatObject, is_mat_file
from circlepose.io.calibration.matlab_values import Fields, assigns, values_of, vector

_MATRIX_KEYS = ("IntrinsicMatrix", "K")
_FISHEYE_KEY = "MappingCoefficients"
_WORDS = (
    "FocalLength",
    "PrincipalPoint",
    "IntrinsicMatrix",
    "RadialDistortion",
    "TangentialDistortion",
    _FISHEYE_KEY,
)
_CLASSES = re.compile(r"(?:camera|stereo|fisheye)\w*")
_PRINTED = re.compile(r"(?:cameraParameters|cameraIntrinsics|fisheyeIntrinsics|fisheyeParameters) with properties")
_PRINTED_BY = 10_000
"""Characters within which a print says what it is of."""
_SAVE = "[K, D] = cameraIntrinsicsToOpenCV(params); save('camera.mat', 'K', 'D', '-v7')"
_MAX_DEPTH = 3


def _recognizes(document: Document) -> bool:
    """Whether the file holds the properties of MATLAB's cameras, or an object of one."""
    if is_mat_file(document.content):
        fields = values_of(document).fields
        return _object_of(fields) is not None or bool(_cameras(fields))
    text = document.text
    if text is None:
        return False
    if text.lstrip().startswith("{"):
        # A word in quotes is quickly found, before anything is parsed.
        if not any(f'"{word}"' in text for word in _WORDS):
            return False
        fields = values_of(document).fields
        # MATLAB's names without RadialDistortion: their pixels count from 1 all the same.
        return bool(_cameras(fields)) or ("FocalLength" in fields and "PrincipalPoint" in fields)
    if document.is_file_storage:
        return False
    return _PRINTED.search(text, 0, _PRINTED_BY) is not None or sum(assigns(text, word) for word in _WORDS) > 1


def _read(document: Document, camera_name: str | None) -> Reading:
    """Return the camera; of a structure of several the first, or that of `camera_name`."""
    where, values = document.name, values_of(document)
    twice = sorted(name for name in values.ambiguous if name in {*_WORDS, "K", "ImageSize", "Skew"})
    if twice:
        raise CalibrationError(f"{where}: {twice[0]}: has several values; keep those of one camera.")
    cameras = _cameras(values.fields)
    if not cameras:
        raise _no_camera(values.fields, where)
    if list(cameras) == [""]:
        refuse_name(camera_name, where)
        return _reading(cameras[""], where, ())
    name, notes = choose(list(cameras), camera_name, where)
    return _reading(cameras[name], f"{where}: {name}", notes)


def _cameras(fields: Fields, depth: int = 0) -> dict[str, Fields]:
    """Return the structures that hold a camera, by name; "" for the variables themselves."""
    has_focal = any(key in fields for key in ("FocalLength", *_MATRIX_KEYS))
    if _FISHEYE_KEY in fields or (has_focal and "RadialDistortion" in fields):
        return {"": fields}
    found: dict[str, Fields] = {}
    for key, value in fields.items():
        if isinstance(value, Mapping) and depth < _MAX_DEPTH:
            found |= {name or key: inner for name, inner in _cameras(value, depth + 1).items()}
    return found


def _no_camera(fields: Fields, where: str) -> CalibrationError:
    class_name = _object_of(fields)
    if class_name is not None:
        return CalibrationError(
            f"{where}: holds an object of MATLAB's class {class_name[:40]}, which only MATLAB can read; save it with "
            f"{_SAVE}."
        )
    missing = "RadialDistortion" if "RadialDistortion" not in fields else "FocalLength, PrincipalPoint"
    return CalibrationError(
        f"{where}: {missing}: is missing, or shown without its numbers; print FocalLength, PrincipalPoint, "
        f"RadialDistortion, TangentialDistortion, or save the camera with {_SAVE}."
    )


def _object_of(fields: Fields) -> str | None:
    return next(_class_names(fields), None)


def _class_names(fields: Fields) -> Iterator[str]:
    for value in fields.values():
        if isinstance(value, MatObject) and _CLASSES.fullmatch(value.class_name):
            yield value.class_name


def _reading(fields: Fields, where: str, notes: tuple[str, ...]) -> Reading:
    if _FISHEYE_KEY in fields:
        raise CalibrationError(
            f"{where}: {_FISHEYE_KEY}: is of Scaramuzza's omnidirectional model, which circlepose does not have; "
            "undistort the images with undistortFisheyeImage and save the camera that it returns, or calibrate with "
            "OpenCV's fisheye model."
        )
    key, matrix, remarks = _matrix(fields, where)
    radial = vector(fields, "RadialDistortion", where, (2, 3))
    tangential = (
        vector(fields, "TangentialDistortion", where, (2,)) if "TangentialDistortion" in fields else [0.0, 0.0]
    )
    k3 = radial[2] if len(radial) == 3 else 0.0
    dist = [radial[0], radial[1], tangential[0], tangential[1], k3]
    size = None
    if "ImageSize" in fields and fields["ImageSize"] != []:
        height, width = vector(fields, "ImageSize", where, (2,))
        size = numbers.image_size(width, height, where, "ImageSize")
    matrix[:2, 2] -= 1.0
    moved = "principal point moved by -1 px: the center of MATLAB's top left pixel is (1, 1)"
    keys = "RadialDistortion, TangentialDistortion"
    camera = numbers.build_camera(where, (key, matrix), (keys, dist), size, "pinhole")
    return Reading(camera, (*notes, *remarks, moved))


def _matrix(fields: Fields, where: str) -> tuple[str, FloatArray, tuple[str, ...]]:
    """Return (key, camera matrix with MATLAB's principal point, remarks), from a matrix or else from its parts."""
    for key in _MATRIX_KEYS:
        if key in fields:
            matrix = numbers.camera_matrix(fields[key], where, key)
            if key == "K":
                return key, matrix, ()
            if matrix[2, :2].any() or not matrix[:2, 2].any():
                return key, matrix.T.copy(), (f"{key} stands transposed, as MATLAB has it",)
            raise CalibrationError(
                f"{where}: {key}: expected MATLAB's [fx 0 0; s fy 0; cx cy 1]; if the matrix is not transposed, call "
                "it K."
            )
    fx, fy = vector(fields, "FocalLength", where, (2,))
    cx, cy = vector(fields, "PrincipalPoint", where, (2,))
    skew = vector(fields, "Skew", where, (1,))[0] if "Skew" in fields else 0.0
    return "FocalLength, PrincipalPoint", np.array(terms.rows(fx, fy, cx, cy, skew)), ()


FORM = Form("MATLAB", _recognizes, _read)
