"""Open3D: PinholeCameraIntrinsic, PinholeCameraParameters and trajectories of them, as JSON.

The matrix stands column by column. Pixels are OpenCV's.
"""

from __future__ import annotations

from collections.abc import Mapping

from circlepose._arguments import shown
from circlepose.errors import CalibrationError
from circlepose.io.calibration import numbers
from circlepose.io.calibration.document import Document
from circlepose.io.calibration.form import Form, Reading, choose, refuse_name
from circlepose.io.calibration.leftovers import refuse_leftovers
from circlepose.io.calibration.lens_models import pinhole_coefficients, plain

_DIST_KEYS = ("distortioncoefficients", "distortioncoeffs", "distcoeffs", "distortion", "dist", "coeffs")
"""Open3D has no distortion; tools that write its form beside one use these."""


def _recognizes(document: Document) -> bool:
    """Whether the entries hold Open3D's class name, or an `intrinsic_matrix` of 9 numbers, column by column."""
    entries = document.entries
    name = entries.get("class_name")
    if isinstance(name, str) and name.startswith("PinholeCamera"):
        return True
    return _is_intrinsic(entries) or _is_intrinsic(entries.get("intrinsic"))


def _read(document: Document, camera_name: str | None) -> Reading:
    """Return the camera; of a trajectory the one that `camera_name` numbers from 0."""
    where, entries = document.name, document.entries
    parameters = entries.get("parameters")
    if isinstance(parameters, list) and parameters:
        name, notes = choose([str(number) for number in range(len(parameters))], camera_name, where)
        where, chosen = f"{where}: parameters[{name}]", parameters[int(name)]
        if not isinstance(chosen, Mapping):
            raise CalibrationError(f"{where}: expected a camera, got {shown(chosen)}.")
        entries = chosen
    else:
        refuse_name(camera_name, where)
        notes = ()
    intrinsic = entries.get("intrinsic", entries)
    if not isinstance(intrinsic, Mapping) or "intrinsic_matrix" not in intrinsic:
        raise CalibrationError(f"{where}: intrinsic.intrinsic_matrix: is missing; write the file again with Open3D.")
    matrix, remarks = numbers.turned_matrix(intrinsic["intrinsic_matrix"], where, "intrinsic_matrix")
    size = None
    if "width" in intrinsic or "height" in intrinsic:
        size = numbers.image_size(intrinsic.get("width"), intrinsic.get("height"), where, "width, height")
    key, dist = _coefficients(intrinsic, where)
    camera = numbers.build_camera(where, ("intrinsic_matrix", matrix), (key, dist), size, "pinhole")
    outer = {"intrinsic", "parameters", "extrinsic"}
    own = {"intrinsic_matrix", "width", "height", key}
    is_nested = intrinsic is not entries
    for group in (document.entries, entries):
        refuse_leftovers(group, outer if is_nested else outer | own, where, camera)
    refuse_leftovers(intrinsic, outer | own, where, camera, "intrinsic." if is_nested else "")
    return Reading(camera, notes + remarks)


def _is_intrinsic(value: object) -> bool:
    if not isinstance(value, Mapping):
        return False
    matrix = value.get("intrinsic_matrix")
    if not isinstance(matrix, list) or len(matrix) != 9:
        return False
    return all(matrix[k] == 0 for k in (2, 5)) and any(matrix[k] != 0 for k in (6, 7))


def _coefficients(intrinsic: Mapping[str, object], where: str) -> tuple[str, list[float]]:
    for key, value in intrinsic.items():
        if plain(key) in _DIST_KEYS:
            return key, pinhole_coefficients(numbers.coefficients(value, where, key), where, key)
    return "distortion_coefficients", []


FORM = Form("Open3D", _recognizes, _read)
