"""Points projected by other tools and by circlepose, with a calibration that the tool wrote: the largest difference.

    python -m benchmarks.calibrations [--points 2000]

Each tool is an optional package (`pip install pycolmap pyrealsense2`); one that is not there is left out, with a
sentence. The points lie in front of the camera, out to 35 deg from the axis. pycolmap's pixels are moved by half a
pixel, as its first pixel has its center at (0.5, 0.5); librealsense calculates in 32 bits, so it agrees to 1e-4 px.
"""

from __future__ import annotations

import argparse
import importlib
import json
import math
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from circlepose._typing import FloatArray
from circlepose.errors import CalibrationError
from circlepose.io.calibration.reader import read_camera_file

SEED = 7
SIZE = (1280, 720)
MATRIX = (905.5, 907.0, 640.25, 355.75)
_MOST_TAN = math.tan(math.radians(35.0))
# Of COLMAP's names of parameters: values of an ordinary lens.
_VALUES = {
    **{"f": 905.5, "fx": 905.5, "fy": 907.0, "cx": 640.75, "cy": 356.25, "k": -0.06, "k1": -0.06, "k2": 0.02},
    **{"p1": 0.001, "p2": -0.002, "k3": 0.004, "k4": 0.03, "k5": -0.01, "k6": 0.002},
}
_REALSENSE = {
    "none": (0.0, 0.0, 0.0, 0.0, 0.0),
    "brown_conrady": (-0.06, 0.02, 0.001, -0.002, 0.004),
    "modified_brown_conrady": (-0.06, 0.02, 0.0, 0.0, 0.004),
    "inverse_brown_conrady": (0.0, 0.0, 0.0, 0.0, 0.0),
    "kannala_brandt4": (0.03, -0.01, 0.002, 0.001, 0.0),
}
Row = tuple[str, str, str]
"""tool, model, largest difference in px or the answer"""


def points(count: int) -> FloatArray:
    """Return points (count, 3) in front of a camera."""
    rng = np.random.default_rng(SEED)
    angle, radius = rng.uniform(0.0, 2.0 * math.pi, count), _MOST_TAN * np.sqrt(rng.uniform(0.0, 1.0, count))
    rays = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.ones(count)], axis=-1)
    scaled: FloatArray = rays * rng.uniform(0.5, 3.0, (count, 1))
    return scaled


def colmap_rows(rays: FloatArray) -> Iterator[Row]:
    """Compare with pycolmap: each of its models, in the text and the binary file that it writes."""
    colmap = importlib.import_module("pycolmap")
    tool = f"pycolmap {colmap.__version__}"
    models = [name for name in dir(colmap.CameraModelId) if name.isupper() and name != "INVALID"]
    for name in models:
        camera = colmap.Camera.create_from_model_name(1, name, MATRIX[0], *SIZE)
        words = [word.strip() for word in camera.params_info.split(",")]
        camera.params = [_VALUES.get(word, value) for word, value in zip(words, camera.params, strict=True)]
        yield tool, name, _answer(lambda camera=camera: _colmap_difference(colmap, camera, rays))


def _colmap_difference(colmap: Any, camera: Any, rays: FloatArray) -> float:
    theirs = np.array([camera.img_from_cam(ray) for ray in rays]) - 0.5
    scene = colmap.Reconstruction()
    scene.add_camera(camera)
    worst = 0.0
    with tempfile.TemporaryDirectory() as folder:
        for write, file in ((scene.write_text, "cameras.txt"), (scene.write_binary, "cameras.bin")):
            write(folder)
            ours = read_camera_file(Path(folder, file)).camera.project(rays)
            worst = max(worst, float(np.abs(ours - theirs).max()))
    return worst


def realsense_rows(rays: FloatArray) -> Iterator[Row]:
    """Compare with librealsense: each model, with the coefficients for which we have it."""
    realsense = importlib.import_module("pyrealsense2")
    tool = f"pyrealsense2 {getattr(realsense, '__version__', '')}".strip()
    for name, coeffs in _REALSENSE.items():
        intrinsics = realsense.intrinsics()
        intrinsics.width, intrinsics.height = SIZE
        intrinsics.fx, intrinsics.fy, intrinsics.ppx, intrinsics.ppy = MATRIX
        intrinsics.model, intrinsics.coeffs = getattr(realsense.distortion, name), list(coeffs)
        yield tool, name, _answer(lambda given=intrinsics: _realsense_difference(realsense, given, rays))


def _realsense_difference(realsense: Any, intrinsics: Any, rays: FloatArray) -> float:
    theirs = np.array([realsense.rs2_project_point_to_pixel(intrinsics, ray.tolist()) for ray in rays])
    names = ("width", "height", "fx", "fy", "ppx", "ppy", "coeffs")
    stated = {name: getattr(intrinsics, name) for name in names} | {"model": str(intrinsics.model)}
    ours = read_camera_file(json.dumps(stated).encode()).camera.project(rays)
    return float(np.abs(ours - theirs).max())


def _answer(difference: Callable[[], float]) -> str:
    try:
        return f"{difference():.1e}"
    except CalibrationError:
        return "refused"


TOOLS = {"pycolmap": colmap_rows, "pyrealsense2": realsense_rows}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", type=int, default=2000, help="points to project")
    rays = points(parser.parse_args().points)
    print("| tool | model | largest difference, px |\n|---|---|---|")
    for package, rows in TOOLS.items():
        try:
            found = list(rows(rays))
        except ImportError as reason:
            found = [(package, "all", f"left out: not installed ({reason})")]
        for row in found:
            print(f"| {' | '.join(row)} |", flush=True)


if __name__ == "__main__":
    main()
