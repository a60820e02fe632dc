"""Whether a command would write to a file that it reads, or twice to one, by whatever name, link or URL."""

from __future__ import annotations

import os
import re
import stat
from collections.abc import Iterable

from circlepose.errors import UsageError
from circlepose.io.remote.images import Place, RemoteFile


class Outputs:
    """The places that a command writes to; `refuse` each place that it reads."""

    def __init__(self, places: Iterable[Place | int | None]) -> None:
        """Take the places that are there already: those that are not cannot be read."""
        self._urls: dict[str, Place] = {}
        self._files: dict[tuple[int, int], Place | int] = {}
        for place in places:
            if isinstance(place, RemoteFile):
                self._urls[_normal_url(place)] = place
            elif place is not None and (identity := _identity(place)) is not None:
                self._files[identity] = place

    def refuse(self, place: Place | int | None, what: str) -> None:
        """Raise `UsageError` where `place` (a descriptor, too), which holds `what`, is also written to."""
        output: Place | int | str | None = None
        if isinstance(place, RemoteFile):
            output = self._urls.get(_normal_url(place))
        elif place is not None and self._files and (identity := _identity(place)) is not None:
            output = self._files.get(identity)
        if output is not None:
            name = "standard input" if isinstance(place, int) else place
            output = "standard output" if isinstance(output, int) else output
            raise UsageError(f"{output}: would be overwritten, but it holds {what} ({name}); give another name.")


def refuse_one_place(outputs: Iterable[tuple[str, Place | None]]) -> None:
    """Raise `UsageError` where two outputs, each with its option, are one file, whether it is there or not."""
    seen: dict[object, tuple[str, Place]] = {}
    for option, place in outputs:
        if place is None:
            continue
        former, other = seen.setdefault(_name_of(place), (option, place))
        if former != option:
            raise UsageError(f"{former} {other}, {option} {place}: are one file; give two names.")


def _name_of(place: Place) -> object:
    """Return the same for places that are one file; for devices and pipes, which take several, never the same."""
    if isinstance(place, RemoteFile):
        return _normal_url(place)
    real = os.path.realpath(place)
    if os.path.exists(real):  # noqa: PTH110 - a name that no file can have is no error here
        return _identity(real) or object()
    return real


def _identity(place: str | os.PathLike[str] | int) -> tuple[int, int] | None:
    try:
        status = os.stat(place if isinstance(place, int) else os.path.realpath(place))  # noqa: PTH116
    except (OSError, ValueError):
        return None
    # Devices and pipes, such as /dev/null, may well be read and written.
    if not stat.S_ISREG(status.st_mode):
        return None
    return status.st_dev, status.st_ino


def _normal_url(file: RemoteFile) -> str:
    """Return the same for URLs that name one object: kinds have aliases, and a query is no part of the name."""
    kind, _, rest = file.url.partition("://")
    kind = {"s3a": "s3", "gcs": "gs", "abfss": "abfs"}.get(kind.lower(), kind.lower())
    return f"{kind}://{re.sub(r'/+', '/', rest.partition('?')[0])}"
