"""What is fuzzed: a sound file of each format, how it is damaged, and what reading it must come to."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

import circlepose
from benchmarks.support.fuzz.calibrations import binary_calibrations, text_calibrations
from benchmarks.support.fuzz.mutations import Rng, damaged_bytes, damaged_png, damaged_text
from circlepose.camera.camera import Camera
from circlepose.errors import CircleposeError, ImageError
from circlepose.io.calibration.reader import read_camera_file
from circlepose.io.images.formats import known_format
from circlepose.io.images.header_size import stated_size
from circlepose.io.images.reader import decode_image
from circlepose.io.tables.columns import COLUMNS
from circlepose.io.tables.json_records import POSES_SCHEMA
from circlepose.io.tables.reader import read_pose_file
from circlepose.io.target_file import read_target, target_from_mapping
from circlepose_cli.reports.camera import describe, report_record, report_text

ROOT = Path(__file__).resolve().parents[3]
NAME = "a"
MOST_CHARACTERS = 2000
"""of a message"""
_MEASURED_CASES = 8
"""One decoded image in so many is measured, too."""
_TIFF_ROWS_PER_STRIP = 278
_TARGET = circlepose.Target.circle(20.0)


@dataclass(frozen=True, slots=True)
class Format:
    """One format: a sound file, how it is damaged and what is done with it."""

    content: bytes
    damage: Callable[[bytes, Rng], bytes]
    read: Callable[[bytes, int], str]
    """returns what came of the case: `read`, or a status; raises on a bug"""


def formats() -> Mapping[str, Format]:
    """Return all formats by name."""
    return {
        **{name: Format(content, damaged_bytes, read_image_case) for name, content in _images().items() if content},
        "png, checksums mended": Format(_encoded(".png", _picture()), damaged_png, read_image_case),
        **{
            f"calibration, {name}": Format(each, damaged_text, read_camera_case)
            for name, each in text_calibrations().items()
        },
        **{
            f"calibration, {name}": Format(each, damaged_bytes, read_camera_case)
            for name, each in binary_calibrations().items()
        },
        **{name: Format(content, damaged_text, read_target_case) for name, content in _targets().items()},
        **{name: Format(content, damaged_text, read_table_case) for name, content in _tables().items()},
    }


def read_image_case(content: bytes, case: int) -> str:
    """Decode, and now and then measure, an image."""
    try:
        image = decode_image(content, NAME)
    except ImageError as error:
        _check_message(str(error))
        return str(error.status)
    kind = known_format(content)
    size = None if kind is None else stated_size(content, kind)
    if size not in (None, image.shape[1::-1]):
        raise AssertionError(f"the header says {size}, the decoder gives {image.shape}")
    if case % _MEASURED_CASES == 0 and image.size <= 1 << 16:
        height, width = image.shape[:2]
        camera = Camera.create(
            [[60.0, 0.0, width / 2], [0.0, 60.0, height / 2], [0.0, 0.0, 1.0]], (), (width, height)
        )
        circlepose.estimate(image, camera, _TARGET)
    return "read"


def read_camera_case(content: bytes, case: int) -> str:  # noqa: ARG001
    """Read and describe a calibration."""
    try:
        file = read_camera_file(content)
        if file.target is not None:
            target_from_mapping(file.target, NAME)
    except CircleposeError as error:
        _check_message(str(error))
        return "refused"
    report = describe(file)
    report_text(report).encode("utf-8", "backslashreplace")
    json.dumps(report_record(report), allow_nan=False)
    return "read"


def read_target_case(content: bytes, case: int) -> str:  # noqa: ARG001
    """Read a target."""
    try:
        read_target(content)
    except CircleposeError as error:
        _check_message(str(error))
        return "refused"
    return "read"


def read_table_case(content: bytes, case: int) -> str:  # noqa: ARG001
    """Read a table of poses."""
    try:
        read_pose_file(content, NAME, truth_allowed=True)
    except CircleposeError as error:
        _check_message(str(error))
        return "refused"
    return "read"


def _check_message(text: str) -> None:
    if not text or "\n" in text or len(text) > MOST_CHARACTERS:
        raise AssertionError(f"a message of {len(text)} characters, {text.count(chr(10)) + 1} lines: {text[:200]!r}")


def _picture() -> np.ndarray:
    """A disc on noise, (48, 64, 3)."""
    noise = np.random.default_rng(3).integers(150, 200, (48, 64, 3), np.uint8)
    cv2.ellipse(noise, (30, 24), (18, 14), 20.0, 0.0, 360.0, (40, 50, 60), -1, cv2.LINE_AA)
    return cv2.GaussianBlur(noise, (0, 0), 0.8)


def _encoded(suffix: str, image: np.ndarray, *options: int) -> bytes:
    """Return the file of an image; nothing where this version of OpenCV does not write such ones."""
    try:
        done, data = cv2.imencode(suffix, image, options)
    except cv2.error:
        done = False
    return data.tobytes() if done else b""


def _images() -> dict[str, bytes]:
    color = _picture()
    grey = np.ascontiguousarray(color[:, :, 1])
    deep = color.astype(np.uint16) * 257
    alpha = np.dstack([color, grey])
    large = cv2.resize(color, (128, 96))
    return {
        "png 8": _encoded(".png", color),
        "png 8 grey": _encoded(".png", grey),
        "png 8 alpha": _encoded(".png", alpha),
        "png 16": _encoded(".png", deep),
        "png 1": _encoded(".png", grey, cv2.IMWRITE_PNG_BILEVEL, 1),
        "jpeg": _encoded(".jpg", color),
        "jpeg grey": _encoded(".jpg", grey),
        "jpeg progressive": _encoded(".jpg", color, cv2.IMWRITE_JPEG_PROGRESSIVE, 1),
        "jpeg restarts": _encoded(".jpg", color, cv2.IMWRITE_JPEG_RST_INTERVAL, 2),
        "tiff lzw": _encoded(".tif", color),
        "tiff plain": _encoded(".tif", grey, cv2.IMWRITE_TIFF_COMPRESSION, 1),
        "tiff deflate 16": _encoded(".tif", deep, cv2.IMWRITE_TIFF_COMPRESSION, 8),
        "tiff packbits": _encoded(".tif", grey, cv2.IMWRITE_TIFF_COMPRESSION, 32773),
        "tiff jpeg": _encoded(".tif", color, cv2.IMWRITE_TIFF_COMPRESSION, 7, _TIFF_ROWS_PER_STRIP, 48),
        "bmp": _encoded(".bmp", color),
        "bmp grey": _encoded(".bmp", grey),
        "webp": _encoded(".webp", color, cv2.IMWRITE_WEBP_QUALITY, 80),
        "webp lossless": _encoded(".webp", color),
        "webp alpha": _encoded(".webp", alpha, cv2.IMWRITE_WEBP_QUALITY, 80),
        "pgm": _encoded(".pgm", grey),
        "ppm 16": _encoded(".ppm", deep),
        "ppm ascii": _encoded(".ppm", color[:24, :24], cv2.IMWRITE_PXM_BINARY, 0),
        "pbm": _encoded(".pbm", (grey > 100).astype(np.uint8) * 255),
        "pam": _encoded(".pam", color),
        "jpeg 2000": _encoded(".jp2", large),
    }


def _targets() -> dict[str, bytes]:
    targets = sorted((ROOT / "configs" / "targets").glob("*.yaml"))
    return {f"target, {path.stem}": path.read_bytes() for path in targets}


def _tables() -> dict[str, bytes]:
    lines = (ROOT / "sample_images" / "coaxial" / "poses.csv").read_bytes().splitlines(keepends=True)
    solution = dict(zip(COLUMNS[4:6], (0, True), strict=True)) | dict(
        zip(COLUMNS[7:10], (1.0, 2.0, 300.0), strict=True)
    )
    solution |= dict(zip(COLUMNS[10:13], (0.0, 0.0, -1.0), strict=True))
    circle = {"instance": 0, "circle": "disc", "method": "chen-huang", "status": "ok", "solutions": [solution]}
    image = {"schema": POSES_SCHEMA, "image": "a.png", "status": "ok", "circles": [circle]}
    poses = json.dumps(image).encode() + b"\n"
    return {
        "table, csv": b"".join(lines[:4]),
        "table, truth": (ROOT / "sample_images" / "coaxial" / "truth.csv").read_bytes(),
        "table, jsonl": poses,
    }
