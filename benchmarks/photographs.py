"""Photographs with truth: what is found and how well, default settings, `--count all`, nothing but the radius given.

    python -m benchmarks.photographs [SET ...]

Errors are of the better candidate, picked with the truth. The radius is known to about 0.5 %, so range is
judged by its spread after one scale per set.
"""

from __future__ import annotations

import sys
import time

import numpy as np

import circlepose
from benchmarks.support.scoring import PHOTOGRAPHS, data_folder, error, match, read_radius, read_truth
from circlepose.io.images.reader import read_image


def main(names: list[str]) -> int:
    """Print a row per set."""
    data = data_folder()
    if data is None:
        print("no images with truth here; set CIRCLEPOSE_DATA", file=sys.stderr)
        return 2
    print(
        "| set | found | others | normal deg, median / 95th | position % of range | scale "
        "| range spread %, median / 95th | ms, median | times its decoding, median / most |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    for name in names or PHOTOGRAPHS:
        folder = data / name
        camera = circlepose.read_camera(folder / "camera.yml")
        target = circlepose.Target.circle(read_radius(folder), count=None)
        errors, milliseconds, ratios, true_circles, reported = [], [], [], 0, 0
        for image, truth in read_truth(folder).items():
            begin = time.perf_counter()
            pixels = read_image(folder / "images" / image)
            start = time.perf_counter()
            result = circlepose.estimate(pixels, camera, target, name=image)
            milliseconds.append(1e3 * (time.perf_counter() - start))
            ratios.append(milliseconds[-1] / (1e3 * (start - begin)))
            reported += len(result.circles)
            true_circles += len(truth)
            matches = match(result, truth)
            errors += [error(c, t) for c, t in zip(matches, truth, strict=True) if c is not None]
        normal = [e.normal_deg for e in errors]
        ratio = np.array([e.range_ratio for e in errors])
        scale = np.median(ratio)
        spread = 100.0 * np.abs(ratio / scale - 1.0)
        print(
            f"| {name} | {len(errors)}/{true_circles} | {reported - len(errors)} "
            f"| {np.median(normal):.2f} / {np.percentile(normal, 95):.2f} "
            f"| {100.0 * np.median([e.position_share for e in errors]):.2f} | {scale:.4f} "
            f"| {np.median(spread):.3f} / {np.percentile(spread, 95):.3f} | {np.median(milliseconds):.0f} "
            f"| {np.median(ratios):.1f} / {max(ratios):.1f} |",
            flush=True,
        )
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
