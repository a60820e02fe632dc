"""A calibration file as it came: its bytes, its text, its keys and values, each made when a form asks for it."""

from __future__ import annotations

import codecs
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from circlepose.errors import CalibrationError
from circlepose.io.calibration.file_storage import parse_storage
from circlepose.io.calibration.signatures import kind_of
from circlepose.io.text.sections import load_sections
from circlepose.io.text.source import MAX_BYTES, Source, read_content, unpacked

_UTF_16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_LEAST_UTF_16 = 16
_MOSTLY = 0.4
"""Share of bytes of 0 at every other place from which a text is UTF-16; of ASCII all of them are."""
_PLAIN = bytes(range(32, 127)) + b"\t\n\r\f"
_LEAST_PLAIN = 0.7
"""Share of ASCII from which a text in another encoding is read: keys and numbers are ASCII, remarks may be other."""
_RULE = re.compile(r"^---[ \t]*\r?$", re.MULTILINE)
_MODEL_LINE = re.compile(r"^distortion_model:", re.MULTILINE)
_MATRIX_LINE = re.compile(r"^[kK]:", re.MULTILINE)


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
        encoding = _encoding(self.content)
        if encoding is None:
            return None
        text = self.content.decode(encoding, "replace")
        return None if "\0" in text else text.removeprefix("\ufeff")

    @property
    def entries(self) -> Mapping[str, object]:
        """The keys and values of a YAML, JSON, TOML, INI or FileStorage file; empty for all others."""
        return self._parsed[0]

    @property
    def is_file_storage(self) -> bool:
        """Whether the syntax is OpenCV's own: XML, or a matrix with OpenCV's tag."""
        return self._parsed[1]

    @property
    def problem(self) -> CalibrationError | None:
        """Why the text is no keys and values."""
        return self._parsed[2]

    @property
    def messages(self) -> int:
        """How many recorded ROS messages the text holds; `entries` are those of the first."""
        return len(self._messages)

    @cached_property
    def _messages(self) -> list[str]:
        text = self.text or ""
        parts: list[str] = []
        start = 0
        for end in (*(rule.start() for rule in _RULE.finditer(text)), len(text)):
            part = text[start:end]
            if _MODEL_LINE.search(part) and _MATRIX_LINE.search(part):
                # Lines keep their numbers; the rule itself begins the next part, as it may of a document.
                parts.append("\n" * text.count("\n", 0, start) + part if not parts else "")
            start = end
        return parts

    @cached_property
    def _parsed(self) -> tuple[Mapping[str, object], bool, CalibrationError | None]:
        if self.text is None:
            return {}, False, None
        try:
            text = self._messages[0] if self._messages else self.text
            return *parse_storage(text, self.name), None
        except CalibrationError as reason:
            problem = reason
        try:
            sections = load_sections(self.text, self.name, CalibrationError)
        except CalibrationError as reason:
            return {}, False, reason
        return (sections, False, None) if sections is not None else ({}, False, problem)


def read_document(source: Source) -> Document:
    """Return the file at a path, in bytes or behind an open handle; raises `CalibrationError` where there is none."""
    _refuse_large(source)
    content, name = read_content(source, CalibrationError)
    content = unpacked(content, name, CalibrationError, MAX_BYTES)
    if not content.strip():
        raise CalibrationError(f"{name}: is empty; expected the calibration of a camera.")
    return Document(name, content)


def _encoding(content: bytes) -> str | None:
    """Return the encoding of a text; None for what is no text. Of remarks in others than Unicode nothing is kept."""
    if content.startswith(_UTF_16):
        return "utf-16"
    for encoding, at in (("utf-16-le", 1), ("utf-16-be", 0)):
        begin = content[:4096]
        if len(begin) >= _LEAST_UTF_16 and begin[at::2].count(0) > _MOSTLY * len(begin[at::2]):
            words = begin.decode(encoding, "replace")
            if all(each.isprintable() or each.isspace() for each in words[:-1]):
                return encoding
    try:
        content.decode("utf-8")
    except UnicodeDecodeError:
        is_text = len(content.translate(None, _PLAIN)) < (1.0 - _LEAST_PLAIN) * len(content)
        has_controls = re.search(rb"[\x00-\x08\x0e-\x1f]", content) is not None
        return "utf-8" if is_text and not has_controls else None
    return "utf-8"


def _refuse_large(source: Source) -> None:
    """Raise `CalibrationError` on a file that is too large, with what it looks like by its first bytes."""
    if not isinstance(source, str | os.PathLike):
        return
    try:
        path = Path(source)
        is_large = path.is_file() and path.stat().st_size > MAX_BYTES
        begin = b""
        if is_large:
            with path.open("rb") as handle:
                begin = handle.read(4096)
    except (OSError, ValueError):
        return
    what = kind_of(begin) if is_large else None
    if what is not None:
        raise CalibrationError(f"{os.fspath(source)}: {what}.")
