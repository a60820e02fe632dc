"""What else finds a circle's pose, on the same images: the rendered discs `lo` of `accuracy.py`.

    python -m benchmarks.peers [--views 100] [--boards 20]

Each package is put into a virtual environment of its own (`environments.py`), which needs pip and a way to an index;
one that cannot be installed is left out, with a sentence. Those that only find an ellipse get our cone and solver.
Each comes out as well as it can: of several ellipses that nearest to the true rim counts, and of two candidates the
better one.

- scikit-image `find_contours`, at the true level midway between dark and light.
- OpenCV contrib `EdgeDrawing.detectEllipses`.
- pye3d `unproject_ellipse`, from the ellipse of scikit-image's contour.
- ringgrid `detect_adaptive`, which looks for rings: on the discs, with the true diameter given, and on boards of
  4 x 3 rings without code, the layout given, beside ours on the same boards.
- napa-vision, which reads tags: a 36h11 tag as wide as the disc, in the disc's pose, turned in its plane at random;
  only where all of the tag is in the image. The row before it is ours on the discs of these views.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import groupby
from typing import TypeVar

import numpy as np

import circlepose
from benchmarks.accuracy import SEED
from benchmarks.support.environments import (
    EDGE_DRAWING,
    NAPA_VISION,
    PYE3D,
    RINGGRID,
    SCIKIT_IMAGE,
    NotInstalledError,
    Rows,
    answers,
    environment,
)
from circlepose._numerics import angle_between
from circlepose._typing import FloatArray, Image
from circlepose.camera.camera import Camera, circle_contour
from circlepose.fitting.cone_fit import fit_cone
from circlepose.fitting.cone_projection import factor_from_ellipse
from circlepose.fitting.direct import fit_ellipse
from circlepose.geometry.cone import plane_basis
from circlepose.geometry.ellipse import Ellipse
from circlepose.results import Failure
from circlepose.solvers.registry import solve
from circlepose.synthesis.disc_sets import RADIUS_MM, disc_views
from circlepose.synthesis.render import render
from circlepose.synthesis.scene import Box, Circle, Disc, Paint, Patch, Plane, Rings, Scene

MIDWAY = 120.0
DARK, LIGHT = Paint(40.0), Paint(200.0)
PITCH_MM, ROWS, COLUMNS, OUTER_MM, INNER_MM = 60.0, 4, 3, 20.0, 10.0
"""of the board of rings"""
QUIET = 1.25
"""side of the tag with its white border, over its own"""
Poses = Sequence[tuple[FloatArray, FloatArray]]
"""candidates: centre (3,) mm and normal (3,)"""
Answer = TypeVar("Answer")


def disc_of(scene: Scene) -> Disc:
    """Return the disc of a scene of `lo`."""
    disc = scene.targets[0]
    assert isinstance(disc, Disc)
    return disc


def poses_of_factor(factor: FloatArray | None, radius_mm: float) -> Poses:
    """Return the candidates of a viewing cone."""
    if factor is None:
        return ()
    solutions = solve("chen-huang", factor, np.zeros((0, 3)), radius_mm)
    return () if isinstance(solutions, Failure) else list(zip(solutions.centers, solutions.normals, strict=True))


def poses_of_ellipse(camera: Camera, ellipse: Ellipse | None, radius_mm: float) -> Poses:
    """Return the candidates of an image ellipse."""
    return () if ellipse is None else poses_of_factor(factor_from_ellipse(camera, ellipse), radius_mm)


def poses_of_contour(camera: Camera, points: FloatArray) -> Poses:
    """Return the candidates of a contour (n, 2) px of a disc of `lo`."""
    fit = fit_cone(camera, points) if len(points) else None
    return poses_of_factor(None if fit is None else fit.factor, RADIUS_MM)


def seen_by_pye3d(camera: Camera, points: FloatArray) -> FloatArray:
    """Return a contour's ellipse as `elsewhere.py` hands it to pye3d."""
    ellipse = fit_ellipse(points)
    assert ellipse is not None
    # It takes the principal point to be the origin.
    x, y = ellipse.center - camera.camera_matrix[:2, 2]
    focal = camera.camera_matrix[0, 0]
    return np.array([x, y, ellipse.semi_minor, ellipse.semi_major, ellipse.angle, focal, RADIUS_MM])


def true_ellipse(camera: Camera, circle: Circle) -> Ellipse:
    """Return the image of a circle."""
    ellipse = fit_ellipse(circle_contour(camera, circle.center, circle.normal, circle.radius))
    assert ellipse is not None
    return ellipse


def distance(ellipse: Ellipse, true: Ellipse) -> float:
    """Return how far two ellipses are apart, px."""
    return float(
        np.linalg.norm(ellipse.center - true.center)
        + abs(ellipse.semi_major - true.semi_major)
        + abs(ellipse.semi_minor - true.semi_minor)
    )


def nearest_ellipse(found: Sequence[Sequence[float]], true: Ellipse) -> Ellipse | None:
    """Return that of the ellipses (centre, semi-axes, angle) that is nearest; a ring's other rim is not it."""
    ellipses = [Ellipse.from_axes(e[:2], e[2:4], e[4]) for e in found if min(e[2:4]) > 0.0]
    best = min(ellipses, key=lambda ellipse: distance(ellipse, true), default=None)
    return best if best is not None and is_same(distance(best, true), true) else None


def is_same(off: float, true: Ellipse) -> bool:
    """Whether an ellipse so far off is still that rim, rather than another one or clutter."""
    return off < 0.5 * float(true.semi_major)


def ours(image: Image, scene: Scene) -> Poses:
    """Our estimate of a lone disc."""
    result = circlepose.estimate(image, scene.camera, circlepose.Target.circle(RADIUS_MM))
    return [(c.center, c.normal) for circle in result.circles for c in circle.candidates]


def ours_on_board(image: Image, scene: Scene) -> list[Poses]:
    """Our estimates of a board's outer rims, in the order of the rings."""
    result = circlepose.estimate(image, scene.camera, circlepose.Target.circle(OUTER_MM, count=None))
    poses: list[Poses] = []
    for ring in scene.targets:
        true = true_ellipse(scene.camera, ring.circles[0])
        near = [(distance(c.ellipse, true), c.candidates) for c in result.circles if c.ellipse is not None]
        off, candidates = min(near, key=lambda each: each[0], default=(np.inf, ()))
        poses.append([(c.center, c.normal) for c in candidates] if is_same(off, true) else ())
    return poses


def board_views(number: int) -> list[Scene]:
    """Return views of a board of dark rings on white, 24 to 48 px across, tilted up to 60 deg."""
    camera = next(disc_views("lo", 1, SEED)).camera
    columns, rows = np.arange(COLUMNS) - (COLUMNS - 1) / 2.0, np.arange(ROWS) - (ROWS - 1) / 2.0
    scenes = []
    for view in range(number):
        generator = np.random.Generator(np.random.PCG64([SEED, view]))
        tilt, azimuth = np.radians(60.0) * generator.random(), 2.0 * np.pi * generator.random()
        ray = np.array([*(0.1 * (generator.random(2) - 0.5)), 1.0])
        first, second = plane_basis(ray / np.linalg.norm(ray))
        normal = -np.cos(tilt) * ray + np.sin(tilt) * (np.cos(azimuth) * first + np.sin(azimuth) * second)
        plane = Plane.create((1000.0 + 1000.0 * generator.random()) * ray, normal)
        centers = [plane.point((PITCH_MM * x, PITCH_MM * y)) for y in rows for x in columns]
        rings = tuple(Rings(center, plane.normal, (OUTER_MM, INNER_MM), (DARK, LIGHT)) for center in centers)
        scenes.append(
            Scene(
                camera, rings, LIGHT, noise_levels=2.0, noise_seed=int(generator.random() * 2.0**32), name=f"{view}"
            )
        )
    return scenes


def tag_view(scene: Scene, cells: FloatArray) -> Scene | None:
    """Return the view with a tag instead of its disc, or None where the image does not hold it."""
    disc = disc_of(scene)
    turn = 2.0 * np.pi * np.random.Generator(np.random.PCG64([SEED, scene.noise_seed])).random()
    first, second = plane_basis(disc.normal)
    plane = Plane.create(disc.center_mm, disc.normal, np.cos(turn) * first + np.sin(turn) * second)
    half = QUIET * RADIUS_MM
    corners = [plane.point((x, y)) for x in (-half, half) for y in (-half, half)]
    seen = scene.camera.project(np.array(corners))
    if not np.all((seen >= 0.0) & (seen <= np.array(scene.image_size) - 1.0)):
        return None
    boxes = [Box((2.0 * RADIUS_MM, 2.0 * RADIUS_MM)), *white_boxes(cells)]
    paints = [DARK, *[LIGHT] * (len(boxes) - 1)]
    shapes = tuple(Patch(box, paint, plane) for box, paint in zip(boxes, paints, strict=True))
    return replace(scene, targets=(), shapes=shapes)


def white_boxes(cells: FloatArray) -> list[Box]:
    """Return the white parts of a tag: runs of cells along the rows and along the columns.

    Where two of the ones meet, one of the others covers the seam.
    """
    side, middle = 2.0 * RADIUS_MM / len(cells), len(cells) / 2.0
    boxes = []
    for across, first, length in runs(cells):
        boxes.append(
            Box((length * side, side), ((first + length / 2.0 - middle) * side, (across + 0.5 - middle) * side))
        )
    for column, first, length in runs(cells.T):
        boxes.append(
            Box((side, length * side), ((column + 0.5 - middle) * side, (first + length / 2.0 - middle) * side))
        )
    return boxes


def runs(cells: FloatArray) -> list[tuple[int, int, int]]:
    """Return the runs of ones in the rows: row, first column, length."""
    found = []
    for row, values in enumerate(cells):
        start = 0
        for value, group in groupby(values):
            length = len(list(group))
            if value:
                found.append((row, start, length))
            start += length
    return found


def row(label: str, truth: Sequence[Circle], poses: Sequence[Poses], milliseconds: Sequence[float]) -> str:
    """Return a row of the table."""
    position, normal = [], []
    for circle, candidates in zip(truth, poses, strict=True):
        # Some normals point away from the camera.
        turned = [(center, n if n @ center < 0.0 else -n) for center, n in candidates]
        if not turned:
            continue
        center, n = max(turned, key=lambda pose: float(pose[1] @ circle.normal))
        position.append(np.linalg.norm(center - circle.center))
        normal.append(np.degrees(angle_between(n, circle.normal)))
    p, q = (np.percentile(errors, [50, 95]) if errors else (np.nan, np.nan) for errors in (position, normal))
    taken = f"{np.median(milliseconds):.1f}" if len(milliseconds) else ""
    return f"| {label} | {len(position)}/{len(truth)} | {p[0]:.3f} / {p[1]:.3f} | {q[0]:.4f} / {q[1]:.3f} | {taken} |"


def timed(
    way: Callable[[Image, Scene], Answer], images: Sequence[Image], scenes: Sequence[Scene]
) -> tuple[list[Answer], list[float]]:
    """Return what a way of ours answers, and its times in ms."""
    found, milliseconds = [], []
    for image, scene in zip(images, scenes, strict=True):
        start = time.perf_counter()
        found.append(way(image, scene))
        milliseconds.append(1e3 * (time.perf_counter() - start))
    return found, milliseconds


def times(rows: Rows) -> list[float]:
    """Return the times of the images on which something was found, ms."""
    return [found[0][0] for found in rows if found]


def on_discs(views: int) -> None:
    """Print the rows of the discs `lo`."""
    scenes = list(disc_views("lo", views, SEED))
    images = [render(scene) for scene in scenes]
    circles = [disc_of(scene).circles[0] for scene in scenes]
    ellipses = [true_ellipse(scene.camera, circle) for scene, circle in zip(scenes, circles, strict=True)]
    camera = scenes[0].camera
    poses, taken = timed(ours, images, scenes)
    print(row("discs: circlepose", circles, poses, taken), flush=True)

    def contours() -> None:
        with environment(SCIKIT_IMAGE) as python:
            found = answers(python, "contour", images, {"level": MIDWAY})
        points = [np.array(rows)[:, 1:] if rows else np.empty((0, 2)) for rows in found]
        label = "discs: scikit-image find_contours, our cone"
        print(row(label, circles, [poses_of_contour(camera, p) for p in points], times(found)), flush=True)
        with environment(PYE3D) as python:
            seen = [seen_by_pye3d(camera, p) for p in points]
            found = answers(python, "pye3d", seen)
        unprojected = [[(np.array(c[1:4]), np.array(c[4:])) for c in rows] for rows in found]
        print(row("discs: scikit-image find_contours, pye3d unproject_ellipse", circles, unprojected, []), flush=True)

    def with_cone(label: str, requirement: str, way: str, options: Mapping[str, object]) -> None:
        with environment(requirement) as python:
            found = answers(python, way, images, options)
        nearest = [nearest_ellipse([e[1:] for e in rows], true) for rows, true in zip(found, ellipses, strict=True)]
        poses = [poses_of_ellipse(camera, ellipse, RADIUS_MM) for ellipse in nearest]
        print(row(label, circles, poses, times(found)), flush=True)

    attempt(contours)
    label = "discs: OpenCV contrib EdgeDrawing, our cone"
    attempt(lambda: with_cone(label, EDGE_DRAWING, "edge-drawing", {}))
    told = {"diameters": [2.0 * float(true.semi_major) for true in ellipses]}
    label = "discs: ringgrid, our cone"
    attempt(lambda: with_cone(label, RINGGRID, "ringgrid", told))


def on_boards(number: int) -> None:
    """Print the rows of the boards of rings."""
    scenes = board_views(number)
    images = [render(scene) for scene in scenes]
    circles = [ring.circles[0] for scene in scenes for ring in scene.targets]
    found, taken = timed(ours_on_board, images, scenes)
    print(row("rings: circlepose", circles, [p for poses in found for p in poses], taken), flush=True)
    with environment(RINGGRID) as python:
        grid = {"grid": [PITCH_MM, ROWS, COLUMNS, OUTER_MM, INNER_MM]}
        seen = answers(python, "ringgrid", images, grid)
    poses = []
    for scene, rows in zip(scenes, seen, strict=True):
        for ring in scene.targets:
            nearest = nearest_ellipse([e[1:] for e in rows], true_ellipse(scene.camera, ring.circles[0]))
            poses.append(poses_of_ellipse(scene.camera, nearest, OUTER_MM))
    print(row("rings: ringgrid, our cone", circles, poses, times(seen)), flush=True)


def on_tags(views: int) -> None:
    """Print the rows of the tags, and of the discs in the same poses."""
    scenes = list(disc_views("lo", views, SEED))
    with environment(NAPA_VISION) as python:
        (drawn,) = answers(python, "napa-cells", [np.zeros(1)])
        cells = np.array(drawn)[:, 1:]
        pairs = [(scene, tag) for scene in scenes if (tag := tag_view(scene, cells)) is not None]
        circles = [disc_of(scene).circles[0] for scene, _ in pairs]
        poses, taken = timed(ours, [render(scene) for scene, _ in pairs], [scene for scene, _ in pairs])
        print(row("tags' poses: circlepose, discs", circles, poses, taken), flush=True)
        told = {"camera_matrix": scenes[0].camera.camera_matrix.tolist(), "size": 2.0 * RADIUS_MM}
        found = answers(python, "napa-poses", [render(tag) for _, tag in pairs], told)
    poses = [[(np.array(c[1:4]), np.array(c[4:])) for c in rows] for rows in found]
    print(row("tags' poses: napa-vision, tags", circles, poses, times(found)), flush=True)


def attempt(part: Callable[[], None]) -> None:
    """Do a part of the benchmark, or say which package it lacks."""
    try:
        part()
    except NotInstalledError as error:
        print(error, file=sys.stderr)


def main() -> None:
    """Print a row per way."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--views", type=int, default=100)
    parser.add_argument("--boards", type=int, default=20)
    options = parser.parse_args()
    print("| way | found | position mm, median / 95th | normal deg, median / 95th | ms, median |")
    print("|---|---|---|---|---|")
    on_discs(options.views)
    attempt(lambda: on_boards(options.boards))
    attempt(lambda: on_tags(options.views))


if __name__ == "__main__":
    main()
