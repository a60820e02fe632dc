"""False finds on 500 images without circles: noise, textures, text, polygons, markers, blobs, gradients, photographs.

    python -m benchmarks.false_alarms [FAMILY ...] [--pictures DIR] [--only KIND]

Each image goes to `estimate` with `count: all` and nothing else said. Whatever is found is a false find. `flagged`
are those with `poor_fit` or `edges_only`, `plain` those with neither. `--pictures` draws each find beside what the
image has there, on a sheet for each kind. The family `bad-input`, which does not count to the 500, is of the inputs
on which time must not grow. Times are of the processor, which a busy machine leaves as they are.
"""

from __future__ import annotations

import argparse
import sys
import time
import zlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import cv2
import numpy as np

import circlepose
from benchmarks.recall import table
from benchmarks.support import empty_grounds as grounds
from benchmarks.support import empty_print as printed
from benchmarks.support.drawn import picture_of
from benchmarks.support.environments import NotInstalledError, environment
from benchmarks.support.package_images import REQUIREMENTS, package_images
from circlepose._typing import Image
from circlepose.results import CircleResult, Flag

Maker = Callable[[np.random.Generator], Image]
FAMILIES: dict[str, dict[str, tuple[int, Maker]]] = {
    "noise": {
        "white": (15, grounds.white),
        "1/f": (10, grounds.pink),
        "JPEG of noise": (10, grounds.noise_jpeg),
        "JPEG of faint noise": (15, grounds.faint_noise_jpeg),
        "salt and pepper": (10, grounds.salt_and_pepper),
    },
    "textures": {
        "stripes": (15, grounds.stripes),
        "chessboard": (15, grounds.chessboard),
        "Voronoi cells": (15, grounds.voronoi),
        "leaves": (15, grounds.leaves),
        "brick": (15, grounds.brick),
        "wood": (10, grounds.wood),
        "fabric": (15, grounds.fabric),
    },
    "text": {
        "photographed": (20, printed.text),
        "scanned": (10, printed.scanned_text),
        "stroke fonts": (10, printed.drawn_text),
        "photographed, no round letters": (20, partial(printed.text, has_rings=False)),
        "scanned, no round letters": (10, partial(printed.scanned_text, has_rings=False)),
        "stroke fonts, no round letters": (10, partial(printed.drawn_text, has_rings=False)),
    },
    "polygons": {
        "3 to 5 corners": (15, partial(printed.regular, lowest=3, highest=5)),
        "6 to 8 corners": (15, partial(printed.regular, lowest=6, highest=8)),
        "9 to 12 corners": (15, partial(printed.regular, lowest=9, highest=12)),
        "13 to 16 corners": (15, partial(printed.regular, lowest=13, highest=16)),
        "irregular": (20, printed.irregular),
    },
    "markers": {
        "ArUco and AprilTag": (50, printed.markers),
        "QR codes": (25, printed.qr_codes),
        "random cells": (25, printed.cells),
    },
    "blobs": {
        "one blob": (15, grounds.blob),
        "several blobs": (15, grounds.blobs),
        "clouds": (10, grounds.clouds),
    },
    "gradients": {"gradient": (20, grounds.gradient)},
}
PHOTOGRAPHS, BAD_INPUT = "photographs", "bad-input"
TARGET = circlepose.Target.circle(30.0, count="all")
_TILE_PX = 160
_MOST_TILES = 120
"""on a sheet; of more finds an even choice is drawn"""


@dataclass(slots=True)
class Row:
    """Counts of a kind."""

    images: int = 0
    with_finds: int = 0
    finds: int = 0
    poor_fit: int = 0
    edges_only: int = 0
    plain: int = 0
    seconds: list[float] = field(default_factory=list)

    def count(self, circles: Iterable[CircleResult], seconds: float) -> None:
        found = list(circles)
        self.images += 1
        self.with_finds += bool(found)
        self.finds += len(found)
        self.poor_fit += sum(Flag.POOR_FIT in circle.flags for circle in found)
        self.edges_only += sum(Flag.EDGES_ONLY in circle.flags for circle in found)
        self.plain += sum(not {Flag.POOR_FIT, Flag.EDGES_ONLY} & set(circle.flags) for circle in found)
        self.seconds.append(seconds)

    def add(self, other: Row) -> None:
        for name in ("images", "with_finds", "finds", "poor_fit", "edges_only", "plain"):
            setattr(self, name, getattr(self, name) + getattr(other, name))
        self.seconds += other.seconds

    def cells(self) -> list[str]:
        counts = (self.images, self.with_finds, self.finds)
        flagged = (self.poor_fit, self.edges_only, self.plain)
        rate = f"{self.finds / max(self.images, 1):.3f}"
        times = 1e3 * np.array(self.seconds or [0.0])
        return [*map(str, counts), rate, *map(str, flagged), f"{np.median(times):.0f}", f"{times.max():.0f}"]


def images_of(family: str, kind: str) -> Iterator[Image]:
    """Yield the images of a kind, from seeds of their own."""
    number, maker = FAMILIES[family][kind]
    for image in range(number):
        yield maker(np.random.Generator(np.random.PCG64([zlib.crc32(kind.encode()), image])))


def bad_input() -> Iterator[tuple[str, Image]]:
    """Yield the inputs on which time must not grow, 640 x 480 but for the larger ones."""
    for kind, maker in (
        ("text", printed.text),
        ("leaves", grounds.leaves),
        ("chessboard", grounds.chessboard),
        ("large leaves", partial(grounds.leaves, size=(1600, 1200))),
    ):
        for seed in range(3):
            yield kind, maker(np.random.Generator(np.random.PCG64([77, seed])))
    for size in ((640, 480), (1600, 1200)):
        for sigma in (1.0, 5.0, 20.0, 50.0):
            generator = np.random.Generator(np.random.PCG64([78, int(sigma)]))
            levels = 120.0 + sigma * generator.standard_normal(size[::-1])
            yield f"noise {sigma:g}, {size[0]} x {size[1]}", grounds.eight_bit(levels)
        yield f"flat, {size[0]} x {size[1]}", np.full(size[::-1], 120, np.uint8)


def found_in(image: Image) -> tuple[tuple[CircleResult, ...], float]:
    """Return what `estimate` finds, and the processor's seconds that it takes."""
    height, width = image.shape[:2]
    matrix = [[900.0, 0.0, (width - 1) / 2.0], [0.0, 900.0, (height - 1) / 2.0], [0.0, 0.0, 1.0]]
    camera = circlepose.Camera.create(matrix, (), (width, height))
    start = time.process_time()
    result = circlepose.estimate(image, camera, TARGET)
    return tuple(circle for circle in result.circles if circle.candidates), time.process_time() - start


class Sheet:
    """Finds and what the image has there, side by side."""

    def __init__(self, path: Path | None) -> None:
        self._path = path
        self._tiles: list[Image] = []
        self._finds = 0
        self._every = 1

    def add(self, image: Image, circles: Iterable[CircleResult], number: int) -> None:
        for circle in circles if self._path is not None else ():
            self._finds += 1
            if circle.ellipse is None or self._finds % self._every:
                continue
            reach = int(1.5 * circle.ellipse.semi_major) + 4
            x, y = (int(c) for c in circle.ellipse.center)
            corner = max(x - reach, 0), max(y - reach, 0)
            part = image[corner[1] : y + reach + 1, corner[0] : x + reach + 1]
            scale = max(1, round(_TILE_PX / (2 * reach + 1)))
            plain, marked = (picture_of(part, shown, scale, corner) for shown in ((), (circle,)))
            tile = np.hstack([cv2.resize(part, (_TILE_PX, _TILE_PX)) for part in (plain, marked)])
            flags = ",".join(flag for flag in circle.flags if flag in (Flag.POOR_FIT, Flag.EDGES_ONLY))
            label = f"{number}: r {circle.ellipse.semi_major:.1f}, {circle.score or 0.0:.2f} {flags}"
            cv2.putText(tile, label, (4, 12), cv2.FONT_HERSHEY_PLAIN, 0.9, (0, 200, 255), 1, cv2.LINE_AA)
            self._tiles.append(tile)
            if len(self._tiles) > _MOST_TILES:
                self._tiles, self._every = self._tiles[::2], 2 * self._every

    def write(self) -> None:
        if self._path is None or not self._tiles:
            return
        columns = 6
        while len(self._tiles) % columns:
            self._tiles.append(np.zeros_like(self._tiles[0]))
        rows = [np.hstack(self._tiles[i : i + columns]) for i in range(0, len(self._tiles), columns)]
        self._path.parent.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(self._path), np.vstack(rows))


def counted(images: Iterable[tuple[str, Image]], folder: Path | None, family: str) -> dict[str, Row]:
    """Run on images with their kinds."""
    rows: dict[str, Row] = {}
    sheets: dict[str, Sheet] = {}
    for kind, image in images:
        row = rows.setdefault(kind, Row())
        name = f"{family}, {kind}.png".replace("/", " to ")
        sheet = sheets.setdefault(kind, Sheet(None if folder is None else folder / name))
        circles, seconds = found_in(image)
        sheet.add(image, circles, row.images)
        row.count(circles, seconds)
    for sheet in sheets.values():
        sheet.write()
    return rows


def photographs() -> Iterator[tuple[str, Image]]:
    """Yield the images that packages ship, if these can be installed."""
    with ExitStack() as stack:
        try:
            python = stack.enter_context(environment(*REQUIREMENTS))
        except NotInstalledError as error:
            print(error, file=sys.stderr)
            return
        yield from package_images(python).items()


def main(arguments: list[str]) -> int:
    """Print a row for each kind of image, and the totals."""
    names = [*FAMILIES, PHOTOGRAPHS, BAD_INPUT]
    parser = argparse.ArgumentParser(prog="python -m benchmarks.false_alarms")
    parser.add_argument("families", nargs="*", metavar="FAMILY", help=f"one of {', '.join(names)}")
    parser.add_argument(
        "--only", metavar="KIND", default="", help="the kinds of the families whose names have this in them"
    )
    parser.add_argument("--pictures", type=Path, metavar="DIR", help="where to draw what is found")
    args = parser.parse_args(arguments)
    unknown = set(args.families) - set(names)
    if unknown:
        parser.error(f"no such family: {', '.join(sorted(unknown))}; there are {', '.join(names)}")
    cv2.setNumThreads(1)
    counts = ["images", "with finds", "finds", "finds an image", "poor_fit", "edges_only", "plain"]
    head = [*counts, "ms, median", "ms, most"]
    totals: dict[str, Row] = {}
    every = Row()
    for name in args.families or names:
        if name == PHOTOGRAPHS:
            images: Iterable[tuple[str, Image]] = photographs()
        elif name == BAD_INPUT:
            images = bad_input()
        else:
            kinds = [kind for kind in FAMILIES[name] if args.only in kind]
            images = ((kind, image) for kind in kinds for image in images_of(name, kind))
        wanted = ((kind, image) for kind, image in images if args.only in kind)
        rows = counted(wanted, args.pictures, name)
        table([name, *head], ([kind, *row.cells()] for kind, row in rows.items()))
        total = totals.setdefault(name, Row())
        for row in rows.values():
            total.add(row)
        if name != BAD_INPUT:
            every.add(total)
    rows = totals | {"all but bad-input": every}
    table(["family", *head], ([name, *row.cells()] for name, row in rows.items()))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
