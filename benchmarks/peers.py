"""What else finds a circle's pose, on the same images: the rendered discs `lo` of `accuracy.py`.

    python benchmarks/peers.py [--views 100] [--contrib-python PYTHON] [--pye3d-python PYTHON]

Peers that only find an ellipse get our cone and solver. Each comes out as well as it can: of several ellipses that
nearest to the true rim counts, and of two candidates the better one.

- scikit-image `find_contours`, at the true level midway between dark and light; of this environment (extra `bench`).
- OpenCV contrib `EdgeDrawing.detectEllipses`; its package replaces the one we use, so it is run by the interpreter of
  another environment, as `--contrib-python`.
- pye3d `unproject_ellipse`, from the ellipse of scikit-image's contour; also in an environment of its own.

A peer that is not there is left out, with a sentence.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import subprocess
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

import circlepose
from accuracy import SEED
from circlepose._typing import FloatArray, Image
from circlepose.camera import circle_contour
from circlepose.conic import Ellipse
from circlepose.fitting.direct import fit_ellipse
from circlepose.fitting.viewing_cone import factor_from_ellipse, fit_cone
from circlepose.solvers.solve import solve
from circlepose.synthesis.disc_sets import RADIUS_MM, disc_views
from circlepose.synthesis.render import render
from circlepose.synthesis.scene import Disc, Scene

MIDWAY = 120.0
Poses = Sequence[tuple[FloatArray, FloatArray]]
"""candidates: centre (3,) mm and normal (3,)"""


def longest_contour(image: Image) -> FloatArray | None:
    """Return scikit-image's longest contour (n, 2) px."""
    from skimage.measure import find_contours  # noqa: PLC0415 (optional)

    contours = find_contours(image.astype(np.float64), MIDWAY)
    return np.asarray(max(contours, key=len)[:, ::-1]) if contours else None


def poses_of_factor(factor: FloatArray | None) -> Poses:
    """Return the candidates of a viewing cone."""
    if factor is None:
        return ()
    solutions = solve("chen-huang", factor, np.zeros((0, 3)), RADIUS_MM)
    return () if isinstance(solutions, str) else list(zip(solutions.centers, solutions.normals, strict=True))


def by_contour(image: Image, scene: Scene) -> Poses:
    """scikit-image's contour and our cone."""
    points = longest_contour(image)
    fit = None if points is None else fit_cone(scene.camera, points)
    return poses_of_factor(None if fit is None else fit.factor)


def by_us(image: Image, scene: Scene) -> Poses:
    """Our estimate."""
    result = circlepose.estimate(image, scene.camera, circlepose.Target.circle(RADIUS_MM))
    return [(c.center, c.normal) for circle in result.circles for c in circle.candidates]


def elsewhere(python: str, what: str, folder: Path) -> list[list[list[float]]]:
    """Run `peers_elsewhere.py` by another interpreter on what lies in `folder`; a list per image."""
    script = Path(__file__).with_name("peers_elsewhere.py")
    done = subprocess.run([python, script, what, folder], capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def nearest_ellipse(found: Sequence[Sequence[float]], scene: Scene) -> Ellipse | None:
    """Return that of the ellipses (centre, semi-axes, angle) which is nearest to the true rim."""
    disc = scene.targets[0]
    assert isinstance(disc, Disc)
    true = fit_ellipse(circle_contour(scene.camera, disc.center_mm, disc.normal, disc.radius_mm))
    assert true is not None

    def off(ellipse: Ellipse) -> float:
        return float(
            np.linalg.norm(ellipse.center - true.center)
            + abs(ellipse.semi_major - true.semi_major)
            + abs(ellipse.semi_minor - true.semi_minor)
        )

    ellipses = [Ellipse.from_axes(e[:2], e[2:4], e[4]) for e in found if min(e[2:4]) > 0.0]
    return min(ellipses, key=off, default=None)


def row(label: str, scenes: Sequence[Scene], poses: Sequence[Poses], milliseconds: Sequence[float]) -> str:
    """Return a row of the table."""
    position, normal = [], []
    for scene, candidates in zip(scenes, poses, strict=True):
        disc = scene.targets[0]
        assert isinstance(disc, Disc)
        # Some normals point away from the camera.
        turned = [(center, n if n @ center < 0.0 else -n) for center, n in candidates]
        if not turned:
            continue
        center, n = max(turned, key=lambda pose: float(pose[1] @ disc.normal))
        position.append(np.linalg.norm(center - disc.center_mm))
        normal.append(np.degrees(2.0 * np.arcsin(min(1.0, float(np.linalg.norm(n - disc.normal)) / 2.0))))
    p, q = (np.percentile(errors, [50, 95]) if errors else (np.nan, np.nan) for errors in (position, normal))
    taken = f"{np.median(milliseconds):.0f}" if len(milliseconds) else ""
    return (
        f"| {label} | {len(position)}/{len(scenes)} | {p[0]:.3f} / {p[1]:.3f} | {q[0]:.4f} / {q[1]:.3f} | {taken} |"
    )


def main() -> None:
    """Print a row per peer that is there."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--views", type=int, default=100)
    parser.add_argument("--contrib-python", help="interpreter of an environment with opencv-contrib-python-headless")
    parser.add_argument("--pye3d-python", help="interpreter of an environment with pye3d")
    options = parser.parse_args()
    scenes = list(disc_views("lo", options.views, SEED))
    images = [render(scene) for scene in scenes]
    print("| way | found | position mm, median / 95th | normal deg, median / 95th | ms, median |")
    print("|---|---|---|---|---|")
    here: dict[str, Callable[[Image, Scene], Poses]] = {"circlepose": by_us}
    has_contours = importlib.util.find_spec("skimage") is not None
    missing = []
    if has_contours:
        here["scikit-image find_contours, our cone"] = by_contour
    else:
        missing.append("scikit-image is not installed (extra `bench`): its contours, and pye3d, are left out.")
    for label, way in here.items():
        poses, milliseconds = [], []
        for scene, image in zip(scenes, images, strict=True):
            start = time.perf_counter()
            poses.append(way(image, scene))
            milliseconds.append(1e3 * (time.perf_counter() - start))
        print(row(label, scenes, poses, milliseconds), flush=True)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if options.contrib_python:
            for i, image in enumerate(images):
                np.save(folder / f"{i:04d}.npy", image)
            answers = elsewhere(options.contrib_python, "edge-drawing", folder)
            poses = []
            for found, scene in zip(answers, scenes, strict=True):
                nearest = nearest_ellipse([e[1:] for e in found], scene)
                poses.append(poses_of_factor(None if nearest is None else factor_from_ellipse(scene.camera, nearest)))
            label = "OpenCV contrib EdgeDrawing, our cone"
            print(row(label, scenes, poses, [found[0][0] for found in answers if found]), flush=True)
        else:
            missing.append("--contrib-python is not given: EdgeDrawing is left out.")
        if options.pye3d_python and has_contours:
            for path in folder.glob("*.npy"):
                path.unlink()
            for i, (scene, image) in enumerate(zip(scenes, images, strict=True)):
                points = longest_contour(image)
                ellipse = None if points is None else fit_ellipse(points)
                if ellipse is not None:
                    # It takes the principal point to be the origin.
                    x, y = ellipse.center - scene.camera.camera_matrix[:2, 2]
                    focal = scene.camera.camera_matrix[0, 0]
                    seen = [x, y, ellipse.semi_minor, ellipse.semi_major, ellipse.angle, focal, RADIUS_MM]
                    np.save(folder / f"{i:04d}.npy", np.array(seen))
            answers = elsewhere(options.pye3d_python, "pye3d", folder)
            poses = [[(np.array(c[1:4]), np.array(c[4:])) for c in found] for found in answers]
            label = "scikit-image find_contours, pye3d unproject_ellipse"
            print(row(label, scenes, poses, []), flush=True)
        elif not options.pye3d_python:
            missing.append("--pye3d-python is not given: pye3d is left out.")
    for sentence in missing:
        print(sentence)


if __name__ == "__main__":
    main()
