"""OpenCV's FileStorage: what `cv2.FileStorage` writes, under the names that its samples and users gave the keys."""

from __future__ import annotations

from circlepose.errors import CalibrationError
from circlepose.io.calibration.assembly import assemble
from circlepose.io.calibration.cameras import cameras_of, pick
from circlepose.io.calibration.document import Document
from circlepose.io.calibration.form import Form, Reading
from circlepose.io.text.validation import some_keys


def _recognizes(document: Document) -> bool:
    """Whether the syntax is OpenCV's own."""
    # An OpenCV file may lack its camera matrix, and says so best.
    return document.is_file_storage


def _read(document: Document, camera_name: str | None) -> Reading:
    """Return the camera of a FileStorage file and remarks; `camera_name` picks one of several, as `2` or `M2`."""
    where, cameras = document.name, cameras_of(document.entries, document.name)
    if not cameras:
        raise CalibrationError(f"{where}: camera_matrix: is missing; found the keys {some_keys(document.entries)}.")
    camera, notes = pick(cameras, camera_name, where)
    reading = assemble(camera.fields, where, is_storage=True)
    return Reading(reading.camera, notes + reading.notes, reading.keys, reading.errors_px, camera.name)


FORM = Form("OpenCV FileStorage", _recognizes, _read, is_generic=True)
