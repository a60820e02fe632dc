"""The two extractions on the same images: what each finds, and how well.

    CIRCLEPOSE_DATA=... python -m benchmarks.extraction

The first five images of each set; errors of the better candidate.
"""

from __future__ import annotations

import sys
import time

import numpy as np

import circlepose
from benchmarks.support.scoring import data_folder, error, match, read_radius, read_truth
from circlepose.detection import EXTRACTIONS
from circlepose.io.images.reader import read_image

PHOTOGRAPHS = ("discocal_rgb_left", "discocal_tir", "boofcv_circle_hex_stills", "opencv_acircles", "rosi_small_dots")
SCENES = {"rendered_cd": 60.0, "rendered_clutter": 25.0}


def main() -> int:
    """Print a row per set and extraction."""
    data = data_folder()
    if data is None:
        print("no images with truth here; set CIRCLEPOSE_DATA", file=sys.stderr)
        return 2
    print("| set | extraction | found | others | position % of range, median | normal deg, median | ms, median |")
    print("|---|---|---|---|---|---|---|")
    for name in (*PHOTOGRAPHS, *SCENES):
        folder = data / name
        camera = circlepose.read_camera(folder / "camera.yml")
        target = circlepose.Target.circle(SCENES.get(name) or read_radius(folder), count=None)
        for extraction in EXTRACTIONS:
            errors, milliseconds, true_circles, reported = [], [], 0, 0
            for image, truth in list(read_truth(folder).items())[:5]:
                pixels = read_image(folder / "images" / image)
                start = time.perf_counter()
                result = circlepose.estimate(pixels, camera, target, extraction=extraction)
                milliseconds.append(1e3 * (time.perf_counter() - start))
                reported += len(result.circles)
                true_circles += len(truth)
                matches = match(result, truth)
                errors += [error(c, t) for c, t in zip(matches, truth, strict=True) if c is not None]
            print(
                f"| {name} | {extraction} | {len(errors)}/{true_circles} | {reported - len(errors)} "
                f"| {100.0 * np.median([e.position_share for e in errors]):.3f} "
                f"| {np.median([e.normal_deg for e in errors]):.3f} | {np.median(milliseconds):.0f} |",
                flush=True,
            )
    return 0


if __name__ == "__main__":
    sys.exit(main())
