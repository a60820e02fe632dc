"""Numbers and matrices out of calibration files, in the shapes in which the tools write them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from circlepose._arguments import shown
from circlepose._typing import FloatArray
from circlepose.camera.camera import Camera, CameraSigma, LensModel
from circlepose.errors import CalibrationError
from circlepose.io.text.validation import REMOVE_QUOTES, is_number_in_quotes


def number(value: object, where: str, key: str) -> float:
    """Return one number; raises `CalibrationError` naming file and key."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        hint = REMOVE_QUOTES if is_number_in_quotes(value) else ""
        raise CalibrationError(f"{where}: {key}: expected a number, got {shown(value)}{hint}.")
    try:
        return float(value)
    except OverflowError:
        raise CalibrationError(f"{where}: {key}: holds a number that is too large.") from None


def number_list(value: object, where: str, key: str, length: int | None = None) -> list[float]:
    """Return a flat list of numbers, of `length` if that is given."""
    if not isinstance(value, Sequence) or isinstance(value, str):
        hint = "; write it as a list, [...], without quotes" if isinstance(value, str) else ""
        raise CalibrationError(f"{where}: {key}: expected a list of numbers, got {shown(value)}{hint}.")
    if length is not None and len(value) != length:
        raise CalibrationError(f"{where}: {key}: expected {length} numbers, got {len(value)}.")
    return [number(each, where, key) for each in value]


def camera_matrix(value: object, where: str, key: str) -> FloatArray:
    """Return a 3 x 3 matrix from {rows, cols, data}, from nested lists or from 9 numbers row by row."""
    grid = _grid(value, where, key)
    if grid.shape in {(1, 9), (9, 1)}:
        grid = grid.reshape(3, 3)
    if grid.shape != (3, 3):
        raise CalibrationError(f"{where}: {key}: expected a 3 x 3 matrix, got {grid.shape[0]} x {grid.shape[1]}.")
    if not grid.any():
        raise CalibrationError(f"{where}: {key}: is all zeros, as of a camera never calibrated; calibrate it.")
    return grid


def turned_matrix(value: object, where: str, key: str) -> tuple[FloatArray, tuple[str, ...]]:
    """Return a camera matrix as `camera_matrix` does, and a remark where it stood transposed (column by column)."""
    grid = camera_matrix(value, where, key)
    is_upper = not grid[2, :2].any()
    if is_upper or grid[:2, 2].any():
        return grid, ()
    return grid.T.copy(), (f"{key} stands column by column, with (0, 0, 1) as its last column; it was transposed",)


def coefficients(value: object, where: str, key: str) -> list[float]:
    """Return lens coefficients from {rows, cols, data}, a list, or nested lists of one row or one column."""
    if isinstance(value, list) and not value:
        return []
    grid = _grid(value, where, key)
    if grid.size and min(grid.shape) != 1:
        raise CalibrationError(
            f"{where}: {key}: expected one row or one column of coefficients, got {grid.shape[0]} x {grid.shape[1]}."
        )
    return [float(each) for each in grid.ravel()]


def image_size(width: object, height: object, where: str, key: str) -> tuple[int, int]:
    """Return (width, height) in px."""
    numbers = [number(width, where, key), number(height, where, key)]
    if any(not each.is_integer() or each < 1.0 for each in numbers):
        raise CalibrationError(f"{where}: {key}: expected a positive width and height in px, got {numbers}.")
    return int(numbers[0]), int(numbers[1])


def build_camera(
    where: str,
    matrix: tuple[str, object],
    dist: tuple[str, object],
    size: tuple[int, int] | None,
    model: LensModel,
) -> Camera:
    """Build the camera from (key in the file, value) pairs, so that messages carry the file's own keys."""
    try:
        return Camera.create(matrix[1], dist[1], size, model)
    except CalibrationError as reason:
        text = str(reason)
        for ours, theirs in (("camera_matrix:", matrix[0]), ("dist_coeffs:", dist[0]), ("image_size:", "image size")):
            text = text.replace(ours, f"{theirs}:")
        raise CalibrationError(f"{where}: {text}") from None


def with_sigma(camera: Camera, where: str, focal_px: float, center_px: float) -> Camera:
    """Return `camera` with standard deviations of its focal length and principal point, px."""
    try:
        return replace(camera, sigma=CameraSigma(focal_px, center_px))
    except CalibrationError as reason:
        raise CalibrationError(f"{where}: {reason}") from None


def _grid(value: object, where: str, key: str) -> FloatArray:
    if isinstance(value, Mapping):
        return _grid_of_mapping(value, where, key)
    if not isinstance(value, list) or not value:
        raise CalibrationError(f"{where}: {key}: expected a matrix or a list of numbers, got {shown(value)}.")
    if not isinstance(value[0], list):
        return np.array([number_list(value, where, key)])
    rows = [number_list(row, where, key, len(value[0])) for row in value]
    return np.array(rows, dtype=np.float64)


def _grid_of_mapping(value: Mapping[str, object], where: str, key: str) -> FloatArray:
    rows, cols = _shape_of_mapping(value, where, key)
    data = number_list(value.get("data"), where, f"{key}.data")
    if not (rows.is_integer() and cols.is_integer() and rows >= 0.0 and rows * cols == len(data)):
        raise CalibrationError(
            f"{where}: {key}: {rows:g} rows of {cols:g} columns need {rows * cols:g} numbers, data has {len(data)}."
        )
    return np.array(data, dtype=np.float64).reshape(int(rows), int(cols))


def _shape_of_mapping(value: Mapping[str, object], where: str, key: str) -> tuple[float, float]:
    sizes = value.get("sizes")
    if sizes is not None:
        # OpenCV 5 writes a vector as an array of one size; XML does not distinguish one number from a list of one.
        lengths = number_list(sizes if isinstance(sizes, list) else [sizes], where, f"{key}.sizes")
        if len(lengths) not in {1, 2}:
            raise CalibrationError(f"{where}: {key}: expected a matrix or a vector, got {len(lengths)} sizes.")
        return lengths[0], lengths[1] if len(lengths) == 2 else 1.0
    for name in ("rows", "cols", "data"):
        if name not in value:
            raise CalibrationError(f"{where}: {key}: a matrix has rows, cols and data; {name} is missing.")
    return number(value["rows"], where, f"{key}.rows"), number(value["cols"], where, f"{key}.cols")
