"""mrcal's `.cameramodel`: a Python dict with `lensmodel`, `intrinsics` and `imagersize`.

Its OpenCV models are OpenCV's, with OpenCV's pixel coordinates: mrcal reads and writes the files of ROS, Kalibr and
OpenCV without moving cx, cy.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

from circlepose._arguments import shown
from circlepose.errors import CalibrationError
from circlepose.io.calibration import numbers, terms
from circlepose.io.calibration.document import Document
from circlepose.io.calibration.form import Form, Reading, refuse_name
from circlepose.io.calibration.lens_models import lens_model
from circlepose.io.text.literal import python_literal

_COUNTS = {"PINHOLE": 0, "OPENCV4": 4, "OPENCV5": 5, "OPENCV8": 8, "OPENCV12": 12}
_MODEL_KEYS = ("lensmodel", "lens_model", "distortion_model")
_SIGNATURE = re.compile(r"['\"](?:lensmodel|lens_model|distortion_model)['\"]\s*:\s*['\"](?:LENSMODEL|DISTORTION)_")
# The packed inputs of the calibration, some MB; not needed here.
_BYTES = re.compile(r"\bb'[^'\n]*'|\bb\"[^\"\n]*\"")
_MOST_CHARACTERS = 100_000


def _recognizes(document: Document) -> bool:
    """Whether the text has mrcal's key of a lens model, with one of mrcal's names."""
    text = document.text
    return text is not None and _SIGNATURE.search(text) is not None and "intrinsics" in text


def _read(document: Document, camera_name: str | None) -> Reading:
    """Return the camera of a model file; it holds one camera, which has no name."""
    where = document.name
    refuse_name(camera_name, where)
    entries = _entries(document.text or "", where)
    key = next(key for key in _MODEL_KEYS if key in entries)
    count = _coefficient_count(entries[key], where, key)
    values = numbers.number_list(_plain_list(entries.get("intrinsics")), where, "intrinsics")
    if len(values) != 4 + count:
        raise CalibrationError(
            f"{where}: intrinsics: {entries[key]} has {4 + count} numbers (fx, fy, cx, cy, then OpenCV's "
            f"coefficients), got {len(values)}."
        )
    fx, fy, cx, cy, *dist = values
    width, height = numbers.number_list(_plain_list(entries.get("imagersize")), where, "imagersize", 2)
    size = numbers.image_size(width, height, where, "imagersize")
    matrix = terms.rows(fx, fy, cx, cy)
    return Reading(numbers.build_camera(where, ("intrinsics", matrix), ("intrinsics", dist), size, "pinhole"))


def _entries(text: str, where: str) -> Mapping[str, object]:
    """Return the dict of a model file; its literal is evaluated without running code."""
    rest = _BYTES.sub("None", text)
    if len(rest) > _MOST_CHARACTERS:
        raise CalibrationError(f"{where}: looks like mrcal's .cameramodel and is too long; expected a small dict.")
    try:
        entries = python_literal(rest)
    except ValueError as reason:
        raise CalibrationError(
            f"{where}: looks like mrcal's .cameramodel, and is no dict of plain values ({reason}); "
            "write it again with mrcal."
        ) from None
    if not isinstance(entries, dict) or not any(key in entries for key in _MODEL_KEYS):
        raise CalibrationError(f"{where}: lensmodel: is missing from this .cameramodel.")
    return {str(key): value for key, value in entries.items()}


def _plain_list(value: object) -> object:
    return list(value) if isinstance(value, tuple) else value


def _coefficient_count(model: object, where: str, key: str) -> int:
    name = re.sub(r"^(LENSMODEL|DISTORTION)_", "", model) if isinstance(model, str) else ""
    if name in ("NONE", "PINHOLE"):
        return 0
    if name in _COUNTS:
        return _COUNTS[name]
    lens_model(model, where, key)
    raise CalibrationError(
        f"{where}: {key}: expected one of {', '.join(f'LENSMODEL_{each}' for each in _COUNTS)}, got {shown(model)}."
    )


FORM = Form("mrcal cameramodel", _recognizes, _read)
