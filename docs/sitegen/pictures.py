"""The pictures of the pages: rendered scenes, measured, with the program's own overlay; and a printed sheet."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from importlib.resources import as_file, files
from pathlib import Path

import cv2

import circlepose
from circlepose._typing import Image
from circlepose.io.scenes.reader import read_scenes
from circlepose.io.sheet_files import PrintOptions, print_target
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
    return [*written, write_png(folder / "demo.png", overlay), write_png(folder / "sheet.png", printed_sheet())]


def printed_sheet() -> Image:
    """Return a board as it is printed on A4, with the border of the paper."""
    import pypdfium2  # noqa: PLC0415 - of the extra test-print, and for this picture alone

    with tempfile.TemporaryDirectory() as name:
        target, sheet = Path(name) / "board.yaml", Path(name) / "sheet.pdf"
        target.write_text("radius_mm: 8\ngrid: {pattern: symmetric, rows: 8, columns: 6, spacing_mm: 29}\n")
        print_target(target, sheet, PrintOptions(paper_mm=(210.0, 297.0)))
        document = pypdfium2.PdfDocument(sheet.read_bytes())
        large = document[0].render(scale=4.0 * WIDTH_PX / 595.0, grayscale=True).to_numpy().squeeze()
        page = cv2.resize(large, None, fx=0.25, fy=0.25, interpolation=cv2.INTER_AREA)
        document.close()
    return cv2.copyMakeBorder(page, 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=128)


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
