"""The journal of a run: what is finished, a line an image, so that a run that was killed can be resumed.

A line is `checksum key values`; the first holds the conditions (options and versions) of the run. Lines are only ever
appended: whatever instant a run is killed at, at most the last line is torn, and reading drops it.
"""

from __future__ import annotations

import json
import os
import stat
import sys
import zlib
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, suppress
from hashlib import blake2b
from pathlib import Path
from typing import IO, Self

from circlepose.errors import OutputError, UsageError
from circlepose.io.atomic import on_behalf, sync_folder_of

if sys.platform != "win32":
    import fcntl

_MAGIC = b"circlepose journal 2\n"
_FORMER = (b"circlepose journal 1\n",)
"""of journals whose results were stored in another way; as long as `_MAGIC`"""
_CONDITIONS = "conditions"
_KEY_BYTES = 8


class Journal:
    """What is finished, by key. One thread may look up while another adds.

    Memory grows by some 200 bytes for each image that was finished when it was opened, and not while it runs.
    """

    def __init__(self, path: Path, conditions: Mapping[str, str], *, resume: bool, output: str) -> None:
        """Open the journal at `path` of the output that messages call `output`; without `resume`, start it again.

        Raises `UsageError` when it has other `conditions`, or another run is writing it, and
        `OutputError` when it cannot be written or the file there is no journal.
        """
        self.path = path
        self.discarded = False
        """whether there was an unfinished run, which is not resumed"""
        self.reused = 0
        """how many results came from the journal; whoever takes them counts"""
        self._offsets: dict[bytes, int] = {}
        self._writer = _opened_alone(path, output)
        try:
            end = self._begun(conditions, resume)
            self._writer.truncate(end)
            if not end:
                self._append(_MAGIC + _line(_CONDITIONS, json.dumps(dict(conditions)).encode()))
            self._reader = path.open("rb")
        except BaseException:
            self._writer.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._reader.close()
        self._writer.close()

    @property
    def is_new(self) -> bool:
        """Whether nothing was finished when it was opened."""
        return not self._offsets

    def find(self, key: str) -> dict[str, object] | None:
        """Return the values last added under `key` before the journal was opened.

        Raises `ValueError` where a whole line holds something else: it was not written by this class.
        """
        offset = self._offsets.get(_short(key))
        if offset is None:
            return None
        self._reader.seek(offset)
        read = _read_line(self._reader.readline())
        if read is None:
            return None
        values = _values(read[1])
        if values is None:
            raise ValueError("it holds no values")
        return values

    def add(self, key: str, values: Mapping[str, object]) -> None:
        """Append `values` under `key`; they are there even if the run is killed at once."""
        self._append(_line(_short(key).hex(), json.dumps(values, separators=(",", ":")).encode()))

    def remove(self) -> None:
        """Delete the file: nothing is left to do."""
        self.path.unlink(missing_ok=True)

    def _begun(self, conditions: Mapping[str, str], resume: bool) -> int:
        """Return where the whole lines of a run to go on with end, 0 without one, and keep where each begins."""
        self._writer.seek(0)
        start = self._writer.read(len(_MAGIC))
        if start in _FORMER and resume:
            raise UsageError(
                f"{self.path}: was written by an earlier version of circlepose, which stored results in another way; "
                "leave out --resume to measure all images again."
            )
        if start in _FORMER:
            self.discarded = True
            return 0
        if not _MAGIC.startswith(start):
            raise _no_journal(self.path)
        lines = _whole_lines(self._writer)
        first = next(lines, None)
        if first is None:
            return 0
        if not resume:
            self.discarded = next(lines, None) is not None
            return 0
        begun_with = _values(first[1])
        if begun_with is None:
            raise UsageError(
                f"{self.path}: its first line does not hold the options of the run; leave out --resume to measure "
                "all images again."
            )
        _refuse_other_conditions(self.path, begun_with, conditions)
        end = first[2]
        for key, _, line_end in lines:
            with suppress(ValueError):
                self._offsets[bytes.fromhex(key)] = end
            end = line_end
        return end

    def _append(self, data: bytes) -> None:
        try:
            # A raw file: each line is one call of the system and nothing waits in this process.
            while data:
                data = data[self._writer.write(data) :]
        except OSError as reason:
            raise OutputError(
                f"{self.path}: cannot be written ({reason.strerror}); it keeps what is finished, go on with --resume."
            ) from None


def _opened_alone(path: Path, output: str) -> IO[bytes]:
    """Open for appending and take the lock, which ends with the process, however it ends."""
    while True:
        handle = _opened(path, output)
        if sys.platform == "win32":
            # There are no such locks: two runs with one output are the user's affair.
            return handle
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            handle.close()
            raise UsageError(f"{output}: another run is writing it; wait for its end, or give another -o.") from None
        except OSError:
            # Some network file systems have no locks.
            return handle
        with suppress(FileNotFoundError):
            if os.path.samestat(path.stat(), os.stat(handle.fileno())):  # noqa: PTH116 - a descriptor
                return handle
        # Another run has just ended and removed it.
        handle.close()


def _opened(path: Path, output: str) -> IO[bytes]:
    """Open a regular file of one name, never through a link, for reading and appending."""
    flags = os.O_RDWR | os.O_CREAT | os.O_APPEND | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
    try:
        with on_behalf(output):
            descriptor = os.open(path, flags, 0o666)
    except OutputError:
        if not (path.is_symlink() or path.is_dir()):
            raise
        raise _no_journal(path) from None
    with ExitStack() as until_known:
        until_known.callback(os.close, descriptor)
        with on_behalf(output):
            status = os.fstat(descriptor)
            sync_folder_of(path)
        if not stat.S_ISREG(status.st_mode) or status.st_nlink > 1:
            raise _no_journal(path)
        until_known.pop_all()
    return os.fdopen(descriptor, "rb+", buffering=0)


def _no_journal(path: Path) -> OutputError:
    return OutputError(f"{path}: exists and is not a circlepose journal; move or delete it.")


def _refuse_other_conditions(path: Path, before: Mapping[str, object], now: Mapping[str, str]) -> None:
    changed = [
        f"{name} was {before.get(name, 'not there')} and is {now.get(name, 'not there')}"
        for name in {**before, **now}
        if before.get(name) != now.get(name)
    ]
    if changed:
        raise UsageError(
            f"{path}: the run has other options: {'; '.join(changed)}. Give the options of that run, or leave "
            "out --resume to measure all images again."
        )


def _whole_lines(handle: IO[bytes]) -> Iterator[tuple[str, bytes, int]]:
    """Yield key, values and end of each line from where `handle` stands, up to the first that is torn."""
    end = handle.tell()
    with open(os.dup(handle.fileno()), "rb") as buffered:  # noqa: PTH123 - a second, buffered reader
        buffered.seek(end)
        for line in buffered:
            read = _read_line(line)
            if read is None:
                return
            end += len(line)
            yield *read, end


def _line(key: str, values: bytes) -> bytes:
    content = key.encode() + b" " + values
    return b"%08x %s\n" % (zlib.crc32(content), content)


def _read_line(line: bytes) -> tuple[str, bytes] | None:
    """Return key and values, or None where the line is torn or damaged."""
    checksum, _, content = line.rstrip(b"\n").partition(b" ")
    if not line.endswith(b"\n") or checksum != b"%08x" % zlib.crc32(content):
        return None
    key, _, values = content.partition(b" ")
    return key.decode("ascii", "replace"), values


def _values(text: bytes) -> dict[str, object] | None:
    """Return the values of a line, None where they are no JSON object."""
    try:
        values = json.loads(text)
    except (ValueError, RecursionError):
        return None
    return values if isinstance(values, dict) else None


def _short(key: str) -> bytes:
    return blake2b(key.encode("utf-8", "surrogateescape"), digest_size=_KEY_BYTES).digest()
