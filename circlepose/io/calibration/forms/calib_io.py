"""calib.io's JSON (Calibrator, libCalib): `Calibration.cameras`, each with a `model` of named parameters."""

from __future__ import annotations

from collections.abc import Mapping

from circlepose._arguments import shown
from circlepose.camera.camera import LensModel
from circlepose.errors import CalibrationError
from circlepose.io.calibration import numbers, terms
from circlepose.io.calibration.document import Document
from circlepose.io.calibration.form import Form, Reading, choose
from circlepose.io.calibration.lens_models import lens_model, plain

_Entries = Mapping[str, object]

_MATRIX = ("f", "ar", "cx", "cy")
_OPENCV = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4", "tauX", "tauY")
_FISHEYE = ("k1", "k2", "k3", "k4")
_NEEDED = ("k1", "k2")
# The name stands with the first camera of its kind; later ones repeat the number, without the highest bit.
_ID_BITS = 0x7FFFFFFF
_MOST_NAME = 100


def _recognizes(document: Document) -> bool:
    """Whether the entries are libCalib's: cameras whose model has a `ptr_wrapper`."""
    return bool(_cameras(document.entries))


def _cameras(entries: _Entries) -> list[_Entries]:
    calibration = entries.get("Calibration", entries.get("calibration"))
    cameras = calibration.get("cameras") if isinstance(calibration, Mapping) else None
    if not isinstance(cameras, list) or not cameras:
        return []
    models = [each.get("model") if isinstance(each, Mapping) else None for each in cameras]
    return cameras if all(isinstance(each, Mapping) and "ptr_wrapper" in each for each in models) else []


def _read(document: Document, camera_name: str | None) -> Reading:
    """Return one camera, `cam0`, `cam1` ... or by its serial number."""
    where, cameras = document.name, _cameras(document.entries)
    words = _words(cameras)
    names = [_name(camera, i) for i, camera in enumerate(cameras)]
    if len(set(names)) < len(names):
        names = [f"cam{i}" for i in range(len(cameras))]
    name, notes = choose(names, camera_name, where)
    index = names.index(name)
    return _reading(cameras[index], words[index], f"{where}: {name}", notes)


def _name(camera: _Entries, index: int) -> str:
    serial = camera.get("serial", camera.get("serialNumber"))
    return serial if isinstance(serial, str) and 0 < len(serial) <= _MOST_NAME else f"cam{index}"


def _words(cameras: list[_Entries]) -> list[object]:
    """Return the name of each camera's model."""
    known: dict[int, object] = {}
    found: list[object] = []
    for camera in cameras:
        model = camera.get("model")
        group = model if isinstance(model, Mapping) else {}
        number, word = group.get("polymorphic_id"), group.get("polymorphic_name")
        key = number & _ID_BITS if isinstance(number, int) else -1
        known.setdefault(key, word)
        found.append(word if word is not None else known[key])
    return found


def _reading(camera: _Entries, word: object, where: str, notes: tuple[str, ...]) -> Reading:
    model, names = _lens(word, where)
    wrapper = terms.mapping(terms.mapping(camera["model"], where, "model").get("ptr_wrapper"), where, "ptr_wrapper")
    data = terms.mapping(wrapper.get("data"), where, "data")
    given = terms.mapping(data.get("parameters"), where, "parameters")
    values = {str(key): each.get("val") if isinstance(each, Mapping) else each for key, each in given.items()}
    prefix = "parameters."
    terms.refuse_rest(values, (*_MATRIX, "skew", *names), where, str(word), prefix)
    focal, ratio, cx, cy = (terms.term(values, key, where, prefix) for key in _MATRIX)
    skew = numbers.number(values.get("skew", 0.0), where, f"{prefix}skew")
    dist = terms.lens(values, where, names, prefix, optional=set(names) - set(_NEEDED))
    while model == "pinhole" and len(dist) > 5 and not any(dist[-_group(len(dist)) :]):
        dist = dist[: -_group(len(dist))]
    matrix = terms.rows(focal, focal * ratio, cx, cy, skew)
    built = numbers.build_camera(where, (f"{prefix}f", matrix), (f"{prefix}k1", dist), _size(data, where), model)
    return Reading(built, notes)


def _group(count: int) -> int:
    """Return how many coefficients the next shorter of OpenCV's models lacks."""
    return {14: 2, 12: 4, 8: 3}[count]


def _lens(word: object, where: str) -> tuple[LensModel, tuple[str, ...]]:
    name = plain(word).removeprefix("libcalib").removeprefix("cameramodel") if isinstance(word, str) else ""
    if name in ("opencv", "pinhole", "matlab"):
        return "pinhole", _OPENCV
    if name in ("opencvfisheye", "fisheye", "kannalabrandt"):
        return "fisheye", _FISHEYE
    if name:
        lens_model(name, where, "polymorphic_name")
    raise CalibrationError(
        f"{where}: polymorphic_name: expected libCalib::CameraModelOpenCV, got {shown(word)}; export OpenCV's model."
    )


def _size(data: _Entries, where: str) -> tuple[int, int] | None:
    group: object = data
    for key in ("CameraModelCRT", "CameraModelBase"):
        group = group.get(key) if isinstance(group, Mapping) else None
    if not isinstance(group, Mapping):
        return None
    size = group.get("imageSize")
    if isinstance(size, Mapping):
        return numbers.image_size(size.get("width"), size.get("height"), where, "imageSize")
    if "imageWidth" in group and "imageHeight" in group:
        return numbers.image_size(group["imageWidth"], group["imageHeight"], where, "imageWidth, imageHeight")
    return None


FORM = Form("calib.io", _recognizes, _read)
