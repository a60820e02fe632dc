"""Run by `peers.py` in another environment: measure each .npy file of a folder, and print JSON.

    python peers_elsewhere.py edge-drawing|pye3d FOLDER

A list per file, of rows that start with the time in ms.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

import numpy as np


def edge_drawing(image: np.ndarray) -> list[list[float]]:
    """Return the ellipses of an image: centre, semi-axes, angle (rad)."""
    import cv2  # noqa: PLC0415 (only one of the two is there)

    detector = cv2.ximgproc.createEdgeDrawing()
    detector.detectEdges(image)
    found = detector.detectEllipses()
    # A circle has its radius third, an ellipse both semi-axes after it.
    return (
        []
        if found is None
        else [
            [x, y, radius + a, radius + b, float(np.radians(turn))]
            for x, y, radius, a, b, turn in found.reshape(-1, 6)
        ]
    )


def pye3d(seen: np.ndarray) -> list[list[float]]:
    """Return centre and normal of both circles that have the image ellipse `seen`."""
    from pye3d.geometry.primitives import Ellipse  # noqa: PLC0415
    from pye3d.geometry.projections import unproject_ellipse  # noqa: PLC0415

    x, y, minor, major, angle, focal, radius = (float(v) for v in seen)
    circles = unproject_ellipse(Ellipse([x, y], minor, major, angle), focal, radius)
    return [[*map(float, c.center), *map(float, c.normal)] for c in circles or ()]


def main() -> None:
    """Print what is found in every file."""
    way = {"edge-drawing": edge_drawing, "pye3d": pye3d}[sys.argv[1]]
    answers = []
    for path in sorted(Path(sys.argv[2]).glob("*.npy")):
        what = np.load(path)
        start = time.perf_counter()
        rows = way(what)
        taken = 1e3 * (time.perf_counter() - start)
        answers.append([[taken, *map(float, values)] for values in rows])
    print(json.dumps(answers))


if __name__ == "__main__":
    main()
