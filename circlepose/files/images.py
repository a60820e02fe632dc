"""Image files -> arrays exactly as stored, or a status that says why not."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np

from circlepose._typing import Image
from circlepose.errors import ImageError, OutputError
from circlepose.files.atomic import atomic_writer
from circlepose.files.image_bytes import IMAGE_SUFFIXES, is_complete, known_format, without_remarks
from circlepose.pose import Status

__all__ = ["IMAGE_SUFFIXES", "read_image", "write_image"]


def read_image(path: str | os.PathLike[str]) -> Image:
    """Return the image as stored: (h, w) grey, (h, w, 3) BGR or (h, w, 4) BGRA, uint8 or uint16.

    EXIF orientation is not applied: the calibration holds for the sensor's rows and columns.

    Raises
    ------
    ImageError
        With the status `unreadable`, `not_an_image` or `truncated_image`.
    """
    name = os.fspath(path)
    content = _content(name)
    kind = known_format(content)
    if kind is None:
        what = "is no image of a known format" if content else "is empty"
        raise ImageError(Status.NOT_AN_IMAGE, f"{name}: {what}.")
    # OpenCV 4 fills the lost part of a JPEG with grey and says nothing.
    if not is_complete(content, kind):
        raise ImageError(Status.TRUNCATED_IMAGE, f"{name}: the {kind} image ends early; copy or take it again.")
    image = _decoded(without_remarks(content, kind))
    if image is None:
        raise ImageError(
            Status.TRUNCATED_IMAGE, f"{name}: the {kind} image is damaged or ends early; copy or take it again."
        )
    if image.dtype not in (np.uint8, np.uint16) or (image.ndim == 3 and image.shape[2] not in {3, 4}):
        channels = image.shape[2] if image.ndim == 3 else 1
        raise ImageError(
            Status.NOT_AN_IMAGE,
            f"{name}: holds {channels} channel(s) of {image.dtype}; expected 8- or 16-bit grey, BGR or BGRA.",
        )
    return image


def write_image(path: str | os.PathLike[str], image: Image) -> None:
    """Write `image` in the format that the name's ending says, whole or not at all; raises `OutputError`."""
    name, suffix = os.fspath(path), Path(path).suffix.lower()
    if suffix not in IMAGE_SUFFIXES:
        raise OutputError(f"{name}: expected a name that ends in .png, .jpg or another image ending.")
    try:
        with _quiet():
            done, encoded = cv2.imencode(suffix, image)
    except cv2.error:
        done = False
    if not done:
        raise OutputError(f"{name}: an image of {image.dtype}, {image.shape} cannot be stored as {suffix}.")
    with atomic_writer(path, binary=True) as handle:
        handle.write(encoded.tobytes())


def _content(name: str) -> bytes:
    try:
        # Python opens names that OpenCV cannot: any bytes on Linux, non-Latin ones on Windows.
        return Path(name).read_bytes()
    except FileNotFoundError:
        reason = "there is no such file"
    except IsADirectoryError:
        reason = "is a folder, not an image file"
    except PermissionError:
        reason = "may not be read (permission denied)"
    except OSError as error:
        reason = f"cannot be read ({error.strerror or error})"
    except ValueError:
        reason = "is no file name (it holds a NUL character; part the names by line ends)"
    raise ImageError(Status.UNREADABLE, f"{name!r}: {reason}." if "\0" in name else f"{name}: {reason}.")


def _decoded(content: bytes | bytearray) -> Image | None:
    buffer = np.frombuffer(content, dtype=np.uint8)
    try:
        with _quiet():
            return cv2.imdecode(buffer, cv2.IMREAD_UNCHANGED)
    except (cv2.error, MemoryError):
        return None


@contextmanager
def _quiet() -> Iterator[None]:
    """Silence OpenCV's own log on stderr: the status says what went wrong."""
    # The setter moved in OpenCV 5.
    logging = getattr(cv2.utils, "logging", cv2)
    before = logging.setLogLevel(0)
    try:
        yield
    finally:
        logging.setLogLevel(before)
