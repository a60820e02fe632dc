"""Recall on rendered families: noise, blur, hidden rims, color, 16 bit, backgrounds, rough rims, raw images.

    python -m benchmarks.recall [FAMILY ...] [--alone] [--pictures DIR]

Each image goes to `estimate` with `count: all` and nothing else said, as a file of its kind would, and to OpenCV's
EdgeDrawing and SimpleBlobDetector as 8 bit gray, stretched from its 0.1th to its 99.9th percentile where it has more
bits. A disc is found when a report stands at its place, within a tenth of its size and 1 px, with its size, within a
quarter. `--alone` leaves the other detectors out; `--pictures` draws what is found.

The second table compares the errors of the better candidate with the covariance: `predicted` is the root mean
variance of the center, chi2 is per degree of freedom (1 expected), of the center (3) and of center and tilts (5);
`beyond` are poses with a chi2 of five that noise exceeds once in 10^4. Times are of the processor,
which a busy machine leaves as they are.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
from scipy.stats import chi2

import circlepose
from benchmarks.accuracy import errors, nees
from benchmarks.detection import blobs
from benchmarks.support.disc_families import FAMILIES, counted
from benchmarks.support.disc_pictures import RADIUS_MM, Picture
from benchmarks.support.drawn import drawn
from benchmarks.support.environments import EDGE_DRAWING, NotInstalledError, answers, environment
from circlepose._typing import FloatArray, Image
from circlepose.imaging.gray import to_grey
from circlepose.results import CircleResult, Flag

TARGET = circlepose.Target.circle(RADIUS_MM, count="all")
BEYOND = float(chi2.ppf(1.0 - 1e-4, 5))


def matched(reports: FloatArray, truth: FloatArray) -> list[int | None]:
    """Return the report (x, y, major axis) of each true one, by place and size; none is used twice."""
    free = np.ones(len(reports), bool)
    found: list[int | None] = []
    for x, y, major in truth:
        off = np.hypot(reports[:, 0] - x, reports[:, 1] - y) / (0.1 * major + 1.0)
        off[(np.abs(reports[:, 2] / major - 1.0) > 0.25) | ~free] = np.inf
        best = int(np.argmin(off)) if len(off) else -1
        hit = best >= 0 and off[best] < 1.0
        found.append(best if hit else None)
        if hit:
            free[best] = False
    return found


def eight_bit_gray(image: Image) -> Image:
    """Return what the other detectors are given."""
    gray = to_grey(image)
    if gray.dtype == np.uint8:
        return gray
    low, high = np.percentile(gray, [0.1, 99.9])
    return np.clip(255.0 * (gray.astype(np.float64) - low) / max(high - low, 1e-9), 0.0, 255.0).astype(np.uint8)


@dataclass(slots=True)
class Row:
    """Counts of a setting."""

    number: int = 0
    found: int = 0
    others: int = 0
    axis_errors: list[float] = field(default_factory=list)
    flags: Counter[Flag] = field(default_factory=Counter)
    seconds: list[float] = field(default_factory=list)
    elsewhere: dict[str, list[int]] = field(default_factory=dict)
    """found and others of each other detector"""
    poses: list[tuple[float, float, float, float]] = field(default_factory=list)
    """squared error of the center (mm), its variance, and chi2 of three and of five"""

    def count(self, picture: Picture, circles: Sequence[CircleResult]) -> None:
        """Count what `estimate` gives for an image."""
        seen = [circle for circle in circles if circle.candidates and circle.ellipse is not None]
        reports = np.array([[*c.ellipse.center, 2.0 * c.ellipse.semi_major] for c in seen if c.ellipse is not None])
        hits = matched(reports.reshape(-1, 3), _truth(picture))
        self.number += len(picture.discs)
        self.others += len(seen) - sum(hit is not None for hit in hits)
        true = picture.ellipses()
        for number, (disc, hit) in enumerate(zip(picture.discs, hits[: len(picture.discs)], strict=True)):
            if hit is None:
                continue
            circle = seen[hit]
            assert circle.ellipse is not None
            self.found += 1
            self.flags.update(circle.flags)
            self.axis_errors.append(abs(float(circle.ellipse.semi_major - true.semi_major[number])))
            self.axis_errors.append(abs(float(circle.ellipse.semi_minor - true.semi_minor[number])))
            best = max(circle.candidates, key=lambda candidate: float(candidate.normal @ disc.normal))
            off, turn = errors(best, disc)
            consistent = nees(best, off, turn)
            if consistent is not None and best.covariance is not None:
                variance = float(np.trace(best.covariance[:3, :3]))
                self.poses.append((float(off @ off), variance, *consistent))

    def count_other(self, name: str, picture: Picture, reports: FloatArray) -> None:
        """Count what another detector reports."""
        hits = matched(reports, _truth(picture))
        counts = self.elsewhere.setdefault(name, [0, 0])
        counts[0] += sum(hit is not None for hit in hits[: len(picture.discs)])
        counts[1] += len(reports) - sum(hit is not None for hit in hits)

    def cells(self, others: Iterable[str]) -> list[str]:
        """Return the cells of the first table."""
        elsewhere = [f"{self.elsewhere[name][0]} + {self.elsewhere[name][1]}" for name in others]
        error = f"{np.median(self.axis_errors):.3f}" if self.axis_errors else "--"
        flags = [str(self.flags[flag] or "") for flag in (Flag.POOR_FIT, Flag.EDGES_ONLY)]
        return [
            f"{self.found}/{self.number}",
            str(self.others),
            *elsewhere,
            error,
            *flags,
            f"{1e3 * np.median(self.seconds):.0f}",
        ]

    def pose_cells(self) -> list[str]:
        """Return the cells of the second table."""
        squares, variances, of_center, of_pose = np.array(self.poses).T
        return [
            f"{len(self.poses)}/{self.found}",
            f"{np.sqrt(squares.mean()):.3f}",
            f"{np.sqrt(variances.mean()):.3f}",
            f"{of_center.mean() / 3.0:.2f}",
            f"{of_pose.mean() / 5.0:.2f}",
            f"{np.median(of_pose) / chi2.median(5):.2f}",
            str(int(np.sum(of_pose > BEYOND)) or ""),
        ]


def _truth(picture: Picture) -> FloatArray:
    rims = picture.ellipses()
    return np.column_stack([rims.center, 2.0 * rims.semi_major])


def measured(name: str, python: str | None, folder: Path | None) -> dict[str, Row]:
    """Run all detectors on a family; rows by setting."""
    rows: dict[str, Row] = {}
    for setting, pictures in counted(FAMILIES[name]()).items():
        row = rows.setdefault(setting, Row())
        for number, picture in enumerate(pictures):
            start = time.process_time()
            result = circlepose.estimate(picture.image, picture.camera, TARGET)
            row.seconds.append(time.process_time() - start)
            row.count(picture, result.circles)
            if folder is not None:
                drawn(folder / f"{name}, {setting}, {number}.png".replace("/", " to "), picture.image, result.circles)
        if python is None:
            continue
        greys = [np.ascontiguousarray(eight_bit_gray(picture.image)) for picture in pictures]
        for picture, grey, found in zip(pictures, greys, answers(python, "edge-drawing", greys), strict=True):
            seen = np.array(found).reshape(-1, 6)
            major = 2.0 * seen[:, 3:5].max(axis=1, initial=0.0)
            row.count_other("EdgeDrawing", picture, np.column_stack([seen[:, 1:3], major]))
            row.count_other("SimpleBlobDetector", picture, blobs(grey))
    return rows


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a Markdown table."""
    print(f"\n| {' | '.join(head)} |\n|{'---|' * len(head)}")
    for cells in rows:
        print(f"| {' | '.join(cells)} |")
    sys.stdout.flush()


def main(arguments: list[str]) -> int:
    """Print both tables of each family."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.recall")
    parser.add_argument("families", nargs="*", metavar="FAMILY", help=f"one of {', '.join(FAMILIES)}")
    parser.add_argument("--alone", action="store_true", help="without the other detectors")
    parser.add_argument("--pictures", type=Path, metavar="DIR", help="where to draw what is found")
    args = parser.parse_args(arguments)
    unknown = set(args.families) - set(FAMILIES)
    if unknown:
        parser.error(f"no such family: {', '.join(sorted(unknown))}; there are {', '.join(FAMILIES)}")
    cv2.setNumThreads(1)
    poses: list[list[str]] = []
    totals: list[list[str]] = []
    with ExitStack() as stack:
        python = None
        if not args.alone:
            try:
                python = stack.enter_context(environment(EDGE_DRAWING))
            except NotInstalledError as error:
                print(error, file=sys.stderr)
        others = ("EdgeDrawing", "SimpleBlobDetector") if python else ()
        head = ["found", "others", *(f"{name}, found + others" for name in others)]
        head += ["axis error px, median", "poor_fit", "edges_only", "ms, median"]
        for name in args.families or FAMILIES:
            rows = measured(name, python, args.pictures)
            table([name, *head], ([setting, *row.cells(others)] for setting, row in rows.items()))
            poses += [[f"{name}: {setting}", *row.pose_cells()] for setting, row in rows.items() if row.poses]
            number, found = (sum(getattr(row, key) for row in rows.values()) for key in ("number", "found"))
            elsewhere = [str(sum(row.elsewhere[other][0] for row in rows.values())) for other in others]
            stray = sum(row.others for row in rows.values())
            totals.append([name, f"{found}/{number}", f"{found / number:.3f}", str(stray), *elsewhere])
    table(("family", "found", "recall", "others", *(f"{name}, found" for name in others)), totals)
    head = ["with covariance", "center rms mm", "predicted mm", "chi2 center", "chi2 pose"]
    table(["poses", *head, "median chi2 pose / expected", "beyond"], poses)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
