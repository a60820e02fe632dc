"""What is found on photographs with truth, against other detectors on the same images in one run.

    python benchmarks/detection.py [SET ...]

Nothing but the image is given, as to `circlepose estimate --count all` without intervals. Each detector finds circles
or ellipses; a true one is found when a report stands at its place with its size (within a quarter). A report that
stands at no true circle counts against the precision, unless it is *alike*: it has the size and the contrast of true
circles of its image, which is how the discs look that the truth does not list.

OpenCV's HoughCircles and SimpleBlobDetector run with settings that suit small dark discs, since their defaults find
hardly any. EdgeDrawing needs `opencv-contrib-python-headless` and ringgrid its own package (it knows only its own
coded rings); both are skipped with a sentence where they are absent. OpenCV's two wheels exclude each other, so give
EdgeDrawing an environment of its own.
"""

from __future__ import annotations

import importlib
import importlib.util
import sys
import time
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

import circlepose
from circlepose.extraction.find import find_contours
from circlepose.extraction.grey import to_grey
from circlepose.files.images import read_image
from scoring import PHOTOGRAPHS, TrueCircle, data_folder, read_truth

Detector = Callable[[np.ndarray], np.ndarray]
"""Grey image -> (n, 3): x, y and major axis in px."""
SIZES_PX = ((0.0, 10.0), (10.0, 25.0), (25.0, np.inf))
CONTRASTS = ((0.0, 60.0), (60.0, 130.0), (130.0, np.inf))
_ALIKE = 0.3


def ours(grey: np.ndarray) -> np.ndarray:
    """Contours as `estimate` gets them."""
    contours = find_contours(grey, circlepose.AxisIntervals()).contours
    return np.array([[*c.ellipse.center, 2.0 * c.ellipse.semi_major] for c in contours]).reshape(-1, 3)


def hough(grey: np.ndarray) -> np.ndarray:
    """OpenCV's gradient Hough transform."""
    found = cv2.HoughCircles(
        cv2.GaussianBlur(grey, (3, 3), 0), cv2.HOUGH_GRADIENT, 1.0, 8.0, param1=120.0, param2=14.0, maxRadius=120
    )
    return np.empty((0, 3)) if found is None else found.reshape(-1, found.shape[-1])[:, :3] * [1.0, 1.0, 2.0]


def blobs(grey: np.ndarray) -> np.ndarray:
    """OpenCV's blobs over many thresholds, dark and bright."""
    reports = []
    for color in (0, 255):
        params = cv2.SimpleBlobDetector.Params()
        params.blobColor = color
        params.minArea, params.maxArea = 25.0, 60_000.0
        params.filterByCircularity, params.minCircularity = True, 0.7
        params.filterByInertia, params.minInertiaRatio = True, 0.15
        params.minDistBetweenBlobs = 5.0
        keypoints = cv2.SimpleBlobDetector.create(params).detect(grey)
        reports += [[*k.pt, k.size] for k in keypoints]
    return np.array(reports).reshape(-1, 3)


def edge_drawing(grey: np.ndarray) -> np.ndarray:
    """EDCircles of opencv-contrib."""
    detector = cv2.ximgproc.createEdgeDrawing()  # type: ignore[attr-defined]
    detector.detectEdges(grey)
    found = detector.detectEllipses()
    if found is None:
        return np.empty((0, 3))
    x, y, radius, a, b, _ = found.reshape(-1, 6).T
    return np.stack([x, y, 2.0 * np.where(radius > 0.0, radius, np.maximum(a, b))], axis=-1)


def ringgrid(grey: np.ndarray) -> np.ndarray:
    """Rings of the ringgrid target: only these, of which there are none on boards of discs."""
    module = importlib.import_module("ringgrid")
    found = module.Detector.from_target(module.TargetLayout.default_hex()).detect(grey)
    outer = [m.ellipse_outer for m in found.detected_markers if m.ellipse_outer is not None]
    return np.array([[e.cx, e.cy, 2.0 * max(e.a, e.b)] for e in outer]).reshape(-1, 3)


def detectors() -> dict[str, Detector]:
    """Return those that are installed here; say which are not."""
    chosen: dict[str, Detector] = {"circlepose": ours, "HoughCircles": hough, "SimpleBlobDetector": blobs}
    if hasattr(cv2, "ximgproc"):
        chosen["EdgeDrawing"] = edge_drawing
    else:
        print("EdgeDrawing is skipped: this OpenCV has no contrib modules.", file=sys.stderr)
    if importlib.util.find_spec("ringgrid"):
        chosen["ringgrid"] = ringgrid
    else:
        print("ringgrid is skipped: it is not installed.", file=sys.stderr)
    return chosen


class Tally:
    """Counts of one detector over the images of one set."""

    def __init__(self) -> None:
        self.hits: list[tuple[float, float, bool]] = []
        self.reported = self.alike = 0
        self.seconds: list[float] = []

    def add(self, grey: np.ndarray, truth: list[TrueCircle], detector: Detector) -> None:
        """Run the detector on an image and count."""
        start = time.perf_counter()
        reports = detector(grey)
        self.seconds.append(time.perf_counter() - start)
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
        for x, y, size in reports[~right]:
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
        cells += [f"{recall:.3f}", f"{precision:.3f}", f"{f1:.3f}", *shares, f"{1e3 * np.median(self.seconds):.0f}"]
        return " | ".join(cells)

    def _recall(self, column: int, low: float, high: float) -> str:
        hits = [each[2] for each in self.hits if low <= each[column] < high]
        return f"{np.mean(hits):.3f}" if hits else "--"


def _contrast(grey: np.ndarray, center: np.ndarray, major_px: float) -> float:
    """Return how much the inside differs from what is around, grey levels, by medians."""
    reach = int(np.ceil(0.8 * major_px)) + 2
    x0, y0 = (max(0, int(c) - reach) for c in center)
    patch = grey[y0 : y0 + 2 * reach + 1, x0 : x0 + 2 * reach + 1].astype(float)
    y, x = np.mgrid[0 : patch.shape[0], 0 : patch.shape[1]]
    distance = np.hypot(x + x0 - center[0], y + y0 - center[1]) / max(major_px, 1e-9)
    inside, around = patch[distance < 0.25], patch[(distance > 0.6) & (distance < 0.75)]
    return float(abs(np.median(inside) - np.median(around))) if len(inside) and len(around) else 0.0


def main(names: list[str]) -> int:
    """Print a row per set and detector."""
    data = data_folder()
    if data is None:
        print("no images with truth here; set CIRCLEPOSE_DATA", file=sys.stderr)
        return 2
    cv2.setNumThreads(1)
    chosen = detectors()
    classes = [f"recall {low:g} to {high:g} px" for low, high in SIZES_PX]
    classes += [f"contrast {low:g} to {high:g}" for low, high in CONTRASTS]
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
    print(f"| {' | '.join(head)} |\n|{'---|' * len(head)}")
    for name in names or PHOTOGRAPHS:
        folder: Path = data / name
        tallies = {detector: Tally() for detector in chosen}
        for image, truth in read_truth(folder).items():
            grey = to_grey(read_image(folder / "images" / image))
            for detector, tally in tallies.items():
                tally.add(grey, truth, chosen[detector])
        for detector, tally in tallies.items():
            print(f"| {name} | {detector} | {tally.row()} |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
