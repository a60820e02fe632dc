"""The images under a prefix or glob of a URL, one after the other: a bucket's list is never in memory as a whole."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain
from typing import Any

from circlepose.errors import UsageError
from circlepose.io.images.formats import is_image_name
from circlepose.io.inputs.globs import EVERYWHERE, is_pattern, name_matches
from circlepose.io.remote.images import RemoteFile, RemoteStat, first_line, opened, state_of
from circlepose.io.text.escaping import redacted

_PAGE = 1000
"""Objects that S3 lists at a time."""

Found = tuple[str, RemoteStat | None]
"""path below the prefix, and state"""


def is_listing(url: str) -> bool:
    """Whether a URL stands for several objects: it ends in a slash, or has a pattern."""
    return url.endswith("/") or _is_glob(url)


def images_at(url: str, recursive: bool) -> Iterator[tuple[RemoteFile, str]]:
    """Yield the images under a prefix (ending in `/`) or glob, each with its path below the prefix.

    In the order of the listing: S3's own, that of the bytes; elsewhere folder by folder, names in order. Hidden ones
    are left out. Raises `UsageError`, before the first image, where there is none or the listing fails.
    """
    if _is_glob(url) and not url.count("*") and _exists(url):
        return iter([(RemoteFile(url), url)])
    base, parts = _split_at_pattern(url)
    found = _images(base, parts, recursive)
    first = next(found, None)
    if first is None:
        raise UsageError(f"{redacted(url)}: {_nothing(base, parts, recursive)}")
    return ((RemoteFile(base + path, state), path) for path, state in chain([first], found))


def _images(base: str, parts: Sequence[str], recursive: bool) -> Iterator[Found]:
    deep = recursive if not parts else EVERYWHERE in parts or len(parts) > 1
    start = "" if not parts else _fixed_start(parts[0])
    try:
        for path, state in _objects(base, start, deep):
            names = path.split("/")
            matched = _matches(names, parts) if parts else not any(name.startswith(".") for name in names)
            if matched and is_image_name(path):
                yield path, state
    except FileNotFoundError:
        return
    except PermissionError:
        raise UsageError(f"{redacted(base)}: may not be listed (permission denied).") from None
    except UsageError:
        raise
    except Exception as error:
        # The libraries below fsspec raise errors of many families of their own.
        raise UsageError(f"{redacted(base)}: cannot be listed ({first_line(error)}).") from None


def _objects(base: str, start: str, deep: bool) -> Iterator[Found]:
    """Yield the objects below `base` whose path there begins with `start`; unless `deep`, those directly there."""
    files, root = opened(base)
    if hasattr(files, "call_s3"):
        yield from _s3_objects(files, root, start, deep)
        return
    root = root if root.endswith("/") else f"{root}/"
    for folder, below, found in files.walk(root, maxdepth=None if deep else 1, detail=True, on_error="raise"):
        for name in [each for each in below if each.startswith(".")]:
            del below[name]
        for name in sorted(found):
            path = f"{folder.rstrip('/')}/{name}"
            if path.startswith(root + start):
                yield path[len(root) :], state_of(found[name])


def _s3_objects(files: Any, root: str, start: str, deep: bool) -> Iterator[Found]:
    """Page through a bucket; s3fs's own listing would hold a folder of any size in memory."""
    bucket, _, key = root.partition("/")
    key = f"{key.rstrip('/')}/" if key else ""
    more: dict[str, Any] = {} if deep else {"Delimiter": "/"}
    while True:
        page = files.call_s3("list_objects_v2", Bucket=bucket, Prefix=key + start, MaxKeys=_PAGE, **more)
        for each in page.get("Contents", ()):
            path = each["Key"][len(key) :]
            if path and not path.endswith("/"):
                yield path, state_of(each)
        if not page.get("IsTruncated"):
            return
        more["ContinuationToken"] = page["NextContinuationToken"]


def _is_glob(url: str) -> bool:
    if url.startswith(("http://", "https://")):
        # There, a question mark begins a query.
        return "*" in url.partition("?")[0]
    return is_pattern(url)


def _split_at_pattern(url: str) -> tuple[str, list[str]]:
    """Return the prefix of a URL, with its slash, and the parts of the pattern below it; none for a prefix alone."""
    parts = url.split("/")
    # Not in `scheme://bucket`.
    count = next((number for number in range(3, len(parts)) if is_pattern(parts[number])), len(parts) - 1)
    return "/".join(parts[:count]) + "/", [part for part in parts[count:] if part]


def _fixed_start(part: str) -> str:
    """Return what all names begin with that a part of a pattern matches."""
    if part == EVERYWHERE:
        return ""
    return part[: next(place for place, mark in enumerate(part) if mark in "*?[")]


def _matches(names: Sequence[str], parts: Sequence[str]) -> bool:
    """Whether the names of a path are matched by the parts of a pattern."""
    if not parts:
        return not names
    if parts[0] == EVERYWHERE:
        rest = parts[1:] or ["*"]
        visible = next((place for place, name in enumerate(names) if name.startswith(".")), len(names))
        return any(_matches(names[place:], rest) for place in range(min(visible, len(names) - 1) + 1))
    return bool(names) and name_matches(names[0], parts[0]) and _matches(names[1:], parts[1:])


def _exists(url: str) -> bool:
    files, path = opened(url)
    try:
        return bool(files.exists(path))
    except Exception:
        return False


def _nothing(base: str, parts: Sequence[str], recursive: bool) -> str:
    """Return the rest of a sentence on a prefix or glob without images."""
    if parts:
        return "matches no image; check the pattern."
    if not recursive and next(_images(base, parts, recursive=True), None) is not None:
        return "holds no image itself, but prefixes in it do; add --recursive."
    return "holds no image; images end in .png, .jpg, .tif and the like."
