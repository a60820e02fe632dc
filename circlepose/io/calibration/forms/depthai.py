"""Luxonis depthai: the JSON of a device's calibration memory, a camera per socket.

Matrices are row by row, coefficients in OpenCV's order and pixels OpenCV's: nothing is converted.
"""

from __future__ import annotations

from collections.abc import Mapping

from circlepose._arguments import shown
from circlepose.camera.camera import LensModel
from circlepose.errors import CalibrationError
from circlepose.io.calibration import numbers
from circlepose.io.calibration.document import Document
from circlepose.io.calibration.form import Form, Reading, choose
from circlepose.io.calibration.lens_models import pinhole_coefficients, plain

_SOCKETS = {"rgb": 0, "color": 0, "center": 0, "left": 1, "right": 2}
"""what the sockets were called before they had letters"""
_TYPES: Mapping[object, LensModel] = {0: "pinhole", "perspective": "pinhole", 1: "fisheye", "fisheye": "fisheye"}
_FISHEYE_COUNT = 4
_LAST_SOCKET = 25


def _recognizes(document: Document) -> bool:
    """Whether the entries hold `cameraData`, a list of pairs of a socket and its camera."""
    data = document.entries.get("cameraData")
    return isinstance(data, list) and any(isinstance(pair, list) and len(pair) == 2 for pair in data)


def _read(document: Document, camera_name: str | None) -> Reading:
    """Return the camera of a socket (`CAM_B`, its number 1, or left)."""
    cameras = _cameras(document)
    name, notes = choose(list(cameras), _socket_name(camera_name), document.name)
    camera, where = cameras[name], f"{document.name}: {name}"
    for key in ("intrinsicMatrix", "distortionCoeff"):
        if key not in camera:
            raise CalibrationError(f"{where}: {key}: is missing; read the calibration from the device again.")
    kind = camera.get("cameraType", 0)
    model = _TYPES.get(plain(kind) if isinstance(kind, str) else kind) if isinstance(kind, str | int) else None
    if model is None:
        raise CalibrationError(
            f"{where}: cameraType: expected 0 (perspective) or 1 (fisheye), got {shown(kind)}; circlepose has no "
            "other model, so calibrate the camera again with one of these."
        )
    dist = numbers.number_list(camera["distortionCoeff"], where, "distortionCoeff")
    if model == "pinhole":
        dist = pinhole_coefficients(dist, where, "distortionCoeff")
    elif any(dist[_FISHEYE_COUNT:]):
        raise CalibrationError(f"{where}: distortionCoeff: a fisheye camera has 4 coefficients, got {shown(dist)}.")
    else:
        dist = dist[:_FISHEYE_COUNT]
    size = None
    if camera.get("width") or camera.get("height"):
        size = numbers.image_size(camera.get("width"), camera.get("height"), where, "width, height")
    matrix = numbers.camera_matrix(camera["intrinsicMatrix"], where, "intrinsicMatrix")
    position = camera.get("lensPosition", 0)
    if isinstance(position, int) and position:
        notes += (
            f"calibrated at lens position {position}; autofocus changes the focal length, so fix the lens there",
        )
    built = numbers.build_camera(where, ("intrinsicMatrix", matrix), ("distortionCoeff", dist), size, model)
    return Reading(built, notes)


def _cameras(document: Document) -> dict[str, Mapping[str, object]]:
    """Return the cameras by the name of their socket, in the order of the sockets."""
    found: dict[int, Mapping[str, object]] = {}
    data = document.entries["cameraData"]
    for pair in data if isinstance(data, list) else []:
        if not (isinstance(pair, list) and len(pair) == 2 and isinstance(pair[1], Mapping)):
            raise CalibrationError(
                f"{document.name}: cameraData: expected pairs [socket, camera], got {shown(pair)}."
            )
        number = _socket(pair[0])
        if number is None:
            raise CalibrationError(
                f"{document.name}: cameraData: expected a socket from 0 to {_LAST_SOCKET}, got {shown(pair[0])}."
            )
        if number in found:
            raise CalibrationError(f"{document.name}: cameraData: the socket {number} is given twice; remove one.")
        found[number] = pair[1]
    return {_name(number): found[number] for number in sorted(found)}


def _socket(value: object) -> int | None:
    """Return the number of a socket that is given as a number, a letter (CAM_B) or a former name."""
    if isinstance(value, str):
        word = plain(value)
        if word in _SOCKETS:
            return _SOCKETS[word]
        letter = word.removeprefix("cam")
        if len(letter) == 1 and "a" <= letter <= "z":
            return ord(letter) - ord("a")
        value = int(word) if word.isascii() and word.isdigit() and len(word) <= 2 else None
    is_socket = isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= _LAST_SOCKET
    return value if is_socket else None  # type: ignore[return-value]


def _socket_name(camera_name: str | None) -> str | None:
    number = None if camera_name is None else _socket(camera_name)
    return camera_name if number is None else _name(number)


def _name(number: int) -> str:
    return f"CAM_{chr(ord('A') + number)}"


FORM = Form("depthai", _recognizes, _read)
