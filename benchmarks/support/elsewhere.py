"""Run in another environment: what packages make of each .npy file of a folder, an image if nothing else is said.

    python elsewhere.py contour|edge-drawing|napa-cells|napa-poses|pye3d|ringgrid FOLDER

Prints JSON: a list per file, of rows that start with the time in ms. What a way is given besides is in
FOLDER/options.json.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

Way = Callable[[np.ndarray, int], list[list[float]]]
"""(image, its number) -> rows"""


def contour(options: dict[str, Any]) -> Way:
    """scikit-image's longest contour at `level`: its points."""
    from skimage.measure import find_contours  # noqa: PLC0415 (only one of these packages is there)

    def way(image: np.ndarray, _: int) -> list[list[float]]:
        contours = find_contours(image.astype(np.float64), options["level"])
        return max(contours, key=len)[:, ::-1].tolist() if contours else []

    return way


def ringgrid(options: dict[str, Any]) -> Way:
    """ringgrid's outer ellipses: centre, semi-axes, angle (rad).

    `grid` is (pitch, rows, columns, outer and inner radius) of a board of rings without code; without it, the
    package's own hexagonal board without code. `diameters` in px, by image, are given if there are any.
    """
    from ringgrid import Detector, TargetLayout  # noqa: PLC0415

    if options.get("grid"):
        layout = TargetLayout.plain_rect(*options["grid"], dots=False)
    else:
        layout = TargetLayout.plain_hex(8.0, 15, 14, 4.8, 3.2, dots=False)
    detector = Detector.from_target(layout)
    diameters = options.get("diameters")

    def way(image: np.ndarray, number: int) -> list[list[float]]:
        found = detector.detect_adaptive(image, diameters[number] if diameters else None)
        outer = [marker.ellipse_outer for marker in found.detected_markers]
        return [[e.cx, e.cy, e.a, e.b, e.angle] for e in outer if e is not None]

    return way


def edge_drawing(_: dict[str, Any]) -> Way:
    """OpenCV contrib's ellipses: centre, semi-axes, angle (rad)."""
    import cv2  # noqa: PLC0415

    detector = cv2.ximgproc.createEdgeDrawing()

    def way(image: np.ndarray, _: int) -> list[list[float]]:
        detector.detectEdges(image)
        found = detector.detectEllipses()
        rows = [] if found is None else found.reshape(-1, 6)
        # A circle has its radius third, an ellipse both semi-axes after it.
        return [[x, y, radius + a, radius + b, float(np.radians(turn))] for x, y, radius, a, b, turn in rows]

    return way


def pye3d(_: dict[str, Any]) -> Way:
    """pye3d's circles, centre and normal, of an ellipse: a file is its centre, axes, angle, focal length, radius."""
    from pye3d.geometry.primitives import Ellipse  # noqa: PLC0415
    from pye3d.geometry.projections import unproject_ellipse  # noqa: PLC0415

    def way(seen: np.ndarray, _: int) -> list[list[float]]:
        x, y, minor, major, angle, focal, radius = (float(v) for v in seen)
        circles = unproject_ellipse(Ellipse([x, y], minor, major, angle), focal, radius)
        return [[*map(float, c.center), *map(float, c.normal)] for c in circles or ()]

    return way


def napa_cells(_: dict[str, Any]) -> Way:
    """The black square of napa-vision's tag 0, row by row, 1 for white; of the image nothing is used."""
    from napa_vision.tags import tag_cells  # noqa: PLC0415

    def way(_: np.ndarray, __: int) -> list[list[float]]:
        return tag_cells(0, quiet_zone_cells=0).astype(float).tolist()

    return way


def napa_poses(options: dict[str, Any]) -> Way:
    """napa-vision's poses of a tag: centre and normal (3,) of each solution, in the unit of `size`."""
    import cv2  # noqa: PLC0415
    from napa_vision import NapaDetector  # noqa: PLC0415
    from napa_vision.solvers import SingleTagPoseSolver  # noqa: PLC0415

    class Camera:
        calibration_matrix = np.array(options["camera_matrix"])
        distortion_coefficients = np.zeros(5)

    detector, solver = NapaDetector(), SingleTagPoseSolver()

    def way(image: np.ndarray, _: int) -> list[list[float]]:
        rows = []
        for pose in solver.solve_many(detector.detect(image), Camera(), options["size"]):
            if pose is None:
                continue
            both = ((pose.pose_0_rvec, pose.pose_0_tvec), (pose.pose_1_rvec, pose.pose_1_tvec))
            rows += [[*t.ravel(), *cv2.Rodrigues(r)[0][:, 2]] for r, t in both if r is not None]
        return rows

    return way


WAYS = {
    "contour": contour,
    "edge-drawing": edge_drawing,
    "napa-cells": napa_cells,
    "napa-poses": napa_poses,
    "pye3d": pye3d,
    "ringgrid": ringgrid,
}


def main() -> None:
    """Print what is found in every file."""
    folder = Path(sys.argv[2])
    way = WAYS[sys.argv[1]](json.loads((folder / "options.json").read_text()))
    answers = []
    for number, path in enumerate(sorted(folder.glob("*.npy"))):
        image = np.load(path)
        start = time.perf_counter()
        rows = way(image, number)
        taken = 1e3 * (time.perf_counter() - start)
        answers.append([[taken, *map(float, values)] for values in rows])
    print(json.dumps(answers))


if __name__ == "__main__":
    main()
