"""Kalibr camchains (cam0, cam1 ...), and the same keys for a single camera, as EuRoC's sensor.yaml has them."""

from __future__ import annotations

from collections.abc import Mapping

from circlepose._arguments import shown
from circlepose.camera.camera import LensModel
from circlepose.errors import CalibrationError
from circlepose.io.calibration import numbers, terms
from circlepose.io.calibration.document import Document
from circlepose.io.calibration.form import Form, Reading, choose
from circlepose.io.calibration.leftovers import refuse_group, refuse_leftovers
from circlepose.io.calibration.lens_models import lens_model, pinhole_coefficients, plain

_RAYS = ("pinhole", "perspective", "none")
"""camera models that say nothing of the distortion"""
_DIST_KEYS = ("distortion_coeffs", "distortion_coefficients", "distortion_coeff")


def _recognizes(document: Document) -> bool:
    """Whether the entries hold at least one camera with Kalibr's keys."""
    return bool(_cameras(document.entries))


def _read(document: Document, camera_name: str | None) -> Reading:
    """Return one camera of a camchain (`camera_name`, or the first)."""
    cameras = _cameras(document.entries)
    name, notes = choose(sorted(cameras), camera_name, document.name)
    where = f"{document.name}: {name}" if name else document.name
    reading = _camera(cameras[name], where)
    refuse_group(name, where, reading.camera)
    return Reading(reading.camera, notes + reading.notes, name=name)


def _cameras(entries: Mapping[str, object]) -> dict[str, Mapping[str, object]]:
    if _is_camera(entries):
        return {"": entries}
    return {key: value for key, value in entries.items() if isinstance(value, Mapping) and _is_camera(value)}


def _is_camera(entries: Mapping[str, object]) -> bool:
    intrinsics = entries.get("intrinsics")
    if not isinstance(intrinsics, list) or any(isinstance(each, list) for each in intrinsics):
        return False
    return len(intrinsics) != 9 and any(
        isinstance(entries.get(key), str) for key in ("camera_model", "distortion_model")
    )


def _camera(entries: Mapping[str, object], where: str) -> Reading:
    model_key, distortion, notes = _distortion(entries, where)
    model = _model(entries, model_key, distortion, where)
    key = _coefficients_key(entries, where)
    dist = numbers.number_list(entries.get(key, []), where, key)
    if distortion == "none":
        if any(dist):
            raise CalibrationError(
                f"{where}: {key}: {shown(dist)} stand beside the distortion model none; name the model (radtan or "
                "equidistant), or remove them."
            )
        dist = []
    elif model == "fisheye":
        if len(dist) != 4:
            raise CalibrationError(f"{where}: {key}: {distortion} has 4 coefficients, got {len(dist)}; correct it.")
    elif len(dist) < 4:
        raise CalibrationError(
            f"{where}: {key}: {distortion} has 4 coefficients, got {len(dist)}; give k1, k2, p1, p2."
        )
    else:
        dist = pinhole_coefficients(dist, where, key)
    fx, fy, cx, cy = numbers.number_list(entries["intrinsics"], where, "intrinsics", 4)
    matrix = terms.rows(fx, fy, cx, cy)
    size = None
    if "resolution" in entries:
        width, height = numbers.number_list(entries["resolution"], where, "resolution", 2)
        size = numbers.image_size(width, height, where, "resolution")
    camera = numbers.build_camera(where, ("intrinsics", matrix), (key, dist), size, model)
    used = {"camera_model", "distortion_model", "intrinsics", "resolution", key}
    refuse_leftovers(entries, used, where, camera, is_model_stated=distortion != "none")
    return Reading(camera, notes)


def _coefficients_key(entries: Mapping[str, object], where: str) -> str:
    keys = [key for key in _DIST_KEYS if key in entries]
    if len(keys) > 1:
        raise CalibrationError(f"{where}: {keys[0]}, {keys[1]}: mean the same; remove one of them.")
    return keys[0] if keys else _DIST_KEYS[0]


def _distortion(entries: Mapping[str, object], where: str) -> tuple[str, str, tuple[str, ...]]:
    """Return the key that states how the lens distorts, the model's name, and a remark where there is none."""
    name = entries.get("distortion_model")
    if name is not None:
        if not isinstance(name, str):
            raise CalibrationError(
                f"{where}: distortion_model: expected a name such as radtan or equidistant, got {shown(name)}."
            )
        return "distortion_model", "none" if plain(name) == "none" else name, ()
    camera_model = entries.get("camera_model")
    if isinstance(camera_model, str) and plain(camera_model) not in _RAYS:
        # Other tools state `plumb_bob` here.
        return "camera_model", camera_model, ()
    remark = "distortion_model is missing: taken for a lens without distortion"
    return "distortion_model", "none", (remark,)


def _model(entries: Mapping[str, object], key: str, distortion: str, where: str) -> LensModel:
    """Return the lens model of both keys: how rays reach the lens, and how it distorts them."""
    camera_model = lens_model(entries.get("camera_model", "pinhole"), where, "camera_model")
    if distortion == "none":
        return camera_model
    model = lens_model(distortion, where, key)
    if camera_model == "fisheye" and model == "pinhole":
        raise CalibrationError(
            f"{where}: camera_model, distortion_model: contradict each other ({entries['camera_model']}, "
            f"{distortion}); keep the one that was calibrated."
        )
    return model


FORM = Form("Kalibr camchain", _recognizes, _read)
