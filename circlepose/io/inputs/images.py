"""From what was typed to images: files, folders, globs and paths on standard input, in natural order."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import TypeAlias

from circlepose.errors import UsageError
from circlepose.io.images.formats import is_image_name
from circlepose.io.images.unread_kinds import skipped_line, suffix_of_unread
from circlepose.io.inputs.globs import is_pattern, matches, refused_folder
from circlepose.io.marks import is_drawn_file
from circlepose.io.remote.images import Place, RemoteFile, is_url, place_of, require
from circlepose.io.remote.listing import images_at, is_listing
from circlepose.io.text.escaping import redacted

STDIN = "-"

_LOOKED_INTO = 50
"""folders that are looked into for a hint"""


@dataclass(frozen=True, slots=True, init=False)
class InputImage:
    """One image to measure; small, as there may be millions."""

    _place: str | RemoteFile
    name: str
    """what the table calls it: the path as typed, or relative to the folder where that is the only input; a URL is
    without its credentials"""

    def __init__(self, path: Place | str, name: str) -> None:
        # A Path takes several times the memory of its text.
        object.__setattr__(self, "_place", path if isinstance(path, RemoteFile) else os.fspath(path))
        object.__setattr__(self, "name", name)

    @property
    def path(self) -> Place:
        """Where it is."""
        return Path(self._place) if isinstance(self._place, str) else self._place


Stdin: TypeAlias = Iterable[str] | Iterable[bytes] | Iterable[bytes | InputImage]
"""paths, one each, or one image that came itself"""


def expand_inputs(
    inputs: Sequence[str],
    stdin: Stdin | None = None,
    recursive: bool = False,
    skipped: Counter[str] | None = None,
) -> Iterator[InputImage]:
    """Return the images that `inputs` stand for: in the order typed, folders and globs in natural order, each once.

    - A folder stands for the images in it (and in folders below, if `recursive`); hidden ones are left out, and so
      are pictures that circlepose drew.
    - A glob (`*`, `?`, `[...]`, `**`) that is not itself a file stands for what it matches.
    - A URL that ends in `/`, or has a pattern, stands for the images there, in the order in which they are listed and
      each taken when it is asked for; whether one comes twice is not looked at.
    - `-` stands for the paths and URLs on `stdin`, one a line, each taken when it is asked for: the producer may be
      endless.
    - Anything else is a file or an object; if it is missing, its row gets the status when it is read.

    Photographs and films in folders and globs, of kinds that are not read, are counted in `skipped` by their ending.

    A name is the path as typed, so that it leads back to the image; with a single folder as the only input it
    is the path below that folder. Raises `UsageError`, before the first image, for an input without any image.
    """
    if not inputs:
        raise UsageError("no image was given; give image files, a folder, a glob or - for paths on standard input.")
    if STDIN in inputs and stdin is None:
        raise UsageError("-: there is no standard input to read paths from.")
    skipped = Counter() if skipped is None else skipped
    parts = [_expanded(each, recursive, stdin or (), skipped, is_lone=len(inputs) == 1) for each in inputs]
    return _each_once(parts)


def are_streamed(inputs: Sequence[str]) -> bool:
    """Whether the images of `inputs` are known one after the other only, and may be more than fit in memory."""
    return any(each == STDIN or (is_url(each) and is_listing(each)) for each in inputs)


def natural_key(name: str) -> tuple[str, str]:
    """Return a sort key by which img2 comes before img10, and parts of a path are compared one by one."""
    # A number is led by the count of its digits; the name itself parts img1 from img01.
    key = re.sub(r"0*([0-9]+)", lambda match: f"{len(match[1]):03d}{match[1]}", name.casefold())
    return key.replace(os.sep, "\0"), name


def _each_once(parts: Iterable[Iterable[InputImage]]) -> Iterator[InputImage]:
    """Yield the images of all parts, those of lists once; streams are too long to remember."""
    parts = list(parts)
    if len(parts) == 1:
        yield from parts[0]
        return
    seen: set[str] = set()
    for part in parts:
        if not isinstance(part, list):
            yield from part
            continue
        for image in part:
            # Path drops ./ and doubled slashes but, rightly, no `..`.
            place = str(image.path)
            if place not in seen:
                seen.add(place)
                yield image


def _expanded(
    typed: str, recursive: bool, stdin: Stdin, skipped: Counter[str], *, is_lone: bool
) -> Iterable[InputImage]:
    """Return the images of one input; those of folders and globs of this machine are found at once."""
    if typed == STDIN:
        return _from_stdin(stdin)
    if is_url(typed):
        return _from_url(typed, recursive, skipped, is_lone)
    base = typed if is_lone and _is_folder(typed) else None
    return [
        InputImage(path, path if base is None else path[len(base) :].lstrip(os.sep).replace(os.sep, "/"))
        for path in _paths(typed, recursive, skipped)
    ]


def _from_stdin(lines: Stdin) -> Iterator[InputImage]:
    empty = True
    for line in lines:
        if isinstance(line, InputImage):
            yield line
            return
        path = os.fsdecode(line).rstrip("\r\n")
        if path:
            empty = False
            yield InputImage(place_of(path), redacted(path) if is_url(path) else path)
    if empty:
        raise UsageError("-: no path came on standard input; expected one a line.")


def _from_url(typed: str, recursive: bool, skipped: Counter[str], is_lone: bool) -> Iterable[InputImage]:
    place = place_of(typed)
    if isinstance(place, Path):
        return [InputImage(path, path) for path in _paths(str(place), recursive, skipped)]
    require(typed)
    if not is_listing(typed):
        return [InputImage(place, str(place))]
    below = is_lone and typed.endswith("/")
    return (InputImage(file, path if below else str(file)) for file, path in images_at(typed, recursive))


def _paths(typed: str, recursive: bool, skipped: Counter[str]) -> list[str]:
    if _is_folder(typed):
        return _in_folder(typed, recursive, skipped)
    if not is_pattern(typed) or os.path.lexists(typed):
        return [typed]
    found = sorted(set(matches(*_split_at_pattern(typed))), key=natural_key)
    images = [each for each in found if is_image_name(each) and not _is_folder(each) and not is_drawn_file(each)]
    if images:
        _count_unread(found, skipped)
        return images
    what = f"matches no image, only {_some(found)}" if found else "matches no file"
    raise UsageError(f"{typed}: {what}; check the pattern.")


def _split_at_pattern(typed: str) -> tuple[str, Sequence[str]]:
    """Return the part of a glob that is a folder, even with brackets in its name, and the pattern below it."""
    parts = Path(typed).parts
    count = 0
    while count < len(parts) - 1 and _is_folder(str(Path(*parts[: count + 1]))):
        count += 1
    return (str(Path(*parts[:count])) if count else ""), parts[count:]


def _count_unread(paths: Iterable[str], skipped: Counter[str]) -> None:
    skipped.update(suffix for suffix in map(suffix_of_unread, paths) if suffix is not None)


def _in_folder(typed: str, recursive: bool, skipped: Counter[str]) -> list[str]:
    images, others, folders = _listed(typed, recursive)
    if images:
        _count_unread(others, skipped)
        return images
    if not recursive and any(_has_image_below(folder) for folder in folders[:_LOOKED_INTO]):
        raise UsageError(f"{typed}: holds no image itself, but folders in it do; add --recursive.")
    if others:
        unread: Counter[str] = Counter()
        _count_unread(others, unread)
        how = skipped_line(unread).partition("; ")[2] if unread else "images end in .png, .jpg, .tif and the like"
        raise UsageError(f"{typed}: holds no image, only {_some(others)}; {how}.")
    raise UsageError(f"{typed}: is an empty folder; expected images in it.")


def _listed(folder: str, recursive: bool) -> tuple[list[str], list[str], list[str]]:
    """Return the paths of images, of other files and of folders in `folder`, without hidden ones."""
    images: list[str] = []
    others: list[str] = []
    folders: list[str] = []
    for files, below in _walk(folder, refused_folder):
        folders += below
        for path in files:
            if not is_image_name(path):
                others.append(path)
            elif not is_drawn_file(path):
                images.append(path)
        if not recursive:
            break
    return sorted(images, key=natural_key), sorted(others, key=natural_key), sorted(folders, key=natural_key)


def _has_image_below(folder: str) -> bool:
    """Whether a short look finds an image; what cannot be read is passed over."""
    looks = islice(_walk(folder, None), _LOOKED_INTO)
    return any(is_image_name(path) for files, _ in looks for path in files)


def _walk(folder: str, refused: Callable[[OSError], Exception] | None) -> Iterator[tuple[list[str], list[str]]]:
    """Yield the files and the folders in `folder` and in each one below, without hidden ones and links to folders.

    One after the other, not within one another: `os.walk` of Python 3.11 ends at a depth of a thousand. What cannot
    be read raises what `refused` makes of it, or is passed over.
    """
    waiting = [folder]
    while waiting:
        files: list[str] = []
        folders: list[str] = []
        each = waiting.pop()
        try:
            with os.scandir(each) as entries:
                for entry in entries:
                    if not entry.name.startswith("."):
                        path = os.path.join(each, entry.name)  # noqa: PTH118 - keeps the ./ that was typed
                        is_folder = entry.is_dir(follow_symlinks=False) or (entry.is_symlink() and _is_folder(path))
                        (folders if is_folder else files).append(path)
        except OSError as error:
            if refused is not None:
                raise refused(error) from None
            continue
        yield files, folders
        waiting += [path for path in folders if not os.path.islink(path)]  # noqa: PTH114 - a Path drops the ./


def _is_folder(path: str) -> bool:
    # Unlike Path.is_dir, False also for a name that is too long or in a folder that may not be searched.
    return os.path.isdir(path)  # noqa: PTH112


def _some(paths: list[str]) -> str:
    names = ", ".join(Path(each).name for each in paths[:3])
    return f"{len(paths)} other file{'s' if len(paths) > 1 else ''} ({names}{', ...' if len(paths) > 3 else ''})"
