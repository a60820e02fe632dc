"""Images at URLs: `s3://`, `gs://`, `https://` and whatever else fsspec reads."""

from __future__ import annotations

import re
from dataclasses import dataclass
from hashlib import blake2b
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

from circlepose.errors import ImageError, UsageError
from circlepose.io.images.content import MAX_FILE_BYTES, too_many_bytes
from circlepose.io.text.escaping import redacted
from circlepose.results import Status

_URL = re.compile(r"([A-Za-z][A-Za-z0-9+.-]+)://")
_LOCAL = re.compile(r"(?:file|local)://")
_TAGS = ("ETag", "etag", "md5Hash", "LastModified", "mtime", "created")
_INSTALL = "pip install 'circlepose[cluster]'"


class RemoteStat(NamedTuple):
    """As much of `os.stat_result` as shows whether an object has changed."""

    st_size: int
    st_mtime_ns: int
    """not a time: a digest of the object's tag or time of change"""


@dataclass(frozen=True, slots=True, repr=False)
class RemoteFile:
    """An object at a URL; as text it is the URL without credentials."""

    url: str
    """as it is opened: not to be shown"""
    listed: RemoteStat | None = None
    """from the listing that it was found in"""

    def __str__(self) -> str:
        return redacted(self.url)

    __repr__ = __str__

    @property
    def name(self) -> str:
        """The last part of the path."""
        return str(self).rsplit("/", 1)[-1]

    @property
    def parent(self) -> RemoteFile:
        """What a folder would be: the URL up to its last slash, without query."""
        return RemoteFile(re.split(r"\?", self.url)[0].rsplit("/", 1)[0] + "/")

    def stat(self) -> RemoteStat:
        """Return the object's state; raises `OSError` where there is none to be had.

        A URL with credentials or a query has none: what it gives may depend on what must not be kept.
        """
        if str(self) != self.url:
            raise FileNotFoundError(f"{self}: the state of what is behind a query is not known")
        if self.listed is not None:
            return self.listed
        try:
            state = state_of(_info(self))
        except Exception as error:
            raise FileNotFoundError(f"{self}: {first_line(error)}") from None
        if state is None:
            raise FileNotFoundError(f"{self}: has neither a tag nor a time")
        return state

    def read_bytes(self) -> bytes:
        """Return the content; raises `ImageError` with the status `unreadable` or `too_large`."""
        try:
            size = self.listed.st_size if self.listed else _info(self).get("size")
            if size is None or size <= MAX_FILE_BYTES:
                files, path = opened(self.url)
                return bytes(files.cat_file(path))
        except (FileNotFoundError, IsADirectoryError):
            reason = "there is no such object"
        except PermissionError:
            reason = "may not be read (permission denied)"
        except ImportError as error:
            reason = f"cannot be read ({first_line(error)}); {_INSTALL}"
        except Exception as error:
            # The libraries below fsspec raise errors of many families of their own.
            reason = f"cannot be read ({first_line(error)})"
        else:
            raise too_many_bytes(str(self), size)
        raise ImageError(Status.UNREADABLE, f"{self}: {reason}.")


Place: TypeAlias = Path | RemoteFile
"""Where an image is."""


def is_url(typed: str) -> bool:
    """Whether an input or a line is a URL, not a path; `file://` counts as one."""
    return _URL.match(typed) is not None


def place_of(typed: str) -> Place:
    """Return the place that a path or URL names."""
    local = _LOCAL.match(typed)
    if local:
        return Path(typed[local.end() :])
    if not is_url(typed):
        return Path(typed)
    return RemoteFile(typed)


def _info(file: RemoteFile) -> dict[str, Any]:
    files, path = opened(file.url)
    return dict(files.info(path))


def state_of(info: dict[str, Any]) -> RemoteStat | None:
    """Return the state that a listing or a server states."""
    tags = [str(info[key]) for key in _TAGS if info.get(key)]
    size = info.get("size", info.get("Size"))
    if not tags or size is None:
        return None
    digest = blake2b(tags[0].encode(), digest_size=7).digest()
    return RemoteStat(int(size), int.from_bytes(digest, "big"))


def require(url: str) -> None:
    """Raise `UsageError` unless fsspec, and what it needs for this kind of URL, is installed."""
    match = _URL.match(url)
    if match is None:
        raise UsageError(f"{redacted(url)}: is no URL.")
    try:
        import fsspec  # noqa: PLC0415 - only where there are URLs

        fsspec.get_filesystem_class(match[1].lower())
    except ImportError as error:
        missing = "fsspec" if error.name == "fsspec" else first_line(error)
        raise UsageError(f"{redacted(url)}: URLs of this kind cannot be read ({missing}); {_INSTALL}.") from None
    except ValueError:
        raise UsageError(f"{redacted(url)}: {match[1]}:// is no kind of URL that can be read.") from None


def opened(url: str) -> tuple[Any, str]:
    """Return the file system of a URL, which fsspec keeps, and the path in it."""
    import fsspec  # noqa: PLC0415 - only where there are URLs

    kind = url.partition("://")[0].lower()
    maker = fsspec.get_filesystem_class(kind)
    # Not fsspec.core.url_to_fs, which takes `::`, as it may stand in a name, for a chain of URLs. And listings of
    # millions of objects are not to be kept.
    files = fsspec.filesystem(kind, use_listings_cache=False, **maker._get_kwargs_from_urls(url))
    return files, str(maker._strip_protocol(url))


def first_line(error: Exception) -> str:
    """Return an error's kind and the first line of what it says, without credentials."""
    text = redacted(str(error)).strip().partition("\n")[0][:200]
    return f"{type(error).__name__}: {text}" if text else type(error).__name__
