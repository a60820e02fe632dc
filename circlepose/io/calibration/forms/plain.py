"""Keys and values as `json.dump` and `yaml.dump` write them: flat or nested, whatever the keys' spelling."""

from __future__ import annotations

from circlepose.io.calibration.assembly import assemble
from circlepose.io.calibration.cameras import cameras_of, fields_of, pick
from circlepose.io.calibration.document import Document
from circlepose.io.calibration.form import Form, Reading, refuse_name
from circlepose.io.calibration.keys import near_name

_PARTS = ("matrix", "fx", "fy", "cx", "cy", "focal", "distortion", "coefficient")


def _recognizes(document: Document) -> bool:
    """Whether at least one key is a part of a camera, or nearly spelt like the camera matrix."""
    if document.is_file_storage:
        return False
    fields = fields_of(document.entries)
    return any(each.role in _PARTS for each in fields) or any(
        near_name(key) == "camera_matrix" for key in list(document.entries)[:100]
    )


def _read(document: Document, camera_name: str | None) -> Reading:
    """Return the camera and remarks; of several the one in the group `camera_name`."""
    where, cameras = document.name, cameras_of(document.entries, document.name)
    if not cameras:
        refuse_name(camera_name, where)
        return assemble(fields_of(document.entries), where)
    camera, notes = pick(cameras, camera_name, where)
    reading = assemble(camera.fields, where)
    return Reading(reading.camera, notes + reading.notes, reading.keys, reading.errors_px, camera.name)


FORM = Form("keys and values", _recognizes, _read, is_generic=True)
