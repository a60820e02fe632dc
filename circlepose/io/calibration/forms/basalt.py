"""Basalt's calibration: JSON of cereal with `value0.intrinsics`, a list of cameras cam0, cam1 ..."""

from __future__ import annotations

from collections.abc import Mapping

from circlepose._arguments import shown
from circlepose.camera.camera import Camera, LensModel
from circlepose.errors import CalibrationError
from circlepose.io.calibration import numbers, terms
from circlepose.io.calibration.document import Document
from circlepose.io.calibration.form import Form, Reading, choose
from circlepose.io.calibration.lens_models import lens_model

_MODELS: Mapping[str, tuple[LensModel, tuple[str, ...]]] = {
    "pinhole": ("pinhole", ()),
    "pinhole-radtan8": ("pinhole", ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")),
    "kb4": ("fisheye", ("k1", "k2", "k3", "k4")),
}
# Up to which radius the model was fitted; our own lens model finds where it turns back.
_UNUSED = ("rpmax",)
_MATRIX = ("fx", "fy", "cx", "cy")


def _recognizes(document: Document) -> bool:
    """Whether the entries are cereal's `value0` with a list of cameras that have a `camera_type`."""
    return bool(_cameras(document))


def _cameras(document: Document) -> dict[str, Mapping[str, object]]:
    value = document.entries.get("value0")
    cameras = value.get("intrinsics") if isinstance(value, Mapping) else None
    if not isinstance(cameras, list) or not all(
        isinstance(each, Mapping) and "camera_type" in each for each in cameras
    ):
        return {}
    return {f"cam{i}": each for i, each in enumerate(cameras)}


def _read(document: Document, camera_name: str | None) -> Reading:
    """Return one camera (`cam1`, or the first)."""
    cameras = _cameras(document)
    name, notes = choose(list(cameras), camera_name, document.name)
    size = _size(document, list(cameras).index(name))
    return Reading(_camera(cameras[name], f"{document.name}: {name}", size), notes)


def _camera(camera: Mapping[str, object], where: str, size: tuple[int, int] | None) -> Camera:
    word = camera["camera_type"]
    if not isinstance(word, str) or word not in _MODELS:
        lens_model(word, where, "camera_type")
        raise CalibrationError(f"{where}: camera_type: expected one of {', '.join(_MODELS)}, got {shown(word)}.")
    model, names = _MODELS[word]
    values = terms.mapping(camera.get("intrinsics"), where, "intrinsics")
    prefix = "intrinsics."
    terms.refuse_rest(values, (*_MATRIX, *names, *_UNUSED), where, word, prefix)
    dist = terms.lens(values, where, names, prefix)
    matrix = terms.matrix(values, where, _MATRIX, prefix)
    return numbers.build_camera(where, (f"{prefix}fx", matrix), (f"{prefix}k1", dist), size, model)


def _size(document: Document, index: int) -> tuple[int, int] | None:
    value = document.entries["value0"]
    sizes = value.get("resolution") if isinstance(value, Mapping) else None
    if not isinstance(sizes, list) or index >= len(sizes):
        return None
    key = f"resolution[{index}]"
    width, height = numbers.number_list(sizes[index], document.name, key, 2)
    return numbers.image_size(width, height, document.name, key)


FORM = Form("Basalt calibration", _recognizes, _read)
