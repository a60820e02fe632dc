"""BoofCV's camera files: `model` with a group `pinhole`, and groups of distortion.

BoofCV's own export to OpenCV leaves cx, cy as they are, takes t1, t2 for p1, p2 and radial for k1, k2, k3; so do we.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from circlepose._arguments import shown
from circlepose.errors import CalibrationError
from circlepose.io.calibration import numbers, terms
from circlepose.io.calibration.document import Document
from circlepose.io.calibration.form import Form, Reading, choose
from circlepose.io.calibration.lens_models import lens_model

_Entries = Mapping[str, object]

_PINHOLE, _BROWN = ("pinhole",), ("pinhole_radial_tangential", "radial_tangential")
_KANNALA_BRANDT = "kannala_brandt"
_MODELS = (*_PINHOLE, *_BROWN, _KANNALA_BRANDT, "omnidirectional_universal")
# By the model of a file that holds cameras: their keys.
_CONTAINERS: Mapping[object, tuple[str, ...]] = {
    "stereo_camera": ("left", "right"),
    "visual_depth": ("intrinsic",),
    "monocular_plane": ("intrinsic",),
}
_ASYMMETRIC = ("radial", "radial_trig", "tangent", "tangent_trig")


def _recognizes(document: Document) -> bool:
    """Whether the entries are one of BoofCV's cameras, or a file of BoofCV that holds some."""
    return bool(_cameras(document.entries))


def _is_camera(entries: object) -> bool:
    return isinstance(entries, Mapping) and "model" in entries and isinstance(entries.get("pinhole"), Mapping)


def _cameras(entries: _Entries) -> dict[str, _Entries]:
    if _is_camera(entries):
        return {"": entries}
    model = entries.get("model")
    groups = {key: entries.get(key) for key in _CONTAINERS.get(model, ())} if isinstance(model, str) else {}
    return {key: group for key, group in groups.items() if isinstance(group, Mapping) and _is_camera(group)}


def _read(document: Document, camera_name: str | None) -> Reading:
    """Return the camera; of a stereo file `left` or `right`."""
    where, cameras = document.name, _cameras(document.entries)
    if list(cameras) == [""]:
        if camera_name is not None:
            raise CalibrationError(f"{where}: holds one camera, without a name; leave out the name {camera_name!r}.")
        return _reading(cameras[""], where, ())
    name, notes = choose(list(cameras), camera_name, where)
    return _reading(cameras[name], f"{where}: {name}", notes)


def _reading(entries: _Entries, where: str, notes: tuple[str, ...]) -> Reading:
    model = entries["model"]
    if model not in _MODELS:
        raise CalibrationError(f"{where}: model: expected one of {', '.join(_MODELS)}, got {shown(model)}.")
    pinhole = terms.mapping(entries["pinhole"], where, "pinhole")
    fx, fy, cx, cy = (terms.term(pinhole, key, where, "pinhole.") for key in ("fx", "fy", "cx", "cy"))
    skew = numbers.number(pinhole.get("skew", 0.0), where, "pinhole.skew")
    size = _size(pinhole, where)
    if model == _KANNALA_BRANDT:
        scale, dist = _symmetric(entries, where)
        matrix = terms.rows(fx * scale, fy * scale, cx, cy, skew * scale)
        if scale != 1.0:
            notes += (
                f"fx, fy and the coefficients scaled by symmetric[0] = {scale:.6g}, which is 1 in OpenCV's model",
            )
        camera = numbers.build_camera(where, ("pinhole", matrix), ("symmetric", dist), size, "fisheye")
        return Reading(camera, notes)
    matrix = terms.rows(fx, fy, cx, cy, skew)
    if model == "omnidirectional_universal":
        lens_model("omnidirectional", where, "model")
    dist = _brown(entries, where) if model in _BROWN else []
    camera = numbers.build_camera(where, ("pinhole", matrix), ("radial_tangential", dist), size, "pinhole")
    return Reading(camera, notes)


def _size(pinhole: _Entries, where: str) -> tuple[int, int] | None:
    sides = pinhole.get("width", 0), pinhole.get("height", 0)
    return None if sides == (0, 0) else numbers.image_size(*sides, where, "pinhole.width, height")


def _brown(entries: _Entries, where: str) -> list[float]:
    group = terms.mapping(entries.get("radial_tangential"), where, "radial_tangential")
    radial = _list(group, "radial", where, "radial_tangential.")
    terms.refuse_rest(_numbered(radial[3:], 3), (), where, "of OpenCV", "radial_tangential.radial")
    k1, k2, k3 = (*radial[:3], *[0.0] * (3 - len(radial)))
    t1, t2 = (numbers.number(group.get(key, 0.0), where, f"radial_tangential.{key}") for key in ("t1", "t2"))
    return [k1, k2, t1, t2, k3]


def _symmetric(entries: _Entries, where: str) -> tuple[float, list[float]]:
    """Return the scale and the four coefficients of s0 angle + s1 angle^3 + ... as OpenCV has them."""
    for key in _ASYMMETRIC:
        if any(_list(entries, key, where)):
            raise CalibrationError(
                f"{where}: {key}: has terms that are not symmetric, which OpenCV's fisheye model lacks; "
                "calibrate again without them."
            )
    values = _list(entries, "symmetric", where)
    if not values or not values[0] > 0.0:
        raise CalibrationError(f"{where}: symmetric: expected coefficients of which the first is positive.")
    terms.refuse_rest(_numbered(values[5:], 5), (), where, "of OpenCV's fisheye lens", "symmetric")
    scale, *rest = values[:5]
    return scale, [*(each / scale for each in rest), *[0.0] * (4 - len(rest))]


def _list(group: _Entries, key: str, where: str, prefix: str = "") -> Sequence[float]:
    value = group.get(key)
    return [] if value is None else numbers.number_list(value, where, prefix + key)


def _numbered(values: Sequence[float], first: int) -> dict[str, object]:
    return {f"[{number}]": value for number, value in enumerate(values, first)}


FORM = Form("BoofCV camera", _recognizes, _read)
