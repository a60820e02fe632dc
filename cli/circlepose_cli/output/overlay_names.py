"""Where the picture of each result goes: one file per image, always inside the folder asked for."""

from __future__ import annotations

import os
import re
import unicodedata
from collections import Counter
from collections.abc import Iterable
from hashlib import blake2b
from itertools import chain, count
from pathlib import Path

from circlepose.errors import OutputError, UsageError
from circlepose.io.atomic import is_replaceable_file, refuse_foreign
from circlepose.io.inputs.images import InputImage
from circlepose.io.remote.images import RemoteFile

_UNSAFE = re.compile('[\x00-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069<>:"|?*]')
_LONGEST_BYTES = 200
"""Most file systems take 255 with the ending."""


class OverlayNames:
    """Gives each image `<its name>.png`, or its folders' names joined with `__` where several share a name."""

    def __init__(self, folder: Path, known: Iterable[InputImage], *, overwrite: bool = False) -> None:
        """Take the images that are `known` beforehand; others may come.

        Raises `OutputError` where a picture would replace a file that circlepose did not write, unless `overwrite`.
        """
        self._overwrite = overwrite
        self._folder = folder
        self._place = os.path.realpath(folder)
        self._seen_apart: str | None = None
        known = list(known)
        for image in known:
            self._refuse_own_folder(image)
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(f"--overlay {folder}: the folder cannot be made ({error.strerror}).") from None
        stems = Counter(_parts(image.name)[-1] for image in known)
        self._shared = {stem for stem, times in stems.items() if times > 1}
        self._used: set[str] = set()
        self.replaced: tuple[Path, ...] = ()
        """pictures of the known images that are there already"""
        if any(folder.iterdir()):
            # A rehearsal: what may not be replaced is to be known before anything is measured.
            self.replaced = tuple(path for path in map(self.path_for, known) if path.exists())
            self._used.clear()

    def path_for(self, image: InputImage) -> Path:
        """Return the path of the picture of `image`, different for each call."""
        self._refuse_own_folder(image)
        parts = _parts(image.name)
        joined = "__".join(parts)
        plain = joined if parts[-1] in self._shared else parts[-1]
        choices = chain((plain, joined), (f"{joined}-{number}" for number in count(2)))
        name = next(choice for choice in map(_shortened, choices) if self._is_free(choice))
        self._used.add(_as_file_system(name))
        path = self._folder / f"{name}.png"
        refuse_foreign(path, overwrite=self._overwrite)
        return path

    def holds(self, path: Path) -> bool:
        """Return whether the folder of `path` is that of the pictures."""
        return os.path.realpath(path.parent) == self._place

    def _is_free(self, name: str) -> bool:
        # Through a link that lies there, the picture would be written somewhere else; a pipe has no end.
        path = self._folder / f"{name}.png"
        is_planted = path.is_symlink() or not is_replaceable_file(path)
        return _as_file_system(name) not in self._used and not is_planted

    def _refuse_own_folder(self, image: InputImage) -> None:
        if isinstance(image.path, RemoteFile):
            return
        folder, name = os.path.split(image.path)
        # Images come folder by folder, and links are slow to follow.
        if folder == self._seen_apart:
            return
        if os.path.realpath(folder) == self._place:
            raise UsageError(
                f"--overlay {self._folder}: holds {name} itself; give another folder, or the next run "
                "would take the pictures for images."
            )
        self._seen_apart = folder


def _as_file_system(name: str) -> str:
    """Return the same for names that are one file on some systems: they differ by case, or in how é is coded."""
    return unicodedata.normalize("NFC", name).casefold()


def _shortened(name: str) -> str:
    """Return `name`, or of a long one the beginning and a digest."""
    raw = os.fsencode(name)
    if len(raw) <= _LONGEST_BYTES:
        return name
    return f"{raw[: _LONGEST_BYTES - 20].decode('utf-8', 'ignore')}-{blake2b(raw, digest_size=8).hexdigest()}"


def _parts(name: str) -> list[str]:
    """Split a path into safe folder names and the stem of its file."""
    parts = [part for part in re.split(r"[\\/]", _UNSAFE.sub("_", name)) if part not in ("", ".", "..")]
    return [*parts[:-1], Path(parts[-1]).stem] if parts else ["image"]
