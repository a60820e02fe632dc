"""What is found on photographs with truth, against other detectors on the same images in one run.

    python -m benchmarks.detection [SET ...]

Only the image is given, as to `circlepose estimate --count all` without intervals, unless said below. Each detector
finds circles or ellipses; a true one is found when a report stands at its place with its size (within a quarter). A
report that stands at no true circle counts against the precision, unless it is *alike*: it has the size and the
contrast of true circles of its image, which is how the discs look that the truth does not list.

OpenCV's HoughCircles and SimpleBlobDetector run with settings that suit small dark discs, since their defaults find
hardly any. findCirclesGrid gets these blobs and the board's layout, without which it cannot run, and is tried plainly
and then with CALIB_CB_CLUSTERING; it finds all discs or none, and as it gives no sizes, the place alone counts.
EdgeDrawing of opencv-contrib and ringgrid are put into environments of their own (`environments.py`); what cannot be
installed is left out, with a sentence. ringgrid is given a board of rings without code, since it has none of discs:
of the board's layout where that is a symmetric grid, its own hexagonal one elsewhere. It does without the inner rims.
"""

from __future__ import annotations

import json
import re
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from typing import Any

import cv2
import numpy as np

import circlepose
from benchmarks.support.environments import EDGE_DRAWING, RINGGRID, NotInstalledError, answers, environment
from benchmarks.support.scoring import PHOTOGRAPHS, TrueCircle, data_folder, read_truth
from circlepose._typing import FloatArray, Image
from circlepose.detection.detect import find_contours
from circlepose.imaging.gray import to_grey
from circlepose.io.images.reader import read_image

Detector = Callable[[Image], FloatArray]
"""Grey image -> (n, 3): x, y and major axis in px, NaN where it gives none."""
Photograph = tuple[Image, list[TrueCircle]]
SIZES_PX = ((0.0, 10.0), (10.0, 25.0), (25.0, np.inf))
CONTRASTS = ((0.0, 60.0), (60.0, 130.0), (130.0, np.inf))
_ALIKE = 0.3


def ours(grey: Image) -> FloatArray:
    """Contours as `estimate` gets them."""
    contours = find_contours(grey, circlepose.AxisIntervals()).contours
    return np.array([[*c.ellipse.center, 2.0 * c.ellipse.semi_major] for c in contours]).reshape(-1, 3)


def hough(grey: Image) -> FloatArray:
    """OpenCV's gradient Hough transform."""
    found = cv2.HoughCircles(
        cv2.GaussianBlur(grey, (3, 3), 0), cv2.HOUGH_GRADIENT, 1.0, 8.0, param1=120.0, param2=14.0, maxRadius=120
    )
    return np.empty((0, 3)) if found is None else found.reshape(-1, found.shape[-1])[:, :3] * [1.0, 1.0, 2.0]


def blobs(grey: Image) -> FloatArray:
    """OpenCV's blobs over many thresholds, dark and bright."""
    reports = []
    for color in (0, 255):
        reports += [[*k.pt, k.size] for k in blob_detector(color).detect(grey)]
    return np.array(reports).reshape(-1, 3)


def blob_detector(color: int) -> cv2.SimpleBlobDetector:
    """Return OpenCV's detector of blobs of this level, 0 or 255, with settings that suit discs."""
    params = cv2.SimpleBlobDetector.Params()
    params.blobColor = color
    params.minArea, params.maxArea = 25.0, 60_000.0
    params.filterByCircularity, params.minCircularity = True, 0.7
    params.filterByInertia, params.minInertiaRatio = True, 0.15
    params.minDistBetweenBlobs = 5.0
    return cv2.SimpleBlobDetector.create(params)


@dataclass(frozen=True, slots=True)
class Grid:
    """Layout of a board: discs in a row and rows, as findCirclesGrid wants them."""

    size: tuple[int, int]
    is_asymmetric: bool = False


def grid_of(pattern: str, truth: list[TrueCircle]) -> Grid | None:
    """Return the layout of a board, from a set's `pattern` and the places in the lattice that name its discs.

    An asymmetric grid's lattice runs along the diagonals. Boards that are no rectangle of either kind have none.
    """
    symmetric = re.search(r"\bsymmetric grid (\d+)x(\d+)", pattern)
    if symmetric:
        return Grid((int(symmetric[1]), int(symmetric[2])))
    if not re.search(r"\basymmetric\b", pattern):
        return None
    i, j = np.array([circle.name.split("_") for circle in truth], dtype=int).T
    along, across = int(np.ptp(i + j)) + 1, int(np.ptp(i - j)) + 1
    either = ((along // 2, across), (across // 2, along))
    return Grid(min(either, key=lambda size: abs(size[0] * size[1] - len(truth))), is_asymmetric=True)


def circles_grid(grey: Image, grid: Grid) -> FloatArray:
    """OpenCV's findCirclesGrid, plainly and, if there is nothing, with clustering; no sizes."""
    kind = cv2.CALIB_CB_ASYMMETRIC_GRID if grid.is_asymmetric else cv2.CALIB_CB_SYMMETRIC_GRID
    for flags in (kind, kind | cv2.CALIB_CB_CLUSTERING):
        found, centers = cv2.findCirclesGrid(grey, grid.size, flags=flags, blobDetector=blob_detector(0))
        if found:
            return np.insert(centers.reshape(-1, 2), 2, np.nan, axis=1)
    return np.empty((0, 3))


class Tally:
    """Counts of one detector over the images of one set."""

    def __init__(self) -> None:
        self.hits: list[tuple[float, float, bool]] = []
        self.reported = self.alike = 0
        self.seconds: list[float] = []

    def run(self, grey: Image, truth: list[TrueCircle], detector: Detector) -> None:
        """Run a detector on an image and count."""
        start = time.perf_counter()
        reports = detector(grey)
        self.seconds.append(time.perf_counter() - start)
        self.count(grey, truth, reports)

    def count(self, grey: Image, truth: list[TrueCircle], reports: FloatArray) -> None:
        """Count what was reported on an image."""
        right = np.zeros(len(reports), bool)
        looks = []
        for true in truth:
            if true.seen_px is None or true.major_px is None:
                continue
            contrast = _contrast(grey, true.seen_px, true.major_px)
            looks.append((true.major_px, contrast))
            off = np.linalg.norm(reports[:, :2] - true.seen_px, axis=1) / (0.1 * true.major_px + 1.0)
            off[np.abs(reports[:, 2] / true.major_px - 1.0) > 0.25] = np.inf
            best = int(np.argmin(off)) if len(off) else -1
            hit = best >= 0 and off[best] < 1.0
            self.hits.append((true.major_px, contrast, bool(hit)))
            if hit:
                right[best] = True
        self.reported += len(reports)
        known = np.array(looks).reshape(-1, 2)
        for x, y, size in reports[~right & np.isfinite(reports[:, 2])]:
            look = np.array([size, _contrast(grey, np.array([x, y]), size)])
            self.alike += bool(np.any(np.all(np.abs(known / np.maximum(look, 1e-9) - 1.0) < _ALIKE, axis=1)))

    def row(self) -> str:
        """Return the cells of the table."""
        found = sum(hit for *_, hit in self.hits)
        recall = found / max(len(self.hits), 1)
        precision = (found + self.alike) / max(self.reported, 1)
        f1 = 2.0 * recall * precision / max(recall + precision, 1e-9)
        shares = [self._recall(0, *limits) for limits in SIZES_PX] + [
            self._recall(1, *limits) for limits in CONTRASTS
        ]
        cells = [f"{found}/{len(self.hits)}", f"{self.reported - found}", f"{self.alike}"]
        cells += [f"{recall:.3f}", f"{precision:.3f}", f"{f1:.3f}", *shares]
        cells.append(f"{1e3 * np.median(self.seconds):.0f}" if self.seconds else "--")
        return " | ".join(cells)

    def _recall(self, column: int, low: float, high: float) -> str:
        hits = [each[2] for each in self.hits if low <= each[column] < high]
        return f"{np.mean(hits):.3f}" if hits else "--"


def _contrast(grey: Image, center: FloatArray, major_px: float) -> float:
    """Return how much the inside differs from what is around, grey levels, by medians."""
    reach = int(np.ceil(0.8 * major_px)) + 2
    x0, y0 = (max(0, int(c) - reach) for c in center)
    patch = grey[y0 : y0 + 2 * reach + 1, x0 : x0 + 2 * reach + 1].astype(float)
    y, x = np.mgrid[0 : patch.shape[0], 0 : patch.shape[1]]
    distance = np.hypot(x + x0 - center[0], y + y0 - center[1]) / max(major_px, 1e-9)
    inside, around = patch[distance < 0.25], patch[(distance > 0.6) & (distance < 0.75)]
    return float(abs(np.median(inside) - np.median(around))) if len(inside) and len(around) else 0.0


def _span(limits: tuple[float, float]) -> str:
    low, high = limits
    return f"{low:g} to {high:g}" if np.isfinite(high) else f"from {low:g}"


@dataclass(frozen=True, slots=True)
class Elsewhere:
    """A detector that has an environment of its own."""

    name: str
    python: str
    way: str

    def run(self, photographs: list[Photograph], options: dict[str, object]) -> Tally:
        """Run it on the images of a set and count."""
        tally = Tally()
        greys = [np.ascontiguousarray(grey) for grey, _ in photographs]
        rows = answers(self.python, self.way, greys, options)
        for (grey, truth), found in zip(photographs, rows, strict=True):
            # Time, centre, semi-axes.
            seen = np.array(found).reshape(-1, 6)
            tally.seconds += [*seen[:1, 0] / 1e3]
            tally.count(grey, truth, np.column_stack([seen[:, 1:3], 2.0 * seen[:, 3:5].max(axis=1, initial=0.0)]))
        return tally


def elsewhere(stack: ExitStack) -> Iterator[Elsewhere]:
    """Yield the detectors that can be installed; say which cannot."""
    wanted = (
        ("EdgeDrawing", EDGE_DRAWING, "edge-drawing"),
        ("ringgrid", RINGGRID, "ringgrid"),
    )
    for name, requirement, way in wanted:
        try:
            yield Elsewhere(name, stack.enter_context(environment(requirement)), way)
        except NotInstalledError as error:
            print(error, file=sys.stderr)


def tallies(photographs: list[Photograph], target: dict[str, Any], others: list[Elsewhere]) -> dict[str, Tally]:
    """Run all detectors on the images of a set; `target` is its target.json."""
    here: dict[str, Detector] = {"circlepose": ours, "HoughCircles": hough, "SimpleBlobDetector": blobs}
    counted = {name: Tally() for name in here}
    grids = [grid_of(target["pattern"], truth) for _, truth in photographs]
    for (grey, truth), grid in zip(photographs, grids, strict=True):
        for name, detector in here.items():
            counted[name].run(grey, truth, detector)
        if grid is not None:
            counted.setdefault("findCirclesGrid", Tally()).run(grey, truth, partial(circles_grid, grid=grid))
    options: dict[str, object] = {}
    if grids[0] is not None and not grids[0].is_asymmetric:
        columns, rows = grids[0].size
        options["grid"] = [target["spacing"], rows, columns, target["radius"], target["radius"] / 2.0]
    return counted | {other.name: other.run(photographs, options) for other in others}


def main(names: list[str]) -> int:
    """Print a row per set and detector."""
    data = data_folder()
    if data is None:
        print("no images with truth here; set CIRCLEPOSE_DATA", file=sys.stderr)
        return 2
    cv2.setNumThreads(1)
    classes = [f"recall {_span(limits)} px" for limits in SIZES_PX]
    classes += [f"contrast {_span(limits)}" for limits in CONTRASTS]
    head = [
        "set",
        "detector",
        "found",
        "others",
        "of them alike",
        "recall",
        "precision",
        "F1",
        *classes,
        "ms, median",
    ]
    print(f"| {' | '.join(head)} |\n|{'---|' * len(head)}", flush=True)
    with ExitStack() as stack:
        others = list(elsewhere(stack))
        for name in names or PHOTOGRAPHS:
            folder = data / name
            target = json.loads((folder / "target.json").read_text())
            images = read_truth(folder).items()
            photographs = [(to_grey(read_image(folder / "images" / image)), truth) for image, truth in images]
            for detector, tally in tallies(photographs, target, others).items():
                print(f"| {name} | {detector} | {tally.row()} |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
