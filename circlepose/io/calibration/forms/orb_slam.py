"""Settings of ORB-SLAM 2 and 3: `Camera.fx`, `Camera1.fx`, and `LEFT.K` of stereo files.

The coefficients are OpenCV's. The numbers belong to the images as they come, also where ORB-SLAM 3 resizes them.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

from circlepose._arguments import shown
from circlepose.camera.camera import Camera, LensModel
from circlepose.errors import CalibrationError
from circlepose.io.calibration import numbers, terms
from circlepose.io.calibration.document import Document
from circlepose.io.calibration.form import Form, Reading, choose
from circlepose.io.calibration.leftovers import refuse_leftovers
from circlepose.io.calibration.lens_models import lens_model, plain

_Entries = Mapping[str, object]

_NAMES = ("Camera", "Camera1", "Camera2")
_SIDES = ("LEFT", "RIGHT")
_COEFFICIENT = re.compile(r"[kps][0-9]")
_USED = ("fx", "fy", "cx", "cy", "K", "D", "R", "P", "width", "height")
_OF_ALL = ("type", "bFishEye", "imageScale", "newWidth", "newHeight", "newImWidth", "newImHeight")
_PINHOLE = ("k1", "k2", "p1", "p2", "k3")
_FISHEYE = ("k1", "k2", "k3", "k4")


def _recognizes(document: Document) -> bool:
    """Whether the entries have ORB-SLAM's flat keys; those with a `Camera.model` are stella_vslam's."""
    entries = document.entries
    # ORB-SLAM asks for k1, and since version 3 for the type; other tools write a list of coefficients.
    stated = ("Camera.type", *(f"{name}.k1" for name in _NAMES), *(f"{side}.K" for side in _SIDES))
    is_stated = any(key in entries for key in stated)
    return is_stated and any(f"{name}.fx" in entries for name in _NAMES) and "Camera.model" not in entries


def _read(document: Document, camera_name: str | None) -> Reading:
    """Return one camera: `LEFT` before `Camera`, which in a file of both is that of the rectified images."""
    where, entries = document.name, document.entries
    raw = [side for side in _SIDES if f"{side}.K" in entries]
    names = [*raw, *(name for name in _NAMES if f"{name}.fx" in entries)]
    name, notes = choose(names, camera_name, where)
    if name in raw:
        if "Camera" in names:
            notes += (
                "Camera.fx, fy, cx, cy belong to the images that ORB-SLAM rectifies; --camera-name Camera takes them",
            )
        raw_camera = _raw_camera(entries, name, where)
        _check_rest(entries, (f"{name}.",), where, raw_camera)
        return Reading(raw_camera, notes)
    camera, remarks = _camera(entries, name, where)
    _check_rest(entries, (f"{name}.",) if "Camera.fx" in entries else (f"{name}.", "Camera."), where, camera)
    return Reading(camera, (*notes, *remarks))


def _check_rest(entries: _Entries, prefixes: tuple[str, ...], where: str, camera: Camera) -> None:
    """Refuse what is not used of the keys of one camera, and of those without a group."""
    own = prefixes[0]
    used = {f"{own}{key}" for key in _USED} | {f"Camera.{key}" for key in _OF_ALL}
    if own.startswith("Camera"):
        # Those that the lens model has, and no other is there unless it is 0.
        used |= {key for key in entries if key.startswith(own) and _COEFFICIENT.fullmatch(key.removeprefix(own))}
    rest = {key: value for key, value in entries.items() if "." not in key or key.startswith(prefixes)}
    refuse_leftovers(rest, used, where, camera, is_model_stated="Camera.type" in entries)


def _raw_camera(entries: _Entries, side: str, where: str) -> Camera:
    """Return the camera of the raw image of one side, which stands in matrices."""
    matrix = numbers.camera_matrix(entries[f"{side}.K"], where, f"{side}.K")
    if f"{side}.D" not in entries:
        raise CalibrationError(f"{where}: {side}.D: is missing beside {side}.K.")
    dist = numbers.coefficients(entries[f"{side}.D"], where, f"{side}.D")
    size = _size(entries, side, where) or _size(entries, "Camera", where)
    return numbers.build_camera(where, (f"{side}.K", matrix), (f"{side}.D", dist), size, "pinhole")


def _camera(entries: _Entries, name: str, where: str) -> tuple[Camera, tuple[str, ...]]:
    prefix = f"{name}."
    own = {key.removeprefix(prefix): value for key, value in entries.items() if key.startswith(prefix)}
    model, is_rectified = _model(entries, own, where)
    known = _FISHEYE if model == "fisheye" else _PINHOLE
    given = {key: value for key, value in own.items() if _COEFFICIENT.fullmatch(key)}
    notes: tuple[str, ...] = ()
    if is_rectified:
        terms.refuse_rest(given, (), where, "Rectified", prefix)
        dist: list[float] = []
        notes += ("Camera.type is Rectified: measure in images that are rectified already",)
    elif not given:
        dist = [] if model == "pinhole" else [0.0] * 4
        notes += (f"{prefix}k1 and the others are not there, so the lens is taken to have no distortion",)
    else:
        terms.refuse_rest(given, known, where, "KannalaBrandt8" if model == "fisheye" else "PinHole", prefix)
        dist = terms.lens(given, where, known, prefix, optional=("k3",) if model == "pinhole" else ())
    matrix = terms.matrix(own, where, prefix=prefix)
    size = _size(entries, "Camera", where)
    camera = numbers.build_camera(where, (f"{prefix}fx", matrix), (f"{prefix}k1", dist), size, model)
    return camera, (*notes, *_resizing(entries, size))


def _model(entries: _Entries, own: _Entries, where: str) -> tuple[LensModel, bool]:
    """Return the lens model and whether the images are rectified already."""
    word = entries.get("Camera.type")
    if isinstance(word, str) and plain(word) == "rectified":
        return "pinhole", True
    model: LensModel = "pinhole" if word is None else lens_model(word, where, "Camera.type")
    flag = entries.get("Camera.bFishEye", 0)
    if flag not in (0, 1):
        raise CalibrationError(f"{where}: Camera.bFishEye: expected 0 or 1, got {shown(flag)}.")
    if flag == 1 and model == "pinhole":
        if not all(key in own for key in _FISHEYE):
            raise CalibrationError(
                f"{where}: Camera.bFishEye: is 1, and a fisheye lens has k1 k2 k3 k4; not all of them are there."
            )
        return "fisheye", False
    return model, False


def _size(entries: _Entries, prefix: str, where: str) -> tuple[int, int] | None:
    for width, height in (("width", "height"), ("cols", "rows")):
        keys = f"{prefix}.{width}", f"{prefix}.{height}"
        if all(key in entries for key in keys):
            return numbers.image_size(entries[keys[0]], entries[keys[1]], where, ", ".join(keys))
    return None


def _resizing(entries: _Entries, size: tuple[int, int] | None) -> tuple[str, ...]:
    """Return a remark where ORB-SLAM 3 works on smaller images than those that the numbers belong to."""
    for keys in (("Camera.newWidth", "Camera.newHeight"), ("Camera.newImWidth", "Camera.newImHeight")):
        sides = tuple(entries.get(key) for key in keys)
        if sides not in ((None, None), size):
            belongs = "the images as they come" if size is None else f"{size[0]} x {size[1]} px"
            return (f"{keys[0]}, {keys[1]} are not used: the numbers belong to {belongs}",)
    scale = entries.get("Camera.imageScale", 1)
    return (
        () if scale == 1 else (f"Camera.imageScale {shown(scale)} is not used: the numbers belong to the full image",)
    )


FORM = Form("ORB-SLAM settings", _recognizes, _read)
