"""From the keys of one camera, whatever their spelling, to the camera: what each means, and that they agree."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence

from circlepose._arguments import shown
from circlepose._typing import FloatArray
from circlepose.camera.camera import Camera
from circlepose.errors import CalibrationError
from circlepose.io.calibration import distortion, numbers, terms
from circlepose.io.calibration.form import Reading
from circlepose.io.calibration.keys import (
    COEFFICIENTS,
    Field,
    is_matrix,
    looks_like_distortion,
    near_name,
    pair_of,
)
from circlepose.io.calibration.leftovers import is_something, refuse_order, refuse_unused
from circlepose.io.calibration.lens_models import plain
from circlepose.io.calibration.text_values import check_text
from circlepose.io.text.validation import brief, some_keys

_Fields = Sequence[Field]
_HOW_MATRIX = "give camera_matrix, or all of fx, fy, cx, cy in px"
_HARMLESS = ("name", "cameraname", "id", "cameraid", "serial", "serialnumber")
"""by which a camera is asked for"""
FROM_ONE = "if MATLAB wrote it, subtract 1 from cx and cy: MATLAB counts pixels from (1, 1)"
"""remark on a camera matrix that stands column by column"""
_OF_COLMAP = ("PINHOLE", "OPENCV", "FULL_OPENCV", "OPENCV_FISHEYE")
_COLMAP = "if COLMAP wrote it, subtract 0.5 from cx and cy: the center of COLMAP's first pixel is (0.5, 0.5)"
_OF_OTHER_IMAGES = re.compile(
    r"(?:new|optimal|optim|rectified|rect|undistorted)(?:optimal)?(?:camera|cam|intrinsics?)?(?:matrix|mtx|k|roi|size)"
)
"""camera matrices of the images that were undistorted with this calibration"""
_MOST_COMPARED = 500
"""A key is compared with those that we know in 0.2 ms."""
_EXPECTED = {
    **dict.fromkeys(("matrix", "cameramatrix", "intrinsics"), "[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]"),
    **dict.fromkeys(
        ("distortion", "distcoeffs", "distortioncoefficients"), "[k1, k2, p1, p2, k3], or [] for no distortion"
    ),
    "radial": "[k1, k2, k3]",
    "tangential": "[p1, p2]",
    "shape": "[height, width] in px",
    **dict.fromkeys(("size", "imagesize"), "[width, height] in px"),
    **dict.fromkeys(("model", "cameramodel", "distortionmodel"), "the name of a lens model, such as pinhole"),
}
"""by role, and by key"""
_NEAR_CENTER, _OFF_CENTER = 0.05, 0.08
"""Offsets of the principal point, as shares of the image's size: where a size is surely (height, width)."""


def assemble(fields: _Fields, where: str, *, is_storage: bool = False) -> Reading:
    """Return the camera that its keys describe; raises `CalibrationError`: file, key, what is expected, what to do.

    Files of OpenCV (`is_storage`) hold much else, which is not remarked on; and where they lack the coefficients,
    another file has them.
    """
    _check_empty(fields, where)
    _check_unknown(fields, where)
    matrix_key, matrix, notes = _matrix(fields, where)
    model = distortion.stated_model(fields, where)
    dist_key, dist, said = distortion.coefficients(fields, where, model, is_needed=is_storage)
    size, turned = _size(fields, where, matrix)
    notes += said + turned
    camera = numbers.build_camera(where, (matrix_key, matrix), (dist_key, dist), size, model or "pinhole")
    refuse_order(fields, where, camera)
    unread = [each for each in fields if not each.role]
    refuse_unused(unread, where, camera, is_model_stated=model is not None)
    if camera.camera_matrix[0, 1]:
        notes += (f"the skew of {camera.camera_matrix[0, 1]:g} px is used: x = fx u + skew v + cx",)
    if any(each.role == "model" and each.value in _OF_COLMAP for each in fields):
        notes += (_COLMAP,)
    unused = [each.path for each in unread if each.name not in _HARMLESS]
    if unused and not is_storage:
        notes += (f"not used: {some_keys(unused)}",)
    errors = {each.path: numbers.number(each.value, where, each.path) for each in fields if each.role == "error"}
    keys = {"camera_matrix": matrix_key, "dist_coeffs": dist_key}
    return Reading(_with_sigma(camera, fields, where), notes, keys, errors)


def _check_empty(fields: _Fields, where: str) -> None:
    for field in fields:
        if field.value is None and field.role and field.role != "target":
            raise CalibrationError(
                f"{where}: {field.path}: has no value; expected {_EXPECTED.get(field.role, 'a number')}."
            )


def _check_unknown(fields: _Fields, where: str) -> None:
    """Refuse keys that nothing is done with though they seem to matter."""
    compared = 0
    for field in fields:
        key = field.path.rpartition(".")[2]
        if field.role == "stray" and is_something(field.value):
            raise CalibrationError(
                f"{where}: {field.path}: it is not clear of which camera this distortion is; put it to the keys of "
                "its camera, or name it as the camera matrix is named (K1, D1)."
            )
        check_text(field, where, _EXPECTED)
        if field.role or _OF_OTHER_IMAGES.fullmatch(field.name):
            continue
        if looks_like_distortion(field) and is_something(field.value):
            near = near_name(key, 0.7) if is_matrix(field.value) else None
            hint = (
                f"did you mean {near}?"
                if near
                else f"expected dist_coeffs, or {', '.join(COEFFICIENTS[:5])}; rename it so, or remove it."
            )
            raise CalibrationError(
                f"{where}: {brief(field.path)}: is no known key and looks like distortion "
                f"({shown(field.value)}); {hint}"
            )
        compared += 1
        near = near_name(key) if compared <= _MOST_COMPARED else None
        if near is not None and plain(near) == field.name:
            expected = _EXPECTED.get(field.name, "another value")
            raise CalibrationError(
                f"{where}: {field.path}: expected {expected}, got {shown(field.value)}; correct it."
            )
        if near is not None:
            raise CalibrationError(f"{where}: {brief(field.path)}: is no known key; did you mean {near}?")


# --- The camera matrix ---


def _matrix(fields: _Fields, where: str) -> tuple[str, FloatArray | list[list[float]], tuple[str, ...]]:
    stated = [each for each in fields if each.role == "matrix"]
    _check_one(stated, where)
    parts = _parts(fields, where)
    if not stated:
        missing = [name for name in ("fx", "fy", "cx", "cy") if name not in parts]
        if missing:
            found = some_keys(each.path for each in fields)
            raise CalibrationError(f"{where}: {_missing(missing)}: missing; {_HOW_MATRIX}; found {found}.")
        return ", ".join(dict.fromkeys([parts["fx"][0], parts["fy"][0]])), _square(parts), ()
    field = stated[0]
    four = _four(field, where)
    if four is not None:
        matrix: FloatArray | list[list[float]] = terms.rows(*four)
        notes: tuple[str, ...] = ()
    else:
        matrix, notes = numbers.turned_matrix(field.value, where, field.path)
        notes += (FROM_ONE,) if notes else ()
    places = {"fx": (0, 0), "fy": (1, 1), "cx": (0, 2), "cy": (1, 2)}
    for name, (key, value) in parts.items():
        if name in places and not math.isclose(value, float(matrix[places[name][0]][places[name][1]]), rel_tol=1e-6):
            raise CalibrationError(
                f"{where}: {key}: contradicts {field.path}; give either {field.path} or fx, fy, cx, cy, not both."
            )
    return field.path, matrix, notes


def _four(field: Field, where: str) -> list[float] | None:
    """Return fx, fy, cx, cy where a key such as `intrinsics` has these four numbers in place of a matrix."""
    value = field.value
    if isinstance(value, Mapping):
        value = value.get("data")
    if not isinstance(value, list) or len(value) != 4 or any(isinstance(each, list) for each in value):
        return None
    return numbers.number_list(value, where, field.path) if "intrinsic" in plain(field.path) else None


def _missing(names: Iterable[str]) -> str:
    names = list(names)
    return "camera_matrix" if len(names) == 4 else ", ".join(names)


def _parts(fields: _Fields, where: str) -> dict[str, tuple[str, float]]:
    """Return fx, fy, cx, cy and the skew, as far as they stand by themselves: each with its key."""
    parts: dict[str, tuple[str, float]] = {}
    for role in ("fx", "fy", "cx", "cy", "skew", "alpha"):
        stated = [each for each in fields if each.role == role]
        _check_one(stated, where)
        for field in stated:
            parts[role] = field.path, numbers.number(field.value, where, field.path)
    for role, names in (("focal", ("fx", "fy")), ("center", ("cx", "cy"))):
        stated = [each for each in fields if each.role == role]
        if not stated or any(name in parts for name in names):
            continue
        _check_one(stated, where)
        value, key = stated[0].value, stated[0].path
        pair = numbers.number_list(value if isinstance(value, list) else [value, value], where, key, 2)
        parts |= {name: (key, each) for name, each in zip(names, pair, strict=True)}
    return parts


def _square(parts: Mapping[str, tuple[str, float]]) -> list[list[float]]:
    fx, fy, cx, cy = (parts[name][1] for name in ("fx", "fy", "cx", "cy"))
    skew = parts["skew"][1] if "skew" in parts else parts["alpha"][1] * fx if "alpha" in parts else 0.0
    return terms.rows(fx, fy, cx, cy, skew)


def _check_one(stated: _Fields, where: str) -> None:
    if len(stated) > 1:
        raise CalibrationError(f"{where}: {stated[0].path}, {stated[1].path}: mean the same; remove one of them.")


# --- The image size, and how well the camera is known ---


def _size(
    fields: _Fields, where: str, matrix: FloatArray | list[list[float]]
) -> tuple[tuple[int, int] | None, tuple[str, ...]]:
    """Return the image's (width, height) and a remark where it stood as (height, width)."""
    found: list[tuple[str, tuple[int, int]]] = []
    notes: tuple[str, ...] = ()
    widths = [each for each in fields if each.role == "width"]
    heights = [each for each in fields if each.role == "height"]
    if len(widths) != len(heights):
        (alone,) = (widths or heights)[:1]
        other = "height" if widths else "width"
        raise CalibrationError(f"{where}: {alone.path}: stands without the image's {other}; give both, in px.")
    for width, height in zip(widths, heights, strict=True):
        key = f"{width.path}, {height.path}"
        found.append((key, numbers.image_size(width.value, height.value, where, key)))
    for field in fields:
        if field.role not in ("size", "shape"):
            continue
        first, second = _pair(field, where)
        size = numbers.image_size(first, second, where, field.path)
        is_turned = field.role == "shape" or is_height_first(size, matrix)
        if is_turned:
            size = size[1], size[0]
            why = "as NumPy's shape" if field.role == "shape" else "as the principal point shows"
            notes += (f"{field.path} is (height, width), {why}: the image has {size[0]} x {size[1]} px",)
        found.append((field.path, size))
    for key, size in found[1:]:
        if size != found[0][1]:
            one, other = (f"{width} x {height}" for width, height in (found[0][1], size))
            raise CalibrationError(
                f"{where}: {found[0][0]}, {key}: contradict each other ({one}, {other} px); keep the size of the "
                "images that were calibrated."
            )
    return (found[0][1] if found else None), notes


def _pair(field: Field, where: str) -> tuple[object, object]:
    value = field.value
    if isinstance(value, str):
        value = pair_of(value)
    if isinstance(value, Mapping):
        value = numbers.coefficients(value, where, field.path)
    if field.role == "shape" and isinstance(value, list) and len(value) == 3:
        # The third is the number of channels.
        value = value[:2]
    first, second = numbers.number_list(value, where, field.path, 2)
    return first, second


def is_height_first(size: tuple[int, int], matrix: FloatArray | list[list[float]]) -> bool:
    """Return whether the principal point is in the middle of (height, width), and far from that of `size`."""
    point = float(matrix[0][2]), float(matrix[1][2])

    def offsets(width: int, height: int) -> list[float]:
        return [abs(place - 0.5 * (side - 1)) / side for place, side in zip(point, (width, height), strict=True)]

    return max(offsets(size[1], size[0])) < _NEAR_CENTER and min(offsets(*size)) > _OFF_CENTER


def _with_sigma(camera: Camera, fields: _Fields, where: str) -> Camera:
    """Add how well the camera is known, where the file says it: the larger of both axes."""
    sigma = {"focal_sigma": 0.0, "center_sigma": 0.0}
    for field in fields:
        if field.role in sigma:
            sigma[field.role] = numbers.number(field.value, where, field.path)
        elif field.role == "deviation" and is_matrix(field.value):
            # Of fx, fy, cx, cy, as OpenCV's interactive calibration writes them; one that was kept fixed is 0 there.
            values = numbers.coefficients(field.value, where, field.path)
            if len(values) != 4 or not all(0.0 <= value < math.inf for value in values):
                raise CalibrationError(
                    f"{where}: {field.path}: expected the standard deviations of fx, fy, cx, cy, 4 numbers of 0 or "
                    "more."
                )
            sigma = {"focal_sigma": max(values[:2]), "center_sigma": max(values[2:])}
    if not any(sigma.values()):
        return camera
    return numbers.with_sigma(camera, where, sigma["focal_sigma"], sigma["center_sigma"])
