"""`.npz` and `.npy` of those who calibrate with cv2.calibrateCamera and save mtx and dist with NumPy."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence

import numpy as np

from circlepose._typing import FloatArray
from circlepose.camera.camera import Camera, LensModel
from circlepose.camera.plausibility import reprojection_doubts
from circlepose.errors import CalibrationError
from circlepose.io.calibration import numbers
from circlepose.io.calibration.assembly import is_height_first
from circlepose.io.calibration.document import Document
from circlepose.io.calibration.form import Form, Reading, choose
from circlepose.io.calibration.leftovers import refuse_leftovers
from circlepose.io.calibration.lens_models import lens_model, plain
from circlepose.io.calibration.numpy_file import ARRAY, MOST_BYTES, SAVE_ANEW, ZIP, Archive, array_of, members
from circlepose.io.text.validation import some_keys

_MOST_CHECKED = 200
_LARGEST_CHECKED = 100
_LEAST = 4
"""numbers of a matrix, or of coefficients; K1 with one number is no matrix"""
# Names are compared in lower case without separators.
_MATRIX = re.compile(
    r"(?P<start>left|right)?(?:(?:camera|cam|c|intrinsic)?(?:matrix|mat|mtx)|k|m|intrinsics?|cammatrix)"
    r"(?P<end>[0-9]|l|r|left|right|cam[0-9])?"
)
_DIST = re.compile(
    r"(?P<start>left|right)?(?:dist(?:ortions?)?(?:coefs?|coeffs?|coefficients?)?|d)"
    r"(?P<end>[0-9]|l|r|left|right|cam[0-9])?"
)
_MODEL = re.compile(r"(?:is)?fisheye(?:model)?|(?:camera|lens|distortion|dist)?model(?:type)?")
_SIZE = re.compile(r"(?:image|img|frame)?size|(?:image|img|camera)?resolution")
_SHAPE = re.compile(r"(?:image|img|frame|gray)?shape")
_RMS = re.compile(r"ret|retval|rms|(?:mean|avg|total)?(?:reproj(?:ection)?)?err(?:or)?|rmserr(?:or)?")


def _recognizes(document: Document) -> bool:
    """Whether the content is a NumPy array, or a zip archive of such."""
    content = document.content
    return content.startswith(ARRAY) or (content.startswith(ZIP) and bool(members(content)))


def _read(document: Document, camera_name: str | None) -> Reading:
    """Return the camera of an archive; `camera_name` picks one of several, by its matrix (`K2`) or number (`2`)."""
    where = document.name
    if document.content.startswith(ARRAY):
        raise _lone_array(document)
    names = members(document.content)
    if names == {"": ""}:
        raise CalibrationError(f"{where}: looks like a NumPy archive (.npz) and is damaged; copy it again.")
    archive = Archive(where, document.content, names)
    matrices = _keys(names, _MATRIX, where)
    if not matrices:
        raise CalibrationError(
            f"{where}: holds no camera matrix (mtx, K, camera_matrix); found {some_keys(names)}; {SAVE_ANEW}."
        )
    end, notes = _chosen(matrices, camera_name, where)
    matrix_key = matrices[end]
    dist_keys = _keys(names, _DIST, where)
    if end not in dist_keys:
        raise CalibrationError(
            f"{where}: holds {matrix_key} and no lens coefficients for it (dist, D, dist_coeffs); "
            f"found {some_keys(names)}; {SAVE_ANEW}, with D = np.zeros(5) for a lens without distortion."
        )
    return _reading(archive, matrix_key, dist_keys[end], notes)


def _reading(archive: Archive, matrix_key: str, dist_key: str, notes: tuple[str, ...]) -> Reading:
    where = archive.where
    matrix, turned = numbers.turned_matrix(_numbers(archive, matrix_key).tolist(), where, matrix_key)
    dist = [float(each) for each in _numbers(archive, dist_key).ravel()]
    model, model_key = _model(archive)
    size, converted = _size(archive, matrix)
    if model_key is None and len(dist) == 4 and any(dist):
        notes += (
            "the 4 coefficients are taken for a pinhole lens (k1 k2 p1 p2); for a fisheye lens save fisheye=True too",
        )
    camera = numbers.build_camera(where, (matrix_key, matrix), (dist_key, dist), size, model)
    used = [matrix_key, dist_key, *([model_key] if model_key is not None else [])]
    _check_rest(archive, used, camera, is_model_stated=model_key is not None)
    return Reading(camera, (*notes, *turned, *converted, *_rms_notes(archive, camera)))


def _keys(names: Mapping[str, str], pattern: re.Pattern[str], where: str) -> dict[str, str]:
    """Return the arrays whose names match, by the side or the number of the camera in the name."""
    found: dict[str, str] = {}
    for name in names:
        match = pattern.fullmatch(plain(name))
        if match is None:
            continue
        end = (match["start"] or match["end"] or "").removeprefix("cam")
        end = {"l": "left", "r": "right"}.get(end, end)
        if end in found:
            raise CalibrationError(f"{where}: {found[end]}, {name}: mean the same; keep one of them.")
        found[end] = name
    return found


def _chosen(matrices: Mapping[str, str], camera_name: str | None, where: str) -> tuple[str, tuple[str, ...]]:
    ends = sorted(matrices)
    if camera_name is not None and camera_name.lower() in ends:
        return camera_name.lower(), ()
    name, notes = choose([matrices[end] for end in ends], camera_name, where)
    return next(end for end in ends if matrices[end] == name), notes


def _numbers(archive: Archive, name: str) -> np.ndarray:
    array = archive.array(name)
    if array.dtype.kind not in "fiu":
        raise CalibrationError(f"{archive.where}: {name}: expected numbers, got an array of {array.dtype}.")
    return array.astype(np.float64)


def _check_rest(archive: Archive, used: Sequence[str], camera: Camera, *, is_model_stated: bool) -> None:
    """Refuse arrays that change the camera and are not used; large ones are points and images."""
    rest: dict[str, object] = {}
    for name in list(archive.names)[:_MOST_CHECKED]:
        if name in used:
            continue
        # Of another camera.
        is_other = any(pattern.fullmatch(plain(name)) for pattern in (_MATRIX, _DIST))
        try:
            array = archive.array(name)
        except CalibrationError:
            continue
        if array.size <= _LARGEST_CHECKED and not (is_other and array.size >= _LEAST):
            values = array.ravel().tolist()
            rest[name] = values[0] if array.size == 1 and array.ndim == 0 else values
    refuse_leftovers(rest, (), archive.where, camera, is_model_stated=is_model_stated)


def _model(archive: Archive) -> tuple[LensModel, str | None]:
    """Return the lens model and the name of the array that states it."""
    for name in archive.names:
        if _MODEL.fullmatch(plain(name)):
            value = archive.array(name).ravel()
            if value.size != 1:
                raise CalibrationError(f"{archive.where}: {name}: expected one name of a lens model.")
            word = value[0].item()
            if isinstance(word, int | float) and word in (0, 1):
                return ("fisheye" if word else "pinhole"), name
            return lens_model(word, archive.where, name), name
    return "pinhole", None


def _size(archive: Archive, matrix: FloatArray) -> tuple[tuple[int, int] | None, tuple[str, ...]]:
    """Return the image size (width, height) and what was converted."""
    where = archive.where
    for name in archive.names:
        if _SIZE.fullmatch(plain(name)):
            width, height = _lengths(archive, name, (2,))
            size = numbers.image_size(width, height, where, name)
            if not is_height_first(size, matrix):
                return size, ()
            turned = f"the image has {size[1]} x {size[0]} px"
            return size[::-1], (f"{name} is (height, width), as the principal point shows: {turned}",)
    plains = {plain(name): name for name in archive.names}
    for prefix in ("image", "img", "frame", ""):
        keys = [plains.get(f"{prefix}{side}") for side in ("width", "height")]
        if keys[0] is not None and keys[1] is not None:
            (width,), (height,) = _lengths(archive, keys[0], (1,)), _lengths(archive, keys[1], (1,))
            return numbers.image_size(width, height, where, f"{keys[0]}, {keys[1]}"), ()
    if "w" in plains and "h" in plains:
        (width,), (height,) = _lengths(archive, plains["w"], (1,)), _lengths(archive, plains["h"], (1,))
        return numbers.image_size(width, height, where, "w, h"), ()
    for name in archive.names:
        if _SHAPE.fullmatch(plain(name)):
            height, width, *_ = _lengths(archive, name, (2, 3))
            note = f"{name} is taken as NumPy's (height, width): the image is {width:g} x {height:g}"
            return numbers.image_size(width, height, where, name), (note,)
    return None, ()


def _lengths(archive: Archive, name: str, counts: Sequence[int]) -> list[float]:
    values = [float(each) for each in _numbers(archive, name).ravel()]
    if len(values) not in counts:
        raise CalibrationError(f"{archive.where}: {name}: expected {counts[0]} numbers, got {len(values)}.")
    return values


def _rms_notes(archive: Archive, camera: Camera) -> tuple[str, ...]:
    """Return what the reprojection error says, which calibrateCamera returns first and many store as `ret`."""
    for name in archive.names:
        if _RMS.fullmatch(plain(name)):
            array = archive.array(name)
            if array.dtype.kind == "f" and array.size == 1 and math.isfinite(float(array.ravel()[0])):
                return tuple(
                    f"{name}: {doubt.text}" for doubt in reprojection_doubts(float(array.ravel()[0]), camera)
                )
    return ()


def _lone_array(document: Document) -> CalibrationError:
    array = array_of(document.content[: MOST_BYTES + 1], document.name)
    what = (
        "a 3 x 3 matrix alone, without the lens coefficients"
        if array.shape == (3, 3)
        else (f"one array of shape {' x '.join(map(str, array.shape)) or 'none'}, which is not a whole calibration")
    )
    return CalibrationError(
        f"{document.name}: holds {what}; save both in one file: np.savez('camera.npz', K=K, D=D, "
        "image_size=[width, height]), with D = np.zeros(5) for a lens without distortion."
    )


FORM = Form("NumPy arrays", _recognizes, _read)
