"""Image files -> arrays exactly as stored, or a status that says why not."""

from __future__ import annotations

import os
from pathlib import Path

import cv2
import numpy as np

from circlepose._arguments import shown
from circlepose._typing import Image
from circlepose.errors import ArgumentError, ImageError, OutputError
from circlepose.io.atomic import atomic_writer
from circlepose.io.images.content import read_content
from circlepose.io.images.decoder_messages import decoders_quiet, tells_of_lost_pixels
from circlepose.io.images.formats import (
    IMAGE_SUFFIXES,
    JPEG_2000,
    JPEG_2000_VARIABLE,
    is_complete,
    known_format,
    reads_jpeg_2000,
    without_remarks,
)
from circlepose.io.images.header_size import over_limit, stated_size, too_many_scans
from circlepose.io.images.pages import more_pages
from circlepose.io.marks import HEAD_BYTES, is_drawn, with_picture_mark
from circlepose.io.remote.images import RemoteFile
from circlepose.results import Status

__all__ = ["IMAGE_SUFFIXES", "read_image", "write_image"]

_AS_STORED = cv2.IMREAD_UNCHANGED
"""Looked up at the import: where OpenCV is broken, nothing has been written yet."""


def read_image(path: str | os.PathLike[str] | RemoteFile) -> Image:
    """Read one image file as it is stored.

    EXIF orientation is not applied: the calibration holds for the sensor's rows and columns.

    Parameters
    ----------
    path
        Of a file, or an object of a bucket.

    Returns
    -------
    (h, w) gray, (h, w, 3) BGR or (h, w, 4) BGRA, uint8 or uint16.

    Raises
    ------
    ImageError
        With the status `unreadable`, `not_an_image`, `truncated_image`, `too_large` or `not_allowed`.
    ArgumentError
        Where `path` is no path.
    """
    if not isinstance(path, str | os.PathLike | RemoteFile):
        raise ArgumentError(f"path: expected the path of an image file, got {shown(path)}.")
    return read_photograph(path)[0]


def read_photograph(path: str | os.PathLike[str] | RemoteFile) -> tuple[Image, str]:
    """Return what `read_image` does, and in words what else the file holds: more pages; empty where nothing."""
    if isinstance(path, RemoteFile):
        name, content = str(path), path.read_bytes()
    else:
        name = os.fspath(path)
        content = read_content(name)
    image = decode_image(content, name)
    return image, more_pages(content, known_format(content) or "")


def decode_image(content: bytes, name: str) -> Image:
    """Return the image that a file's `content` holds; as `read_image`, whose messages call the file `name`."""
    kind = known_format(content)
    if kind is None:
        what = "is no image of a known format" if content else "is empty"
        raise ImageError(Status.NOT_AN_IMAGE, f"{name}: {what}.")
    if is_drawn(content[:HEAD_BYTES]):
        raise ImageError(Status.NOT_AN_IMAGE, f"{name}: is a picture that circlepose drew, not a photograph.")
    if kind == JPEG_2000 and not reads_jpeg_2000():
        raise ImageError(
            Status.NOT_ALLOWED,
            f"{name}: is a JPEG 2000 image, whose decoder has had bugs that a hostile file could use; convert it "
            f"to PNG, or set the environment variable {JPEG_2000_VARIABLE}=1 where you trust the file.",
        )
    # OpenCV 4 fills the lost part of a JPEG with gray and says nothing.
    if not is_complete(content, kind):
        raise ImageError(Status.TRUNCATED_IMAGE, f"{name}: the {kind} image ends early; copy or take it again.")
    size = stated_size(content, kind)
    limit = over_limit(size) if size else None
    if size and limit:
        raise ImageError(Status.TOO_LARGE, f"{name}: is {size[0]} x {size[1]} px, {limit}.")
    slow = too_many_scans(content, kind, size) if size else None
    if slow:
        raise ImageError(Status.TOO_LARGE, f"{name}: {slow}.")
    image, remarks = _decoded(without_remarks(content, kind))
    if image is None or tells_of_lost_pixels(remarks):
        raise ImageError(
            Status.TRUNCATED_IMAGE, f"{name}: the {kind} image is damaged or ends early; copy or take it again."
        )
    if image.dtype not in (np.uint8, np.uint16) or (image.ndim == 3 and image.shape[2] not in {3, 4}):
        channels = image.shape[2] if image.ndim == 3 else 1
        raise ImageError(
            Status.NOT_AN_IMAGE,
            f"{name}: holds {channels} channel(s) of {image.dtype}; expected 8- or 16-bit gray, BGR or BGRA.",
        )
    return image


def write_image(path: str | os.PathLike[str], image: Image, *, drawn: bool = False, overwrite: bool = False) -> None:
    """Write `image` in the format that the name's ending says, whole or not at all; raises `OutputError`.

    A PNG or JPEG file bears our mark. With `drawn`, for a picture about a photograph, it is never measured itself.
    """
    name, suffix = os.fspath(path), Path(path).suffix.lower()
    if suffix not in IMAGE_SUFFIXES:
        raise OutputError(f"{name}: expected a name that ends in .png, .jpg or another image ending.")
    try:
        with decoders_quiet():
            done, encoded = cv2.imencode(suffix, image)
    except cv2.error:
        done = False
    if not done:
        raise OutputError(f"{name}: an image of {image.dtype}, {image.shape} cannot be stored as {suffix}.")
    with atomic_writer(path, binary=True, overwrite=overwrite) as handle:
        handle.write(with_picture_mark(encoded.tobytes(), drawn=drawn))


def _decoded(content: bytes | bytearray) -> tuple[Image | None, list[str]]:
    buffer = np.frombuffer(content, dtype=np.uint8)
    remarks: list[str] = []
    try:
        with decoders_quiet() as remarks:
            return cv2.imdecode(buffer, _AS_STORED), remarks
    except (cv2.error, MemoryError):
        return None, remarks
