"""PhotonVision's calibration JSON: `cameraIntrinsics` and `distCoeffs` as matrices, one file a resolution.

Older versions name the coefficients `cameraExtrinsics`. The settings of a camera hold a list `calibrations`.
"""

from __future__ import annotations

from collections.abc import Mapping

from circlepose.errors import CalibrationError
from circlepose.io.calibration import numbers, terms
from circlepose.io.calibration.document import Document
from circlepose.io.calibration.form import Form, Reading, choose
from circlepose.io.calibration.lens_models import lens_model, pinhole_coefficients

_DIST_KEYS = ("distCoeffs", "cameraExtrinsics")
_MODEL_KEYS = ("lensmodel", "lensModel")


def _recognizes(document: Document) -> bool:
    """Whether the entries have PhotonVision's `cameraIntrinsics`, once or in a list of calibrations."""
    return bool(_calibrations(document.entries))


def _calibrations(entries: Mapping[str, object]) -> list[Mapping[str, object]]:
    if _is_calibration(entries):
        return [entries]
    listed = entries.get("calibrations")
    return [each for each in listed if _is_calibration(each)] if isinstance(listed, list) else []


def _is_calibration(entries: object) -> bool:
    if not isinstance(entries, Mapping):
        return False
    matrix = entries.get("cameraIntrinsics")
    return isinstance(matrix, Mapping) and "data" in matrix


def _read(document: Document, camera_name: str | None) -> Reading:
    """Return a calibration, of several that of a resolution (`640x480`)."""
    where, found = document.name, _calibrations(document.entries)
    by_name: dict[str, Mapping[str, object]] = {}
    for each in found:
        size = _size(each, where)
        name = f"{size[0]}x{size[1]}"
        if name in by_name:
            raise CalibrationError(f"{where}: holds two calibrations of {name} px; remove one of them.")
        by_name[name] = each
    name, notes = choose(list(by_name), camera_name, where)
    return _reading(by_name[name], where, notes)


def _reading(entries: Mapping[str, object], where: str, notes: tuple[str, ...]) -> Reading:
    for key in _MODEL_KEYS:
        if key in entries and lens_model(entries[key], where, key) != "pinhole":
            raise CalibrationError(f"{where}: {key}: PhotonVision calibrates pinhole cameras only; correct it.")
    dist_key = next((key for key in _DIST_KEYS if key in entries), None)
    if dist_key is None:
        raise CalibrationError(f"{where}: distCoeffs: is missing beside cameraIntrinsics.")
    matrix = numbers.camera_matrix(entries["cameraIntrinsics"], where, "cameraIntrinsics")
    dist = pinhole_coefficients(numbers.coefficients(entries[dist_key], where, dist_key), where, dist_key)
    camera = numbers.build_camera(
        where, ("cameraIntrinsics", matrix), (dist_key, dist), _size(entries, where), "pinhole"
    )
    return Reading(camera, notes)


def _size(entries: Mapping[str, object], where: str) -> tuple[int, int]:
    size = terms.mapping(entries.get("resolution"), where, "resolution")
    return numbers.image_size(size.get("width"), size.get("height"), where, "resolution")


FORM = Form("PhotonVision", _recognizes, _read)
