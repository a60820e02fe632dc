"""The pictures of the pages: rendered scenes, measured, with the program's own overlay."""

from __future__ import annotations

from dataclasses import replace
from importlib.resources import as_file, files
from pathlib import Path

import cv2

import circlepose
from circlepose._typing import Image
from circlepose.io.scenes.reader import read_scenes
from circlepose.synthesis.render import render
from sitegen.paths import DOCS

SCENES = ("disc", "hint", "ring", "coaxial", "plane", "board")
WIDTH_PX = 680
LARGEST_BYTES = 100_000
"""What is committed stays small."""


def measured(scenes: str | Path, *, same_plane: bool) -> tuple[Image, Image]:
    """Return the image of a scene file, and the same with its overlay."""
    file = read_scenes(scenes)
    (scene,) = file.scenes
    # Scenes have no key for it.
    target = replace(file.target, same_plane=True) if same_plane else file.target
    image = render(scene)
    result = circlepose.estimate(image, scene.camera, target, name=Path(scenes).stem)
    return image, circlepose.draw_overlay(image, result, scene.camera)


def write_pictures(folder: Path) -> list[Path]:
    """Write the overlay of each scene of the pages and of the demo's; return the files."""
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for name in SCENES:
        image, overlay = measured(DOCS / "scenes" / f"{name}.yaml", same_plane=name == "plane")
        written.append(write_png(folder / f"{name}.png", overlay))
        if name == "disc":
            written.append(write_png(folder / "photograph.png", image))
    with as_file(files("circlepose.io.scenes") / "demo.yaml") as scenes:
        _, overlay = measured(scenes, same_plane=True)
    return [*written, write_png(folder / "demo.png", overlay)]


def write_png(path: Path, image: Image) -> Path:
    """Write a picture for a page, in steps of 8 levels, which halves a PNG of smooth edges."""
    steps = (at_most(WIDTH_PX, image) & 0xF8) | 0x04
    path.write_bytes(cv2.imencode(".png", steps, [cv2.IMWRITE_PNG_COMPRESSION, 9])[1].tobytes())
    return path


def at_most(width: int, image: Image) -> Image:
    """Return a picture that is not wider than `width` px."""
    if image.shape[1] <= width:
        return image
    size = (width, round(image.shape[0] * width / image.shape[1]))
    return cv2.resize(image, size, interpolation=cv2.INTER_AREA)
