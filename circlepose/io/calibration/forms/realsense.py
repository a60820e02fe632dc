"""Intrinsics of librealsense: JSON of `rs2::intrinsics` (ppx, ppy, coeffs), and text of `rs-enumerate-devices -c`.

As librealsense projects: Brown-Conrady is OpenCV's model, Kannala-Brandt its fisheye; the modified one applies the
tangential terms to points that the radial ones have moved; the inverse one maps the other way, pixels to points.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from circlepose._arguments import shown
from circlepose.camera.camera import LensModel
from circlepose.errors import CalibrationError
from circlepose.io.calibration import numbers, terms
from circlepose.io.calibration.document import Document
from circlepose.io.calibration.form import Form, Reading, choose
from circlepose.io.calibration.leftovers import refuse_group, refuse_leftovers
from circlepose.io.calibration.lens_models import lens_model, plain
from circlepose.io.text.validation import some_keys

_KEYS = ("fx", "fy", "ppx", "ppy")
# As librealsense numbers them, in JSON that states a number.
_NUMBERED = ("none", "modifiedbrownconrady", "inversebrownconrady", "ftheta", "brownconrady", "kannalabrandt4")
# Those that do nothing where all coefficients are 0.
_SAME_IF_ZERO = ("none", "modifiedbrownconrady", "inversebrownconrady", "brownconrady")
_PREFIXES = ("rs2distortion", "distortion")
_AGAIN = "calibrate this camera with OpenCV, or measure in a stream that is rectified (its coefficients are 0)"
_SECTION = re.compile(
    r"^[ \t]*Intrinsic of \"(?P<stream>[^\"\n]{1,40})\"[ \t]*/[ \t]*(?P<size>\d{1,5}x\d{1,5})", re.M
)
_FIELD = re.compile(r"^[ \t]*(Width|Height|PPX|PPY|Fx|Fy|Distortion|Coeffs):[ \t]*(\S[^\n]{0,300})$", re.M)
_MOST_DEPTH = 4


@dataclass(frozen=True, slots=True)
class _Stream:
    """One stream as the file states it, under rs2::intrinsics' names, and where."""

    entries: Mapping[str, object]
    prefix: str


def _recognizes(document: Document) -> bool:
    """Whether a group of entries has librealsense's ppx and ppy, or the text is that of rs-enumerate-devices."""
    if document.text is not None and _SECTION.search(document.text):
        return True
    return next(_groups(document.entries, ""), None) is not None


def _groups(entries: object, path: str, depth: int = 0) -> Iterator[tuple[str, _Stream]]:
    """Yield the groups that hold intrinsics, by their path in the file."""
    if depth > _MOST_DEPTH or not isinstance(entries, Mapping):
        return
    if "ppx" in entries and "ppy" in entries and ("coeffs" in entries or "model" in entries):
        yield path, _Stream({str(key): value for key, value in entries.items()}, f"{path}." if path else "")
        return
    for key, value in entries.items():
        name = some_keys([str(key)])
        yield from _groups(value, f"{path}.{name}" if path else name, depth + 1)


def _sections(text: str) -> Iterator[tuple[str, _Stream]]:
    """Yield the streams of rs-enumerate-devices' text; a stream and size that occurs again (another format) once."""
    marks = list(_SECTION.finditer(text))
    names = {"Width": "width", "Height": "height", "PPX": "ppx", "PPY": "ppy", "Fx": "fx", "Fy": "fy"}
    names |= {"Distortion": "model", "Coeffs": "coeffs"}
    for mark, following in zip(marks, [*marks[1:], None], strict=True):
        part = text[mark.end() : following.start() if following else mark.end() + 2000]
        entries: dict[str, object] = {}
        for key, value in _FIELD.findall(part):
            entries.setdefault(names[key], value.strip() if key == "Distortion" else _numbers(value, key == "Coeffs"))
        name = f"{mark['stream']} {mark['size']}"
        yield name, _Stream(entries, f"{name}: ")


def _numbers(text: str, is_list: bool) -> object:
    try:
        values = [float(word) for word in text.split()]
    except ValueError:
        return text.strip()
    return values if is_list or len(values) != 1 else values[0]


def _read(document: Document, camera_name: str | None) -> Reading:
    """Return one stream, by its path (`color`) or its name and size (`Color 1280x720`)."""
    where, text = document.name, document.text or ""
    streams = dict(_sections(text)) if _SECTION.search(text) else dict(_groups(document.entries, ""))
    if list(streams) == [""]:
        if camera_name is not None:
            raise CalibrationError(f"{where}: holds one camera, without a name; leave out the name {camera_name!r}.")
        return _reading(streams[""], where, ())
    name, notes = choose(list(streams), camera_name, where)
    reading = _reading(streams[name], where, notes)
    refuse_group(name, where, reading.camera)
    outer = {key: value for key, value in document.entries.items() if not isinstance(value, Mapping | list)}
    refuse_leftovers(outer, (), where, reading.camera, is_model_stated=True)
    return reading


def _reading(stream: _Stream, where: str, notes: tuple[str, ...]) -> Reading:
    entries, prefix = stream.entries, stream.prefix
    coeffs_key = "coeffs" if "coeffs" in entries else "distortion_coeffs"
    model_key, word = _model_key(entries)
    if coeffs_key not in entries and (word is None or _model_name(word) != "none"):
        raise CalibrationError(f"{where}: {prefix}coeffs: is missing; if the image has no distortion, give 5 zeros.")
    coeffs = numbers.number_list(entries.get(coeffs_key, []), where, prefix + coeffs_key)
    model, dist = _lens(entries, coeffs, where, prefix)
    matrix = terms.matrix(entries, where, _KEYS, prefix)
    size = None
    if "width" in entries and "height" in entries:
        size = numbers.image_size(entries["width"], entries["height"], where, f"{prefix}width, height")
    keys = f"{prefix}fx", f"{prefix}{coeffs_key}"
    camera = numbers.build_camera(where, (keys[0], matrix), (keys[1], dist), size, model)
    used = {*_KEYS, coeffs_key, model_key, "width", "height"}
    refuse_leftovers(entries, used, where, camera, prefix, is_model_stated=word is not None)
    return Reading(camera, notes)


def _lens(
    entries: Mapping[str, object], coeffs: Sequence[float], where: str, prefix: str
) -> tuple[LensModel, list[float]]:
    """Return our model and coefficients; refuse what is not exactly one of ours."""
    key, word = _model_key(entries)
    name = _model_name(word)
    if len(coeffs) not in (0, 4, 5):
        raise CalibrationError(f"{where}: {prefix}coeffs: expected 5 coefficients, got {len(coeffs)}.")
    if name == "kannalabrandt4":
        terms.refuse_rest(dict(_named(coeffs[4:], 5)), (), where, "Kannala-Brandt", prefix)
        return "fisheye", [*coeffs[:4], *[0.0] * (4 - len(coeffs))]
    if not any(coeffs) and name in _SAME_IF_ZERO:
        return "pinhole", []
    if word is None:
        raise CalibrationError(
            f"{where}: {prefix}model: is missing; expected brown_conrady or another of librealsense."
        )
    if name == "brownconrady":
        return "pinhole", list(coeffs)
    if name == "modifiedbrownconrady" and _is_same(coeffs):
        return "pinhole", list(coeffs)
    if name in ("none", "modifiedbrownconrady", "inversebrownconrady"):
        meant = {
            "none": "says that there is no distortion, but the coefficients are not 0",
            "modifiedbrownconrady": "applies the tangential terms after the radial ones, unlike OpenCV's model",
            "inversebrownconrady": "maps pixels to points, unlike OpenCV's model, unless all coefficients are 0",
        }[name]
        raise CalibrationError(f"{where}: {prefix}{key}: {shown(word)} {meant}; {_AGAIN}.")
    lens_model(name, where, prefix + key)
    raise CalibrationError(f"{where}: {prefix}{key}: expected brown_conrady or none, got {shown(word)}.")


def _named(coeffs: Sequence[float], first: int) -> Iterator[tuple[str, float]]:
    """Yield coefficients under the names that messages have for them."""
    for number, value in enumerate(coeffs, first):
        yield f"coeffs[{number}]", value


def _is_same(coeffs: Sequence[float]) -> bool:
    """Whether the order of radial and tangential terms makes no difference, as one of them is 0."""
    k1, k2, p1, p2, k3 = (*coeffs, *[0.0] * (5 - len(coeffs)))
    return (p1 == 0 and p2 == 0) or (k1 == 0 and k2 == 0 and k3 == 0)


def _model_key(entries: Mapping[str, object]) -> tuple[str, object]:
    for key in ("model", "distortion_model", "distortion"):
        if isinstance(entries.get(key), str | int):
            return key, entries[key]
    return "model", None


def _model_name(word: object) -> str:
    if isinstance(word, int) and 0 <= word < len(_NUMBERED):
        return _NUMBERED[word]
    if word is None:
        return "none"
    name = plain(str(word))
    for prefix in _PREFIXES:
        name = name.removeprefix(prefix)
    return name


FORM = Form("RealSense intrinsics", _recognizes, _read)
