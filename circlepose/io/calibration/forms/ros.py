"""ROS camera_info: the YAML of camera_calibration, and the message as `topic echo` prints it (K, D or k, d).

The raw image's K and D are used; R and P belong to the rectified image.
"""

from __future__ import annotations

from collections.abc import Mapping

from circlepose._arguments import shown
from circlepose.camera.camera import LensModel
from circlepose.errors import CalibrationError
from circlepose.io.calibration import numbers
from circlepose.io.calibration.document import Document
from circlepose.io.calibration.form import Form, Reading
from circlepose.io.text.validation import some_keys
from circlepose.io.text.yaml import MatrixNode

_MODELS: Mapping[str, tuple[LensModel, tuple[int, ...]]] = {
    "plumb_bob": ("pinhole", (0, 4, 5)),
    "rational_polynomial": ("pinhole", (8, 12, 14)),
    "equidistant": ("fisheye", (4,)),
}


def _recognizes(document: Document) -> bool:
    """Whether the entries are a camera_info: untagged matrices or the message's K, and a named lens model."""
    entries = document.entries
    matrix = entries.get("camera_matrix")
    if isinstance(matrix, Mapping) and not isinstance(matrix, MatrixNode):
        return True
    return any(isinstance(entries.get(key), list) for key in ("K", "k")) and "distortion_model" in entries


def _read(document: Document, camera_name: str | None) -> Reading:
    """Return the camera of a camera_info; `camera_name`, if given, must be the file's own."""
    where, entries = document.name, document.entries
    own_name = entries.get("camera_name")
    if camera_name is not None and camera_name != own_name:
        only = some_keys([own_name]) if isinstance(own_name, str) and own_name else "one without a name"
        raise CalibrationError(f"{where}: holds no camera {camera_name!r}, only {only}.")
    _check_window(entries, where)
    matrix_key = _first(entries, ("camera_matrix", "K", "k"), where)
    dist_key = _first(entries, ("distortion_coefficients", "D", "d"), where)
    dist = numbers.coefficients(entries[dist_key], where, dist_key)
    model = _model(entries, dist, dist_key, where)
    matrix = numbers.camera_matrix(entries[matrix_key], where, matrix_key)
    return Reading(numbers.build_camera(where, (matrix_key, matrix), (dist_key, dist), _size(entries, where), model))


def _first(entries: Mapping[str, object], keys: tuple[str, ...], where: str) -> str:
    for key in keys:
        if key in entries:
            return key
    raise CalibrationError(f"{where}: {keys[0]}: is missing from this camera_info.")


def _model(entries: Mapping[str, object], dist: list[float], dist_key: str, where: str) -> LensModel:
    name = entries.get("distortion_model")
    if name == "" and not any(dist):
        return "pinhole"
    if not isinstance(name, str) or name not in _MODELS:
        problem = "is missing; " if name is None else ""
        got = "" if name is None else f", got {shown(name)}"
        raise CalibrationError(f"{where}: distortion_model: {problem}expected one of {', '.join(_MODELS)}{got}.")
    model, counts = _MODELS[name]
    if len(dist) not in counts:
        expected = ", ".join(str(count) for count in counts)
        raise CalibrationError(f"{where}: {dist_key}: the model {name} has {expected} coefficients, got {len(dist)}.")
    return model


def _size(entries: Mapping[str, object], where: str) -> tuple[int, int] | None:
    for width, height in (("image_width", "image_height"), ("width", "height")):
        if width in entries and height in entries:
            if entries[width] == 0 and entries[height] == 0:
                return None
            return numbers.image_size(entries[width], entries[height], where, f"{width}, {height}")
    return None


def _check_window(entries: Mapping[str, object], where: str) -> None:
    """Refuse binning and a region of interest: K then belongs to another image than the one that is seen."""
    roi = entries.get("roi")
    window = {key: entries.get(key, 0) for key in ("binning_x", "binning_y")}
    if isinstance(roi, Mapping):
        window |= {f"roi.{key}": roi.get(key, 0) for key in ("x_offset", "y_offset")}
    for key, value in window.items():
        if value not in (0, 1) if key.startswith("binning") else value != 0:
            raise CalibrationError(
                f"{where}: {key}: is {shown(value)}; images that are binned or cut out are not supported, "
                "calibrate them as they are and leave this key at 0."
            )


FORM = Form("ROS camera_info", _recognizes, _read)
