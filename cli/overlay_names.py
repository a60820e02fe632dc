"""Where the picture of each result goes: one file per image, always inside the folder asked for."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable
from itertools import chain, count
from pathlib import Path

from circlepose.errors import OutputError, UsageError
from circlepose.files.inputs import InputImage

_UNSAFE = re.compile(r'[\x00-\x1f\x7f<>:"|?*]')


class OverlayNames:
    """Gives each image `<its name>.png`, or its folders' names joined with `__` where several share a name."""

    def __init__(self, folder: Path, known: Iterable[InputImage]) -> None:
        """Take the images that are `known` beforehand; others may come."""
        self._folder = folder
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

    def path_for(self, image: InputImage) -> Path:
        """Return the path of the picture of `image`, different for each call."""
        self._refuse_own_folder(image)
        parts = _parts(image.name)
        joined = "__".join(parts)
        plain = joined if parts[-1] in self._shared else parts[-1]
        choices = chain((plain, joined), (f"{joined}-{number}" for number in count(2)))
        # Two names that differ by case only are one file on some systems.
        name = next(choice for choice in choices if choice.casefold() not in self._used)
        self._used.add(name.casefold())
        return self._folder / f"{name}.png"

    def _refuse_own_folder(self, image: InputImage) -> None:
        if image.path.parent.resolve() == self._folder.resolve():
            raise UsageError(
                f"--overlay {self._folder}: holds {image.path.name} itself; give another folder, or the next run "
                "would take the pictures for images."
            )


def _parts(name: str) -> list[str]:
    """Split a path into safe folder names and the stem of its file."""
    parts = [part for part in re.split(r"[\\/]", _UNSAFE.sub("_", name)) if part not in ("", ".", "..")]
    return [*parts[:-1], Path(parts[-1]).stem] if parts else ["image"]
