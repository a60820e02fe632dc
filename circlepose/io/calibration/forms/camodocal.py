"""Cameras of camodocal, as VINS-Mono and VINS-Fusion read them: `model_type` with groups of parameters."""

from __future__ import annotations

from collections.abc import Mapping

from circlepose.camera.camera import Camera
from circlepose.errors import CalibrationError
from circlepose.io.calibration import numbers, terms
from circlepose.io.calibration.document import Document
from circlepose.io.calibration.form import Form, Reading
from circlepose.io.calibration.lens_models import lens_model
from circlepose.io.text.validation import some_keys

_PINHOLE = ("k1", "k2", "p1", "p2")
_PINHOLE_FULL = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
# Of angle + k2 angle^3 + k3 angle^5 ...: OpenCV's k1 k2 k3 k4. mu, mv are the focal lengths, u0, v0 the center.
_KANNALA_BRANDT = ("k2", "k3", "k4", "k5")
_PROJECTION = ("mu", "mv", "u0", "v0")
_PREFIXES = ("projection_parameters.", "distortion_parameters.")
_FILES = ("cam0_calib", "cam1_calib")


def _recognizes(document: Document) -> bool:
    """Whether the entries have camodocal's `model_type`, or VINS-Fusion's names of camera files."""
    entries = document.entries
    groups = ("projection_parameters", "distortion_parameters", "mirror_parameters", "image_width")
    return ("model_type" in entries and any(key in entries for key in groups)) or isinstance(
        entries.get(_FILES[0]), str
    )


def _read(document: Document, camera_name: str | None) -> Reading:
    """Return the camera; `camera_name`, if given, must be its own."""
    where, entries = document.name, document.entries
    if "model_type" not in entries:
        files = some_keys(str(entries[key]) for key in _FILES if key in entries)
        raise CalibrationError(
            f"{where}: is the configuration of VINS-Fusion, whose cameras are in {files}; give one of these."
        )
    own_name = entries.get("camera_name")
    if camera_name is not None and camera_name != own_name:
        only = some_keys([own_name]) if isinstance(own_name, str) else "one without a name"
        raise CalibrationError(f"{where}: holds no camera {camera_name!r}, only {only}.")
    model = entries["model_type"]
    if model == "PINHOLE":
        return Reading(_pinhole(entries, where, _PINHOLE))
    if model == "PINHOLE_FULL":
        return Reading(_pinhole(entries, where, _PINHOLE_FULL))
    if model == "KANNALA_BRANDT":
        return Reading(_fisheye(entries, where))
    lens_model(model, where, "model_type")
    raise CalibrationError(f"{where}: model_type: expected PINHOLE, PINHOLE_FULL or KANNALA_BRANDT, got {model!r}.")


def _pinhole(entries: Mapping[str, object], where: str, names: tuple[str, ...]) -> Camera:
    projection = terms.mapping(entries.get("projection_parameters"), where, "projection_parameters")
    distortion = terms.mapping(entries.get("distortion_parameters"), where, "distortion_parameters")
    terms.refuse_rest(distortion, names, where, str(entries["model_type"]), _PREFIXES[1])
    dist = terms.lens(distortion, where, names, _PREFIXES[1])
    matrix = terms.matrix(projection, where, prefix=_PREFIXES[0])
    keys = f"{_PREFIXES[0]}fx", f"{_PREFIXES[1]}k1"
    return numbers.build_camera(where, (keys[0], matrix), (keys[1], dist), _size(entries, where), "pinhole")


def _fisheye(entries: Mapping[str, object], where: str) -> Camera:
    projection = terms.mapping(entries.get("projection_parameters"), where, "projection_parameters")
    terms.refuse_rest(projection, (*_KANNALA_BRANDT, *_PROJECTION), where, "KANNALA_BRANDT", _PREFIXES[0])
    dist = terms.lens(projection, where, _KANNALA_BRANDT, _PREFIXES[0])
    matrix = terms.matrix(projection, where, _PROJECTION, _PREFIXES[0])
    keys = f"{_PREFIXES[0]}mu", f"{_PREFIXES[0]}k2"
    return numbers.build_camera(where, (keys[0], matrix), (keys[1], dist), _size(entries, where), "fisheye")


def _size(entries: Mapping[str, object], where: str) -> tuple[int, int] | None:
    if "image_width" not in entries or "image_height" not in entries:
        return None
    return numbers.image_size(entries["image_width"], entries["image_height"], where, "image_width, image_height")


FORM = Form("camodocal (VINS)", _recognizes, _read)
