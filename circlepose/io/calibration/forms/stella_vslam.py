"""Configuration of stella_vslam and OpenVSLAM: a group `Camera`, or flat keys `Camera.model`, `Camera.fx`."""

from __future__ import annotations

import re
from collections.abc import Mapping

from circlepose.errors import CalibrationError
from circlepose.io.calibration import numbers, terms
from circlepose.io.calibration.document import Document
from circlepose.io.calibration.form import Form, Reading
from circlepose.io.calibration.lens_models import lens_model
from circlepose.io.text.validation import some_keys

_COEFFICIENT = re.compile(r"[kps][0-9]|distortion")
_PREFIX = "Camera."


def _recognizes(document: Document) -> bool:
    """Whether the entries have a `Camera` with a model and the parameters of a configuration."""
    camera = _camera(document.entries)
    return "model" in camera and ("setup" in camera or "cols" in camera or "fx" in camera)


def _camera(entries: Mapping[str, object]) -> Mapping[str, object]:
    group = entries.get("Camera")
    if isinstance(group, Mapping):
        return {str(key): value for key, value in group.items()}
    return {key.removeprefix(_PREFIX): value for key, value in entries.items() if key.startswith(_PREFIX)}


def _read(document: Document, camera_name: str | None) -> Reading:
    """Return the camera; `camera_name`, if given, must be its own."""
    where, entries = document.name, _camera(document.entries)
    own_name = entries.get("name")
    if camera_name is not None and camera_name != own_name:
        only = some_keys([own_name]) if isinstance(own_name, str) else "one without a name"
        raise CalibrationError(f"{where}: holds no camera {camera_name!r}, only {only}.")
    model = lens_model(entries["model"], where, "Camera.model")
    known = ("k1", "k2", "k3", "k4") if model == "fisheye" else ("k1", "k2", "p1", "p2", "k3")
    given = {key: value for key, value in entries.items() if _COEFFICIENT.fullmatch(key)}
    terms.refuse_rest(given, known, where, str(entries["model"]), _PREFIX)
    dist = terms.lens(entries, where, known, _PREFIX)
    size = None
    if "cols" in entries and "rows" in entries:
        size = numbers.image_size(entries["cols"], entries["rows"], where, "Camera.cols, Camera.rows")
    matrix = terms.matrix(entries, where, prefix=_PREFIX)
    return Reading(numbers.build_camera(where, ("Camera.fx", matrix), ("Camera.k1", dist), size, model))


FORM = Form("stella_vslam configuration", _recognizes, _read)
