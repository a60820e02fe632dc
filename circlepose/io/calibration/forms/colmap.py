"""COLMAP's cameras.txt and cameras.bin.

COLMAP's pixel (0, 0) is the corner of the image: the center of the first pixel is (0.5, 0.5) there, and (0, 0) here.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from circlepose._arguments import shown
from circlepose.camera.camera import LensModel
from circlepose.errors import CalibrationError
from circlepose.io.calibration import numbers, terms
from circlepose.io.calibration.document import Document
from circlepose.io.calibration.form import Form, Reading, choose
from circlepose.io.calibration.lens_models import lens_model

_Shape = tuple[str, LensModel, tuple[str, ...]]

# What the model shares (one focal length or two), ours, and its coefficients in COLMAP's order.
_MODELS: Mapping[str, _Shape] = {
    "SIMPLE_PINHOLE": ("f", "pinhole", ()),
    "PINHOLE": ("fx fy", "pinhole", ()),
    "SIMPLE_RADIAL": ("f", "pinhole", ("k1",)),
    "RADIAL": ("f", "pinhole", ("k1", "k2")),
    "OPENCV": ("fx fy", "pinhole", ("k1", "k2", "p1", "p2")),
    "FULL_OPENCV": ("fx fy", "pinhole", ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")),
    "SIMPLE_FISHEYE": ("f", "fisheye", ()),
    "FISHEYE": ("fx fy", "fisheye", ()),
    "SIMPLE_RADIAL_FISHEYE": ("f", "fisheye", ("k1",)),
    "RADIAL_FISHEYE": ("f", "fisheye", ("k1", "k2")),
    "OPENCV_FISHEYE": ("fx fy", "fisheye", ("k1", "k2", "k3", "k4")),
}
# By the number that stands in cameras.bin; with the number of parameters.
_NUMBERED = (
    *(("SIMPLE_PINHOLE", 3), ("PINHOLE", 4), ("SIMPLE_RADIAL", 4), ("RADIAL", 5), ("OPENCV", 8)),
    *(("OPENCV_FISHEYE", 8), ("FULL_OPENCV", 12), ("FOV", 5), ("SIMPLE_RADIAL_FISHEYE", 4), ("RADIAL_FISHEYE", 5)),
    *(("THIN_PRISM_FISHEYE", 12), ("RAD_TAN_THIN_PRISM_FISHEYE", 16), ("SIMPLE_DIVISION", 4), ("DIVISION", 5)),
    *(("SIMPLE_FISHEYE", 3), ("FISHEYE", 4), ("EUCM", 6), ("EQUIRECTANGULAR", 2)),
)
_HEADER = re.compile(r"\s*#\s*CAMERA_ID\s*,\s*MODEL\s*,\s*WIDTH\s*,\s*HEIGHT", re.M)
_OTHER_TABLES = re.compile(r"\s*#\s*(IMAGE_ID, QW|POINT3D_ID, X|FRAME_ID, RIG_ID|RIG_ID, NUM_SENSORS)", re.M)
_LINE = re.compile(r"\s*\d+\s+[A-Z][A-Z_]+[A-Z]\s+\d+\s+\d+(?:\s|$)")
_ENTRY = struct.Struct("<iiQQ")
_COUNT = struct.Struct("<Q")
_MOST_PX = 1_000_000
_MOST_DIGITS = 20
_HALF_PIXEL = "cx, cy moved by -0.5 px: the center of COLMAP's first pixel is (0.5, 0.5)"


@dataclass(frozen=True, slots=True)
class _Entry:
    """One camera as the file states it."""

    where: str
    model: str
    width: object
    height: object
    parameters: Sequence[float]


def _recognizes(document: Document) -> bool:
    """Whether the text has COLMAP's heading or a line of its form, or the bytes begin as cameras.bin does."""
    if document.text is None:
        return _is_binary(document.content)
    head = document.text[:2000]
    if _HEADER.search(head) or _OTHER_TABLES.search(head):
        return True
    first = next(
        (line for line in document.text.splitlines() if line.strip() and not line.lstrip().startswith("#")), ""
    )
    return _LINE.match(first) is not None


def _is_binary(content: bytes) -> bool:
    if len(content) < _COUNT.size + _ENTRY.size:
        return False
    (count,) = _COUNT.unpack_from(content)
    _, model, width, height = _ENTRY.unpack_from(content, _COUNT.size)
    return (
        0 < count <= len(content) // _ENTRY.size
        and 0 <= model < 100
        and all(0 < side < _MOST_PX for side in (width, height))
    )


def _read(document: Document, camera_name: str | None) -> Reading:
    """Return the camera with the id `camera_name`, or the first."""
    entries = dict(_text_entries(document) if document.text is not None else _binary_entries(document))
    if not entries:
        raise CalibrationError(f"{document.name}: is COLMAP's, and holds no line of a camera; give its cameras.txt.")
    name, notes = choose(list(entries), camera_name, document.name)
    return replace(_reading(entries[name], notes), name=name)


def _text_entries(document: Document) -> Iterator[tuple[str, _Entry]]:
    other = _OTHER_TABLES.search((document.text or "")[:2000])
    if other:
        raise CalibrationError(
            f"{document.name}: is another of COLMAP's tables ({other[1]} ...); give its cameras.txt."
        )
    seen: set[str] = set()
    for number, line in enumerate((document.text or "").splitlines(), 1):
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        where = f"{document.name}, line {number}"
        if len(words) < 4 or len(words[0]) > _MOST_DIGITS:
            raise CalibrationError(
                f"{where}: expected CAMERA_ID MODEL WIDTH HEIGHT PARAMS, got {shown(line.strip())}."
            )
        if words[0] in seen:
            raise CalibrationError(f"{where}: the camera {shown(words[0])} is given twice; remove one of them.")
        seen.add(words[0])
        width, height, *parameters = (_number(word, where) for word in words[2:])
        yield words[0], _Entry(where, words[1], width, height, parameters)


def _number(word: str, where: str) -> float:
    try:
        return float(word)
    except ValueError:
        raise CalibrationError(f"{where}: expected a number, got {shown(word)}.") from None


def _binary_entries(document: Document) -> Iterator[tuple[str, _Entry]]:
    content, where = document.content, document.name
    (count,) = _COUNT.unpack_from(content)
    at = _COUNT.size
    for _ in range(count):
        if at + _ENTRY.size > len(content):
            raise _short(where, count)
        camera_id, model, width, height = _ENTRY.unpack_from(content, at)
        if not 0 <= model < len(_NUMBERED):
            raise CalibrationError(
                f"{where}: camera {camera_id}: has COLMAP's lens model number {model}, unknown to circlepose; "
                "export cameras.txt (colmap model_converter --output_type TXT)."
            )
        name, length = _NUMBERED[model]
        at += _ENTRY.size
        if at + 8 * length > len(content):
            raise _short(where, count)
        parameters = struct.unpack_from(f"<{length}d", content, at)
        at += 8 * length
        yield str(camera_id), _Entry(f"{where}: camera {camera_id}", name, width, height, parameters)
    if at != len(content):
        raise CalibrationError(
            f"{where}: looks like COLMAP's cameras.bin and has {len(content) - at} bytes too many."
        )


def _short(where: str, count: int) -> CalibrationError:
    return CalibrationError(
        f"{where}: looks like COLMAP's cameras.bin of {count} cameras and ends early; copy it again."
    )


def _reading(entry: _Entry, notes: tuple[str, ...]) -> Reading:
    where = entry.where
    if entry.model not in _MODELS:
        lens_model(entry.model, where, "MODEL")
        raise CalibrationError(f"{where}: MODEL: expected one of {', '.join(_MODELS)}, got {shown(entry.model)}.")
    focal, model, names = _MODELS[entry.model]
    expected = [*focal.split(), "cx", "cy", *names]
    given = list(entry.parameters)
    if len(given) != len(expected):
        raise CalibrationError(
            f"{where}: {entry.model} has {len(expected)} parameters ({' '.join(expected)}), got {len(given)}."
        )
    count = len(focal.split())
    fx, fy, (cx, cy) = given[0], given[count - 1], given[count : count + 2]
    dist = given[count + 2 :]
    if model == "fisheye" or dist:
        dist += [0.0] * (4 - len(dist))
    size = numbers.image_size(entry.width, entry.height, where, "WIDTH, HEIGHT")
    matrix = terms.rows(fx, fy, cx - 0.5, cy - 0.5)
    camera = numbers.build_camera(where, ("PARAMS", matrix), ("PARAMS", dist), size, model)
    return Reading(camera, (*notes, _HALF_PIXEL))


FORM = Form("COLMAP cameras", _recognizes, _read)
