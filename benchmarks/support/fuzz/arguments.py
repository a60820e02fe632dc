"""Calls of the library with odd arguments: each a result, or one documented error of one sentence."""

from __future__ import annotations

import datetime
import decimal
import fractions
import inspect
import io
import itertools
import pathlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from enum import EnumMeta
from functools import cache
from importlib.util import find_spec

import cv2
import numpy as np

import circlepose
from benchmarks.support.fuzz.formats import Format
from benchmarks.support.fuzz.mutations import Rng, generator
from circlepose import Camera, CameraSigma, CircleposeError, DirectionHint, Target
from circlepose._arguments import shown
from circlepose.board_result import BoardPose, BoardResult, BoardTerms
from circlepose.detection import EXTRACTIONS
from circlepose.disambiguation.options import DisambiguationOptions
from circlepose.measurement.options import MeasurementOptions
from circlepose.rings.options import RingOptions
from circlepose.solvers import METHODS

MOST_CHARACTERS = 600
"""of a message"""


@dataclass(frozen=True, slots=True)
class Call:
    """One call of the library, with sound arguments."""

    function: Callable[..., object]
    sound: Callable[[], dict[str, object]]
    """returns arguments anew by name"""


def formats() -> Mapping[str, Format]:
    """Return all calls by name, as `fuzz.fuzz` takes them: what is read is the text of the odd arguments."""
    return {f"call of {name}": _as_format(f"call of {name}", call) for name, call in calls().items()}


def calls() -> Mapping[str, Call]:
    """Return all calls that are fuzzed by name."""
    return {
        "estimate": Call(circlepose.estimate, lambda: {**_of_estimate(), "world_board": None}),
        "estimate_from_contour": Call(circlepose.estimate_from_contour, _of_contour),
        "estimate_from_ellipse": Call(circlepose.estimate_from_ellipse, _of_ellipse),
        "explain": Call(_explained, _of_estimate),
        "inspect": Call(circlepose.inspect, _of_inspect),
        "measure": Call(_measured_files, _of_measure),
        "read_image": Call(circlepose.read_image, lambda: {"path": str(_PHOTOGRAPH)}),
        "draw_overlay": Call(circlepose.draw_overlay, _of_overlay),
        "to_rows": Call(circlepose.to_rows, lambda: {"results": [_result()]}),
        "relative_to_world": Call(circlepose.relative_to_world, _of_relative),
        "to_dataframe": Call(_as_frame, lambda: {"results": [_result()]}),
        "Camera.create": Call(_measured_by, _of_camera),
        "Camera": Call(_measured_by_own, _of_own_camera),
        "CameraSigma": Call(CameraSigma, lambda: {"focal_px": 1.0, "center_px": 2.0}),
        "Target.circle": Call(_looked_for_circle, _of_circle),
        "Target.rings": Call(Target.rings, _of_rings),
        "Target.coaxial": Call(Target.coaxial, _of_coaxial),
        "Target": Call(_looked_for, _of_target),
        "AxisIntervals": Call(circlepose.AxisIntervals, lambda: {"major_px": (8.0, 60.0), "minor_px": (4.0, 60.0)}),
        "DirectionHint": Call(_hinted, lambda: {"direction": (0.0, 1.0, 0.0), "spread_deg": 10.0}),
        "Ellipse.from_axes": Call(
            circlepose.Ellipse.from_axes, lambda: {"center": [30.0, 20.0], "semi_axes": [9.0, 5.0], "angle": 0.3}
        ),
        "EstimateOptions": Call(
            circlepose.EstimateOptions,
            lambda: {
                "measurement": MeasurementOptions(),
                "rings": RingOptions(),
                "disambiguation": DisambiguationOptions(),
            },
        ),
        "read_camera": Call(circlepose.read_camera, lambda: {"source": b"fx: 60\nfy: 60\ncx: 31.5\ncy: 23.5\n"}),
        "read_target": Call(circlepose.read_target, lambda: {"source": b"radius_mm: 20\n"}),
    }


def _as_format(name: str, call: Call) -> Format:
    def damage(_: bytes, rng: Rng) -> bytes:
        return ", ".join(f"{key}={shown(value)}" for key, value in _made_odd(call, rng).items()).encode(
            "utf-8", "replace"
        )

    def read(content: bytes, case: int) -> str:
        return _outcome(call, _made_odd(call, generator(name, case)) if content else call.sound())

    return Format(b"", damage, read)


def _made_odd(call: Call, rng: Rng) -> dict[str, object]:
    """Return the arguments of one case: one to three of them odd."""
    arguments = call.sound()
    count = int(rng.choice([1, 1, 1, 2, 3]))
    for key in rng.choice(list(arguments), size=min(len(arguments), count), replace=False):
        arguments[str(key)] = odd(arguments[str(key)], rng)
    return arguments


def _outcome(call: Call, arguments: dict[str, object]) -> str:
    """Make one call; return what came of it, or raise on a bug."""
    try:
        result = call.function(**arguments)
    except CircleposeError as error:
        check_message(str(error))
        return type(error).__name__
    _check_finite(result)
    # A data frame has a column of that name.
    status = getattr(result, "status", "ok")
    return status if isinstance(status, str) and status != "ok" else "read"


def check_message(message: str) -> None:
    """Raise where a message is not one sentence that begins with what it is about."""
    if not message.endswith(".") or "\n" in message or ": " not in message or len(message) > MOST_CHARACTERS:
        raise AssertionError(f"no sentence on a parameter: {message!r}")
    if "--" in message.split(", got ", maxsplit=1)[0]:
        raise AssertionError(f"names an option: {message!r}")


def odd(value: object, rng: Rng) -> object:
    """Return something in place of `value`: of another kind, or much the same with something absurd in it."""
    if rng.random() < 0.3:
        return _ODD[int(rng.integers(len(_ODD)))]()
    match value:
        case np.ndarray():
            return _odd_array(value, rng)
        case bytes():
            return _odd_bytes(value, rng)
        case tuple() | list() if value:
            return _odd_sequence(value, rng)
        case str():
            return _NAMES[int(rng.integers(len(_NAMES)))]
        case float():
            return _odd_number(rng)
        case Camera():
            return _odd_camera(rng)
        case Target():
            return _odd_target(rng)
        case _:
            return _ODD[int(rng.integers(len(_ODD)))]()


def _odd_number(rng: Rng) -> float:
    if rng.random() < 0.3:
        return float(_NUMBERS[int(rng.integers(len(_NUMBERS)))])
    return float(10.0 ** rng.uniform(-8.0, 14.0) * rng.choice([-1.0, 1.0, 1.0, 1.0]))


def _odd_bytes(value: bytes, rng: Rng) -> object:
    kinds = (io.BytesIO(value), io.StringIO(value.decode()), value[:-3], value * 2, value.replace(b"0", b""))
    return kinds[int(rng.integers(len(kinds)))]


def _odd_camera(rng: Rng) -> Camera:
    """Return a camera that may be made but not meant."""
    focal = 10.0 ** rng.uniform(-9.0, 9.0, 2)
    center = 10.0 ** rng.uniform(-2.0, 9.0, 2) * rng.choice([-1.0, 1.0], 2)
    if rng.random() < 0.5:
        focal, center = np.array([60.0, 60.0]), np.array([31.5, 23.5])
    model, count = (("pinhole", int(rng.choice([0, 4, 5, 8, 12, 14]))), ("fisheye", 4))[int(rng.integers(2))]
    coefficients = 10.0 ** rng.uniform(-6.0, rng.choice([0.0, 9.0]), count) * rng.choice([-1.0, 1.0], count)
    size = (_SIZE, None, (65, 48), (1, 1), (10**9, 10**9))[int(rng.integers(5))]
    sigma = CameraSigma(*(10.0 ** rng.uniform(-9.0, 9.0, 2)))
    matrix = [[focal[0], float(rng.choice([0.0, 1.0, 1e9])), center[0]], [0.0, focal[1], center[1]], [0.0, 0.0, 1.0]]
    return Camera.create(matrix, coefficients, size, model, sigma)


def _odd_target(rng: Rng) -> Target:
    """Return a target that may be made but not meant."""
    first, second = np.sort(10.0 ** rng.uniform(-6.0, 12.0, 2))[::-1].tolist()
    sigma = first * float(rng.choice([0.0, 0.01, 0.999]))
    match int(rng.integers(4)):
        case 0:
            return Target("coplanar", (first, second), count=None, radius_sigma_mm=sigma)
        case 1:
            length = min(1e12, first * (1.0 + 10.0 ** rng.uniform(-9.0, 9.0)))
            return Target("coaxial", (first, second), generatrix_mm=length if length > first - second else None)
        case 2:
            hint = DirectionHint(tuple(10.0 ** rng.uniform(-5.0, 5.0, 3) * -1.0), 10.0 ** rng.uniform(-300.0, 2.0))
            return Target("circle", (first,), normal_hint=hint, facing="up", radius_sigma_mm=sigma)
        case _:
            return Target("circle", (first,), count=None, same_plane=True, depth_range_mm=(0.0, first))


def _odd_sequence(value: tuple[object, ...] | list[object], rng: Rng) -> object:
    parts = list(value)
    place = int(rng.integers(len(parts)))
    match int(rng.integers(7)):
        case 0:
            del parts[place]
        case 1:
            parts.append(parts[place])
        case 2:
            return np.array(parts, dtype=object)
        case 3:
            parts.reverse()
        case 4:
            return iter(parts)
        case _:
            parts[place] = odd(parts[place], rng)
    return tuple(parts) if isinstance(value, tuple) else parts


def _odd_array(value: np.ndarray, rng: Rng) -> object:
    """Return an array of another type, shape or content."""
    kinds = ("f2", "f4", "f8", "i1", "i4", "i8", "u1", "u2", "u4", "c16", "O", "?", "U3", "g", "M8[s]", "S2")
    array = value.copy()
    spot = tuple(int(rng.integers(length)) for length in array.shape)
    match int(rng.integers(14)):
        case 0 | 1 | 2:
            with np.errstate(all="ignore"):
                return array.astype(kinds[int(rng.integers(len(kinds)))])
        case 3 | 4 | 5:
            array = array.astype(np.float64)
            array[spot] = _NUMBERS[int(rng.integers(len(_NUMBERS)))]
        case 6:
            with np.errstate(all="ignore"):
                array = array * float(_NUMBERS[int(rng.integers(len(_NUMBERS)))])
        case 7:
            array = array.astype(np.float64)
            array[rng.random(array.shape) < rng.choice([0.01, 0.1, 0.5, 1.0])] = rng.choice([np.nan, np.inf, -np.inf])
        case 8:
            return array[..., None]
        case 9:
            return array[None]
        case 10:
            return array[tuple(slice(int(rng.integers(4))) for _ in array.shape)]
        case 11:
            return np.asfortranarray(array)[::-1]
        case 12:
            return array.tolist()
        case _:
            return np.full_like(array, array.flat[0])
    return array


_NUMBERS = (
    0.0, -0.0, -1.0, 0.5, 1e-308, 5e-324, 1e-30, 1e-6, 1e6, 1e12, 1e30, 1e154, 1e200, 1e300, 1e308, -1e308,
    np.nan, np.inf, -np.inf,
)  # fmt: skip


_NAMES = (
    "all", *METHODS, *EXTRACTIONS, "circle", "coplanar", "coaxial", "dark", "bright", "fisheye", "pinhole", "left",
    "", "Chen-Huang", "a\0b", "\ud800",
)  # fmt: skip


class _Unlike:
    """An object that refuses everything."""

    def __repr__(self) -> str:
        raise RuntimeError("no text")

    def __eq__(self, other: object) -> bool:
        raise RuntimeError("no comparison")

    __hash__ = None  # type: ignore[assignment]

    def __array__(self, *_: object, **__: object) -> np.ndarray:
        raise RuntimeError("no array")

    def __iter__(self) -> object:
        raise TypeError("no parts")


def _recursive() -> list[object]:
    parts: list[object] = [1.0]
    parts.append(parts)
    return parts


_ODD: tuple[Callable[[], object], ...] = (
    *(lambda number=number: number for number in _NUMBERS),
    *(lambda number=number: np.float64(number) for number in (0.0, 1e308, np.nan)),
    *(lambda value=value: value for value in (
        None, True, False, 0, 1, 2, -1, 10**400, -(10**30), 1 + 2j, "", "x", "nan", "all", "circle", "é" * 200, b"",
        b"\xff\xfe", (), [], {}, {"a": 1}, (512,), (0, 0), (-3, 5), (1.5, 2.5), (640, 480), [[1.0]], [[]], [None],
        ["a.png", "b.png"], object, int, len, ..., NotImplemented, float("inf"),
    )),
    object,
    _Unlike,
    _recursive,
    lambda: decimal.Decimal("NaN"),
    lambda: decimal.Decimal("1e999"),
    lambda: fractions.Fraction(1, 3),
    lambda: datetime.date(2020, 1, 1),
    lambda: pathlib.Path("no such file"),
    pathlib.Path,
    lambda: (part for part in range(3)),
    lambda: range(3),
    lambda: {1.0, 2.0},
    lambda: memoryview(b"abc"),
    lambda: io.StringIO("x"),
    lambda: np.zeros((0, 4)),
    lambda: np.zeros(0),
    lambda: np.zeros((3, 3)),
    lambda: np.eye(3) * np.nan,
    lambda: np.array(5.0),
    lambda: np.array([None, "a"], dtype=object),
    lambda: np.ma.masked_array([1.0, 2.0], [True, False]),
    lambda: np.datetime64("NaT", "s"),
    lambda: np.bool_(True),
    lambda: np.int8(3),
    lambda: np.float16(3.0),
    lambda: np.str_("circle"),
    lambda: np.zeros(3, dtype=[("x", "f8"), ("y", "f8")]),
    lambda: Target.circle(1e-6),
    lambda: Target.circle(1e12),
    lambda: Target("coplanar", (1e12, 1e-6)),
    lambda: Target("coaxial", (20.0, 10.0), generatrix_mm=1e12),
    lambda: Camera.create([[1e9, 0, 1e9], [0, 1e-9, -1e9], [0, 0, 1]], (1e9, -1e9, 1e9, 1e9)),
    lambda: Camera.create(np.diag([1e-9, 1e9, 1.0]), (1e9,) * 4, None, "fisheye"),
    lambda: Camera.create(np.eye(3), (), (3, 1_000_000_000)),
    lambda: CameraSigma(1e9, 1e9),
    lambda: DirectionHint((1e-9, 0.0, 0.0), 180.0),
)  # fmt: skip

_PHOTOGRAPH = pathlib.Path(__file__).parents[3] / "sample_images" / "cd" / "a.png"
_SIZE = (64, 48)
_MATRIX = ((60.0, 0.0, 31.5), (0.0, 60.0, 23.5), (0.0, 0.0, 1.0))


def _picture() -> np.ndarray:
    """Return a small image (h, w) of a disc."""
    picture = np.full((_SIZE[1], _SIZE[0]), 190, np.uint8)
    cv2.ellipse(picture, (30, 24), (17, 12), 20.0, 0.0, 360.0, 60, -1, cv2.LINE_AA)
    return cv2.GaussianBlur(picture, (0, 0), 0.8)


def _camera() -> Camera:
    return Camera.create(_MATRIX, (), _SIZE)


def _of_estimate() -> dict[str, object]:
    return {
        "image": _picture(),
        "camera": _camera(),
        "target": Target.circle(20.0),
        "method": "chen-huang",
        "refine": True,
        "extraction": "edges",
        "scale_calibration": True,
        "name": "a",
    }


def _of_contour() -> dict[str, object]:
    contours, _ = cv2.findContours((_picture() < 120).astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return {
        "contour": contours[0],
        "camera": _camera(),
        "radius_mm": 20.0,
        "method": "chen-huang",
        "image": _picture(),
    }


def _of_ellipse() -> dict[str, object]:
    ellipse = circlepose.Ellipse.from_axes([30.0, 24.0], [17.0, 12.0], 0.35)
    return {"ellipse": ellipse, "camera": _camera(), "radius_mm": 20.0, "method": "chen-huang"}


def _of_inspect() -> dict[str, object]:
    intervals = circlepose.AxisIntervals(major_px=(8.0, 60.0))
    return {"image": _picture(), "intervals": intervals, "polarity": "dark", "rings": True}


def _of_measure() -> dict[str, object]:
    return {
        "images": ["no such file.png"],
        "camera": _camera(),
        "target": Target.circle(20.0),
        "recursive": False,
        "method": "chen-huang",
        "refine": True,
        "scale_calibration": True,
    }


def _of_overlay() -> dict[str, object]:
    return {"image": _picture(), "result": _result(), "camera": _camera()}


@cache
def _result() -> circlepose.ImageResult:
    return circlepose.estimate(_picture(), _camera(), Target.circle(20.0), name="a")


def _of_relative() -> dict[str, object]:
    terms = BoardTerms(np.eye(6))
    pose = BoardPose(np.eye(3), np.array([0.0, 0.0, 100.0]), terms.total, terms, 0.1)
    return {"result": replace(_result(), world=BoardResult(0, (pose,), 0.0, (), 12))}


def _of_camera() -> dict[str, object]:
    return {
        "camera_matrix": [list(row) for row in _MATRIX],
        "dist_coeffs": [-0.1, 0.01, 0.0, 0.0],
        "image_size": _SIZE,
        "model": "pinhole",
        "sigma": CameraSigma(0.1, 0.2),
    }


def _of_own_camera() -> dict[str, object]:
    return {**_of_camera(), "camera_matrix": np.array(_MATRIX), "dist_coeffs": np.array([-0.1, 0.01, 0.0, 0.0])}


def _of_circle() -> dict[str, object]:
    return {
        "radius_mm": 20.0,
        "count": 1,
        "polarity": "any",
        "axis_intervals": circlepose.AxisIntervals(major_px=(8.0, 60.0)),
        "depth_range_mm": (1.0, 1000.0),
        "same_plane": False,
        "normal_hint": None,
        "up_hint": None,
        "facing": "left",
        "radius_sigma_mm": 0.1,
    }


def _of_rings() -> dict[str, object]:
    return {"radii_mm": [20.0, 10.0], "count": 1, "polarity": "any", "flatness_sigma_mm": 0.1}


def _of_coaxial() -> dict[str, object]:
    return {"radii_mm": (20.0, 10.0), "height_mm": 5.0, "generatrix_mm": None, "count": 1, "radius_sigma_mm": 0.1}


def _of_target() -> dict[str, object]:
    return {
        "kind": "circle",
        "radii_mm": (20.0,),
        "generatrix_mm": None,
        "count": 1,
        "polarity": "any",
        "axis_intervals": None,
        "depth_range_mm": (1.0, 1000.0),
        "same_plane": False,
        "normal_hint": DirectionHint((0.0, 0.0, -1.0), 20.0),
        "up_hint": DirectionHint((0.0, 1.0, 0.0), 30.0),
        "facing": (0.0, -1.0, 0.0),
        "radius_sigma_mm": 0.1,
    }


def _measured_by(**arguments: object) -> object:
    return circlepose.estimate(_picture(), Camera.create(**arguments), Target.circle(20.0), scale_calibration=True)


def _measured_by_own(**arguments: object) -> object:
    return circlepose.estimate(_picture(), Camera(**arguments), Target.circle(20.0), scale_calibration=True)


def _looked_for_circle(**arguments: object) -> object:
    return circlepose.estimate(_picture(), _camera(), Target.circle(**arguments))


def _as_frame(**arguments: object) -> object:
    if find_spec("pandas") is None:
        return circlepose.to_rows(**arguments)
    # A frame has its column as `status`.
    return circlepose.to_dataframe(**arguments).to_numpy()


def _explained(**arguments: object) -> object:
    return circlepose.explain(**arguments).result


def _measured_files(**arguments: object) -> object:
    """Measure files; of a stream of any length the first."""
    return list(itertools.islice(circlepose.measure(**arguments), 3))


def _looked_for(**arguments: object) -> object:
    return circlepose.estimate(_picture(), _camera(), Target(**arguments))


def _hinted(**arguments: object) -> object:
    return Target("circle", (20.0,), up_hint=DirectionHint(**arguments))


def _check_finite(result: object) -> None:
    """Raise where a pose has a number that is none."""
    circles = getattr(result, "circles", (result,) if hasattr(result, "candidates") else ())
    for circle in circles:
        for candidate in circle.candidates:
            if not (np.all(np.isfinite(candidate.center)) and np.all(np.isfinite(candidate.normal))):
                raise AssertionError(f"a pose that is not finite: {candidate.center}, {candidate.normal}")
            if candidate.covariance is not None and not np.all(np.isfinite(candidate.covariance)):
                raise AssertionError("a covariance that is not finite")


def unfuzzed() -> set[str]:
    """Return the public names that can be called and are not fuzzed: values that the library makes itself."""
    fuzzed = {name.split(".")[0] for name in calls()}
    public = {name: getattr(circlepose, name) for name in circlepose.__all__}
    callables = {
        name
        for name, value in public.items()
        if callable(value)
        and not isinstance(value, EnumMeta)
        and not (inspect.isclass(value) and issubclass(value, Exception))
    }
    return callables - fuzzed
