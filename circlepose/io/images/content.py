"""The bytes of one image file, or why they are not to be had; what is no regular file is never waited for."""

from __future__ import annotations

import os
import stat

from circlepose.errors import ImageError
from circlepose.io.images.formats import HEAD_BYTES, known_format
from circlepose.io.text.source import open_at_once
from circlepose.results import Status

MAX_FILE_BYTES = (1 << 31) - 1
"""OpenCV counts the bytes that it decodes in 31 bits."""


def read_content(name: str) -> bytes:
    """Return the bytes of an image file; of a file that is no image, only the first.

    Raises `ImageError` with the status `unreadable` or `too_large`.
    """
    try:
        return _content(name)
    except FileNotFoundError:
        reason = "there is no such file"
    except IsADirectoryError:
        reason = "is a folder, not an image file"
    except PermissionError:
        reason = "may not be read (permission denied)"
    except OSError as error:
        reason = f"cannot be read ({error.strerror or error})"
    except MemoryError:
        reason = "does not fit in memory"
    except ValueError:
        reason = "is no file name (it holds a NUL character; part the names by line ends)"
    raise ImageError(Status.UNREADABLE, f"{name!r}: {reason}." if "\0" in name else f"{name}: {reason}.")


def too_many_bytes(name: str, size: int) -> ImageError:
    """Return the error that says so."""
    return ImageError(Status.TOO_LARGE, f"{name}: has {size} bytes; no more than {MAX_FILE_BYTES} are read.")


def _content(name: str) -> bytes:
    # Python opens names that OpenCV cannot: any bytes on Linux, non-Latin ones on Windows.
    with open(name, "rb", opener=open_at_once) as handle:
        status = os.fstat(handle.fileno())
        if not stat.S_ISREG(status.st_mode):
            raise ImageError(Status.UNREADABLE, f"{name}: is a pipe or a device, not an image file.")
        if known_format(handle.peek(HEAD_BYTES)[:HEAD_BYTES]) is None:
            return handle.read(HEAD_BYTES)
        if status.st_size > MAX_FILE_BYTES:
            raise too_many_bytes(name, status.st_size)
        return handle.read()
