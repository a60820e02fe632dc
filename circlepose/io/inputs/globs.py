"""Globs as a shell reads them, except that a folder that cannot be read is reported: its images would be missed."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from fnmatch import translate
from functools import lru_cache

from circlepose.errors import UsageError

EVERYWHERE = "**"


def matches(folder: str, parts: Sequence[str]) -> Iterator[str]:
    """Yield the paths below `folder` whose names match the `parts` of a pattern one by one, in no order.

    `*`, `?` and `[...]` match names that are not hidden; `**` any folders, but not by way of links, which may lead
    round in a circle. Raises `UsageError` for a folder that cannot be read.
    """
    part, rest = parts[0], parts[1:]
    if part == EVERYWHERE:
        while rest and rest[0] == EVERYWHERE:
            rest = rest[1:]
        for each in _folders(folder):
            yield from matches(each, rest or ["*"])
    elif not rest:
        if is_pattern(part):
            yield from (path for path, entry in _entries(folder) if name_matches(entry.name, part))
        elif os.path.lexists(_join(folder, part)):
            yield _join(folder, part)
    elif is_pattern(part):
        for path, entry in _entries(folder):
            if name_matches(entry.name, part) and entry.is_dir():
                yield from matches(path, rest)
    elif os.path.isdir(_join(folder, part)):  # noqa: PTH112 - False, too, where it may not be looked
        yield from matches(_join(folder, part), rest)


def _folders(folder: str) -> Iterator[str]:
    """Yield `folder` and those below it that are neither hidden nor links, however deep they lie in one another."""
    waiting = [folder]
    while waiting:
        each = waiting.pop()
        yield each
        waiting += [
            path
            for path, entry in _entries(each)
            if entry.is_dir(follow_symlinks=False) and not entry.name.startswith(".")
        ]


def is_pattern(part: str) -> bool:
    """Whether a name has characters that stand for others."""
    return any(mark in part for mark in "*?[")


def name_matches(name: str, pattern: str) -> bool:
    """Whether one name, without folders, is matched; hidden ones are by a pattern that begins with a dot."""
    if name.startswith(".") and not pattern.startswith("."):
        return False
    return _compiled(os.path.normcase(pattern)).match(os.path.normcase(name)) is not None


def refused_folder(error: OSError) -> UsageError:
    """Return the error that says of a folder that it cannot be read."""
    return UsageError(f"{error.filename}: the folder cannot be read ({error.strerror}).")


@lru_cache
def _compiled(pattern: str) -> re.Pattern[str]:
    return re.compile(translate(pattern))


def _entries(folder: str) -> Iterator[tuple[str, os.DirEntry[str]]]:
    try:
        with os.scandir(folder or ".") as entries:
            for entry in list(entries):
                yield _join(folder, entry.name), entry
    except OSError as error:
        raise refused_folder(error) from None


def _join(folder: str, name: str) -> str:
    return os.path.join(folder, name)  # noqa: PTH118 - keeps the ./ that was typed
