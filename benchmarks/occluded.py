"""The view with an outlier (an object touches the rim): the whole contour fitted, and the arcs of one ellipse only.

    python -m benchmarks.occluded

The sample cd/c, whose disc is touched by a bar of its own brightness. `whole contour` is what a plain pipeline does:
the border of the merged region goes into a direct ellipse fit and an exact solver.
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

import circlepose
from benchmarks.support.scoring import TrueCircle, error
from circlepose.io.images.reader import read_image

SAMPLE = Path(__file__).resolve().parents[1] / "sample_images" / "cd"
CENTER, NORMAL = np.array([-14.86, 31.54, 902.38]), np.array([0.0, -0.97, -0.24])


def main() -> None:
    """Print a row per way to use the contour."""
    camera = circlepose.read_camera(SAMPLE / "camera.yml")
    target = circlepose.read_target(SAMPLE / "target.yaml")
    image = read_image(SAMPLE / "c.png")
    truth = TrueCircle(CENTER, NORMAL / np.linalg.norm(NORMAL), None, None, "disc")
    _, region = cv2.threshold(cv2.GaussianBlur(image, (0, 0), 1.0), 0, 255, cv2.THRESH_OTSU)
    borders, _ = cv2.findContours(region, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    merged = max(borders, key=len)[:, 0, :].astype(np.float64)
    ways = {
        "whole contour": circlepose.estimate_from_contour(merged, camera, 60.0),
        "whole contour, four points (chen-huang-contour)": circlepose.estimate_from_contour(
            merged, camera, 60.0, method="chen-huang-contour"
        ),
        "circlepose estimate": circlepose.estimate(image, camera, target).circles[0],
    }
    print("| way | position error mm | normal error deg | residual px | rim used | flags |")
    print("|---|---|---|---|---|---|")
    for name, circle in ways.items():
        if not circle.candidates:
            print(f"| {name} | | | | | {circle.status}: {circle.reason} |")
            continue
        measured = error(circle, truth)
        print(
            f"| {name} | {measured.position_mm:.3f} | {measured.normal_deg:.3f} | {circle.residual_px:.2f} "
            f"| {circle.rim_used:.2f} | {', '.join(circle.flags)} |"
        )


if __name__ == "__main__":
    main()
