"""What decoders print: libpng and libjpeg write to the process's standard error, whatever OpenCV's log level is."""

from __future__ import annotations

import os
import re
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import BinaryIO

import cv2

_STDERR = 2
_MOST_BYTES = 1 << 16
_LOCK = threading.Lock()
_OF_DECODERS = re.compile(
    r"libpng (?:warning|error): |Corrupt JPEG data: |Premature end of JPEG |Inconsistent progression sequence |"
    r"Invalid SOS parameters |Unknown Adobe color |Warning: unknown JFIF |Application transferred |"
    r"\[ *(?:DEBUG|INFO|WARN|ERROR|FATAL):|imdecode_|OpenCV\("
)
# Not those on bytes too many or a bad color profile, which some cameras write and which harm no pixel.
_OF_LOST_PIXELS = re.compile(
    r"Corrupt JPEG data: (premature end|bad \w+ code|found marker)|Premature end|Inconsistent progression"
)


@contextmanager
def decoders_quiet() -> Iterator[list[str]]:
    """Keep decoders from printing; the list holds, afterwards, the lines that they had to say.

    What anything else in this process writes to standard error meanwhile is passed on. Standard error belongs
    to the process, so threads wait for each other here.
    """
    lines: list[str] = []
    # The setter moved in OpenCV 5.
    logging = getattr(cv2.utils, "logging", cv2)
    with _LOCK:
        before = logging.setLogLevel(0)
        try:
            with _captured(lines):
                yield lines
        finally:
            logging.setLogLevel(before)


def tells_of_lost_pixels(lines: list[str]) -> str | None:
    """Return the first line by which a decoder says that it made up pixels, or None."""
    return next((line for line in lines if _OF_LOST_PIXELS.match(line)), None)


@contextmanager
def _captured(lines: list[str]) -> Iterator[None]:
    try:
        kept = os.dup(_STDERR)
    except OSError:
        # There is no standard error.
        yield
        return
    try:
        with _scratch_file() as file:
            os.dup2(file.fileno(), _STDERR)
            try:
                yield
            finally:
                os.dup2(kept, _STDERR)
                file.seek(0)
                _sort(file.read(_MOST_BYTES), lines, kept)
    finally:
        os.close(kept)


def _scratch_file() -> BinaryIO:
    if hasattr(os, "memfd_create"):
        return os.fdopen(os.memfd_create("decoder"), "w+b")
    return tempfile.TemporaryFile()


def _sort(written: bytes, lines: list[str], stderr: int) -> None:
    for line in written.splitlines(keepends=True):
        text = line.decode("utf-8", "replace").rstrip()
        if _OF_DECODERS.match(text):
            lines.append(text)
        elif text:
            os.write(stderr, line)
