"""The gallery: each folder of sample_images with its command, the table that it prints, and the overlays."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import circlepose

from sitegen.paths import GENERATED, ROOT, write
from sitegen.pictures import write_png

TITLES = {
    "cd": "A compact disc in three views",
    "clutter": "Four discs among shapes that are no circles",
    "coaxial": "A boss: two circles on one axis",
    "coplanar": "A ring: two circles in one plane",
}
INTRODUCTION = """# Gallery

The sample images that come with the source, in `sample_images/`: rendered, with exact truth. Tables and pictures on this page were
made by the commands above them when the page was built.

"""


def sample_folders() -> list[Path]:
    """Return the folders of the sample images."""
    return sorted(path for path in (ROOT / "sample_images").iterdir() if path.is_dir())


def write_pages() -> None:
    """Write the page and its pictures."""
    write("gallery.md", INTRODUCTION + "\n".join(section(folder) for folder in sample_folders()))


def section(folder: Path) -> str:
    """Return the part of the page on one folder, and draw its overlays."""
    command = f"circlepose estimate sample_images/{folder.name} --format table"
    parts = [f"## {TITLES.get(folder.name, folder.name)}\n", f"```console\n$ {command}\n{printed(command)}```\n"]
    camera = circlepose.read_camera(folder / "camera.yml")
    target = circlepose.read_target(folder / "target.yaml")
    for result in circlepose.measure(folder, camera, target):
        overlay = circlepose.draw_overlay(circlepose.read_image(folder / result.image), result, camera)
        picture = Path("pictures") / f"sample-{folder.name}-{Path(result.image).stem}.png"
        (GENERATED / picture).parent.mkdir(parents=True, exist_ok=True)
        write_png(GENERATED / picture, overlay, width=1000)
        parts.append(f"![{folder.name}/{result.image} with its overlay]({picture.as_posix()})\n")
    return "\n".join(parts)


def printed(command: str) -> str:
    """Return what a command prints in a terminal of 120 columns, beside the checkout's files."""
    environment = {**os.environ, "COLUMNS": "120", "NO_COLOR": "1", "TERM": "dumb"}
    typed = [sys.executable, "-m", *command.split(), "--quiet"]
    done = subprocess.run(
        typed, cwd=ROOT, env=environment, capture_output=True, text=True, check=True, encoding="utf-8"
    )
    return done.stdout
