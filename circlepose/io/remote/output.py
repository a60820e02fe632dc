"""Files that appear at a URL whole or not at all: written on this machine, then uploaded."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from hashlib import blake2b
from pathlib import Path
from typing import BinaryIO

from circlepose.errors import OutputError
from circlepose.io.atomic import atomic_writer
from circlepose.io.marks import HEAD_BYTES, is_marked
from circlepose.io.remote.images import RemoteFile, first_line, opened, require

_WHOLE = {"s3", "s3a", "gs", "gcs", "az", "abfs", "abfss", "adl", "oci", "memory"}
"""kinds of stores where an object appears when all of it is there"""
_PART = ".circlepose-part"


def stand_in(file: RemoteFile) -> Path:
    """Return the path, on this machine, of what is to be at `file`: below `$XDG_STATE_HOME`, the same in each run.

    Its folder is made. Raises `OutputError` where that fails.
    """
    base = os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state"
    folder = Path(base) / "circlepose"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(
            f"{folder}: the folder, where a run that writes to a URL keeps what is finished, cannot be made "
            f"({error.strerror}); name another in XDG_STATE_HOME."
        ) from None
    digest = blake2b(str(file).encode(), digest_size=8).hexdigest()
    return folder / f"{digest}-{file.name[-100:]}"


@contextmanager
def uploading_writer(file: RemoteFile, *, overwrite: bool = False) -> Iterator[BinaryIO]:
    """Yield a handle for what is at `file` once the block has ended; if it raises, nothing is changed there.

    Until then the content is in a file of this machine, in the folder of `stand_in`. Raises `UsageError` for a kind
    of URL that is not known, and `OutputError`, before the block where possible, when it cannot be written or what is
    there was not written by circlepose, unless `overwrite`.
    """
    _try_out(file)
    if not overwrite:
        _refuse_foreign(file)
    local = stand_in(file)
    try:
        with atomic_writer(local, binary=True, overwrite=True) as handle:
            yield handle
        _upload(local, file)
    finally:
        local.unlink(missing_ok=True)


def _try_out(file: RemoteFile) -> None:
    """Write something small beside it: who may not write is to know before the images are measured."""
    require(file.url)
    if file.url.startswith(("http://", "https://")):
        raise OutputError(
            f"{file}: nothing can be written there; give a file, or an object as s3://bucket/poses.csv."
        )
    if file.url.endswith("/"):
        raise OutputError(f"{file}: is a folder; give the name of a file.")
    try:
        files, path = opened(file.url)
        files.pipe_file(path + _PART, b"\n")
    except Exception as error:
        raise _refused(file, error) from None
    with suppress(Exception):
        files.rm_file(path + _PART)


def _refuse_foreign(file: RemoteFile) -> None:
    try:
        files, path = opened(file.url)
        head = bytes(files.cat_file(path, start=0, end=HEAD_BYTES))
    except FileNotFoundError:
        return
    except Exception as error:
        raise _refused(file, error) from None
    if head and not is_marked(head) and not head.startswith(b"PAR1"):
        raise OutputError(
            f"{file}: exists and does not bear circlepose's mark; give another name, or --overwrite to replace it."
        )


def _upload(local: Path, file: RemoteFile) -> None:
    try:
        files, path = opened(file.url)
        if file.url.partition("://")[0].lower() in _WHOLE:
            files.put_file(str(local), path)
        else:
            files.put_file(str(local), path + _PART)
            files.mv(path + _PART, path)
    except Exception as error:
        raise _refused(file, error, "; what is finished is kept, go on with --resume") from None


def _refused(file: RemoteFile, error: Exception, further: str = "") -> OutputError:
    # The libraries below fsspec raise errors of many families of their own.
    if isinstance(error, FileNotFoundError):
        return OutputError(f"{file}: cannot be written (there is no such bucket or folder){further}.")
    if isinstance(error, PermissionError):
        return OutputError(f"{file}: cannot be written (permission denied){further}.")
    return OutputError(f"{file}: cannot be written ({first_line(error)}){further}.")
