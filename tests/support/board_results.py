"""Small pictures of boards with their truth, and results of boards made by hand."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from circlepose._typing import FloatArray, Image
from circlepose.board_result import BoardCircleFit, BoardPose, BoardResult, BoardTerms
from circlepose.results import Candidate, CircleResult, CovarianceTerms, Flag, ImageResult
from tests.support.discs import CAMERA, CAMERA_YAML, RADIUS_MM, discs_image

ROWS, COLUMNS, SPACING_MM = 3, 4, 60.0
BOARD_YAML = (
    f"kind: board\nradius_mm: {RADIUS_MM:g}\n"
    f"grid: {{pattern: symmetric, rows: {ROWS}, columns: {COLUMNS}, spacing_mm: {SPACING_MM:g}}}\n"
)
TABLE_HEADER = [
    "image",
    "#",
    "x",
    "mm",
    "y",
    "mm",
    "z",
    "mm",
    "qw",
    "qx",
    "qy",
    "qz",
    "±",
    "mm",
    "±",
    "deg",
    "circles",
    "rms",
    "px",
    "ambiguity",
    "remarks",
]
"""Of a table of boards on a wide terminal."""
ROTATION = cv2.Rodrigues(np.array([0.4, -0.3, 0.1]))[0]
TRANSLATION = np.array([-80.0, -60.0, 600.0])
POINTS_MM = np.array([[c * SPACING_MM, r * SPACING_MM, 0.0] for r in range(ROWS) for c in range(COLUMNS)])


def board_image() -> Image:
    """A board of dark discs on white, seen from its front."""
    return discs_image(POINTS_MM @ ROTATION.T + TRANSLATION, -ROTATION[:, 2], CAMERA)


def board_folder(folder: Path, images: int = 2) -> Path:
    """A folder that `circlepose estimate` can measure without an option."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "camera.yaml").write_text(CAMERA_YAML)
    (folder / "target.yaml").write_text(BOARD_YAML)
    for number in range(images):
        cv2.imwrite(str(folder / f"board{number}.png"), board_image())
    return folder


def made_board(
    instance: int = 0, flags: Sequence[Flag] = (Flag.ROLL_AMBIGUOUS,), candidates: int = 2, growth: float = 0.0
) -> BoardResult:
    """A board with numbers of no other meaning."""
    poses = []
    for number in range(candidates):
        root = np.random.default_rng(7 * instance + number).normal(size=(6, 6)) * np.repeat(
            [[0.1], [1e-3]], 3, axis=0
        )
        terms = BoardTerms(root @ root.T, 0.1 * np.eye(6), None)
        turn = cv2.Rodrigues(np.array([0.4, -0.3, 0.1 + number]))[0]
        poses.append(BoardPose(turn, TRANSLATION + instance, terms.total, terms, 0.07 + number))
    circles = (
        BoardCircleFit("r0c0", True, np.array([0.1, -1.0 / 3.0]), 0.9),
        BoardCircleFit("r0c1", False, np.array([1.5, 2.5]), 12.0),
    )
    return BoardResult(instance, tuple(poses), 0.25, circles, ROWS * COLUMNS, tuple(flags), growth)


def made_board_result(*boards: BoardResult, image: str = "a.png") -> ImageResult:
    """An image with boards, and with a circle of each."""
    boards = boards or (made_board(),)
    circles = tuple(
        CircleResult(
            board.instance,
            "r0c0",
            "chen-huang",
            RADIUS_MM,
            tuple(
                Candidate(pose.translation, -pose.rotation[:, 2], CAMERA.project(pose.translation))
                for pose in board.candidates
            ),
            chosen=board.chosen,
            flags=board.flags,
        )
        for board in boards
    )
    return ImageResult(image, circles=circles, image_size=(320, 240), boards=boards)


def placed(center: FloatArray, normal: FloatArray, terms: CovarianceTerms | None, number: int = 0) -> CircleResult:
    """A lone circle in a place, with the terms of its covariance."""
    total = None if terms is None else terms.total
    candidate = Candidate(center, normal, np.zeros(2), covariance=total, covariance_terms=terms)
    return CircleResult(number, "disc", "chen-huang", RADIUS_MM, (candidate,))
