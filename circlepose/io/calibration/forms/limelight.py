"""Limelight's calibration JSON: INTRINSICS_MATRIX, DISTORTION_COEFFICIENTS, RES_X, RES_Y; conventions of OpenCV."""

from __future__ import annotations

from circlepose.errors import CalibrationError
from circlepose.io.calibration import numbers
from circlepose.io.calibration.document import Document
from circlepose.io.calibration.form import Form, Reading, refuse_name
from circlepose.io.calibration.leftovers import refuse_leftovers
from circlepose.io.calibration.lens_models import pinhole_coefficients

_MATRIX, _DIST = "INTRINSICS_MATRIX", "DISTORTION_COEFFICIENTS"


def _recognizes(document: Document) -> bool:
    """Whether the entries have Limelight's keys in capitals."""
    return _MATRIX in document.entries and any(key in document.entries for key in (_DIST, "RES_X"))


def _read(document: Document, camera_name: str | None) -> Reading:
    """Return the camera; a file holds one, of one resolution."""
    where, entries = document.name, document.entries
    refuse_name(camera_name, where)
    if _DIST not in entries:
        raise CalibrationError(f"{where}: {_DIST}: is missing beside {_MATRIX}.")
    matrix, notes = numbers.turned_matrix(entries[_MATRIX], where, _MATRIX)
    dist = pinhole_coefficients(numbers.coefficients(entries[_DIST], where, _DIST), where, _DIST)
    size = None
    if "RES_X" in entries or "RES_Y" in entries:
        size = numbers.image_size(entries.get("RES_X"), entries.get("RES_Y"), where, "RES_X, RES_Y")
    camera = numbers.build_camera(where, (_MATRIX, matrix), (_DIST, dist), size, "pinhole")
    refuse_leftovers(entries, {_MATRIX, _DIST, "RES_X", "RES_Y"}, where, camera)
    return Reading(camera, notes)


FORM = Form("Limelight", _recognizes, _read)
