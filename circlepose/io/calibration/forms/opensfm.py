"""OpenSfM's camera_models.json, and the cameras of its reconstruction.json.

Lengths are shares of the image's longer side; the principal point is an offset from the image's center.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from circlepose._arguments import shown
from circlepose.camera.camera import LensModel
from circlepose.errors import CalibrationError
from circlepose.io.calibration import numbers, terms
from circlepose.io.calibration.document import Document
from circlepose.io.calibration.form import Form, Reading, choose
from circlepose.io.calibration.leftovers import refuse_leftovers
from circlepose.io.calibration.lens_models import lens_model

# Ours, its coefficients in our order, and whether both focal lengths and the principal point are stated.
_MODELS: Mapping[str, tuple[LensModel, tuple[str, ...], bool]] = {
    "perspective": ("pinhole", ("k1", "k2"), False),
    "simple_radial": ("pinhole", ("k1",), True),
    "radial": ("pinhole", ("k1", "k2"), True),
    "brown": ("pinhole", ("k1", "k2", "p1", "p2", "k3"), True),
    "fisheye": ("fisheye", ("k1", "k2"), False),
    "fisheye_opencv": ("fisheye", ("k1", "k2", "k3", "k4"), True),
}
_FOCAL = ("focal", "focal_x")
_MOST_DEPTH = 3
_SCALED = "focal lengths times the image's longer side, c_x, c_y from the image's center: in px"


def _recognizes(document: Document) -> bool:
    """Whether a group of keys has OpenSfM's `projection_type` and a focal length."""
    return next(_cameras(document.entries, "", 0), None) is not None


def _cameras(entries: object, name: str, depth: int) -> Iterator[tuple[str, Mapping[str, object]]]:
    if not isinstance(entries, Mapping) or depth > _MOST_DEPTH:
        return
    if isinstance(entries.get("projection_type"), str) and any(key in entries for key in _FOCAL):
        yield name, entries
        return
    for key, value in entries.items():
        yield from _cameras(value, str(key), depth + 1)


def _read(document: Document, camera_name: str | None) -> Reading:
    """Return the camera that `camera_name` names in full, or the first."""
    cameras = dict(_cameras(document.entries, "", 0))
    name, notes = choose(list(cameras), camera_name, document.name)
    where = f"{document.name}: {name[:80]}" if name else document.name
    return _reading(cameras[name], where, notes)


def _reading(entries: Mapping[str, object], where: str, notes: tuple[str, ...]) -> Reading:
    word = str(entries["projection_type"])
    if word not in _MODELS:
        lens_model(word, where, "projection_type")
        expected = ", ".join(_MODELS)
        raise CalibrationError(f"{where}: projection_type: expected one of {expected}, got {shown(word)}.")
    model, names, is_full = _MODELS[word]
    size = numbers.image_size(entries.get("width"), entries.get("height"), where, "width, height")
    longer = max(size)
    keys = ("focal_x", "focal_y") if is_full else ("focal", "focal")
    fx, fy = (longer * terms.term(entries, key, where) for key in keys)
    center = ("c_x", "c_y") if is_full else ()
    offset = terms.lens(entries, where, center, optional=center) or [0.0, 0.0]
    # OpenSfM's (0, 0) is the corner between the middle pixels of an image with even sides.
    cx, cy = (longer * each + 0.5 * side - 0.5 for each, side in zip(offset, size, strict=True))
    dist = terms.lens(entries, where, names, optional=names)
    dist += [0.0] * (4 - len(dist))
    matrix = terms.rows(fx, fy, cx, cy)
    camera = numbers.build_camera(where, (keys[0], matrix), (names[0], dist), size, model)
    used = {"projection_type", "width", "height", *keys, *center, *names}
    refuse_leftovers(entries, used, where, camera, is_model_stated=True)
    if not is_full and any(entries.get(key) for key in ("c_x", "c_y", "focal_x", "focal_y")):
        raise CalibrationError(f"{where}: projection_type: {word} has one focal length, and no c_x, c_y; correct it.")
    return Reading(camera, (*notes, _SCALED))


FORM = Form("OpenSfM cameras", _recognizes, _read)
