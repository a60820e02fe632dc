"""Boards: which disc is which on photographs, and the pose of rendered boards against the bound.

    CIRCLEPOSE_DATA=... python -m benchmarks.boards [--views 40]

Photographs: the layout and the radius are given, and nothing else. A disc of the truth counts as placed where a
circle of the board stands on it whose row and column are the truth's, up to one shift and turn for the whole image;
all discs of the layout being in the image, no other shift would fit. `any camera`: rims, lattice and place with a
camera whose focal length is 28 % too long, without distortion. findCirclesGrid of OpenCV gets the image, the layout
and SimpleBlobDetector with settings that suit the discs; it finds all or none, and is asked where it can be.

Rendered: random views of dark discs on white, 1280 x 960, f = 1000 px, k1 = -0.1, 450 to 700 mm away, blur 0.7 px,
noise 2. `over bound`: rms error over the standard deviation that the noise sets, of position and rotation together.
NEES: of six numbers; 6 where the covariance is right.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Iterator
from dataclasses import dataclass

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import cv2
import numpy as np

import circlepose
from benchmarks.detection import blob_detector
from benchmarks.support.scoring import TrueCircle, data_folder, read_truth
from circlepose._typing import FloatArray, Image
from circlepose.board_result import BoardPose
from circlepose.boards.lattice import lattices
from circlepose.boards.marks import are_rings
from circlepose.boards.placement import Placement, neighbor_radii, place
from circlepose.boards.pose import rotation_of
from circlepose.boards.refinement import rigid
from circlepose.boards.symmetry import symmetries
from circlepose.camera.camera import Camera
from circlepose.geometry.ellipse import Ellipse
from circlepose.imaging.gray import to_grey
from circlepose.io.images.reader import read_image
from circlepose.synthesis.render import render
from circlepose.synthesis.scene import Disc, Paint, Scene
from circlepose.targets.board import BoardCircle, BoardLayout, Grid

CAMERA = Camera.create([[1000.0, 0, 639.5], [0, 1000.0, 479.5], [0, 0, 1]], (-0.1, 0.02, 0.0, 0.0, 0.0), (1280, 960))
_NEAR_PX = 3.0
_BORDER_PX = 50.0


@dataclass(frozen=True)
class Board:
    """The board of a set of photographs, or of some of its images."""

    layout: BoardLayout
    images: str = ""
    """part of the names of its images"""
    opencv: tuple[int, int] | None = None
    """columns and rows for findCirclesGrid"""


def _grid(pattern: str, rows: int, columns: int, spacing: float, radius: float, **others: object) -> BoardLayout:
    return BoardLayout.on_grid(radius, Grid(pattern, rows, columns, spacing), **others)  # type: ignore[arg-type]


_HEXAGONAL = Board(_grid("hexagonal", 25, 14, 12.0, 5.0, omit=[(0, column) for column in range(14)]))
_ROOT = 0.5**0.5
BOARDS = {
    "discocal_rgb_left": [Board(_grid("symmetric", 4, 3, 90.0, 35.0), opencv=(3, 4))],
    "discocal_tir": [Board(_grid("symmetric", 4, 3, 90.0, 30.0), opencv=(3, 4))],
    "opencv_circles_a": [Board(_grid("symmetric", 7, 7, 1.0, 0.2214), opencv=(7, 7))],
    "opencv_circles_c_wide": [Board(_grid("symmetric", 7, 7, 1.0, 0.2156), opencv=(7, 7))],
    "opencv_acircles": [
        Board(_grid("asymmetric", 13, 7, _ROOT, 0.2284), "acircles" + str(number), (7, 13)) for number in (1, 2, 3)
    ]
    + [Board(_grid("asymmetric", 5, 5, _ROOT, 0.2284), "acircles" + str(number), (5, 5)) for number in (4, 5, 6)]
    + [Board(_grid("asymmetric", 9, 3, _ROOT, 0.2284), "acircles" + str(number), (3, 9)) for number in (7, 8, 9)],
    "boofcv_circle_regular_stills": [Board(_grid("symmetric", 10, 8, 25.0, 7.5), opencv=(8, 10))],
    "boofcv_circle_hex_stills": [_HEXAGONAL],
    "boofcv_movie_hex": [_HEXAGONAL],
    "rosi_small_dots": [Board(_grid("symmetric", 10, 10, 25.4, 6.35, marks={(0, 9): (12.7,)}), opencv=(10, 10))],
    "dice_telephoto_donuts": [
        Board(_grid("symmetric", 9, 11, 3.5, 0.7059, marks=dict.fromkeys(((3, 2), (6, 2), (6, 7)), (0.79, 0.28))))
    ],
}
RENDERED = {
    "63 discs": _grid("symmetric", 7, 9, 30.0, 8.0),
    "asymmetric 7 x 5": _grid("asymmetric", 7, 5, 20.0, 6.0),
    "hexagonal 8 x 8": _grid("hexagonal", 8, 8, 20.0, 8.0),
    "four corners": BoardLayout(
        tuple(
            BoardCircle(f"h{i}", (x, y, 0.0), (8.0,))
            for i, (x, y) in enumerate([(0.0, 0.0), (240.0, 0.0), (240.0, 180.0), (0.0, 181.0)])
        )
    ),
    "four neighbors": BoardLayout(
        tuple(
            BoardCircle(f"h{i}", (x, y, 0.0), (8.0,))
            for i, (x, y) in enumerate([(0.0, 0.0), (30.0, 0.0), (30.0, 30.0), (0.0, 31.0)])
        )
    ),
    "two discs": BoardLayout(tuple(BoardCircle(f"h{i}", (240.0 * i, 0.0, 0.0), (8.0 + i,)) for i in range(2))),
}


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--views", type=int, default=40)
    options = parser.parse_args()
    print("\n".join(photographs()))
    print()
    print("\n".join(rendered(options.views)))


def photographs() -> Iterator[str]:
    """Yield the table of the photographs."""
    yield "| set | discs | placed | any camera | posed | rms px, median | findCirclesGrid | ms, median |"
    yield "|---|---|---|---|---|---|---|---|"
    data = data_folder()
    if data is None:
        yield "no images with truth here; set CIRCLEPOSE_DATA"
        return
    for name, boards in BOARDS.items():
        folder = data / name
        camera = circlepose.read_camera(folder / "camera.yml")
        counts, placed, roughly, posed, grids, rms, times = 0, 0, 0, 0, [0, 0], [], []
        truth = read_truth(folder)
        for image_name, circles in truth.items():
            board = next(each for each in boards if each.images in image_name)
            image = read_image(folder / "images" / image_name)
            target = circlepose.Target.board(board.layout)
            start = time.perf_counter()
            result = circlepose.estimate(image, camera, target)
            times.append(1e3 * (time.perf_counter() - start))
            counts += len(circles)
            if result.boards:
                posed += 1
                rms.append(result.boards[0].pose.rms_px)
                index = {circle: i for i, circle in enumerate(board.layout.names)}
                seen = [each for each in result.circles if each.ellipse is not None]
                nodes = board.layout.node_of[[index[each.circle] for each in seen]]
                placed += _agreeing(nodes, np.array([each.ellipse.center for each in seen]), circles)
            roughly += _placed_by_any_camera(image, camera, board.layout, circles)
            if board.opencv is not None:
                grids[0] += _by_opencv(to_grey(image), board)
                grids[1] += 1
        by_opencv = f"{grids[0]} of {grids[1]}" if grids[1] else "--"
        yield (
            f"| {name} | {counts} | {placed / counts:.4f} | {roughly / counts:.4f} | {posed} of {len(truth)} "
            f"| {np.median(rms):.2f} | {by_opencv} | {np.median(times):.0f} |"
        )


def _placed_by_any_camera(image: Image, camera: Camera, layout: BoardLayout, circles: list[TrueCircle]) -> int:
    matrix = camera.camera_matrix.copy()
    matrix[0, 0] *= 1.28
    matrix[1, 1] *= 1.28
    wrong = Camera.create(matrix, (), camera.image_size)
    target = circlepose.Target.circle(layout.usual_radius_mm, count="all")
    result = circlepose.estimate(image, wrong, target, force_calibration=True)
    ellipse = Ellipse.batch([each.ellipse for each in result.circles if each.ellipse is not None])
    assert layout.grid is not None
    patches = lattices(ellipse, neighbor_radii(layout.grid, layout), layout.grid.order)
    if not patches or result.image_size is None:
        return 0
    rings = are_rings(to_grey(image), ellipse, layout)
    found = place(patches[0], ellipse, layout, result.image_size, rings)
    if not isinstance(found, Placement):
        return 0
    return _agreeing(layout.node_of[found.circles], ellipse.center[found.members], circles)


def _agreeing(nodes: FloatArray, places: FloatArray, circles: list[TrueCircle]) -> int:
    """Return how many circles stand where the truth has the same row and column, up to one shift and turn."""
    true = np.array([circle.seen_px for circle in circles])
    rows = np.array([[float(part) for part in circle.name.split("_")] for circle in circles])
    apart = np.linalg.norm(places[:, None] - true, axis=2)
    nearest, near = apart.argmin(axis=1), apart.min(axis=1) < _NEAR_PX
    if np.count_nonzero(near) < 3:
        return 0
    design = np.column_stack([nodes, np.ones(len(nodes))])[near]
    turn = np.round(np.linalg.lstsq(design, rows[nearest[near]], rcond=None)[0])
    return int(np.count_nonzero(np.abs(design @ turn - rows[nearest[near]]).max(axis=1) < 0.1))


def _by_opencv(gray: Image, board: Board) -> bool:
    assert board.opencv is not None
    assert board.layout.grid is not None
    kind = cv2.CALIB_CB_ASYMMETRIC_GRID if board.layout.grid.pattern == "asymmetric" else cv2.CALIB_CB_SYMMETRIC_GRID
    for more in (0, cv2.CALIB_CB_CLUSTERING):
        try:
            if cv2.findCirclesGrid(gray, board.opencv, flags=kind | more, blobDetector=blob_detector(0))[0]:
                return True
        except cv2.error:
            continue
    return False


def rendered(views: int) -> Iterator[str]:
    """Yield the table of the rendered boards."""
    yield "| board | views | posed | rotation deg, rms | position mm, rms | over bound | NEES | ms, median |"
    yield "|---|---|---|---|---|---|---|---|"
    for name, layout in RENDERED.items():
        degrees, millimeters, ratios, squares, times = [], [], [], [], []
        for view in range(views):
            image, rotation, translation = _view(layout, view)
            start = time.perf_counter()
            result = circlepose.estimate(image, CAMERA, circlepose.Target.board(layout))
            times.append(1e3 * (time.perf_counter() - start))
            if result.boards:
                pose = result.boards[0].pose
                error = _error(pose, rotation, translation, layout)
                degrees.append(np.degrees(np.linalg.norm(error[3:])))
                millimeters.append(np.linalg.norm(error[:3]))
                squares.append(error @ np.linalg.solve(pose.covariance, error))
                sigma = np.diagonal(pose.covariance)
                ratios.append([error[:3] @ error[:3] / sigma[:3].sum(), error[3:] @ error[3:] / sigma[3:].sum()])
        ratio = np.sqrt(np.mean(ratios))
        yield (
            f"| {name} | {views} | {len(squares)} | {np.sqrt(np.mean(np.square(degrees))):.4f} "
            f"| {np.sqrt(np.mean(np.square(millimeters))):.4f} | {ratio:.2f} | {np.mean(squares):.2f} "
            f"| {np.median(times):.0f} |"
        )


def _view(layout: BoardLayout, view: int) -> tuple[Image, FloatArray, FloatArray]:
    generator = np.random.Generator(np.random.PCG64([22, view]))
    middle = layout.centers_mm.mean(axis=0)
    while True:
        tilt, azimuth = np.radians(generator.uniform(5.0, 55.0)), generator.uniform(0.0, 2.0 * np.pi)
        axis = tilt * np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        rotation = rotation_of(axis) @ rotation_of(np.array([0.0, 0.0, generator.uniform(-0.5, 0.5)]))
        center = generator.uniform([-60.0, -40.0, 450.0], [60.0, 40.0, 700.0])
        translation = center - rotation @ middle
        places = layout.centers_mm @ rotation.T + translation
        pixels = CAMERA.project(places)
        size = np.array(CAMERA.image_size)
        if np.all((pixels > _BORDER_PX) & (pixels < size - 1.0 - _BORDER_PX)):
            break
    normal = tuple(-rotation[:, 2])
    discs = tuple(
        Disc(tuple(place), normal, float(radius), Paint(40.0))
        for place, radius in zip(places, layout.radius_mm, strict=True)
    )
    scene = Scene(CAMERA, discs, Paint(200.0), blur_px=0.7, noise_levels=2.0, noise_seed=view)
    return render(scene), rotation, translation


def _error(pose: BoardPose, rotation: FloatArray, translation: FloatArray, layout: BoardLayout) -> FloatArray:
    """Return (6,) the translation and the rotation vector from a pose to the true one, of the nearest roll."""
    errors = []
    for permutation in symmetries(layout):
        turn = rigid(layout.centers_mm[permutation], layout.centers_mm)
        vector = cv2.Rodrigues(rotation @ turn.rotation @ pose.rotation.T)[0][:, 0]
        errors.append(np.concatenate([rotation @ turn.translation + translation - pose.translation, vector]))
    return min(errors, key=lambda error: float(np.linalg.norm(error[3:])))


if __name__ == "__main__":
    main()
