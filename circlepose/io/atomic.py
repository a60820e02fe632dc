"""The one way in which files are written: whole or not at all, over nothing that is not ours.

The content goes to a new file beside the place it is meant for, which then takes the place's name. After a power cut
the place holds the former content or the new one, both whole: the file and its folder are synced before the file is
renamed, and the folder once more after it.
"""

from __future__ import annotations

import errno
import io
import os
import secrets
import shutil
import stat
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from hashlib import blake2b
from pathlib import Path
from typing import IO, Any, BinaryIO, Literal, TextIO, overload

from circlepose.errors import OutputError
from circlepose.io.marks import bears_mark

_STORAGE_FAILS = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EROFS}
_NO_FOLDER_SYNC = {errno.EINVAL, errno.ENOTSUP, errno.EACCES, errno.EBADF, errno.EPERM}
"""what file systems and permissions answer that do not let a folder be synced"""
_NEW_FILE = os.O_RDWR | os.O_CREAT | os.O_EXCL | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_CLOEXEC", 0)
_unfinished: set[Path] = set()


def is_replaceable_file(path: str | os.PathLike[str]) -> bool:
    """Return whether what `path` leads to is a regular file, or nothing yet: not a device, a pipe or a folder."""
    try:
        return stat.S_ISREG(os.stat(path).st_mode)  # noqa: PTH116 - a path need not be a Path
    except OSError:
        return True


def refuse_foreign(path: str | os.PathLike[str], *, overwrite: bool) -> None:
    """Raise `OutputError` where `path` leads to a regular file that is neither empty nor ours, unless `overwrite`."""
    if overwrite:
        return
    name = os.fspath(path)
    try:
        # Where it will be written: of `gone/../t.csv` the system finds nothing, and realpath does.
        place = Path(os.path.realpath(path))
        status = place.stat()
        is_foreign = stat.S_ISREG(status.st_mode) and status.st_size > 0 and not bears_mark(place)
    except FileNotFoundError:
        return
    except (OSError, ValueError) as reason:
        raise OutputError(f"{name}: cannot be written ({_why(reason)}).") from None
    if is_foreign:
        raise OutputError(
            f"{name}: exists and does not bear circlepose's mark; give another name, or --overwrite to replace it."
        )


@overload
def atomic_writer(
    path: str | os.PathLike[str], *, binary: Literal[False] = False, overwrite: bool = False
) -> AbstractContextManager[TextIO]: ...
@overload
def atomic_writer(
    path: str | os.PathLike[str], *, binary: Literal[True], overwrite: bool = False
) -> AbstractContextManager[BinaryIO]: ...
def atomic_writer(
    path: str | os.PathLike[str], *, binary: bool = False, overwrite: bool = False
) -> AbstractContextManager[IO[Any]]:
    r"""Return a context manager for writing `path`: it yields a handle, UTF-8 text with `\n` as written, or binary.

    The file takes its place when the block ends; if the block raises, what stood there before is untouched. Links
    are followed to the file that they lead to. A device or a pipe (`/dev/null`) is written to directly. Names that
    are not UTF-8 pass through text as `os.fsdecode` gives them.

    Raises `OutputError` when the folder is missing, not writable or full, and when a file is there that was not
    written by circlepose, unless `overwrite`.
    """
    return _written(path, binary, overwrite)


@contextmanager
def _written(path: str | os.PathLike[str], binary: bool, overwrite: bool) -> Iterator[IO[Any]]:
    name = os.fspath(path)
    if not is_replaceable_file(path):
        try:
            with _opened_in_place(name) as raw, _layered(raw, binary) as handle:
                yield handle
        except OSError as reason:
            if reason.errno in _STORAGE_FAILS and reason.filename is None:
                raise OutputError(f"{name}: cannot be written ({_why(reason)}).") from None
            raise
        return
    refuse_foreign(path, overwrite=overwrite)
    place = Path(os.path.realpath(path))
    temporary = place.with_name(f"{_stem_of_temporaries(place)}{secrets.token_hex(8)}.part")
    try:
        with _unlinked_at_end(temporary):
            with _created(temporary, name) as raw:
                _keep_mode(raw, place)
                with _layered(raw, binary) as handle:
                    yield handle
                    handle.flush()
                    os.fsync(raw.fileno())
            _sync_folder(place.parent)
            os.replace(temporary, place)  # noqa: PTH105 - one call of the system by its name
            _sync_folder(place.parent)
    except OSError as reason:
        if reason.errno in _STORAGE_FAILS or reason.filename in (str(temporary), str(place.parent)):
            raise OutputError(f"{name}: cannot be written ({_why(reason)}).") from None
        raise


def remove_unfinished() -> None:
    """Remove the files that are being written, and folders of temporary files: the process ends at once."""
    for temporary in list(_unfinished):
        with suppress(OSError):
            os.unlink(temporary)  # noqa: PTH108 - one call of the system by its name
            continue
        shutil.rmtree(temporary, ignore_errors=True)


@contextmanager
def removed_at_end(temporary: Path) -> Iterator[None]:
    """Have `remove_unfinished` remove a file or folder, meanwhile, that the caller removes otherwise."""
    _unfinished.add(temporary)
    try:
        yield
    finally:
        _unfinished.discard(temporary)


def remove_left_behind(path: str | os.PathLike[str]) -> None:
    """Remove what a killed run left of the file at `path`; the caller knows that no other run is writing it."""
    place = Path(os.path.realpath(path))
    stem = _stem_of_temporaries(place)
    with suppress(OSError):
        for entry in os.scandir(place.parent):
            if entry.name.startswith(stem) and entry.is_file(follow_symlinks=False):
                os.unlink(entry.path)  # noqa: PTH108 - one call of the system by its name


def sync_folder_of(path: Path) -> None:
    """Have the name of the file at `path` survive a power cut."""
    _sync_folder(path.parent)


def _stem_of_temporaries(place: Path) -> str:
    return f".circlepose-{blake2b(os.fsencode(place.name), digest_size=4).hexdigest()}-"


@contextmanager
def _unlinked_at_end(temporary: Path) -> Iterator[None]:
    with removed_at_end(temporary):
        try:
            yield
        finally:
            with suppress(FileNotFoundError):
                os.unlink(temporary)  # noqa: PTH108 - one call of the system by its name


@contextmanager
def _created(temporary: Path, name: str) -> Iterator[io.RawIOBase]:
    """Yield a new file, never one that is there already nor through a link."""
    with on_behalf(name):
        descriptor = os.open(temporary, _NEW_FILE, 0o666)
    with raw_file(descriptor) as raw:
        yield raw


@contextmanager
def _opened_in_place(name: str) -> Iterator[io.RawIOBase]:
    with on_behalf(name):
        descriptor = os.open(name, os.O_WRONLY)
    with raw_file(descriptor) as raw:
        yield raw


def raw_file(descriptor: int) -> io.RawIOBase:
    """Return the unbuffered file of a descriptor."""
    return io.FileIO(descriptor, "wb")


@contextmanager
def on_behalf(name: str) -> Iterator[None]:
    """Report what the system refuses under the name that the caller gave."""
    try:
        yield
    except FileNotFoundError:
        raise OutputError(f"{name}: the folder {Path(name).parent} does not exist; make it first.") from None
    except IsADirectoryError:
        raise OutputError(f"{name}: is a folder; give the name of a file.") from None
    except (OSError, ValueError) as reason:
        raise OutputError(f"{name}: cannot be written ({_why(reason)}).") from None


@contextmanager
def _layered(raw: io.RawIOBase, binary: bool) -> Iterator[IO[Any]]:
    buffered = io.BufferedWriter(raw)
    try:
        if binary:
            yield buffered
        else:
            with text_layer(buffered) as text:
                yield text
        buffered.flush()
    finally:
        with suppress(OSError, ValueError):
            buffered.close()


@contextmanager
def text_layer(content: BinaryIO) -> Iterator[IO[str]]:
    """Yield text to write into `content`, which stays open."""
    text = io.TextIOWrapper(content, encoding="utf-8", errors="surrogateescape", newline="")
    try:
        yield text
        text.flush()
    finally:
        # What could not be written must not be tried again when the layer is collected.
        with suppress(OSError, ValueError):
            text.detach()


def _keep_mode(raw: io.RawIOBase, place: Path) -> None:
    """Give the new file the permissions of the one that it replaces."""
    with suppress(OSError, AttributeError):
        os.fchmod(raw.fileno(), stat.S_IMODE(place.stat().st_mode))


def _sync_folder(folder: Path) -> None:
    if not hasattr(os, "O_DIRECTORY"):
        return
    try:
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
    except OSError as reason:
        if reason.errno not in _NO_FOLDER_SYNC:
            raise OSError(reason.errno, reason.strerror, str(folder)) from None


def _why(reason: OSError | ValueError) -> str:
    return str(getattr(reason, "strerror", None) or reason)
