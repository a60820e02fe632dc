"""Small pictures of discs with their truth, and results made by hand."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import cv2
import numpy as np

from circlepose._typing import Image
from circlepose.camera.camera import Camera, circle_contour
from circlepose.geometry.cone import ConeKind, factor_from_circle, principal_frame
from circlepose.geometry.ellipse import Ellipse
from circlepose.geometry.measured_cone import Cone
from circlepose.results import Candidate, CircleResult, Flag, ImageResult
from circlepose.solvers.chen_huang import poses_from_frame

CAMERA = Camera.create([[400.0, 0.0, 159.5], [0.0, 400.0, 119.5], [0.0, 0.0, 1.0]], (), (320, 240))
RADIUS_MM = 20.0
CENTER_MM = np.array([10.0, -5.0, 200.0])
NORMAL = np.array([0.5, 0.1, -0.8]) / np.linalg.norm([0.5, 0.1, -0.8])
CAMERA_YAML = "fx: 400\nfy: 400\ncx: 159.5\ncy: 119.5\nimage_size: [320, 240]\n"
_FINER = 8


def disc_image(center: np.ndarray = CENTER_MM, normal: np.ndarray = NORMAL, camera: Camera = CAMERA) -> Image:
    """A dark disc on white."""
    return discs_image([center], normal, camera)


def discs_image(centers: Iterable[np.ndarray], normal: np.ndarray, camera: Camera) -> Image:
    """Dark discs on white, drawn `_FINER` times too large and averaged, with a little noise."""
    width, height = camera.image_size or (320, 240)
    large = np.full((height * _FINER, width * _FINER), 200, np.uint8)
    for center in centers:
        rim = (circle_contour(camera, center, normal, RADIUS_MM) + 0.5) * _FINER - 0.5
        cv2.fillPoly(large, [np.round(rim * 16).astype(np.int32)], 40, shift=4)
    small = cv2.resize(large, (width, height), interpolation=cv2.INTER_AREA)
    noise = np.random.default_rng(0).normal(0.0, 1.0, small.shape)
    return np.clip(cv2.GaussianBlur(small, (0, 0), 0.7) + noise, 0, 255).astype(np.uint8)


def write_disc(path: Path) -> Path:
    cv2.imwrite(str(path), disc_image())
    return path


def disc_folder(folder: Path, images: int = 2) -> Path:
    """A folder that `circlepose estimate` can measure without an option."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "camera.yaml").write_text(CAMERA_YAML)
    (folder / "target.yaml").write_text(f"radius_mm: {RADIUS_MM}\n")
    for number in range(images):
        write_disc(folder / f"disc{number}.png")
    return folder


def found_notes(folder: Path) -> str:
    """What is said of the files in the folder that set the scale of its results."""
    return (
        f"{folder}/camera.yaml: found beside the images and used as calibration\n"
        f"{folder}/target.yaml: found beside the images and used as target, radius_mm {RADIUS_MM:g}\n"
    )


def made_circle(
    instance: int = 0,
    center: np.ndarray = CENTER_MM,
    circle: str = "disc",
    method: str = "chen-huang",
    covariance: np.ndarray | None = None,
    camera: Camera = CAMERA,
) -> CircleResult:
    """The exact result for a disc."""
    frame = principal_frame(factor_from_circle(center, NORMAL, RADIUS_MM))
    centers, normals = poses_from_frame(frame, RADIUS_MM)
    order = np.argsort(-(normals @ NORMAL))
    candidates = tuple(
        Candidate(centers[i], normals[i], camera.project(centers[i]), covariance=covariance) for i in order
    )
    contour = circle_contour(camera, center, NORMAL, RADIUS_MM)
    middle, axes, angle = cv2.fitEllipse(contour.astype(np.float32))
    return CircleResult(
        instance,
        circle,
        method,
        RADIUS_MM,
        candidates,
        ambiguity=0.25,
        cone=Cone(factor_from_circle(center, NORMAL, RADIUS_MM), ConeKind.ELLIPTICAL, 1e-8 * np.eye(5)),
        ellipse=Ellipse.from_axes(middle, np.array(axes) / 2.0, np.radians(angle)),
        residual_px=0.05,
        contour=contour,
        flags=(Flag.POOR_FIT, Flag.NEAR_RIGHT),
    )


def made_result(*circles: CircleResult, image: str = "a.png") -> ImageResult:
    return ImageResult(image, circles=circles or (made_circle(),), image_size=(320, 240))
