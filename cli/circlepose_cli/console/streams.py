"""Standard streams that are closed, full or left by their reader: no traceback, and no message among the data."""

from __future__ import annotations

import errno
import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import IO, Any

from circlepose.errors import OutputError


class _Output(io.TextIOWrapper):
    """Standard output in UTF-8, with line ends as written, whatever the locale.

    A reader that has gone, as `| head` does, ends the program with success; any other failure is an `OutputError`.
    """

    is_closed = False
    """whether the program was started with its standard output closed"""

    def write(self, text: str) -> int:
        if self.is_closed:
            raise OutputError("standard output: is closed; open it, or give -o FILE where the command has it.")
        try:
            return super().write(text)
        except OSError as error:
            raise self._failure(error) from None

    def flush(self) -> None:
        try:
            super().flush()
        except OSError as error:
            raise self._failure(error) from None

    def _failure(self, error: OSError) -> BaseException:
        _to_nowhere(self)
        if error.errno == errno.EPIPE:
            return SystemExit(0)
        return OutputError(f"standard output: cannot be written ({error.strerror}).")


class _Messages(io.TextIOWrapper):
    """Standard error, whose failures are no reason to end a run."""

    def write(self, text: str) -> int:
        try:
            return super().write(text)
        except OSError:
            _to_nowhere(self)
            return len(text)

    def flush(self) -> None:
        try:
            super().flush()
        except OSError:
            _to_nowhere(self)


@contextmanager
def standard_streams() -> Iterator[None]:
    """Guard standard output and error meanwhile.

    Descriptors 0 to 2 that are closed lead to the null device: a file opened later would else take their number, and
    with it what OpenCV and worker processes print.
    """
    _fill_descriptors()
    before = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = _guarded(sys.stdout, _Output), _guarded(sys.stderr, _Messages)
    try:
        yield
    finally:
        for ours, theirs in zip((sys.stdout, sys.stderr), before, strict=True):
            if isinstance(ours, _Output | _Messages):
                ours.detach()
            if theirs is not None:
                theirs.flush()
        sys.stdout, sys.stderr = before


def _fill_descriptors() -> None:
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            # Takes the lowest free number, which is this one.
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)


def _guarded(stream: IO[str] | None, kind: type[_Output | _Messages]) -> Any:
    if stream is None:
        guarded = kind(open(os.devnull, "wb"), encoding="utf-8", errors="backslashreplace")  # noqa: PTH123, SIM115
        if isinstance(guarded, _Output):
            guarded.is_closed = True
        return guarded
    if not isinstance(stream, io.TextIOWrapper):
        return stream
    stream.flush()
    is_output = kind is _Output
    return kind(
        stream.buffer,
        encoding="utf-8" if is_output else stream.encoding,
        errors="surrogateescape" if is_output else "backslashreplace",
        newline="" if is_output else None,
        line_buffering=stream.line_buffering,
        write_through=stream.write_through,
    )


def _to_nowhere(stream: io.TextIOWrapper) -> None:
    """Lead what is still buffered to the null device: the interpreter flushes once more when it ends."""
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, stream.fileno())
    os.close(null)
