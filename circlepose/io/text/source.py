"""Small text files as they come: from a path, bytes or an open handle, checked before any parser sees them."""

from __future__ import annotations

import os
import stat
import zlib
from typing import IO, TypeAlias

from circlepose._arguments import shown
from circlepose.errors import CircleposeError

Source: TypeAlias = str | os.PathLike[str] | bytes | IO[str] | IO[bytes]
"""A path, or the content itself as bytes or an open handle."""

MAX_TABLE_BYTES = 1_000_000_000
"""A table of poses is read whole, and takes ten times as much memory; a row has some 500 bytes."""
GZIP = b"\x1f\x8b"
_MOST_PARTS = 100
MAX_BYTES = 10_000_000
"""No calibration or target is larger; a larger file is another file, given by mistake."""


def read_source(source: Source, error: type[CircleposeError]) -> tuple[str, str]:
    """Return the text of `source` and the name by which messages call it.

    Raises `error` when there is no such file, or it is empty, over `MAX_BYTES`, binary or not UTF-8.
    """
    content, name = read_content(source, error)
    text = _decoded(content, name, error)
    if "\0" in text:
        raise error(f"{name}: is a binary file; expected text (if it is compressed, unpack it first).")
    if not text.strip():
        raise error(f"{name}: is empty; expected a text file with keys and values.")
    return text, name


def read_content(source: Source, error: type[CircleposeError]) -> tuple[bytes, str]:
    """Return the bytes of `source` (UTF-8, of a handle that gives text) and the name by which messages call it.

    Raises `error` when there is no such file, or it is over `MAX_BYTES`.
    """
    content, name = _content(source, error)
    content = content.encode("utf-8", "surrogatepass") if isinstance(content, str) else content
    if len(content) > MAX_BYTES:
        raise error(f"{name}: is larger than {MAX_BYTES // 1_000_000} MB; expected a small file.")
    return content, name


def unpacked(content: bytes, name: str, error: type[CircleposeError], most_bytes: int) -> bytes:
    """Return the content of a file, unpacked if it is gzipped.

    Raises `error` where it is damaged, ends early, or unpacks to more than `most_bytes`.
    """
    if not content.startswith(GZIP):
        return content
    whole = b""
    # A file may be packed in parts, and padded with zeros.
    for _ in range(_MOST_PARTS):
        unpack = zlib.decompressobj(31)
        try:
            whole += unpack.decompress(content, most_bytes + 1 - len(whole))
        except zlib.error as reason:
            raise error(f"{name}: is gzipped and damaged ({reason}); copy it again.") from None
        if len(whole) > most_bytes:
            raise error(f"{name}: unpacks to more than {most_bytes // 1_000_000} MB, the most that is read.")
        if not unpack.eof:
            raise error(f"{name}: is gzipped and ends early; copy it again.")
        content = unpack.unused_data.lstrip(b"\0")
        if not content:
            return whole
    raise error(f"{name}: is gzipped in more than {_MOST_PARTS} parts; pack it again in one.")


def read_regular(name: str, error: type[CircleposeError], most_bytes: int) -> bytes:
    """Return the bytes of a file of at most `most_bytes`, or raise `error`: one sentence that says why not.

    A pipe is read where something writes to it, as the shell's `<(command)` does; a device is refused.
    """
    try:
        with open(name, "rb", opener=open_at_once) as handle:
            status = os.fstat(handle.fileno())
            if stat.S_ISFIFO(status.st_mode):
                return _piped(handle, name, error, most_bytes)
            if not stat.S_ISREG(status.st_mode):
                raise error(f"{name}: is a device; expected a regular file.")
            # A file may grow meanwhile, and those of /proc state no size.
            content = handle.read(most_bytes + 1) if status.st_size <= most_bytes else b""
            if max(len(content), status.st_size) > most_bytes:
                raise _too_large(name, error, most_bytes)
            return content
    except FileNotFoundError:
        raise error(f"{name}: there is no such file; check the path.") from None
    except IsADirectoryError:
        raise error(f"{name}: is a folder; give the file in it.") from None
    except (OSError, ValueError) as reason:
        raise error(f"{name}: cannot be opened ({getattr(reason, 'strerror', None) or reason}).") from None


def _piped(handle: IO[bytes], name: str, error: type[CircleposeError], most_bytes: int) -> bytes:
    try:
        begin = os.read(handle.fileno(), most_bytes + 1)
    except BlockingIOError:
        begin = None
    if begin == b"":
        raise error(f"{name}: is a pipe to which nothing writes; expected a file.")
    # It has a writer: wait for the rest.
    os.set_blocking(handle.fileno(), True)
    content = (begin or b"") + handle.read(most_bytes + 1)
    if len(content) > most_bytes:
        raise _too_large(name, error, most_bytes)
    return content


def _too_large(name: str, error: type[CircleposeError], most_bytes: int) -> CircleposeError:
    return error(f"{name}: is larger than {most_bytes // 1_000_000} MB, the most that is read.")


def open_at_once(name: str, flags: int) -> int:
    """Open a file as `open` does; without this flag, opening a pipe waits for someone who writes to it."""
    return os.open(name, flags | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOCTTY", 0), 0o666)


def _content(source: Source, error: type[CircleposeError]) -> tuple[str | bytes, str]:
    if isinstance(source, bytes):
        return source, "<bytes>"
    if not isinstance(source, str | os.PathLike):
        return _read(source, error), str(getattr(source, "name", "<stream>"))
    name = os.fspath(source)
    return read_regular(name, error, MAX_BYTES), name


def _read(source: object, error: type[CircleposeError]) -> str | bytes:
    read = getattr(source, "read", None)
    if not callable(read):
        raise error(f"source: expected a path, bytes or an open file, got {shown(source)}.")
    try:
        content = read(MAX_BYTES + 1)
    except (OSError, ValueError, TypeError) as reason:
        raise error(f"source: cannot be read ({reason}).") from None
    if isinstance(content, str | bytes):
        return content
    raise error(f"source: expected an open file that gives text or bytes, got {shown(content)}.")


def _decoded(content: bytes, name: str, error: type[CircleposeError]) -> str:
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as reason:
        what = (
            "is a binary file; expected text (if it is compressed, unpack it first)"
            if b"\0" in content or content[:2] == b"\x1f\x8b"
            else f"is not UTF-8 text (byte {reason.start}); save it as UTF-8"
        )
        raise error(f"{name}: {what}.") from None
