"""Files that appear whole or not at all: written beside the place they are meant for, then renamed."""

from __future__ import annotations

import errno
import os
import secrets
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import IO, Any, BinaryIO, Literal, TextIO, overload

from circlepose.errors import OutputError

_STORAGE_FAILS = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO}


@overload
def atomic_writer(
    path: str | os.PathLike[str], *, binary: Literal[False] = False, temporary: Path | None = None
) -> AbstractContextManager[TextIO]: ...
@overload
def atomic_writer(
    path: str | os.PathLike[str], *, binary: Literal[True], temporary: Path | None = None
) -> AbstractContextManager[BinaryIO]: ...
def atomic_writer(
    path: str | os.PathLike[str], *, binary: bool = False, temporary: Path | None = None
) -> AbstractContextManager[IO[Any]]:
    r"""Return a context manager that yields a handle (UTF-8 text, `\n` kept as written, or binary) for `path`.

    The file takes its place when the block ends; if the block raises, what stood there before is untouched.
    A device or a pipe (`/dev/null`, `/dev/stdout`) is written to directly. Names that are not UTF-8 pass
    through text as `os.fsdecode` gives them. Until the end the content is in `temporary`, which is overwritten, or
    else in a new hidden file; it has to be in the folder of the file that `path` leads to, links followed.
    Raises `OutputError` when the folder is missing, not writable or full.
    """
    place = Path(os.path.realpath(path))
    # os.path, unlike Path, does not raise where a folder may not be searched; opening the file then says so.
    is_device = os.path.exists(place) and not os.path.isfile(place)  # noqa: PTH110, PTH113
    name = os.fspath(path)
    return open_on_behalf(place, name, "w", binary=binary) if is_device else _renamed(place, name, binary, temporary)


@contextmanager
def _renamed(place: Path, name: str, binary: bool, given: Path | None) -> Iterator[IO[Any]]:
    temporary = given or place.with_name(f".circlepose-{secrets.token_hex(8)}.part")
    handle = open_on_behalf(temporary, name, "w" if given else "x", binary=binary)
    try:
        with handle:
            yield handle
            handle.flush()
            os.fsync(handle.fileno())
        temporary.replace(place)
    except OSError as reason:
        if reason.errno in _STORAGE_FAILS or reason.filename in (str(temporary), str(place)):
            raise OutputError(f"{name}: cannot be written ({reason.strerror}).") from None
        raise
    finally:
        temporary.unlink(missing_ok=True)


def open_on_behalf(file: Path, name: str, mode: str, *, binary: bool, buffering: int = -1) -> IO[Any]:
    """Open `file` on behalf of the file that the caller calls `name`; raises `OutputError`."""
    try:
        if binary:
            return file.open(mode + "b", buffering)
        return file.open(mode, encoding="utf-8", errors="surrogateescape", newline="")
    except FileNotFoundError:
        raise OutputError(f"{name}: the folder {Path(name).parent} does not exist; make it first.") from None
    except IsADirectoryError:
        raise OutputError(f"{name}: is a folder; give the name of a file.") from None
    except (OSError, ValueError) as reason:
        why = getattr(reason, "strerror", None) or reason
        raise OutputError(f"{name}: cannot be written ({why}).") from None
