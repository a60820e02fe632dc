"""Photographed boards, `same_plane: yes`: how often the right candidate of each disc is chosen, and how surely.

    CIRCLEPOSE_DATA=... python -m benchmarks.common_plane [SET ...]

Counted are the discs of the truth that are found, of which the candidates differ by more than 2 deg, the error of
the truth. *alone*: as each disc is listed without the hint, the candidate that faces the camera more first.
"""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np

import circlepose
from benchmarks.support.scoring import data_folder, error, match, read_radius, read_truth
from circlepose._numerics import angle_between
from circlepose.io.images.reader import read_image

SETS = ("discocal_rgb_left", "discocal_tir", "opencv_circles_a", "boofcv_circle_hex_stills")
ALIKE_DEG = 2.0


def main(names: list[str]) -> int:
    """Print a row per set."""
    data = data_folder()
    if data is None:
        print("no images with truth here; set CIRCLEPOSE_DATA", file=sys.stderr)
        return 2
    print("| set | discs | apart deg, median | right alone | right | wrong, expected | ambiguity, worst of right |")
    print("|---|---|---|---|---|---|---|")
    for name in names or SETS:
        folder = data / name
        camera = circlepose.read_camera(folder / "camera.yml")
        alone = circlepose.Target.circle(read_radius(folder), count=None)
        apart, right, told, facing = [], [], [], []
        for image, truth in read_truth(folder).items():
            pixels = read_image(folder / "images" / image)
            result = circlepose.estimate(pixels, camera, replace(alone, same_plane=True), name=image)
            for circle, true in zip(match(result, truth), truth, strict=True):
                if circle is None or len(circle.candidates) < 2:
                    continue
                first, second = circle.candidates
                angle = float(np.degrees(angle_between(first.normal, second.normal)))
                if angle < ALIKE_DEG:
                    continue
                apart.append(angle)
                right.append(error(circle, true).chosen)
                told.append(circle.ambiguity)
                facing.append(right[-1] == (first.normal[2] < second.normal[2]))
        print(
            f"| {name} | {len(right)} | {np.median(apart):.0f} | {sum(facing)} | {sum(right)} | {sum(told):.1f} "
            f"| {max(t for t, r in zip(told, right, strict=True) if r):.2g} |",
            flush=True,
        )
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
