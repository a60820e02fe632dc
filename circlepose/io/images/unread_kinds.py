"""Photographs and films of kinds that are not read, and how to convert them."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Mapping

_FILM = "a film: ffmpeg -i run.mp4 frame%06d.png"
_RAW = "raw: dcraw -T -4 or rawpy, to a 16-bit TIFF"
HOW_TO_CONVERT: Mapping[str, str] = {
    ".heic": "HEIC: heif-convert photo.heic photo.png",
    ".heif": "HEIF: heif-convert photo.heif photo.png",
    ".avif": "AVIF: heif-convert photo.avif photo.png",
    ".gif": "GIF: magick photo.gif photo.png",
    ".exr": "EXR: magick photo.exr photo.tif",
    ".jxl": "JPEG XL: djxl photo.jxl photo.png",
    **dict.fromkeys((".mp4", ".mov", ".avi", ".mkv", ".m4v", ".webm", ".mpg", ".mpeg", ".wmv"), _FILM),
    **dict.fromkeys((".cr2", ".cr3", ".nef", ".arw", ".dng", ".orf", ".rw2", ".raf", ".pef", ".srw"), _RAW),
}


def suffix_of_unread(path: str) -> str | None:
    """Return the ending of a photograph or film of a kind that is not read; None for all other names."""
    suffix = os.path.splitext(path)[1].lower()  # noqa: PTH122 - for a million names
    return suffix if suffix in HOW_TO_CONVERT else None


def skipped_line(skipped: Counter[str]) -> str:
    """Return a sentence on the files, counted by ending, that were passed over."""
    kinds = ", ".join(f"{number} {suffix}" for suffix, number in skipped.most_common())
    ways = dict.fromkeys(HOW_TO_CONVERT[suffix] for suffix, _ in skipped.most_common())
    total = skipped.total()
    return f"{total} file{'s' if total > 1 else ''} skipped: {kinds}; convert first ({'; '.join(ways)})"
