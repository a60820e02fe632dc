"""The gallery: each folder of sample_images with its command, the table that it prints, and the overlays."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2

from sitegen.paths import GENERATED, ROOT, write
from sitegen.pictures import at_most

SECTIONS = {
    "cd": ("A compact disc in three views", ""),
    "clutter": ("Four discs on a plate, among shapes that are no circles", " --coplanar"),
    "coaxial": ("A boss: two circles on one axis", ""),
    "coplanar": ("A ring: two circles in one plane", ""),
}
"""Of a folder: the title, and options for the command."""
INTRODUCTION = """# Gallery

The sample images that come with the source, in `sample_images/`: rendered, with exact truth. Tables and pictures on
this page were made by the commands above them when the page was built.

"""
TERMINAL = {"COLUMNS": "120", "NO_COLOR": "1", "TERM": "dumb"}


def write_pages() -> None:
    """Write the page and its pictures."""
    folders = sorted(path for path in (ROOT / "sample_images").iterdir() if path.is_dir())
    write("gallery.md", INTRODUCTION + "\n".join(section(folder) for folder in folders))


def section(folder: Path) -> str:
    """Return the part of the page on one folder, and draw its overlays."""
    title, options = SECTIONS.get(folder.name, (folder.name, ""))
    command = f"circlepose estimate sample_images/{folder.name}{options} --format table --overlay"
    with TemporaryDirectory() as temporary:
        printed = output_of(f"{command} {shlex.quote(temporary)} --quiet")
        parts = [f"## {title}\n", f"```console\n$ {command} overlays\n{printed}```\n"]
        for overlay in sorted(Path(temporary).iterdir()):
            picture = Path("pictures") / f"sample-{folder.name}-{overlay.stem}.jpg"
            (GENERATED / picture).parent.mkdir(parents=True, exist_ok=True)
            # A PNG of noisy levels is ten times larger.
            cv2.imwrite(str(GENERATED / picture), at_most(1000, cv2.imread(str(overlay))))
            parts.append(f"![{folder.name}/{overlay.name} with its overlay]({picture.as_posix()})\n")
    return "\n".join(parts)


def output_of(command: str) -> str:
    """Return what a command prints in a terminal of 120 columns, in the checkout."""
    typed = [sys.executable, "-m", *shlex.split(command)]
    done = subprocess.run(
        typed, cwd=ROOT, env={**os.environ, **TERMINAL}, capture_output=True, text=True, check=True, encoding="utf-8"
    )
    return done.stdout
