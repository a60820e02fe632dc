"""Results as plain values that JSON keeps to the last bit, and back: what a run leaves for another to go on with.

Contours, which are large and in no table, are left out.
"""

from __future__ import annotations

import dataclasses
import math
import types
from collections.abc import Mapping
from enum import Enum
from functools import cache
from typing import Any, TypeVar, Union, cast, get_args, get_origin, get_type_hints

import numpy as np

from circlepose._typing import FloatArray, frozen
from circlepose.geometry.ellipse import Ellipse
from circlepose.results import BoardResult, CircleResult, ImageResult, Status

T = TypeVar("T")

_LEFT_OUT = frozenset({"contour"})
_PLAIN_TYPES: dict[Any, tuple[type, ...]] = {str: (str,), int: (int,), bool: (bool,), float: (float, int)}
"""as which JSON gives values of these types"""
_UNIT = 1e-6
"""How far the length of a normal may be from 1."""


def plain_result(result: ImageResult) -> dict[str, Any]:
    """Return `result`, without contours, as values for JSON; NaN and infinities stay what they are."""
    return cast("dict[str, Any]", _plain(result))


def restored_result(plain: object) -> ImageResult:
    """Return the result that `plain_result` made `plain` of.

    Raises `ValueError` when it is anything else: other names or types, or poses that cannot be.
    """
    try:
        result = cast("ImageResult", _restored(plain, ImageResult))
    except (TypeError, KeyError, AttributeError, OverflowError, RecursionError) as error:
        raise ValueError(f"is no stored result: {error}") from error
    if result.status is Status.OK and not result.circles:
        raise ValueError("circles: there is none, and the status is ok")
    if result.image_size is not None and min(result.image_size) < 1:
        raise ValueError(f"image_size: {result.image_size} is no size")
    for circle in result.circles:
        _check_circle(circle)
    for board in (*result.boards, *((result.world,) if result.world else ())):
        _check_board(board)
    return result


def _check_board(board: BoardResult) -> None:
    if not 0 <= board.chosen < len(board.candidates) or board.instance < 0:
        raise ValueError(f"chosen: there is no candidate {board.chosen} of board {board.instance}")
    if not 0.0 <= board.ambiguity <= 1.0:
        raise ValueError(f"ambiguity: {board.ambiguity} is no probability")
    if not -1.0 < board.growth < math.inf:
        raise ValueError(f"growth: {board.growth} is no share of a radius")
    for pose in board.candidates:
        _check_matrix("rotation", pose.rotation, 3)
        if np.abs(pose.rotation @ pose.rotation.T - np.eye(3)).max() > _UNIT or np.linalg.det(pose.rotation) < 0.0:
            raise ValueError(f"rotation: {pose.rotation.tolist()} is no rotation")
        if pose.translation.shape != (3,) or not np.isfinite(pose.translation).all():
            raise ValueError(f"translation: expected 3 finite numbers, got {pose.translation.tolist()}")
        _check_matrix("covariance", pose.covariance, 6)
        for term in (pose.terms.image, pose.terms.camera, pose.terms.radius):
            if term is not None:
                _check_matrix("terms", term, 6)
    for circle in board.circles:
        if circle.residual_px.shape != (2,):
            raise ValueError(f"residual_px: expected 2 numbers, got {circle.residual_px.tolist()}")


def _check_circle(circle: CircleResult) -> None:
    if (circle.status is Status.OK) != bool(circle.candidates) or circle.instance < 0:
        number = len(circle.candidates)
        raise ValueError(f"status: {circle.status} of circle {circle.instance} has {number} candidates")
    for name in ("residual_px", "rim_used", "score"):
        number = getattr(circle, name)
        if number is not None and not 0.0 <= number < math.inf:
            raise ValueError(f"{name}: {number} cannot be")
    if circle.ellipse is not None:
        _check_ellipse(circle.ellipse)
    if circle.cone is not None:
        _check_matrix("factor", circle.cone.factor, 3)
        if circle.cone.modes_covariance is not None:
            _check_matrix("modes_covariance", circle.cone.modes_covariance, 5)
    if circle.candidates and not 0 <= circle.chosen < len(circle.candidates):
        raise ValueError(f"chosen: there is no candidate {circle.chosen}")
    if not (0.0 <= circle.ambiguity <= 1.0):
        raise ValueError(f"ambiguity: {circle.ambiguity} is no probability")
    if not (0.0 < circle.radius_mm < math.inf):
        raise ValueError(f"radius_mm: {circle.radius_mm} is no radius")
    for candidate in circle.candidates:
        for name, length in (("center", 3), ("normal", 3), ("imaged_center", 2)):
            values = getattr(candidate, name)
            if values.shape != (length,) or not np.isfinite(values).all():
                raise ValueError(f"{name}: expected {length} finite numbers, got {values.tolist()}")
        if abs(float(np.linalg.norm(candidate.normal)) - 1.0) > _UNIT:
            raise ValueError(f"normal: {candidate.normal.tolist()} is no unit vector")
        if float(candidate.normal @ candidate.center) > _UNIT * float(np.linalg.norm(candidate.center)):
            raise ValueError("normal: leads away from the camera")
        covariance = candidate.covariance
        if covariance is not None and (
            covariance.shape != (5, 5) or not np.isfinite(covariance).all() or covariance.diagonal().min() < 0.0
        ):
            raise ValueError("covariance: expected 5 rows of 5 finite numbers, none negative in the diagonal")


def _check_matrix(name: str, matrix: FloatArray, size: int) -> None:
    if matrix.shape != (size, size) or not np.isfinite(matrix).all():
        raise ValueError(f"{name}: expected {size} rows of {size} finite numbers")


def _check_ellipse(ellipse: Ellipse) -> None:
    shapes = {"center": (2,), "semi_major": (), "semi_minor": (), "angle": ()}
    for name, shape in shapes.items():
        values = np.asarray(getattr(ellipse, name))
        if values.shape != shape or not np.isfinite(values).all():
            raise ValueError(f"{name}: expected finite numbers of the shape {shape}")
    if not 0.0 <= float(ellipse.semi_minor) <= float(ellipse.semi_major):
        raise ValueError("semi_minor: expected at most the semi-major axis")


def _plain(value: Any) -> Any:
    if isinstance(value, Enum):
        return value.value
    if dataclasses.is_dataclass(value):
        names = (field.name for field in dataclasses.fields(value))
        return {name: _plain(getattr(value, name)) for name in names if name not in _LEFT_OUT}
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    if isinstance(value, (tuple, list)):
        return [_plain(each) for each in value]
    if isinstance(value, Mapping):
        return {str(key): _plain(each) for key, each in value.items()}
    if value is None or isinstance(value, (str, int, float)):
        return value
    raise TypeError(f"a {type(value).__name__} cannot be stored")


def _restored(plain: Any, kind: Any) -> Any:
    """Return `plain` as the annotated type `kind` says."""
    origin, arguments = get_origin(kind), get_args(kind)
    if origin in {Union, types.UnionType}:
        if plain is None:
            return None
        (kind,) = (each for each in arguments if each is not type(None))
        return _restored(plain, kind)
    if origin is tuple:
        return _restored_tuple(plain, arguments)
    if kind == FloatArray:
        # Which of NumPy's releases decides what `get_origin` makes of it.
        return frozen(plain)
    if origin is Mapping:
        if not isinstance(plain, dict):
            raise TypeError(f"expected names and values, got {plain!r:.40}")
        return {key: _restored(each, arguments[1]) for key, each in plain.items()}
    if kind in _PLAIN_TYPES:
        if type(plain) not in _PLAIN_TYPES[kind]:
            raise TypeError(f"expected {kind.__name__}, got {plain!r:.40}")
        return plain
    if dataclasses.is_dataclass(kind):
        hints = _hints(cast("type", kind))
        if not isinstance(plain, dict):
            raise TypeError(f"expected the values of a {cast('type', kind).__name__}, got {plain!r:.40}")
        return cast("type", kind)(**{name: _restored(each, hints[name]) for name, each in plain.items()})
    if isinstance(kind, type) and issubclass(kind, Enum):
        return kind(plain)
    raise TypeError(f"a {kind} cannot be restored")


def _restored_tuple(plain: Any, arguments: tuple[Any, ...]) -> tuple[Any, ...]:
    if not isinstance(plain, list):
        raise TypeError(f"expected a list, got {plain!r:.40}")
    if arguments[1:] == (Ellipsis,):
        return tuple(_restored(each, arguments[0]) for each in plain)
    if len(plain) != len(arguments):
        raise TypeError(f"expected {len(arguments)} values, got {len(plain)}")
    return tuple(map(_restored, plain, arguments))


@cache
def _hints(kind: type) -> dict[str, Any]:
    return get_type_hints(kind)
