"""What `circlepose camera --format json` prints: a calibration itself, equal to the one that it describes.

Lost is the `target:` of the original file, which the report has in words alone.
"""

from __future__ import annotations

from circlepose._arguments import shown
from circlepose.camera.camera import LENS_MODELS, LensModel
from circlepose.errors import CalibrationError
from circlepose.io.calibration import numbers
from circlepose.io.calibration.document import Document
from circlepose.io.calibration.form import Form, Reading, refuse_name

CAMERA_SCHEMA = "circlepose.camera/1"
_SCHEMA_START = "circlepose.camera"


def _recognizes(document: Document) -> bool:
    """Whether the entries bear the schema of the report, of this version or another."""
    schema = document.entries.get("schema")
    return isinstance(schema, str) and schema.startswith(_SCHEMA_START)


def _read(document: Document, camera_name: str | None) -> Reading:
    """Return the camera that was reported."""
    where, entries = document.name, document.entries
    refuse_name(camera_name, where)
    if entries["schema"] != CAMERA_SCHEMA:
        raise CalibrationError(f"{where}: schema: expected {CAMERA_SCHEMA}, got {shown(entries['schema'])}.")
    for key in ("camera_matrix", "dist_coeffs"):
        if key not in entries:
            raise CalibrationError(f"{where}: {key}: is missing; write the report again with circlepose camera.")
    matrix = numbers.camera_matrix(entries["camera_matrix"], where, "camera_matrix")
    dist = numbers.number_list(entries["dist_coeffs"], where, "dist_coeffs")
    size = None
    if entries.get("image_size_px") is not None:
        width, height = numbers.number_list(entries["image_size_px"], where, "image_size_px", 2)
        size = numbers.image_size(width, height, where, "image_size_px")
    model = _model(entries.get("model"), where)
    camera = numbers.build_camera(where, ("camera_matrix", matrix), ("dist_coeffs", dist), size, model)
    focal, center = (
        numbers.number(entries.get(key, 0.0), where, key) for key in ("focal_sigma_px", "center_sigma_px")
    )
    notes = ("the target of the reported calibration is not part of its report",) if entries.get("target") else ()
    return Reading(numbers.with_sigma(camera, where, focal, center), notes)


def _model(value: object, where: str) -> LensModel:
    for model in LENS_MODELS:
        if value == model:
            return model
    raise CalibrationError(f"{where}: model: expected one of {', '.join(LENS_MODELS)}, got {shown(value)}.")


FORM = Form("circlepose camera report", _recognizes, _read, has_target=False)
