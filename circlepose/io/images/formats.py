"""What the bytes of an image file show before it is decoded: its format, whether it is all there. Pure Python."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator

IMAGE_SUFFIXES = frozenset(
    (
        ".bmp",
        ".dib",
        ".jp2",
        ".jpe",
        ".jpeg",
        ".jpg",
        ".pbm",
        ".pgm",
        ".png",
        ".pnm",
        ".ppm",
        ".tif",
        ".tiff",
        ".webp",
    )
)
"""Endings that make a file in a folder or glob an image; a file named itself is judged by its content."""

JPEG_2000 = "JPEG 2000"
JPEG_2000_VARIABLE = "CIRCLEPOSE_JPEG2000"
"""Environment variable that allows this format, when it is 1; a process hands it on to its workers."""

HEAD_BYTES = 64
"""bytes that identify the format"""

_JPEG_END = b"\xff\xd9"
_JPEG_SCAN = 0xDA
_PNG_START = b"\x89PNG\r\n\x1a\n"
_FORMATS = (
    ("PNG", re.compile(rb"\x89PNG")),
    ("JPEG", re.compile(rb"\xff\xd8\xff")),
    ("TIFF", re.compile(rb"II[*+]\0|MM\0[*+]")),
    ("BMP", re.compile(rb"BM.{8}.{4}[\x0c\x28\x34\x38\x40\x6c\x7c]\0\0\0", re.DOTALL)),
    ("WebP", re.compile(rb"RIFF.{4}WEBP", re.DOTALL)),
    ("PNM", re.compile(rb"P[1-7]\s")),
    (JPEG_2000, re.compile(rb"\0\0\0\x0cjP  \r\n\x87\n|\xff\x4f\xff\x51")),
)


def is_image_name(name: str) -> bool:
    """Whether the ending of a file's name is that of an image."""
    return os.path.splitext(name)[1].lower() in IMAGE_SUFFIXES  # noqa: PTH122 - for a million names


def known_format(content: bytes) -> str | None:
    """Return the name of the image format that `content` begins like, or None."""
    return next((name for name, start in _FORMATS if start.match(content)), None)


def reads_jpeg_2000() -> bool:
    """Whether JPEG 2000 is decoded, which is refused unless it is asked for.

    OpenJPEG, which OpenCV brings, has had writes out of bounds (CVE-2021-3575, OSV-2023-444).
    """
    return os.environ.get(JPEG_2000_VARIABLE) == "1"


def is_complete(content: bytes, kind: str) -> bool:
    """Whether a JPEG or PNG has its end; the decoder itself checks all other formats."""
    if kind == "JPEG":
        return _jpeg_has_end(content)
    if kind == "PNG":
        return any(name == b"IEND" for name, _, _ in _png_chunks(content))
    return True


def without_remarks(content: bytes, kind: str) -> bytes | bytearray:
    """Return a PNG without the chunks of remarks, on which libpng prints warnings; others as they are."""
    if kind != "PNG":
        return content
    chunks = list(_png_chunks(content))
    # Lower case: a chunk that is not needed to decode; tRNS is the alpha of a palette.
    remarks = [(start, end) for name, start, end in chunks if name[0] & 0x20 and name != b"tRNS"]
    if not remarks:
        return content
    kept, position = bytearray(), 0
    for start, end in remarks:
        kept += memoryview(content)[position:start]
        position = end
    return kept + content[position:]


def _jpeg_has_end(content: bytes) -> bool:
    # The end marker counts only after the start of the scan: a thumbnail in the header has one, too.
    position = 2
    while position + 4 <= len(content) and content[position] == 0xFF:
        marker = content[position + 1]
        if marker == _JPEG_SCAN:
            return content.rfind(_JPEG_END, position) >= 0
        length = int.from_bytes(content[position + 2 : position + 4], "big")
        position += 1 if marker == 0xFF else 2 + length
    return False


def _png_chunks(content: bytes) -> Iterator[tuple[bytes, int, int]]:
    """Yield (name, start, end) of the chunks that are all there, up to the last, IEND."""
    position = len(_PNG_START)
    while position + 12 <= len(content):
        length = int.from_bytes(content[position : position + 4], "big")
        name = content[position + 4 : position + 8]
        end = position + 12 + length
        if end > len(content) or not name.isalpha():
            return
        yield name, position, end
        if name == b"IEND":
            return
        position = end
