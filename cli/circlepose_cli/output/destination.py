"""Where the results go: standard output, or a file with, as long as a run is not at its end, a journal beside it.

What is to be at a URL stands in a folder of this machine until it is whole, and so does its journal.
"""

from __future__ import annotations

import gzip
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any, BinaryIO

from circlepose.batch.journal import Journal
from circlepose.batch.measure import MeasureOptions
from circlepose.batch.resume import conditions, journal_path
from circlepose.errors import UsageError
from circlepose.io.atomic import atomic_writer, is_replaceable_file, refuse_foreign, remove_left_behind, text_layer
from circlepose.io.remote.images import Place, RemoteFile, place_of
from circlepose.io.remote.output import stand_in, uploading_writer
from circlepose_cli.output.results import is_compressed

_STANDARD_OUTPUT = {"-", "/dev/stdout", "/dev/fd/1", "/proc/self/fd/1"}


class Unfinished(Exception):  # noqa: N818 - no error: it takes back what is being written
    """Raised in the block of `open_output`, leaves the former file in its place."""


def output_place(typed: str | os.PathLike[str] | None) -> Place | None:
    """Return the place that -o names, None for standard output."""
    return None if typed is None or str(typed) in _STANDARD_OUTPUT else place_of(str(typed))


def is_file(output: Place) -> bool:
    """Return whether `output` is a file, here or at a URL: not a device or a pipe."""
    return isinstance(output, RemoteFile) or is_replaceable_file(output)


def open_journal(output: Place | None, options: MeasureOptions, *, resume: bool, overwrite: bool) -> Journal | None:
    """Open the journal of `output`; None where that is not a regular file, so that a run cannot be resumed.

    Raises `UsageError` for a run that cannot be resumed, and `OutputError` where `output` may not be replaced.
    """
    if output is None:
        if resume:
            raise UsageError("--resume: needs -o FILE; the journal of the run is beside it.")
        return None
    if isinstance(output, RemoteFile):
        place = stand_in(output)
    elif is_replaceable_file(output):
        refuse_foreign(output, overwrite=overwrite)
        place = Path(os.path.realpath(output))
    else:
        if resume:
            raise UsageError(f"--resume: {output} is not a regular file, so it has no journal.")
        return None
    journal = Journal(journal_path(place), conditions(options), resume=resume, output=str(output))
    # The journal's lock keeps the place for this run.
    remove_left_behind(place)
    return journal


@contextmanager
def open_output(output: Place | None, *, binary: bool = False, overwrite: bool = False) -> Iterator[IO[Any]]:
    """Open `output`, which appears when it is complete, or standard output; compressed where its name ends in .gz."""
    if output is None:
        yield sys.stdout
        return
    opened = (
        uploading_writer(output, overwrite=overwrite)
        if isinstance(output, RemoteFile)
        else atomic_writer(output, binary=True, overwrite=overwrite)
    )
    with opened as raw, _compressed(raw, output) as content:
        if binary:
            yield content
            return
        with text_layer(content) as text:
            yield text


@contextmanager
def _compressed(raw: BinaryIO, output: Place) -> Iterator[BinaryIO]:
    if not is_compressed(output):
        yield raw
        return
    # Without name and time, so that equal results are equal files.
    with _Gzip(filename="", mode="wb", fileobj=raw, mtime=0) as content:
        yield content  # type: ignore[misc]


class _Gzip(gzip.GzipFile):
    def flush(self, *_: int) -> None:
        """Do nothing: after each image, it would spoil the compression, and nobody reads the file meanwhile."""
