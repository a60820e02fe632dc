"""A calibration file as it came: its bytes, its text, its keys and values, each made when a form asks for it."""

from __future__ import annotations

import codecs
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from circlepose.errors import CalibrationError
from circlepose.io.calibration.file_storage import parse_storage
from circlepose.io.text.source import MAX_BYTES, Source, read_content

_GZIP = b"\x1f\x8b"
_UTF_16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)


@dataclass(frozen=True)
class Document:
    """One file. Nothing here raises: what the content is not is None, empty or `problem`."""

    name: str
    """by which messages call it"""
    content: bytes
    """as stored, unpacked if it was gzipped"""

    @cached_property
    def text(self) -> str | None:
        """The content as text, without a byte order mark; None for a binary file."""
        encoding = "utf-16" if self.content.startswith(_UTF_16) else "utf-8-sig"
        try:
            text = self.content.decode(encoding)
        except UnicodeDecodeError:
            return None
        return None if "\0" in text else text

    @property
    def entries(self) -> Mapping[str, object]:
        """The keys and values of a YAML, JSON or FileStorage file; empty for all others."""
        return self._parsed[0]

    @property
    def is_file_storage(self) -> bool:
        """Whether the syntax is OpenCV's own: XML, or a matrix with OpenCV's tag."""
        return self._parsed[1]

    @property
    def problem(self) -> CalibrationError | None:
        """Why the text is no keys and values."""
        return self._parsed[2]

    @cached_property
    def _parsed(self) -> tuple[Mapping[str, object], bool, CalibrationError | None]:
        if self.text is None:
            return {}, False, None
        try:
            return *parse_storage(self.text, self.name), None
        except CalibrationError as problem:
            return {}, False, problem


def read_document(source: Source) -> Document:
    """Return the file at a path, in bytes or behind an open handle; raises `CalibrationError` where there is none."""
    content, name = read_content(source, CalibrationError)
    if content.startswith(_GZIP):
        content = _unpacked(content, name)
    if not content.strip():
        raise CalibrationError(f"{name}: is empty; expected the calibration of a camera.")
    return Document(name, content)


def _unpacked(content: bytes, name: str) -> bytes:
    unpack = zlib.decompressobj(31)
    try:
        unpacked = unpack.decompress(content, MAX_BYTES + 1)
    except zlib.error as reason:
        raise CalibrationError(f"{name}: is gzipped and damaged ({reason}); copy it again.") from None
    if len(unpacked) > MAX_BYTES:
        raise CalibrationError(f"{name}: unpacks to more than {MAX_BYTES // 1_000_000} MB; expected a small file.")
    if not unpack.eof:
        raise CalibrationError(f"{name}: is gzipped and ends early; copy it again.")
    return unpacked
