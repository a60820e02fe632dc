"""From what was typed to images: files, folders, globs and paths on standard input, in natural order."""

from __future__ import annotations

import glob
import os
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from circlepose.errors import UsageError
from circlepose.files.image_bytes import IMAGE_SUFFIXES

STDIN = "-"


@dataclass(frozen=True, slots=True)
class InputImage:
    """One image to measure."""

    path: Path
    name: str
    """what the table calls it: the path as typed, or relative to the folder where that is the only input"""


def expand_inputs(
    inputs: Sequence[str], stdin: Iterable[str] | Iterable[bytes] | None = None, recursive: bool = False
) -> Iterator[InputImage]:
    """Return the images that `inputs` stand for: in the order typed, folders and globs in natural order, each once.

    - A folder stands for the images in it (and in folders below, if `recursive`); hidden ones are left out.
    - A glob (`*`, `?`, `[...]`, `**`) that is not itself a file stands for what it matches.
    - `-` stands for the paths on `stdin`, one a line, each taken when it is asked for: the producer may be endless.
    - Anything else is a file; if it is missing, that is told when it is read, as the status of its row.

    A name is the path as typed, so that it leads back to the image; with a single folder as the only input it
    is the path below that folder. Raises `UsageError`, before the first image, for an input without any image.
    """
    if not inputs:
        raise UsageError("no image was given; give image files, a folder, a glob or - for paths on standard input.")
    if STDIN in inputs and stdin is None:
        raise UsageError("-: there is no standard input to read paths from.")
    lone_folder = len(inputs) == 1 and _is_folder(inputs[0])
    parts = [[STDIN] if each == STDIN else _expanded(each, recursive) for each in inputs]
    return _images(parts, inputs[0] if lone_folder else None, stdin or ())


def natural_key(name: str) -> tuple[str, str]:
    """Return a sort key by which img2 comes before img10, and parts of a path are compared one by one."""
    # A number is led by the count of its digits; the name itself parts img1 from img01.
    key = re.sub(r"0*([0-9]+)", lambda match: f"{len(match[1]):03d}{match[1]}", name.casefold())
    return key.replace(os.sep, "\0"), name


def _images(parts: list[list[str]], base: str | None, stdin: Iterable[str] | Iterable[bytes]) -> Iterator[InputImage]:
    seen: set[str] = set()
    for part in parts:
        if part == [STDIN]:
            yield from _from_stdin(stdin)
            continue
        for path in part:
            # Path drops ./ and doubled slashes but, rightly, no `..`.
            file = Path(path)
            if str(file) not in seen:
                seen.add(str(file))
                name = path if base is None else path[len(base) :].lstrip(os.sep).replace(os.sep, "/")
                yield InputImage(file, name)


def _from_stdin(lines: Iterable[str] | Iterable[bytes]) -> Iterator[InputImage]:
    empty = True
    for line in lines:
        path = os.fsdecode(line).rstrip("\r\n")
        if path:
            empty = False
            yield InputImage(Path(path), path)
    if empty:
        raise UsageError("-: no path came on standard input; expected one a line.")


def _expanded(typed: str, recursive: bool) -> list[str]:
    if _is_folder(typed):
        return _in_folder(typed, recursive)
    if not glob.has_magic(typed) or os.path.lexists(typed):
        return [typed]
    base, pattern = _split_at_magic(typed)
    found = glob.glob(pattern, root_dir=base or None, recursive=True)  # noqa: PTH207 - Path.glob shows hidden files
    matches = [str(Path(base, each)) if base else each for each in sorted(found, key=natural_key)]
    images = [each for each in matches if is_image_name(each) and not _is_folder(each)]
    if images:
        return images
    what = f"matches no image, only {_some(matches)}" if matches else "matches no file"
    raise UsageError(f"{typed}: {what}; check the pattern.")


def _split_at_magic(typed: str) -> tuple[str, str]:
    """Return the part of a glob that is a folder, even with brackets in its name, and the pattern below it."""
    parts = Path(typed).parts
    count = 0
    while count < len(parts) - 1 and _is_folder(str(Path(*parts[: count + 1]))):
        count += 1
    return (str(Path(*parts[:count])) if count else ""), str(Path(*parts[count:]))


def _in_folder(typed: str, recursive: bool) -> list[str]:
    images, others, folders = _listed(typed, recursive)
    if images:
        return images
    if not recursive and any(_listed(folder, recursive=True)[0] for folder in folders):
        raise UsageError(f"{typed}: holds no image itself, but folders in it do; add --recursive.")
    if others:
        raise UsageError(
            f"{typed}: holds no image, only {_some(others)}; images end in .png, .jpg, .tif and the like."
        )
    raise UsageError(f"{typed}: is an empty folder; expected images in it.")


def _listed(folder: str, recursive: bool) -> tuple[list[str], list[str], list[str]]:
    """Return the paths of images, of other files and of folders in `folder`, without hidden ones."""
    images: list[str] = []
    others: list[str] = []
    folders: list[str] = []
    for root, below, files in os.walk(folder, onerror=_refuse_folder):
        below[:] = sorted((each for each in below if not each.startswith(".")), key=natural_key)
        folders += [os.path.join(root, each) for each in below]  # noqa: PTH118 - keeps the ./ that was typed
        for name in files:
            if not name.startswith("."):
                (images if is_image_name(name) else others).append(os.path.join(root, name))  # noqa: PTH118
        if not recursive:
            break
    return sorted(images, key=natural_key), sorted(others, key=natural_key), folders


def is_image_name(name: str) -> bool:
    """Whether the ending of a file's name is that of an image."""
    return os.path.splitext(name)[1].lower() in IMAGE_SUFFIXES  # noqa: PTH122 - for a million names


def _is_folder(path: str) -> bool:
    # Unlike Path.is_dir, False also for a name that is too long or in a folder that may not be searched.
    return os.path.isdir(path)  # noqa: PTH112


def _refuse_folder(error: OSError) -> None:
    raise UsageError(f"{error.filename}: the folder cannot be read ({error.strerror}).")


def _some(paths: list[str]) -> str:
    names = ", ".join(Path(each).name for each in paths[:3])
    return f"{len(paths)} other file{'s' if len(paths) > 1 else ''} ({names}{', ...' if len(paths) > 3 else ''})"
