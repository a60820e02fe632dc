"""Rendered discs with exact truth: errors of the better candidate.

    python benchmarks/discs.py [--method METHOD] [--no-refine]

A black disc of radius 60 mm on white (grey 40 on 200), blur 0.7 px, noise 2 grey levels, 400 to 1500 mm away,
tilted 0 to 75 deg. `lo`: 1280 x 960, f = 1200 px, 100 images; `hi`: 2456 x 2058, f = 3480 px, 30 images;
`lo k1`: as lo, with k1 = -0.3.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

import circlepose
from circlepose.synthesis.disc_sets import RADIUS_MM, disc_views
from circlepose.synthesis.render import render
from scoring import Error, TrueCircle, error

SETS = {"lo": ("lo", 100, ()), "hi": ("hi", 30, ()), "lo k1=-0.3": ("lo", 100, (-0.3, 0.1, 0.0, 0.0))}
SEED = 1999


def measure(label: str, method: str = "chen-huang", refine: bool = True) -> tuple[list[Error], int, list[float]]:
    """Return the errors of a set's discs, how many were not found, and the times (ms) without rendering."""
    size, number, dist_coeffs = SETS[label]
    target = circlepose.Target.circle(RADIUS_MM)
    errors, missed, milliseconds = [], 0, []
    for scene in disc_views(size, number, SEED, dist_coeffs):
        image = render(scene)
        disc = scene.targets[0]
        start = time.perf_counter()
        result = circlepose.estimate(image, scene.camera, target, method=method, refine=refine)
        milliseconds.append(1e3 * (time.perf_counter() - start))
        if result.circles and result.circles[0].candidates:
            errors.append(error(result.circles[0], TrueCircle(disc.center_mm, disc.normal, None, None, "disc")))
        else:
            missed += 1
    return errors, missed, milliseconds


def main() -> None:
    """Print a row per set."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--method", default="chen-huang")
    parser.add_argument("--no-refine", action="store_true")
    options = parser.parse_args()
    print("| set | found | position mm, median / 95th | normal deg, median / 95th | ms, median |")
    print("|---|---|---|---|---|")
    for label in SETS:
        errors, missed, milliseconds = measure(label, options.method, not options.no_refine)
        position = np.percentile([e.position_mm for e in errors], [50, 95])
        normal = np.percentile([e.normal_deg for e in errors], [50, 95])
        print(
            f"| {label} | {len(errors)}/{len(errors) + missed} | {position[0]:.3f} / {position[1]:.3f} "
            f"| {normal[0]:.4f} / {normal[1]:.4f} | {np.median(milliseconds):.0f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
