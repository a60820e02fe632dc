"""The size of an image as its header states it, so that a bomb is refused before it is decoded. Pure Python."""

from __future__ import annotations

import os
import re
import struct
from collections.abc import Callable, Iterator, Mapping

MAX_PIXELS = 1 << 28
"""Accepted by default; more than any camera gives."""
PIXELS_VARIABLE = "OPENCV_IO_MAX_IMAGE_PIXELS"
"""Environment variable of OpenCV that sets another limit, for OpenCV and here."""
MAX_SIDE = 1 << 20
"""OpenCV's own limit."""
SCANS_OF_LARGEST = 4
"""A JPEG is decoded scan by scan, each over all pixels: scans times pixels may be this many of the largest image.
Encoders write 10 for a progressive one, so images of up to 100 million pixels may have more than usual."""

Size = tuple[int, int]

_JPEG_SCAN = b"\xff\xda"
_JPEG_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
_JPEG_BARE = frozenset((0x01, *range(0xD0, 0xD9)))
_J2K_SIZE = b"\xff\x4f\xff\x51"
_PNM_GAP = rb"(?:\s|#[^\r\n]*[\r\n])+"
_PNM = re.compile(rb"P[1-6]" + _PNM_GAP + rb"(\d{1,12})" + _PNM_GAP + rb"(\d{1,12})")
_PAM_SIDE = rb"(?:^|\n)%s\s+(\d{1,12})"


def stated_size(content: bytes, kind: str) -> Size | None:
    """Return (width, height) px of an image of the format `kind`, None where its header does not say."""
    try:
        return _SIZES[kind](content)
    except (struct.error, IndexError, OverflowError):
        return None


def over_limit(size: Size) -> str | None:
    """Return what limit a size goes over and how to raise it, or None."""
    width, height = size
    most = max_pixels()
    if width * height > most:
        return f"over the limit of {most} px in all (the environment variable {PIXELS_VARIABLE} raises it)"
    if max(size) > MAX_SIDE:
        return f"over OpenCV's limit of {MAX_SIDE} px a side"
    return None


def too_many_scans(content: bytes, kind: str, size: Size) -> str | None:
    """Return what is wrong with a JPEG whose scans take too long to decode, or None.

    A scan may be a few bytes long and still goes over all pixels: a small file would take minutes.
    """
    if kind != "JPEG":
        return None
    most = SCANS_OF_LARGEST * max_pixels() // max(size[0] * size[1], 1)
    # In the data of a scan 0xff is followed by 0; only thumbnails can make this a few too many.
    if content.count(_JPEG_SCAN) <= most or _jpeg_scans(content) <= most:
        return None
    return (
        f"has more than {most} scans, too many for an image of {size[0]} x {size[1]} px; save it again "
        "(as a baseline JPEG, or as PNG)"
    )


def _jpeg_scans(content: bytes) -> int:
    return sum(marker == _JPEG_SCAN[1] for marker, _ in _jpeg_segments(content))


def max_pixels() -> int:
    """Return the largest number of pixels of an image that is decoded."""
    said = os.environ.get(PIXELS_VARIABLE, "")
    return int(said) if re.fullmatch("[0-9]{1,15}", said) else MAX_PIXELS


def _png(content: bytes) -> Size:
    width, height = struct.unpack_from(">II", content, 16)
    return width, height


def _jpeg(content: bytes) -> Size | None:
    for marker, position in _jpeg_segments(content):
        if marker in _JPEG_FRAMES:
            height, width = struct.unpack_from(">HH", content, position + 5)
            return width, height
    return None


def _jpeg_segments(content: bytes) -> Iterator[tuple[int, int]]:
    """Yield the markers of a JPEG and where they stand; those between segments are passed over, as by the decoder."""
    position = 2
    while True:
        position = content.find(b"\xff", position)
        if position < 0 or position + 1 >= len(content):
            return
        marker = content[position + 1]
        if marker == 0xFF:
            position += 1
        elif marker == 0 or marker in _JPEG_BARE:
            position += 2
        else:
            yield marker, position
            position += 2 + int.from_bytes(content[position + 2 : position + 4], "big")


def _tiff(content: bytes) -> Size | None:
    order = "<" if content[:2] == b"II" else ">"
    is_big = content[2:4] in (b"+\0", b"\0+")
    (directory,) = struct.unpack_from(order + "Q" if is_big else order + "I", content, 8 if is_big else 4)
    (count,) = struct.unpack_from(order + "Q" if is_big else order + "H", content, directory)
    start, step, value_at = (directory + 8, 20, 12) if is_big else (directory + 2, 12, 8)
    sides: dict[int, int] = {}
    for entry in range(start, min(start + count * step, len(content)), step):
        tag, form = struct.unpack_from(order + "HH", content, entry)
        if tag in (256, 257) and form in _TIFF_NUMBERS:
            (sides[tag],) = struct.unpack_from(order + _TIFF_NUMBERS[form], content, entry + value_at)
    return (sides[256], sides[257]) if len(sides) == 2 else None


_TIFF_NUMBERS = {1: "B", 3: "H", 4: "I", 16: "Q"}


def _bmp(content: bytes) -> Size:
    if content[14] == 12:
        width, height = struct.unpack_from("<HH", content, 18)
    else:
        width, height = struct.unpack_from("<ii", content, 18)
    return abs(width), abs(height)


def _webp(content: bytes) -> Size | None:
    chunk = content[12:16]
    if chunk == b"VP8X":
        width, rest, height, top = struct.unpack_from("<HBHB", content, 24)
        return 1 + (width | rest << 16), 1 + (height | top << 16)
    if chunk == b"VP8L":
        (bits,) = struct.unpack_from("<I", content, 21)
        return 1 + (bits & 0x3FFF), 1 + (bits >> 14 & 0x3FFF)
    if chunk == b"VP8 ":
        width, height = struct.unpack_from("<HH", content, 26)
        return width & 0x3FFF, height & 0x3FFF
    return None


def _pnm(content: bytes) -> Size | None:
    if content[:2] == b"P7":
        head = content[: content.find(b"ENDHDR")]
        width, height = (re.search(_PAM_SIDE % side, head) for side in (b"WIDTH", b"HEIGHT"))
        return (int(width[1]), int(height[1])) if width and height else None
    match = _PNM.match(content)
    return (int(match[1]), int(match[2])) if match else None


def _jpeg_2000(content: bytes) -> Size | None:
    start = content.find(_J2K_SIZE)
    if start < 0:
        return None
    right, bottom, left, top = struct.unpack_from(">IIII", content, start + 8)
    return max(right - left, 0), max(bottom - top, 0)


_SIZES: Mapping[str, Callable[[bytes], Size | None]] = {
    "PNG": _png,
    "JPEG": _jpeg,
    "TIFF": _tiff,
    "BMP": _bmp,
    "WebP": _webp,
    "PNM": _pnm,
    "JPEG 2000": _jpeg_2000,
}
