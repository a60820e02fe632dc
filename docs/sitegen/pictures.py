"""The pictures of the pages: rendered scenes, measured, with the program's own overlay."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import circlepose
import cv2
from circlepose._typing import Image
from circlepose.camera.camera import Camera
from circlepose.io.scenes.reader import read_scenes
from circlepose.synthesis.render import render

from sitegen.paths import DOCS

SCENES = ("disc", "hint", "ring", "coaxial", "plane")
LARGEST_BYTES = 100_000
"""What is committed stays small."""


def measured(name: str) -> tuple[circlepose.ImageResult, Image, Camera]:
    """Return result, image and camera of one scene of docs/scenes."""
    file = read_scenes(DOCS / "scenes" / f"{name}.yaml")
    (scene,) = file.scenes
    # Scenes have no key for it.
    target = replace(file.target, same_plane=True) if name == "plane" else file.target
    image = render(scene)
    return circlepose.estimate(image, scene.camera, target, name=name), image, scene.camera


def write_pictures(folder: Path) -> list[Path]:
    """Write each scene as it was taken and with its overlay; return the files."""
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for name in SCENES:
        result, image, camera = measured(name)
        overlay = circlepose.draw_overlay(image, result, camera)
        written.append(write_png(folder / f"{name}.png", overlay))
        if name == "disc":
            written.append(write_png(folder / "photograph.png", image))
    return written


def write_png(path: Path, image: Image) -> Path:
    """Write a picture for a page, in steps of 8 levels, which halves a PNG of smooth edges."""
    steps = (at_most(800, image) & 0xF8) | 0x04
    path.write_bytes(cv2.imencode(".png", steps, [cv2.IMWRITE_PNG_COMPRESSION, 9])[1].tobytes())
    return path


def at_most(width: int, image: Image) -> Image:
    """Return a picture that is not wider than `width` px."""
    if image.shape[1] <= width:
        return image
    size = (width, round(image.shape[0] * width / image.shape[1]))
    return cv2.resize(image, size, interpolation=cv2.INTER_AREA)
