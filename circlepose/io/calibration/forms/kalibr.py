"""Kalibr camchains (cam0, cam1 ...), and the same keys for a single camera, as EuRoC's sensor.yaml has them."""

from __future__ import annotations

from collections.abc import Mapping

from circlepose._arguments import shown
from circlepose.camera.camera import Camera, LensModel
from circlepose.errors import CalibrationError
from circlepose.io.calibration import numbers
from circlepose.io.calibration.document import Document
from circlepose.io.calibration.form import Form, Reading, choose

_DISTORTIONS: Mapping[str, tuple[LensModel, int]] = {
    "radtan": ("pinhole", 4),
    "radial-tangential": ("pinhole", 4),
    "equidistant": ("fisheye", 4),
    "none": ("pinhole", 0),
}


def _recognizes(document: Document) -> bool:
    """Whether the entries hold at least one camera with Kalibr's keys."""
    return bool(_cameras(document.entries))


def _read(document: Document, camera_name: str | None) -> Reading:
    """Return one camera of a camchain (`camera_name`, or the first)."""
    cameras = _cameras(document.entries)
    name, notes = choose(sorted(cameras), camera_name, document.name)
    return Reading(_camera(cameras[name], f"{document.name}: {name}" if name else document.name), notes)


def _cameras(entries: Mapping[str, object]) -> dict[str, Mapping[str, object]]:
    if _is_camera(entries):
        return {"": entries}
    return {key: value for key, value in entries.items() if isinstance(value, Mapping) and _is_camera(value)}


def _is_camera(entries: Mapping[str, object]) -> bool:
    return "intrinsics" in entries and ("camera_model" in entries or "distortion_model" in entries)


def _camera(entries: Mapping[str, object], where: str) -> Camera:
    camera_model = entries.get("camera_model")
    if camera_model != "pinhole":
        raise CalibrationError(
            f"{where}: camera_model: is {shown(camera_model)}; only pinhole (with radtan or equidistant distortion) "
            "is supported, so calibrate again with pinhole-radtan or pinhole-equi."
        )
    distortion = entries.get("distortion_model", "none")
    if not isinstance(distortion, str) or distortion not in _DISTORTIONS:
        raise CalibrationError(
            f"{where}: distortion_model: expected radtan, equidistant or none, got {shown(distortion)}."
        )
    model, count = _DISTORTIONS[distortion]
    key = "distortion_coefficients" if "distortion_coefficients" in entries else "distortion_coeffs"
    dist = numbers.number_list(entries.get(key, []), where, key)
    if distortion == "none" and not any(dist):
        dist = []
    if len(dist) != count:
        raise CalibrationError(f"{where}: {key}: {distortion} has {count} coefficients, got {len(dist)}.")
    fx, fy, cx, cy = numbers.number_list(entries["intrinsics"], where, "intrinsics", 4)
    matrix = [[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]
    size = None
    if "resolution" in entries:
        width, height = numbers.number_list(entries["resolution"], where, "resolution", 2)
        size = numbers.image_size(width, height, where, "resolution")
    return numbers.build_camera(where, ("intrinsics", matrix), (key, dist), size, model)


FORM = Form("Kalibr camchain", _recognizes, _read)
