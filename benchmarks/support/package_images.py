"""Photographs without circles that Python packages ship in their wheels.

The packages are installed into an environment of their own. Of their images these are left out, as they show what is
round: astronaut, cell, chelsea, clock_motion, coffee, coins, color, hubble_deep_field, ihc, logo, microaneurysms,
moon, motorcycle, phantom, retina, rocket (lights) of scikit-image; flower of scikit-learn.
"""

from __future__ import annotations

import subprocess
from pathlib import Path

import cv2
import numpy as np

from benchmarks.support.environments import SCIKIT_IMAGE
from circlepose._typing import Image

REQUIREMENTS = (SCIKIT_IMAGE, "scikit-learn==1.9.1", "pywavelets==1.9.0")
IMAGES = {
    "skimage/data": (
        "brick.png",
        "camera.png",
        "chessboard_GRAY.png",
        "chessboard_RGB.png",
        "grass.png",
        "gravel.png",
        "horse.png",
        "page.png",
        "text.png",
    ),
    "sklearn/datasets/images": ("china.jpg",),
    "pywt/data": ("aero.npz", "ascent.npz"),
}
HALVED = ("brick", "camera", "grass", "gravel", "horse", "china", "aero", "ascent")


def package_images(python: str) -> dict[str, Image]:
    """Return the images by name; the larger ones also at half their size."""
    ask = "import sysconfig; print(sysconfig.get_path('purelib'))"
    root = Path(subprocess.run([python, "-c", ask], capture_output=True, text=True, check=True).stdout.strip())
    paths = [root / folder / name for folder, names in IMAGES.items() for name in names]
    images = {path.stem: _read(path) for path in paths}
    halves = {
        f"{name}, halved": cv2.resize(images[name], None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
        for name in HALVED
    }
    return images | halves


def _read(path: Path) -> Image:
    if path.suffix == ".npz":
        with np.load(path) as file:
            return np.asarray(file["data"]).astype(np.uint8)
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise FileNotFoundError(path)
    return image
