"""How long finding and measuring circles takes, as a share of reading the same files in the same run.

    python -m benchmarks.speed [--quick]

One process, one thread. Each image is a PNG in a temporary folder; the time of `cv2.imread` of that file is the unit.
`find`: extraction alone; `all`: `circlepose.estimate` on the decoded image. The best of several runs counts, taken in
turns, so that a busy machine burdens all alike. `memory`: the highest allocation of NumPy while `estimate` runs, in
multiples of the decoded image, which itself does not count.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
import tracemalloc
from collections.abc import Callable, Iterator
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import cv2
import numpy as np

import circlepose
from circlepose.camera.camera import Camera
from circlepose.detection.detect import find_contours
from circlepose.imaging.gray import to_grey
from circlepose.synthesis.disc_sets import RADIUS_MM, disc_views
from circlepose.synthesis.render import render
from circlepose.synthesis.scene import Disc, Paint, Scene

SIZES = ((640, 480), (1280, 960), (2456, 2058), (4608, 3456), (8192, 6144))
NUMBERS = (1, 10, 100, 300, 1000)
FIVE_MPX = (2456, 2058)
_DEPTH_MM = 1000.0


def main() -> None:
    """Print a table for each question."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="two runs each, no image above 16 Mpx")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    runs = 2 if options.quick else 5
    sizes = SIZES[:-1] if options.quick else SIZES
    with tempfile.TemporaryDirectory() as folder:
        _table("one disc, `count: 1`, 6 views each", _single(), Path(folder), runs)
        _table("one disc of a fifth of the image's height", (_sized(size) for size in sizes), Path(folder), runs)
        _table("discs in 5 Mpx, `count: all`", (_many(number) for number in NUMBERS), Path(folder), runs)
        _table("no circle, `count: all`", _without(), Path(folder), runs)


Case = tuple[str, list[np.ndarray], Camera, circlepose.Target]


def _single() -> Iterator[Case]:
    for name in ("lo", "hi"):
        scenes = list(disc_views(name, 6, 1999))
        target = circlepose.Target.circle(RADIUS_MM)
        yield (
            f"{'x'.join(map(str, scenes[0].camera.image_size))}",
            [render(s) for s in scenes],
            scenes[0].camera,
            target,
        )


def _camera(size: tuple[int, int]) -> Camera:
    focal = 1.4 * size[0]
    return Camera.create([[focal, 0, (size[0] - 1) / 2], [0, focal, (size[1] - 1) / 2], [0, 0, 1]], (), size)


def _sized(size: tuple[int, int]) -> Case:
    camera = _camera(size)
    radius = 0.1 * size[1] / camera.camera_matrix[0, 0] * _DEPTH_MM
    normal = np.array([0.5, 0.2, -0.84]) / np.linalg.norm([0.5, 0.2, -0.84])
    disc = Disc(np.array([20.0, -10.0, _DEPTH_MM]), normal, radius, Paint(40.0))
    scene = Scene(camera, (disc,), Paint(200.0), blur_px=0.7, noise_levels=2.0, noise_seed=5)
    return f"{size[0] * size[1] / 1e6:.1f} Mpx", [render(scene)], camera, circlepose.Target.circle(radius)


def _many(number: int) -> Case:
    """Discs in rows over the image, each tilted its own way."""
    camera = _camera(FIVE_MPX)
    across = max(2, int(np.ceil(np.sqrt(number))))
    half = 0.44 * _DEPTH_MM * np.array(FIVE_MPX) / camera.camera_matrix[0, 0]
    radius = 0.6 * float(half[1]) / across
    generator = np.random.default_rng(number)
    discs = []
    for i in range(number):
        place = np.array([i % across, i // across]) / (across - 1) * 2.0 - 1.0
        tilt, azimuth = np.radians(generator.uniform(0.0, 60.0)), generator.uniform(0.0, 2.0 * np.pi)
        normal = np.array([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), -np.cos(tilt)])
        discs.append(Disc(np.array([*(place * half), _DEPTH_MM]), normal, radius, Paint(40.0)))
    scene = Scene(camera, tuple(discs), Paint(200.0), blur_px=0.7, noise_levels=2.0, noise_seed=number)
    return f"{number}", [render(scene)], camera, circlepose.Target.circle(radius, count=None)


def _without() -> Iterator[Case]:
    size = (1280, 960)
    y, x = np.mgrid[0 : size[1], 0 : size[0]]
    generator = np.random.default_rng(0)
    page = np.full(y.shape, 235, np.uint8)
    for line in range(18, size[1], 18):
        words = "lazy fix him vexing kilt at wintry mint yew " * 9
        cv2.putText(page, words[line % 40 :], (5, line), cv2.FONT_HERSHEY_SIMPLEX, 0.5, 20, 1, cv2.LINE_AA)
    images = {
        "noise": generator.integers(0, 256, y.shape).astype(np.uint8),
        "flat": np.full(y.shape, 90, np.uint8),
        "chessboard": (((x // 40 + y // 40) % 2) * 200 + 20).astype(np.uint8),
        "page of text": page,
        "leaves": _leaves(generator, size),
    }
    for name, image in images.items():
        yield name, [image], _camera(size), circlepose.Target.circle(10.0, count=None)


def _leaves(generator: np.random.Generator, size: tuple[int, int]) -> np.ndarray:
    image = np.full(size[::-1], 60, np.uint8)
    along = np.linspace(-1.0, 1.0, 20)
    outline = np.stack([np.r_[along, along[::-1]], np.r_[1.0 - along**2, along**2 - 1.0]], axis=-1)
    for _ in range(3000):
        length, angle = generator.uniform(8.0, 60.0), generator.uniform(0.0, np.pi)
        turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        leaf = (outline * [length, generator.uniform(0.25, 0.6) * length]) @ turn + generator.uniform(0.0, size)
        cv2.fillPoly(image, [np.rint(16.0 * leaf).astype(np.int32)], int(generator.integers(30, 220)), cv2.LINE_AA, 4)
    return np.clip(image + generator.normal(0.0, 3.0, image.shape), 0, 255).astype(np.uint8)


def _table(title: str, cases: Iterator[Case], folder: Path, runs: int) -> None:
    print(f"\n{title}\n")
    print("| image | found | imread ms | find / imread | all / imread | memory |\n|---|---|---|---|---|---|")
    for name, images, camera, target in cases:
        reading = finding = everything = memory = 0.0
        found = 0
        for i, image in enumerate(images):
            path = folder / f"{i}.png"
            cv2.imwrite(str(path), image)
            read, find, all_of_it = _best_of(runs, path, camera, target)
            reading, finding, everything = reading + read, finding + find, everything + all_of_it
            result = circlepose.estimate(image, camera, target)
            found += len(result.circles)
            memory = max(memory, _memory(image, camera, target))
        print(
            f"| {name} | {found} | {1e3 * reading / len(images):.1f} | {finding / reading:.2f} "
            f"| {everything / reading:.2f} | {memory:.1f} |",
            flush=True,
        )


def _best_of(runs: int, path: Path, camera: Camera, target: circlepose.Target) -> tuple[float, float, float]:
    """Return the least seconds of reading, of extraction and of the whole estimate."""
    image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    grey = to_grey(image)
    steps: tuple[Callable[[], object], ...] = (
        lambda: cv2.imread(str(path)),
        lambda: find_contours(grey, circlepose.AxisIntervals(), enough=target.count),
        lambda: circlepose.estimate(image, camera, target),
    )
    least = [np.inf] * len(steps)
    for _ in range(runs):
        for i, step in enumerate(steps):
            start = time.perf_counter()
            step()
            least[i] = min(least[i], time.perf_counter() - start)
    return least[0], least[1], least[2]


def _memory(image: np.ndarray, camera: Camera, target: circlepose.Target) -> float:
    tracemalloc.start()
    circlepose.estimate(image, camera, target)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak / image.nbytes


if __name__ == "__main__":
    main()
