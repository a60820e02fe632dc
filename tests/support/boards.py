"""Boards with known poses: rendered, and as exact ellipses."""

from __future__ import annotations

import numpy as np

from circlepose._typing import FloatArray, Image
from circlepose.boards.pose import RigidPose, rotation_of
from circlepose.camera.camera import Camera
from circlepose.fitting.cone_projection import image_ellipses
from circlepose.geometry.cone import factor_from_circle
from circlepose.geometry.ellipse import Ellipse
from circlepose.synthesis.render import render
from circlepose.synthesis.scene import Disc, Paint, Scene
from circlepose.targets.board import BoardCircle, BoardLayout, Grid

CAMERA = Camera.create([[800.0, 0, 319.5], [0, 800.0, 239.5], [0, 0, 1]], (-0.12, 0.03, 0.0, 0.0), (640, 480))


def grid(pattern: str, rows: int, columns: int, spacing: float, radius: float, **others: object) -> BoardLayout:
    return BoardLayout.on_grid(radius, Grid(pattern, rows, columns, spacing), **others)  # type: ignore[arg-type]


def plate(places: list[tuple[float, float]], radius: float = 8.0) -> BoardLayout:
    return BoardLayout(tuple(BoardCircle(f"h{i}", (x, y, 0.0), (radius,)) for i, (x, y) in enumerate(places)))


def posed(
    layout: BoardLayout,
    tilt_deg: float = 30.0,
    azimuth_deg: float = 40.0,
    roll_deg: float = 5.0,
    distance_mm: float = 500.0,
    at: tuple[float, float] = (0.0, 0.0),
) -> RigidPose:
    """Return a pose with the middle of the layout at `at` and `distance_mm`."""
    azimuth = np.radians(azimuth_deg)
    axis = np.radians(tilt_deg) * np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    rotation = rotation_of(axis) @ rotation_of(np.array([0.0, 0.0, np.radians(roll_deg)]))
    middle = layout.centers_mm.mean(axis=0)
    return RigidPose(rotation, np.array([*at, distance_mm]) - rotation @ middle)


def ellipses(layout: BoardLayout, pose: RigidPose, camera: Camera = CAMERA) -> Ellipse:
    centers = layout.centers_mm @ pose.rotation.T + pose.translation
    found, seen = image_ellipses(
        camera, factor_from_circle(centers, layout.normals @ pose.rotation.T, layout.radius_mm)
    )
    assert seen.all()
    return found


def picture(
    boards: list[tuple[BoardLayout, RigidPose]],
    camera: Camera = CAMERA,
    noise: float = 2.0,
    hidden: tuple[int, ...] = (),
) -> Image:
    """Render dark discs on white; those of the first board at the indices `hidden` are not there."""
    discs = []
    for number, (layout, pose) in enumerate(boards):
        centers = layout.centers_mm @ pose.rotation.T + pose.translation
        normals = layout.normals @ pose.rotation.T
        for i, (center, normal) in enumerate(zip(centers, normals, strict=True)):
            if number > 0 or i not in hidden:
                for k, radius in enumerate(layout.circles[i].radii_mm):
                    discs.append(Disc(tuple(center), tuple(normal), radius, Paint(200.0 if k % 2 else 40.0)))
    return render(Scene(camera, tuple(discs), Paint(200.0), blur_px=0.7, noise_levels=noise, noise_seed=7))


def apart(first: RigidPose, rotation: FloatArray, translation: FloatArray) -> tuple[float, float]:
    """Return how far two poses are apart: mm, and deg."""
    turn = first.rotation @ rotation.T
    angle = float(np.degrees(np.arccos(np.clip((np.trace(turn) - 1.0) / 2.0, -1.0, 1.0))))
    return float(np.linalg.norm(first.translation - translation)), angle
