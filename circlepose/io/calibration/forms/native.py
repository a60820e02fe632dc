"""Our own calibration YAML: short enough to be typed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Field

from circlepose.camera.camera import LENS_MODELS, Camera, LensModel
from circlepose.errors import CalibrationError
from circlepose.io.calibration import numbers, terms
from circlepose.io.calibration.assembly import FROM_ONE
from circlepose.io.calibration.document import Document
from circlepose.io.calibration.form import Form, Reading, refuse_name
from circlepose.io.text.validation import Strict, parse

_Row = Annotated[list[float], Field(min_length=3, max_length=3)]


class _CameraForm(Strict):
    model: LensModel = Field("pinhole", description=f"one of {', '.join(LENS_MODELS)}")
    camera_matrix: Annotated[list[_Row], Field(min_length=3, max_length=3)] | None = Field(
        None, description="3 rows of 3 finite numbers in px, such as [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]"
    )
    fx: float | None = Field(None, description="one finite number, the focal length along x in px")
    fy: float | None = Field(None, description="one finite number, the focal length along y in px")
    cx: float | None = Field(None, description="one finite number, the principal point's x in px")
    cy: float | None = Field(None, description="one finite number, the principal point's y in px")
    dist_coeffs: list[float] = Field([], description="a list of finite numbers in OpenCV's order, or []")
    image_size: Annotated[list[int], Field(min_length=2, max_length=2)] | None = Field(
        None, description="[width, height], two whole numbers of px"
    )
    focal_sigma_px: float = Field(0.0, description="one finite number, the standard deviation of fx and fy in px")
    center_sigma_px: float = Field(0.0, description="one finite number, the standard deviation of cx and cy in px")
    target: dict[str, Any] | None = Field(None, description="a mapping that describes the target")


KEYS = tuple(_CameraForm.model_fields)


def _recognizes(document: Document) -> bool:
    """Whether all keys are ours, and no value has a shape that only other tools give it.

    What has other keys, too, or is shaped otherwise, is read as keys and values.
    """
    entries = document.entries
    if not entries or document.is_file_storage or not set(entries) <= set(KEYS):
        return False
    matrix = entries.get("camera_matrix", [[]])
    shaped = [isinstance(matrix, list) and all(isinstance(row, list) for row in matrix)]
    for key in ("dist_coeffs", "image_size"):
        value = entries.get(key)
        shaped.append(not isinstance(value, Mapping | str) and not _is_nested(value))
    return all(shaped)


def _is_nested(value: object) -> bool:
    return isinstance(value, list) and any(isinstance(each, list) for each in value)


def _read(document: Document, camera_name: str | None) -> Reading:
    """Return the camera of our own form; it holds one camera, which has no name."""
    refuse_name(camera_name, document.name)
    entries = document.entries
    notes: tuple[str, ...] = ()
    matrix = entries.get("camera_matrix")
    if _is_column_by_column(matrix):
        turned, notes = numbers.turned_matrix(matrix, document.name, "camera_matrix")
        notes += (FROM_ONE,)
        entries = {**entries, "camera_matrix": turned.tolist()}
    return Reading(camera_of(entries, document.name), notes)


def _is_column_by_column(matrix: object) -> bool:
    if not isinstance(matrix, list) or [len(row) for row in matrix] != [3, 3, 3]:
        return False
    return [row[2] for row in matrix] == [0, 0, 1]


def camera_of(entries: Mapping[str, object], where: str) -> Camera:
    """Return the camera that our own keys describe; raises `CalibrationError` naming `where` and the key."""
    model = entries.get("model")
    if isinstance(model, str) and model.lower() in LENS_MODELS:
        entries = {**entries, "model": model.lower()}
    form = parse(_CameraForm, entries, where, CalibrationError)
    size = None
    if form.image_size is not None:
        size = numbers.image_size(form.image_size[0], form.image_size[1], where, "image_size")
    matrix_key, matrix = _matrix(form, where)
    camera = numbers.build_camera(where, (matrix_key, matrix), ("dist_coeffs", form.dist_coeffs), size, form.model)
    return numbers.with_sigma(camera, where, form.focal_sigma_px, form.center_sigma_px)


def _matrix(form: _CameraForm, where: str) -> tuple[str, list[list[float]]]:
    parts = {"fx": form.fx, "fy": form.fy, "cx": form.cx, "cy": form.cy}
    given = [key for key, value in parts.items() if value is not None]
    if form.camera_matrix is not None:
        if given:
            raise CalibrationError(f"{where}: {given[0]}: give either camera_matrix or fx, fy, cx, cy, not both.")
        return "camera_matrix", form.camera_matrix
    if form.fx is None or form.fy is None or form.cx is None or form.cy is None:
        missing = ", ".join(key for key in parts if key not in given)
        raise CalibrationError(f"{where}: {missing}: missing; give camera_matrix, or all of fx, fy, cx, cy in px.")
    return "fx, fy", terms.rows(form.fx, form.fy, form.cx, form.cy)


FORM = Form("circlepose", _recognizes, _read, is_generic=True)
